"""Benchmark on tiny cases: stored and printed results, initial states, comparison of revisions. Nothing is timed."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.text import text_table
from clothsim.mesh.generators.shapes import rectangle
from clothsim.scene.scene import Scene
from tests.benchmarks.bench import bench_cases, oracle
from tests.benchmarks.bench.__main__ import main
from tests.benchmarks.bench.alone import without_others
from tests.benchmarks.bench.bench_cases import ROOT, Case
from tests.benchmarks.bench.bench_picture import draw, slope
from tests.benchmarks.bench.leads import lead
from tests.benchmarks.bench.measure import PHASES, Worker, measured, ratio
from tests.benchmarks.bench.oracle import Compared, compared
from tests.benchmarks.bench.page import AIMS, GROUPS, against, aimed, grouped, oracle_summary, write_oracle, write_page
from tests.benchmarks.bench.revision import name_of, worktree
from tests.benchmarks.bench.sides import PARTS
from tests.benchmarks.bench.tables import comparison, split, summary

FALLING = Scene(
    cloth={"mesh": "rectangle", "cells": (3, 3)},
    effects={"inertia": {}, "gravity": {}},
    solver={"dt": 0.02, "threads": 1},
)
TINY = (
    Case("falling", scene=FALLING, lead=1, steps=2),
    Case("empty", "import", keys={"code": "pass"}),
)
needs_history = pytest.mark.skipif(not name_of(ROOT), reason="git and the history are not here")


def row(cpu=2.0, iterations=4, vertices=100, **more):
    parts = {"linear solve": 0.5 * cpu, "CCD": 0.125 * cpu, "membrane": 0.25 * cpu}
    found = {"cpu": cpu, "wall": cpu, "peak_memory": 5e7, "iterations": iterations, "linear_solves": iterations}
    found |= {"steps": 2, "simulated": 0.04, "vertices": vertices, "pairs": 0, "parts": parts, "own_solve": 0.2}
    return found | more


@pytest.fixture(scope="module")
def on_ball(tmp_path_factory):
    case = Case("sphere 6", scene=bench_cases.sphere(6), lead=1)
    (found,) = measured(case, [ROOT], tmp_path_factory.mktemp("states"), 1, lambda line: None)
    return found


def test_a_case_has_every_number_and_its_parts_are_in_its_time(on_ball):
    assert on_ball["vertices"] == 49
    assert on_ball["simulated"] == pytest.approx(0.02)
    assert on_ball["iterations"] >= 1
    assert on_ball["linear_solves"] >= on_ball["iterations"]
    assert on_ball["peak_memory"] > 1e7
    assert {"membrane", "body_contact", "friction", *PHASES} - {"candidates", "CCD"} <= set(on_ball["parts"])
    assert sum(on_ball["parts"].values()) <= on_ball["cpu"]
    assert sum(grouped(on_ball).values()) == pytest.approx(sum(on_ball["parts"].values()))
    assert set(grouped(on_ball)) == set(GROUPS)
    assert ratio(on_ball) == pytest.approx(on_ball["cpu"] / on_ball["iterations"] / on_ball["own_solve"])


def test_the_command_keeps_what_it_prints(tmp_path, capsys):
    for _ in range(2):
        assert main(["--results", str(tmp_path), "--repeats", "2"], TINY) == 0
    output = capsys.readouterr().out
    (file,) = tmp_path.glob("*.json")
    kept = json.loads(file.read_text())
    assert file.stem == f"{kept['date'][:10]}-{kept['revision'] or 'no-git'}"
    assert {name: each["trials"] for name, each in kept["cases"].items()} == {"falling": 2, "empty": 2}
    assert kept["cases"]["falling"]["vertices"] == 16
    assert f"kept in {file}" in output
    assert "of last" in output
    assert len(list((tmp_path / "states").glob("falling-*.npz"))) == 1


def test_cases_of_the_same_day_and_revision_are_kept_together(tmp_path):
    assert main(["--results", str(tmp_path), "--repeats", "1", "--only", "empty"], TINY) == 0
    assert main(["--results", str(tmp_path), "--repeats", "1", "--only", "falling"], TINY) == 0
    (file,) = tmp_path.glob("*.json")
    assert set(json.loads(file.read_text())["cases"]) == {"falling", "empty"}


@needs_history
def test_another_revision_is_measured_beside_this_one_and_its_files_are_removed_after(tmp_path, capsys):
    assert main(["--results", str(tmp_path), "--repeats", "1", "--compare", "HEAD"], TINY) == 0
    output = capsys.readouterr().out.split("CPU s HEAD")[1]
    assert "skipped" not in output
    assert [line.split()[0] for line in output.splitlines()[2:4]] == ["falling", "empty"]
    (file,) = tmp_path.glob("*-compared.json")
    compared = json.loads(file.read_text())["compared"]
    assert compared["revision"] == "HEAD"
    assert compared["cases"]["falling"]["iterations"] >= 1


@needs_history
def test_a_worker_measures_the_package_of_its_root_and_no_other(tmp_path):
    with worktree(ROOT, "HEAD") as there, Worker(there, {"kind": "import", "code": "pass"}) as worker:
        assert "cpu" in worker.trial()
    assert not there.exists()
    with Worker(tmp_path, {"kind": "import", "code": "pass"}) as worker:
        assert worker.trial()["skipped"] == f"Python took the package in {ROOT / 'clothsim'}."


@needs_history
def test_an_unknown_revision_is_one_sentence(tmp_path, capsys):
    for name in ("no-such-revision", "--help"):
        assert main(["--results", str(tmp_path), f"--compare={name}"], TINY) == 2
        assert capsys.readouterr().err == f"--compare: git knows no revision {name!r}.\nSee `git log --oneline`.\n"


def test_without_git_it_reports_it(tmp_path, monkeypatch):
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    for path in (None, ""):  # no history, then no git either
        if path is not None:
            monkeypatch.setenv("PATH", path)
        assert name_of(tmp_path) == ""
        with pytest.raises(InputError, match="needs git and the package's history"), worktree(tmp_path, "HEAD"):
            pass


def test_what_a_revision_lacks_is_a_reason():
    job = {"kind": "steps", "scene": {"cloth": {"mesh": "rectangle"}, "effects": {"levitation": {}}}, "directory": "."}
    with Worker(ROOT, job) as worker:
        assert worker.trial()["skipped"].startswith("InputError: ")
        assert "levitation" in worker.trial()["skipped"]


def test_a_state_of_another_mesh_is_a_reason(tmp_path):
    state = lead(TINY[0], tmp_path)
    finer = json.loads(replace(FALLING, cloth={"mesh": "rectangle", "cells": (4, 4)}).to_text())
    directory = finer.pop("directory")
    job = {"kind": "steps", "scene": finer, "directory": directory, "state": str(state), "settle": 0, "steps": 1}
    with Worker(ROOT, job) as worker:
        assert worker.trial()["skipped"] == "Its mesh has 25 vertices, the state 16."


def test_a_state_is_made_once_and_afresh_for_another_scene(tmp_path):
    first = lead(TINY[0], tmp_path)
    made = first.stat().st_mtime_ns
    assert lead(TINY[0], tmp_path) == first
    assert first.stat().st_mtime_ns == made
    assert lead(replace(TINY[0], lead=2), tmp_path) != first
    kept = np.load(first)
    assert kept["time"] == pytest.approx(0.02)
    assert np.allclose(kept["velocities"][:, 2], -9.81 * 0.02)


def test_real_data_that_is_not_there_is_a_reason(tmp_path):
    case = replace(TINY[0], needs=tmp_path / "gone")
    assert measured(case, [ROOT], tmp_path, 1, print)[0]["skipped"] == f"gone is not in {tmp_path.name}."


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--only", "falling,ball"], "--only: there is no case 'ball'."),
        (["--only", ","], "--only names nothing."),
        (["--repeats", "0"], "--repeats is 0."),
    ],
)
def test_bad_arguments_are_one_sentence(arguments, sentence, tmp_path, capsys):
    assert main(["--results", str(tmp_path), *arguments], TINY) == 2
    assert capsys.readouterr().err.splitlines()[0] == sentence


def test_a_folded_sheet_keeps_its_lengths():
    flat, _ = rectangle(size=(1.0, 1.0), cells=(100, 4))
    bent = bench_cases.folded(flat)
    s = np.linspace(-0.5, 0.5, 20001)
    curve = bench_cases.folded(np.column_stack([s, 0 * s, 0 * s]))
    steps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    assert np.allclose(steps, s[1] - s[0], rtol=1e-3)
    assert bent[:, 2].min() == pytest.approx(0.0)
    assert bent[:, 2].max() == pytest.approx(2 * bench_cases.FOLD)
    assert np.array_equal(bent[:, 1], flat[:, 1])


def test_a_wrung_strip_ends_where_its_pins_are():
    scene = bench_cases.from_file("twist.toml")
    rates = [group["motion"]["rotate_degrees_per_second"][0] for group in scene.effects["pins"]["group"]]
    flat = np.array([[-0.5, 0.2, 0.0], [0.25, 0.2, 0.0]])
    left, quarter = bench_cases.wrung(flat)
    angle = np.radians(rates[0] * bench_cases.WRUNG)
    assert np.allclose(left, [-0.5, 0.2 * np.cos(angle), 0.2 * np.sin(angle)])
    angle = 0.5 * np.radians(rates[1] * bench_cases.WRUNG)
    assert np.allclose(quarter, [0.25, 0.2 * np.cos(angle), 0.2 * np.sin(angle)])


def test_the_set_is_named_once_and_quick_is_of_it():
    names = [case.name for case in bench_cases.benchmark()]
    assert len(set(names)) == len(names)
    assert set(bench_cases.QUICK) | set(bench_cases.ORACLE) <= set(names)
    assert [case.name for case in bench_cases.aims()] == list(AIMS)


def test_tables_show_every_row_and_every_reason():
    rows = {"one": row(), "two": {"skipped": "Not here."}}
    text = summary(rows, {"one": row(cpu=1.0)})
    assert text.splitlines()[2].split()[:6] == ["one", "100", "2", "2", "2.00", "4"]
    assert text.splitlines()[-1] == "  two was skipped: Not here."
    assert [line.split()[0] for line in split(rows).splitlines()[2:]] == ["CCD", "linear", "membrane"]
    text = comparison({"one": row(iterations=8), "two": row()}, rows, "abc")
    assert text.splitlines()[2].split() == ["one", "2", "2", "1.00", "8", "4", "0.50", "2.00"]
    assert text.splitlines()[-1] == "  two, now: Not here."


def test_the_page_has_both_tables(tmp_path):
    file = tmp_path / "profile.md"
    file.write_text("head\n<!-- profile -->\n<!-- /profile -->\n<!-- aims -->\n<!-- /aims -->\n", encoding="utf-8")
    write_page(file, {"sphere 100": row(), **{name: row() for name in AIMS}}, "2026-01-02T03:04+00:00")
    text = file.read_text(encoding="utf-8")
    assert text.count("Measured on 2026-01-02.") == 2
    assert "| linear solve | phase | 1.00 | 250.0 | 50.0 % |" in text
    assert "| unattributed |  | 0.25 | 62.5 | 12.5 % |" in text
    assert "200 ms" in text
    assert " 2.50 times one " in text
    assert "| standard 40x40 | 0.04 | 0.02 | 50 | 1.00 | 2.0 | below 25 |" in text
    assert "Not here." in aimed({name: {"skipped": "Not here."} for name in AIMS})


def test_windows_spell_their_settings_and_stand_beside_a_revision(tmp_path):
    cases = bench_cases.windows()
    assert len({case.name for case in cases}) == len(cases) == 3 * len(bench_cases.WINDOWS)
    settings = [case.scene.solver_settings for case in cases]
    assert [(each.integrator, each.balanced) for each in settings[::3]] == [
        ("backward_euler", False), ("bdf2", False), ("bdf2", True)
    ]  # fmt: skip
    assert cases[0].scene.effects["bending"] == {"model": "hinge"}
    file = tmp_path / "page.md"
    file.write_text("<!-- windows -->\n<!-- /windows -->\n", encoding="utf-8")
    name = cases[0].name
    write_page(file, {name: row(), "twist": row()}, "2026-01-02T03:04+00:00", {name: row(cpu=4.0)}, "abc")
    text = file.read_text(encoding="utf-8")
    assert "| as peers | free fall, 0 to 0.1 s | 1.00 | 4 + 0 | 2.00 | 4 + 0 | 0.50 |" in text
    assert "twist" not in text


def test_the_picture_has_lines_and_a_slope(tmp_path):
    assert slope([10, 100, 1000], [3 * n**1.25 for n in (10, 100, 1000)]) == pytest.approx(1.25)
    whole = dict.fromkeys(("linear solve", "CCD", "assembly", "membrane"), 0.4)
    rows = {f"sphere {n}": row(cpu=n / 20, vertices=n * n, parts=whole) for n in (40, 100)} | {"twist": row()}
    draw(rows, tmp_path / "bench.png")
    with Image.open(tmp_path / "bench.png") as image:
        assert len(np.unique(np.asarray(image.convert("L")))) > 50
    with pytest.raises(InputError, match="two sizes"):
        draw({"twist": row()}, tmp_path / "none.png")


def test_columns_of_numbers_stand_to_the_right():
    text = text_table(("name", "value"), [("a", "1.5"), ("long name", "1,234")])
    assert text.splitlines() == ["name       value", "----------------", "a            1.5", "long name  1,234"]


def test_the_copy_has_no_file_of_another_effect():
    with without_others(ROOT) as there:
        left = {file.stem for file in (there / "clothsim" / "physics" / "energies").glob("*.py")}
        assert {"membrane", "inertia", "base"} <= left
        assert not left & {"gravity", "bending", "pressure", "air"}
        assert not list((there / "clothsim" / "physics" / "contact").glob("[a-z]*.py"))


ON_BALL = Case("sphere 6", scene=bench_cases.sphere(6), lead=1)


def test_contact_and_ipctk_do_the_same_work(tmp_path):
    """Counted, not timed: every part of both is there, at as many ways and pairs as there are."""
    found = compared(ON_BALL, tmp_path, 1, print)
    assert found.vertices == 49
    assert found.newton_steps >= 1
    assert found.pairs > 0
    assert found.energy > 0
    for side in (found.ours, found.ipctk):
        assert set(side) == set(PARTS)
        assert sum(side.values()) > 0


def test_contact_that_finds_another_energy_than_ipctk_is_not_timed(tmp_path, monkeypatch):
    monkeypatch.setattr(oracle, "AGREE", -1.0)
    with pytest.raises(ClothsimError, match=r"sphere 6: contact finds .* J, and ipctk .* J\."):
        compared(ON_BALL, tmp_path, 1, print)


def test_a_missing_page_is_reported_before_any_measurement(tmp_path, capsys):
    assert main(["--oracle", "--results", str(tmp_path), "--page", str(tmp_path / "no.md")]) == 2
    oracle_summary = capsys.readouterr()
    assert "no.md, which is no file" in oracle_summary.err
    assert not oracle_summary.out


def test_the_command_prints_the_table_against_ipctk_and_writes_the_page(tmp_path, capsys):
    page = tmp_path / "profile.md"
    page.write_text("head\n<!-- oracle -->\n<!-- /oracle -->\n", encoding="utf-8")
    arguments = ["--oracle", "--repeats", "1", "--results", str(tmp_path), "--page", str(page)]
    assert main(arguments, [ON_BALL]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("  ")[0] for line in lines if line.startswith((*PARTS, "all"))] == [*PARTS, "all"]
    assert any(line.startswith("* sphere 6: ") and "(49 vertices, " in line for line in lines)
    text = page.read_text(encoding="utf-8")
    assert [line.split(" | ")[0] for line in text.splitlines() if line.startswith("|")][2:] == [
        f"| {part}" for part in (*PARTS, "all")
    ]


def test_without_ipctk_it_reports_it(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "ipctk", None)
    assert main(["--oracle", "--results", str(tmp_path)], [ON_BALL]) == 2
    output = capsys.readouterr().err
    assert "ipctk" in output
    assert "clothsim[oracle]" in output


def test_the_table_against_ipctk_has_ratios_and_the_bar(tmp_path):
    ours, theirs = dict.fromkeys(PARTS, 0.001), dict.fromkeys(PARTS, 0.02)
    rows = {"sphere 40": Compared(1681, 20, 900, 50, 1.0, ours, theirs)}
    header, lines = against(rows)
    assert header == ("part", "sphere 40: clothsim [ms]", "ipctk [ms]", "ratio")
    assert lines[-1] == ("all", "4.00", "80.00", "20.0")
    assert oracle_summary(rows) == (
        "Time of ipctk divided by that of clothsim:\n\n"
        "* sphere 40: 20.0 (1,681 vertices, 20 iterations, up to 900 pairs, of which 50 in self contact)\n\n"
        "The aim, a ratio of at least 10, is met."
    )
    slow = {"sphere 100": replace(rows["sphere 40"], ours=theirs | {"CCD": 0.04})}
    assert oracle_summary(slow).endswith("The aim, a ratio of at least 10, is not met.")
    file = tmp_path / "profile.md"
    file.write_text("head\n<!-- oracle -->\n<!-- /oracle -->\n", encoding="utf-8")
    write_oracle(file, rows, "2026-01-02T03:04+00:00")
    assert "Measured on 2026-01-02." in file.read_text(encoding="utf-8")
    assert "| CCD | 1.00 | 20.00 | 20.0 |" in file.read_text(encoding="utf-8")
