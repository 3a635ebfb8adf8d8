"""Farm: plans, claims, publication, work under kills, verification."""

import errno
import json
import os
import platform
import signal
import time

import numpy as np
import pytest
from command_line import refused
from small_scenes import SHEET, small_scene

from clothsim import InputError
from clothsim.base.errors import MachineError
from clothsim.base.file_writing import full_or_forbidden
from clothsim.cli import main
from clothsim.cli.farm_command import SHIPPED, terminated_like_interrupted
from clothsim.cli.sweep_command import _values
from clothsim.scene.toml_file import scenes_folder
from clothsim.study.farm.claims import Worker, claimed, is_stale, worker_of
from clothsim.study.farm.dask_work import make_one
from clothsim.study.farm.plan import open_farm, plan, refuse_unbuildable
from clothsim.study.farm.publication import attempts, content_id, note_attempt, publish
from clothsim.study.farm.reading import read_drape
from clothsim.study.farm.recipe import changed, draw_of, load_recipe, make_recipe, stream_of
from clothsim.study.farm.status import status
from clothsim.study.farm.verification import verify
from clothsim.study.farm.work import make, work
from tests.benchmarks.farm_chaos import sheet_recipe

QUICK = Worker(beat=0.05, stale_after=0.5)


def recipe(count=3, **vary):
    scene = small_scene(run={"duration": 0.08, "frames_per_second": 25})
    return make_recipe(scene, {"count": count, "until": "time"}, {}, vary or {"cloth.density": {"uniform": [0.1, 0.3]}})


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A farm of three drapes, made."""
    farm = plan(recipe(), tmp_path_factory.mktemp("farm"))
    return farm, work(farm, pause=0.01)


def test_another_varied_key_changes_no_other_draw():
    two = recipe(4, **{"body.radius": {"uniform": [0.2, 0.3]}, "cloth.density": {"uniform": [0.1, 0.3]}})
    for index in range(4):
        assert two.values(index)["cloth.density"] == recipe(4).values(index)["cloth.density"]


def test_draws_stay_in_their_boxes_and_have_their_means():
    for given, mean in (
        ({"uniform": [1.0, 3.0]}, 2.0),
        ({"log_uniform": [0.1, 10.0]}, 9.9 / np.log(100)),
        ({"normal": [5.0, 0.5]}, 5.0),
        ([1.0, 2.0, 6.0], 3.0),
    ):
        draw = draw_of("k", given)
        values = np.array([draw.value(stream_of(0, k, "k")) for k in range(4000)])
        low, high = draw.box
        assert low <= values.min()
        assert values.max() <= high
        assert abs(values.mean() - mean) < 5 * values.std() / np.sqrt(4000)


def test_the_same_draw_and_grids():
    given = {
        "cloth.density": {"grid": [0.1, 0.2]},
        "solver.dt": {"grid": [0.01, 0.02, 0.04]},
        "run.duration": "=solver.dt",
    }
    grid = make_recipe(small_scene(), {}, {}, given)
    assert grid.count == 6
    rows = [grid.values(k) for k in range(6)]
    assert len({(row["cloth.density"], row["solver.dt"]) for row in rows}) == 6
    assert all(row["run.duration"] == row["solver.dt"] for row in rows)


@pytest.mark.parametrize(
    "vary",
    [
        {"cloth.density": {"uniform": [3, 1]}},
        {"cloth.density": {"unform": [1, 3]}},
        {"cloth.density": {"log_uniform": [0, 3]}},
        {"cloth.density": []},
        {"cloth.density": "=body.radius"},
    ],
)
def test_bad_recipes_are_refused(vary):
    with pytest.raises(InputError):
        make_recipe(small_scene(), {"count": 2}, {}, vary)


def test_a_bad_key_and_equal_drapes_are_refused_by_the_plan(tmp_path):
    with pytest.raises(InputError):
        plan(recipe(2, **{"cloth.densty": [0.1, 0.2]}), tmp_path / "a")
    with pytest.raises(InputError):
        plan(recipe(3, **{"cloth.density": [0.1, 0.2]}), tmp_path / "b")


def test_a_plan_of_what_no_run_takes_is_refused_before_it_is_built():
    scene = small_scene(cloth={**SHEET, "cells": [4096, 4096]}, run={"duration": 1.0})
    with pytest.raises(InputError, match="GB of"):
        refuse_unbuildable(make_recipe(scene, {"count": 1}, {}, {}))


def test_files_of_others_are_no_plan(tmp_path):
    (tmp_path / "jobs.jsonl").write_text("mine")
    with pytest.raises(InputError, match="exists"):
        plan(recipe(), tmp_path)
    (tmp_path / "farm.json").write_text("mine")
    with pytest.raises(InputError, match="Plan the recipe again"):
        plan(recipe(), tmp_path)
    assert (tmp_path / "jobs.jsonl").read_text() == (tmp_path / "farm.json").read_text() == "mine"


def test_an_id_is_of_the_content_of_files_and_not_of_their_place(tmp_path):
    ids = []
    for folder, text in (("a", "v 0 0 0\n"), ("b", "v 0 0 0\n"), ("c", "v 0 0 1\n")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "x.obj").write_text(text)
        ids.append(content_id(small_scene(cloth={"mesh": "x.obj"}, directory=tmp_path / folder), 1))
    assert ids[0] == ids[1] != ids[2]
    scene = small_scene()
    assert content_id(scene, 1) != content_id(scene, 2)
    assert content_id(scene, 1) != content_id(changed(scene, {"cloth.density": 0.2}), 1)


def test_recipes_of_files_name_files_beside_them(tmp_path):
    (tmp_path / "scene.toml").write_text('[cloth]\nmesh = "rectangle"\n[effects.gravity]\n')
    (tmp_path / "one.obj").write_text("v 0 0 0\n")
    (tmp_path / "r.toml").write_text(
        '[farm]\nscene = "scene.toml"\ncount = 1\n[set]\nsolver.dt = 0.05\n[vary]\n"cloth.mesh" = ["one.obj"]\n'
    )
    read = load_recipe(tmp_path / "r.toml")
    assert read.values(0)["cloth.mesh"] == str((tmp_path / "one.obj").resolve())
    assert read.scene.solver_settings.dt == 0.05
    assert read.scene.run_settings.until == "rest"


def test_one_claim_at_a_time_and_a_stale_one_is_taken_over(tmp_path):
    with claimed(tmp_path, "x", QUICK) as first, claimed(tmp_path, "x", Worker()) as second:
        assert (first, second) == (True, False)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "x").write_text(json.dumps({"token": "t", "host": "elsewhere", "pid": 1}))
    assert not is_stale(tmp_path / "x", Worker())
    with claimed(tmp_path, "x", Worker()) as own:
        assert not own
    os.utime(tmp_path / "x", (time.time() - 100,) * 2)
    with claimed(tmp_path, "x", Worker()) as own:
        assert own


def test_a_task_of_dask_takes_over_claims_by_the_time_that_it_is_given(tmp_path):
    farm = plan(recipe(1), tmp_path)
    job = farm.jobs[0]
    claim = tmp_path / "claims" / job.id
    claim.write_text(json.dumps({"token": "t", "host": "elsewhere", "pid": 1}))
    os.utime(claim, (time.time() - 100,) * 2)
    assert make_one(str(tmp_path), job.id, 3, stale_after=1e4) == job.id
    assert not farm.published()
    assert make_one(str(tmp_path), job.id, 3, stale_after=50.0) == job.id
    assert farm.published() == {job.id}
    assert worker_of(12.0).beat == 2.0
    assert worker_of(600.0).beat == Worker.beat


def test_a_claim_of_a_process_that_ended_is_stale_at_once(tmp_path):
    gone = {"token": "t", "host": platform.node(), "pid": 2**22 + 7, "born": "1"}
    (tmp_path / "x").write_text(json.dumps(gone))
    assert is_stale(tmp_path / "x", Worker())


def test_a_drape_is_published_once(tmp_path):
    for name in ("drapes", "tmp"):
        (tmp_path / name).mkdir()
    assert publish(tmp_path, "x", QUICK, {"a": b"first"})
    assert not publish(tmp_path, "x", Worker(), {"a": b"second"})
    assert (tmp_path / "drapes" / "x" / "a").read_bytes() == b"first"
    assert list((tmp_path / "tmp").iterdir()) == []


def test_work_publishes_all_and_a_second_worker_nothing(made):
    farm, tally = made
    assert (tally.published, tally.usable) == (3, 3)
    assert work(farm).published == 0
    state = status(farm)
    assert (state.planned, state.published, state.usable, state.claimed, state.stale) == (3, 3, 3, 0, 0)
    assert list((farm.directory / "tmp").iterdir()) == list((farm.directory / "claims").iterdir()) == []
    summary, parameters = read_drape(farm.directory, farm.jobs[1].id)
    assert summary["certificate"]["intersection_free"] is True
    assert parameters == {"index": 1, **farm.jobs[1].values}
    positions = np.load(farm.directory / "drapes" / farm.jobs[1].id / "cloth.npy")
    assert (positions.dtype, positions.shape) == (np.float32, (25, 3))
    mesh = np.load(farm.directory / "meshes" / f"{summary['meshes']['cloth']['cloth']}.npz")
    assert mesh["triangles"].shape == (32, 3)
    assert len(list((farm.directory / "meshes").iterdir())) == 2


def test_verify_makes_drapes_again_and_finds_torn_ones(made):
    farm, _ = made
    done = verify(farm, fraction=0.3)
    assert (done.whole, done.torn, done.repeated, done.same, done.good) == (3, {}, 1, 1, True)
    file = farm.directory / "drapes" / farm.jobs[0].id / "cloth.npy"
    before = file.read_bytes()
    file.write_bytes(before[:-4])
    assert set(verify(farm, fraction=0).torn) == {farm.jobs[0].id}
    file.write_bytes(before)


def test_cloth_inside_a_body_is_not_usable(tmp_path):
    sheet = {"size": [0.2, 0.2], "position": [0, 0, 0]}
    for number, (allowed, cause) in enumerate([(False, "refused"), (True, "inside a body")]):
        run = {"duration": 0.08, "frames_per_second": 25, "allow_inside": allowed}
        folder = tmp_path / str(number)
        scene = small_scene(cloth=SHEET | sheet, run=run)
        farm = plan(make_recipe(scene, {"count": 1, "until": "time"}, {}, {}), folder)
        assert work(farm).usable == 0
        assert status(farm).causes == {cause: 1}


def test_drapes_that_fail_are_published_with_their_sentence(tmp_path):
    farm = plan(make_recipe(small_scene(cloth={"mesh": "nothing.obj"}), {"count": 1}, {}, {}), tmp_path)
    tally = work(farm)
    summary, _ = read_drape(tmp_path, farm.jobs[0].id)
    assert (tally.published, tally.usable, summary["cause"]) == (1, 0, "refused")
    assert "nothing.obj" in summary["reason"]
    assert status(farm).causes == {"refused": 1}


def test_a_drape_that_kills_its_process_is_published_after_three_attempts(tmp_path):
    farm = plan(recipe(1), tmp_path)
    name = farm.jobs[0].id
    for event in ("started", "started", "withdrawn", "started"):
        note_attempt(tmp_path, name, event)
    assert attempts(tmp_path, name) == 2
    note_attempt(tmp_path, name, "started")
    made = make(farm, farm.jobs[0], Worker())
    assert made.summary["cause"] == read_drape(tmp_path, name)[0]["cause"] == "killed"


def test_an_attempt_that_is_stopped_by_its_user_does_not_count(tmp_path, monkeypatch):
    farm = plan(recipe(1), tmp_path)

    def stopped(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("clothsim.study.farm.work.drape", stopped)
    with pytest.raises(KeyboardInterrupt):
        make(farm, farm.jobs[0], Worker())
    assert attempts(tmp_path, farm.jobs[0].id) == 0
    assert list((tmp_path / "claims").iterdir()) == list((tmp_path / "tmp").iterdir()) == []


def test_a_full_disk_is_no_verdict_on_a_drape(tmp_path, monkeypatch):
    farm = plan(recipe(1), tmp_path)

    def full(*arguments, **options):
        raise full_or_forbidden(tmp_path / "trajectory.vtkhdf", OSError(errno.ENOSPC, "No space left on device"))

    with monkeypatch.context() as patched:
        patched.setattr("clothsim.study.farm.drape.simulate", full)
        with pytest.raises(MachineError):
            make(farm, farm.jobs[0], Worker())
    assert status(farm).published == 0
    assert work(farm).usable == 1


def test_a_killed_process_leaves_nothing_that_stops_the_next(tmp_path):
    """What SIGKILL leaves at each point of an attempt: a claim, a noted attempt, a folder half written."""
    farm = plan(recipe(2), tmp_path)
    for job in farm.jobs:
        gone = {"token": "t", "host": platform.node(), "pid": 2**22 + 7, "born": "1"}
        (tmp_path / "claims" / job.id).write_text(json.dumps(gone))
        note_attempt(tmp_path, job.id, "started")
        (tmp_path / "tmp" / f"{job.id}.t.whole").mkdir()
        (tmp_path / "tmp" / f"{job.id}.t.whole" / "cloth.npy").write_bytes(b"torn")
    (tmp_path / "claims" / farm.jobs[1].id).write_bytes(b"")  # killed between creation and content
    os.utime(tmp_path / "claims" / farm.jobs[1].id, (time.time() - 100,) * 2)
    assert work(farm, QUICK).published == 2
    assert verify(farm, fraction=0).good
    assert [p for name in ("tmp", "claims") for p in (tmp_path / name).iterdir()] == []


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_processes_killed_in_a_drape_lose_nothing_and_the_third_is_the_last(tmp_path, monkeypatch):
    farm = plan(recipe(2), tmp_path)
    poison, other = farm.jobs
    for _ in range(3):
        child = os.fork()
        if child == 0:
            monkeypatch.setattr("clothsim.study.farm.work.drape", lambda *given: os.kill(os.getpid(), signal.SIGKILL))
            make(farm, poison, Worker())
            os._exit(0)
        assert os.WTERMSIG(os.waitpid(child, 0)[1]) == signal.SIGKILL
        assert (tmp_path / "claims" / poison.id).is_file()
    assert work(farm, Worker()).published == 2
    assert read_drape(tmp_path, poison.id)[0]["cause"] == "killed"
    assert read_drape(tmp_path, other.id)[0]["usable"]
    assert attempts(tmp_path, poison.id) == 3
    assert [p for name in ("tmp", "claims") for p in (tmp_path / name).iterdir()] == []


@pytest.mark.parametrize("name", ["../../thesis", "/thesis", "", "..", "0" * 15, "0" * 15 + "/", "G" * 16, None, 7])
def test_an_id_that_is_none_is_refused_and_no_folder_outside_is_touched(tmp_path, name, capsys):
    thesis = tmp_path / "thesis" / "draft.txt"
    thesis.parent.mkdir()
    thesis.write_text("years")
    (tmp_path / "thesis.bak").mkdir()
    plan(recipe(1), tmp_path / "farm")
    lines = tmp_path / "farm" / "jobs.jsonl"
    lines.write_text(json.dumps(json.loads(lines.read_text()) | {"id": name}) + "\n")
    for action in ("work", "status", "verify"):
        assert main(["farm", action, str(tmp_path / "farm")]) == 2
    assert "16 hexadecimal digits" in capsys.readouterr().err
    assert thesis.read_text() == "years"
    assert (tmp_path / "thesis.bak").is_dir()


@pytest.mark.parametrize("line", ["{", "[]", "{}", '{"index": 1, "id": "0123456789abcdef", "values": {}}', "\x00"])
def test_a_line_of_the_plan_that_is_none_is_refused(tmp_path, line):
    plan(recipe(1), tmp_path)
    (tmp_path / "jobs.jsonl").write_text(line + "\n")
    assert main(["farm", "work", str(tmp_path)]) == 2


def test_a_mesh_outside_of_the_farm_is_not_read(tmp_path):
    farm = plan(recipe(1), tmp_path / "farm")
    work(farm)
    summary = farm.folder(farm.jobs[0].id) / "summary.json"
    content = json.loads(summary.read_text())
    mesh = content["meshes"]["cloth"]["cloth"]
    (tmp_path / "outside.npz").write_bytes((tmp_path / "farm" / "meshes" / f"{mesh}.npz").read_bytes())
    content["meshes"]["cloth"]["cloth"] = "../../outside"
    summary.write_text(json.dumps(content))
    for target in ("data.h5", "shards"):
        assert main(["farm", "pack", str(tmp_path / "farm"), "-o", str(tmp_path / target)]) == 2


def test_a_changed_package_or_file_makes_no_drape_of_the_plan(tmp_path):
    farm = plan(recipe(1), tmp_path)
    text = (tmp_path / "farm.json").read_text()
    (tmp_path / "farm.json").write_text(text.replace('"version": 1', '"version": 2'))
    with pytest.raises(InputError):
        open_farm(tmp_path).scene_of(farm.jobs[0])


def test_commands(tmp_path, capsys):
    (tmp_path / "scene.toml").write_text(
        '[cloth]\nmesh = "skirt"\n[effects.inertia]\n[effects.gravity]\n[run]\nduration = 0.04\n'
    )
    text = '[farm]\nscene = "scene.toml"\nuntil = "time"\ncount = 2\n[vary]\n"cloth.edge" = { grid = [%s] }\n'
    (tmp_path / "none.toml").write_text(text % "0.07, 0.06")
    assert main(["farm", "plan", str(tmp_path / "none.toml"), "-o", str(tmp_path / "none")]) == 2
    assert "0.07" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()
    (tmp_path / "scene.toml").write_text(
        '[cloth]\nmesh = "rectangle"\ncells = [4, 4]\nposition = [0, 0, 0.2]\n'
        '[[body]]\nmesh = "sphere"\nradius = 0.1\n[effects.inertia]\n[effects.body_contact]\n'
        "[run]\nduration = 0.04\n"
    )
    crossing = text.replace("cloth.edge", "cloth.position[2]") % "0.0, 0.2"
    (tmp_path / "r.toml").write_text(crossing)
    where = str(tmp_path / "farm")
    assert main(["farm", "plan", str(tmp_path / "r.toml"), "-o", where, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["planned"] == 2
    assert main(["farm", "work", where, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["causes"] == {"refused": 1}
    assert main(["farm", "status", where]) == main(["farm", "verify", where, "--fraction", "0"]) == 0
    assert len((tmp_path / "farm" / "manifest.jsonl").read_text().splitlines()) == 2
    assert main(["farm", "work", str(tmp_path), "--quiet"]) == 2
    assert main(["farm", "verify", where, "--share", "7"]) == 2


def test_a_sweep_makes_every_combination(tmp_path, capsys):
    (tmp_path / "scene.toml").write_text('[cloth]\nmesh = "rectangle"\ncells = [2, 2]\n[effects.inertia]\n')
    words = ["sweep", str(tmp_path / "scene.toml"), "--vary", "cloth.density=.1,.2", "--vary", "solver.dt=.02,.04"]
    words += ["--set", "run.duration=0.04", "-o", str(tmp_path / "out"), "--json"]
    assert main(words) in (0, 1)
    rows = json.loads(capsys.readouterr().out)["drapes"]
    assert [(row["parameters"]["cloth.density"], row["parameters"]["solver.dt"]) for row in rows] == [
        (0.1, 0.02),
        (0.2, 0.02),
        (0.1, 0.04),
        (0.2, 0.04),
    ]
    assert all(row["status"] == "completed" and row["usable"] for row in rows)
    assert main(["sweep", "sphere", "-o", str(tmp_path / "none")]) == 2


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("cloth.density=.1, 2", [0.1, 2]),
        ("cloth.fabric=cotton,denim", ["cotton", "denim"]),
        ("cloth.size=[0.3, 0.2],[0.4, 0.4]", [[0.3, 0.2], [0.4, 0.4]]),
        ("effects.pins.select={ box = [[0, 0, 0], [1, 1, 1]] },left", [{"box": [[0, 0, 0], [1, 1, 1]]}, "left"]),
        ("cloth.name='a,b',c", ["a,b", "c"]),
        ("run.forces=true,false", [True, False]),
    ],
)
def test_values_are_parted_outside_brackets(text, values):
    assert _values(text) == (text.partition("=")[0], {"grid": values})


def test_a_recipe_that_is_not_there_is_answered_with_those_that_are(tmp_path, capsys):
    for action in ("sample", "plan"):
        lines = refused(capsys, "farm", action, "nosuch", "-o", str(tmp_path / "farm"))
        assert all(name in lines[1] for name in SHIPPED)
    assert "'shirt_by_body'" in refused(capsys, "farm", "sample", "shirt_by_bod", "-o", str(tmp_path / "farm"))[1]
    assert {f"{name}.recipe" for name in SHIPPED} == {file.name for file in scenes_folder().glob("*.recipe")}


def test_the_recipe_of_the_benchmark_can_be_planned(tmp_path):
    assert len(plan(sheet_recipe(5), tmp_path).jobs) == 5


def test_sigterm_ends_a_worker_in_the_background_of_a_script():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as a shell without job control starts it
    try:
        with pytest.raises(KeyboardInterrupt), terminated_like_interrupted():
            signal.raise_signal(signal.SIGTERM)
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)
