"""Command line in this process: exit codes, printed text, output files."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import FREE, SHEET, refused, with_keywords

import clothsim
from clothsim.base.errors import InputError
from clothsim.base.record import read_summary
from clothsim.cli import main
from clothsim.cli.progress import Lines
from clothsim.files.runs.checkpoint import read_checkpoint
from clothsim.files.runs.trajectory import TRAJECTORY_NAME, TrajectoryWriter, read_trajectory
from clothsim.run import pictures
from clothsim.run.receipt import explain_run, explain_scene
from clothsim.run.results import open_run
from clothsim.scene.effects import EFFECTS
from clothsim.scene.toml_file import load_scene

ROOT = Path(__file__).parents[2]
CROSSING = """
[[cloth]]
name = "flag"
mesh = "rectangle"
size = [0.2, 0.2]
cells = [2, 2]
position = [0.3, 0.3, 0.32]
rotation_degrees = [90, 0, 0]
"""
COUNTERS = ("evaluations", "gradients", "hessians", "pairs", "ccd_calls", "seconds", "hessian_nonzeros")


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CLOTHSIM_RENDERER", "ray")
    (tmp_path / "sheet.toml").write_text(SHEET)
    (tmp_path / "free.toml").write_text(FREE)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A run of SHEET."""
    folder = tmp_path_factory.mktemp("finished")
    (folder / "sheet.toml").write_text(SHEET)
    code = main(["run", str(folder / "sheet.toml"), "-o", str(folder / "out"), "--no-picture", "--quiet"])
    assert code == 0
    return folder / "out"


@pytest.fixture(scope="module")
def free(tmp_path_factory):
    """A run of FREE."""
    folder = tmp_path_factory.mktemp("free")
    (folder / "free.toml").write_text(FREE)
    assert main(["run", str(folder / "free.toml"), "-o", str(folder / "out"), "--no-picture", "--quiet"]) == 0
    return folder / "out"


def test_run_prints_settings_progress_and_verdict(capsys, tmp_path):
    assert main(["run", "sheet.toml", "--no-picture"]) == 0
    out, err = capsys.readouterr()
    assert "effects  inertia, membrane, gravity, body_contact" in out
    assert "off      damping: " in out
    assert "d_hat = 0.025 m" in out
    assert re.search(r"\b25\b.*\b32\b", out)
    assert "0.01 s" in out
    assert re.search(r"; Newton [^;]*\d", out)
    assert re.search(r"completed.*0\.04 s", out)
    gap = read_summary(tmp_path / "sheet/summary.json")["certificate"]["minimum_gap"]
    assert 0.01 < gap < 0.025
    assert re.search(rf"smallest\s+gap {1000 * gap:.3g} mm", out)
    assert re.search(r"principal stretches 0\.\d+ to 1\.\d+", out)
    assert "0.040 of 0.04 s" in err.splitlines()[-1]
    assert "Newton, gap " in err
    assert "\x1b" not in err
    left = {path.name for path in (tmp_path / "sheet").iterdir()}
    assert left == {"checkpoint.npz", "record.jsonl", "summary.json", "trajectory.vtkhdf"}


def test_json_is_the_summary_and_nothing_else_is_on_stdout(capsys, tmp_path):
    assert main(["run", "free.toml", "-o", "made/here", "--json", "--no-picture"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out) == read_summary(tmp_path / "made/here/summary.json")
    assert "effects  inertia, gravity" in err


@pytest.mark.parametrize(
    ("words", "lines"),
    [
        (["--preset", "draft"], 0),
        (["--error", "5mm"], 0),
        (["--preset", "draft", "--error", "5mm"], 1),
        (["--preset", "draft", "--set", "solver.error=0.005"], 1),
    ],
)
def test_an_error_and_a_preset_are_answered_with_which_counts(capsys, monkeypatch, words, lines):
    def simulate(scene, *_, **__):
        raise InputError(f"{scene.solver_settings.error}", "")

    monkeypatch.setattr(clothsim, "simulate", simulate)
    assert main(["run", "sheet.toml", "--no-picture", *words]) == 2
    out, err = capsys.readouterr()
    assert sum("--error" in line and "--preset draft" in line for line in (out + err).splitlines()) == lines
    assert ("0.005" in err) == ("5mm" in words or "solver.error=0.005" in words)


def test_quiet_prints_the_end_only(capsys):
    assert main(["run", "free.toml", "--quiet", "--no-picture"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("completed: ")
    assert not err


def test_frames_per_second_replaces_the_scenes(finished, tmp_path):
    main(["run", "free.toml", "--frames-per-second", "50", "--quiet", "--no-picture"])
    assert open_run(tmp_path / "free").times == pytest.approx([0.0, 0.02, 0.04])


def test_picture_and_movie_are_left(capsys, tmp_path, monkeypatch):
    small = {"size": (64, 64)}
    monkeypatch.setattr(pictures, "draw_frame", with_keywords(pictures.draw_frame, small))
    monkeypatch.setattr(pictures, "draw_movie", with_keywords(pictures.draw_movie, small))
    assert main(["run", "free.toml", "--movie", "--frames-per-second", "25"]) == 0
    assert (tmp_path / "free/picture.png").read_bytes().startswith(b"\x89PNG")
    assert list((tmp_path / "free").glob("movie.*"))
    assert "picture.png" in capsys.readouterr().out


def test_a_movie_without_ffmpeg_is_a_gif(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    small = {"size": (64, 64), "renderer": "ray"}
    monkeypatch.setattr(pictures, "draw_movie", with_keywords(pictures.draw_movie, small))
    assert main(["run", "free.toml", "--movie", "--no-picture", "--frames-per-second", "25", "--quiet"]) == 0
    assert [file.name for file in (tmp_path / "free").glob("movie.*")] == ["movie.gif"]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the unit of the counter is Linux's")
def test_the_peak_memory_is_that_of_the_operating_system_picture_included(tmp_path):
    words = ["run", str(tmp_path / "free.toml"), "-o", str(tmp_path / "out"), "--quiet"]
    command = [sys.executable, "-m", "clothsim", *words]
    started = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(started.pid, 0)
    assert status == 0
    assert (tmp_path / "out/picture.png").is_file()
    told = read_summary(tmp_path / "out/summary.json")["peak_memory_bytes"]
    assert 0.98 * 1024 * usage.ru_maxrss < told <= 1024 * usage.ru_maxrss


def test_a_picture_that_fails_is_reported_and_leaves_the_run_completed(capsys, monkeypatch):
    monkeypatch.setenv("CLOTHSIM_RENDERER", "crayon")
    assert main(["run", "free.toml"]) == 0
    assert "picture.png" in capsys.readouterr().out


def test_an_earlier_run_is_replaced_and_other_files_stay(capsys, tmp_path):
    (tmp_path / "free").mkdir()
    (tmp_path / "free/thesis.txt").write_text("all my work")
    main(["run", "free.toml", "--no-picture"])
    assert "free holds other files, which are kept" in capsys.readouterr().out
    assert "--overwrite" in refused(capsys, "run", "free.toml", "--no-picture")[1]
    main(["run", "free.toml", "--no-picture", "--frames-per-second", "25", "--overwrite"])
    assert "free holds an earlier run, which is replaced." in capsys.readouterr().out
    assert len(open_run(tmp_path / "free").times) == 2
    assert (tmp_path / "free/thesis.txt").read_text() == "all my work"


def test_a_failed_run_ends_with_1_and_its_last_good_state(capsys, tmp_path):
    scene = FREE.replace(
        "[solver]", "[effects.membrane]\n[effects.pins]\nselect = 'left'\n[solver]\nmax_iterations = 1"
    )
    (tmp_path / "hard.toml").write_text(scene)
    assert main(["run", "hard.toml", "--no-picture"]) == 1
    out = capsys.readouterr().out
    assert re.search(r"failed: At \S+ s: Newton did not converge in 1 iterations", out)
    assert re.search(r"step \d", out)
    assert "clothsim bundle hard" in out
    assert read_summary(tmp_path / "hard/summary.json")["status"] == "failed"


def test_stopped_by_hand_then_resumed_gives_the_same_frames(capsys, tmp_path, monkeypatch, free):
    def interrupt(self, progress):
        if progress.step == 5:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Lines, "__call__", interrupt)
        assert main(["run", "free.toml", "--no-picture"]) == 130
    assert capsys.readouterr().err.splitlines()[-1].endswith("clothsim resume free")
    assert read_checkpoint(tmp_path / "free/checkpoint.npz").state.frame == 2
    assert main(["resume", "free", "--no-picture"]) == 0
    assert "0.02 s" in capsys.readouterr().out
    again, whole = open_run(tmp_path / "free"), open_run(free)
    np.testing.assert_array_equal(again.times, whole.times)
    np.testing.assert_array_equal(again.positions(-1), whole.positions(-1))
    counts = [
        [run.summary["effects"]["gravity"][key] for key in COUNTERS if key != "seconds"] for run in (again, whole)
    ]
    assert counts[0] == counts[1]


def test_render_a_frame_and_a_movie(capsys, tmp_path, free):
    assert main(["render", str(free), "-o", "a.png", "--size", "64x80", "--view", "-1,-1,0.5", "--frame", "0"]) == 0
    assert "a.png: " in capsys.readouterr().out
    from PIL import Image

    with Image.open(tmp_path / "a.png") as image:
        assert image.size == (64, 80)
    assert main(["render", str(free), "-o", "a.gif", "--size", "64x64", "--colour", "plain", "--quiet"]) == 0
    with Image.open(tmp_path / "a.gif") as image:
        assert image.n_frames == 5


def test_up_is_against_gravity_where_it_is_known(free, finished, tmp_path):
    assert open_run(free).up == pytest.approx((0, 1, 0))
    assert open_run(finished).up == (0, 0, 1)
    shutil.copytree(free, tmp_path / "bare")
    (tmp_path / "bare/checkpoint.npz").unlink()
    assert open_run(tmp_path / "bare").up == "z"


def test_check_lists_all_faults_of_a_mesh_at_once(capsys, tmp_path):
    (tmp_path / "bad.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 5 5 5\nf 1 2 3\nf 1 2 3\nf 2 3 4\n"  # twice, wound the other way, loose
    )
    assert main(["check", "bad.obj"]) == 1
    out = capsys.readouterr().out
    assert re.search(r"twice.*\b1\b", out)
    assert re.search(r"vertex 4\b", out)
    assert "winding inconsistent" in out
    assert out.endswith("3 errors.\n")
    assert main(["check", "bad.obj", "--body"]) == 0
    assert "3 warnings." in capsys.readouterr().out


def test_check_a_sound_mesh_and_a_part_of_it(capsys, tmp_path):
    (tmp_path / "two.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf 1 2 3\nf 3 2 4\nf 5 6 7\n"
    )
    assert main(["check", "two.obj"]) == 0
    assert "7 vertices, 3 triangles" in capsys.readouterr().out
    assert main(["check", "two.obj", "--component", "0", "--scale", "0.1"]) == 0
    out = capsys.readouterr().out
    assert "4 vertices, 2 triangles" in out
    assert "box 0.1 x 0.1 x 0 m" in out


def test_check_a_scene(capsys, tmp_path):
    assert main(["check", "sheet.toml"]) == 0
    out = capsys.readouterr().out
    assert "d_hat = 0.025 m" in out
    assert "cloth and body do not intersect at the start" in out
    assert "cloth and cloth do not intersect at the start" in out
    assert main(["check", "free.toml"]) == 0
    inside = SHEET.replace("0.31]", "0.2]")
    (tmp_path / "inside.toml").write_text(inside)
    assert main(["check", "inside.toml"]) == 1
    assert "error: cloth intersects ball" in capsys.readouterr().out
    (tmp_path / "loose.toml").write_text(inside.replace("[effects.body_contact]", ""))
    assert main(["check", "loose.toml"]) == 0  # without contact a run goes on, with a warning
    out = capsys.readouterr().out
    assert re.search(
        r"warning: cloth and ball intersect at the start, in \d+ pairs of triangles: triangle \d+ of cloth", out
    )
    assert re.search(r"intersects triangle \d+ of ball near \(-?0\.\d+, -?0\.\d+, 0\.2\) m", out)


def test_check_a_run_finds_the_frame_that_was_pushed_into_the_body(capsys, tmp_path, finished):
    assert main(["check", str(finished)]) == 0
    assert "cloth and body do not intersect in any of 2 frames" in capsys.readouterr().out
    shutil.copytree(finished, tmp_path / "pushed")
    trajectory = read_trajectory(finished / TRAJECTORY_NAME)
    everything = np.concatenate([trajectory.positions(1), trajectory.bodies(1)[0][1]])
    everything[:25, 2] -= 0.1
    with TrajectoryWriter(tmp_path / "pushed" / TRAJECTORY_NAME, trajectory.surfaces, resume_at=2) as writer:
        writer.append(0.05, everything, trajectory.stretches(1))
    assert main(["check", "pushed"]) == 1
    out = capsys.readouterr().out
    assert "error: cloth and ball intersect in frame 2 at 0.05 s, in " in out
    assert "cloth and cloth do not intersect in any of 3 frames" in out
    assert out.endswith("1 error.\n")


def test_check_reports_cloth_in_cloth_with_and_without_self_contact(capsys, tmp_path):
    second = SHEET.replace("[cloth]", "[[cloth]]").replace("[[body]]", CROSSING + "[[body]]")
    (tmp_path / "two.toml").write_text(second)
    assert main(["check", "two.toml"]) == 0
    out = capsys.readouterr().out
    assert re.search(
        r"^  warning: cloth\[0\] and flag intersect at the start, in \d+ pairs of triangles", out, re.MULTILINE
    )
    assert "self_contact" in out
    (tmp_path / "on.toml").write_text(second + "[effects.self_contact]\n")
    assert main(["check", "on.toml"]) == 1
    assert re.search(
        r"error: (cloth\[0\] intersects flag|flag intersects cloth\[0\]) at the start", capsys.readouterr().out
    )
    (tmp_path / "out.toml").write_text(second + '[effects.self_contact]\nexclude = [["cloth[0]", "flag"]]\n')
    assert main(["check", "out.toml"]) == 0
    assert "warning: cloth[0] and flag intersect at the start" in capsys.readouterr().out


def test_explain_tells_every_effect_of_the_table(capsys):
    assert main(["explain", "sheet.toml", "--steps", "2", "--json"]) == 0
    reported = json.loads(capsys.readouterr().out)
    assert list(reported) == sorted(EFFECTS)
    assert {name for name, entry in reported.items() if entry["on"]} == {
        "inertia",
        "membrane",
        "gravity",
        "body_contact",
    }
    assert reported["bending"]["reason"] == "not named in the scene"
    assert reported["damping"]["reason"] not in ("not named in the scene", "named in the scene")
    for entry in reported.values():
        assert all(entry[key] >= 0 for key in COUNTERS)
        assert (entry["seconds"] > 0) == entry["on"]
    assert reported["membrane"]["hessian_nonzeros"] == 32 * 81
    assert reported["membrane"]["evaluations"] > 0
    assert reported["body_contact"]["ccd_calls"] > 0
    assert set(reported["body_contact"]["parts"]) == {"candidates", "CCD"}


def test_explain_prints_a_table_that_adds_up(capsys, finished):
    assert main(["explain", str(finished)]) == 0
    out = capsys.readouterr().out
    assert "(linear solve)" in out
    assert "of it CCD" in out
    shares = {
        line.split("  ")[0]: float(found[1])
        for line in out.splitlines()
        if (found := re.search(r" ([\d.]+) %", line)) and not line.startswith("  of it")
    }
    assert shares.pop("all") == 100.0
    assert sum(shares.values()) == pytest.approx(100.0, abs=1.0)
    receipt = explain_run(finished)
    assert receipt.seconds <= open_run(finished).summary["wall_seconds"]


def test_explain_a_run_that_was_stopped(capsys, tmp_path, finished):
    shutil.copytree(finished, tmp_path / "stopped")
    (tmp_path / "stopped/summary.json").unlink()
    assert main(["explain", "stopped", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["membrane"]["gradients"] > 0


def test_explain_counts_only_the_steps_that_were_asked_for():
    scene = load_scene("free.toml")
    one, three = (explain_scene(scene, steps).effects["gravity"]["hessians"] for steps in (1, 3))
    assert three > one > 0


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["run", "missing.toml"], "missing.toml"),
        (["run"], "SCENE"),
        (["walk"], "'walk'"),
        (["run", "free.toml", "--fast"], "--fast"),
        (["run", "free.toml", "--frames-per-second", "-3"], "'-3'"),
        (["run", "free.toml", "-o", "free.toml"], "free.toml"),
        (["run", "broken.toml"], "broken.toml"),
        (["run", "typo.toml"], "'efects'"),
        (["run", "wrong.toml"], "effects.gravity.acceleration"),
        (["run", "unknown.toml"], "'seems'"),
        (["run", "inside.toml"], "cloth intersects ball"),
        (["run", "faults.toml"], "bad: "),
        (["resume", "nowhere"], "nowhere"),
        (["bundle", "nowhere"], "nowhere"),
        (["bundle", "."], "checkpoint"),
        (["bundle", "RUN", "-o", "a.tar"], "a.tar"),
        (["bundle", "RUN", "-o", "no/a.zip"], " no."),
        (["resume", "notes.txt"], "notes.txt"),
        (["resume", "RUN", "-o", "there"], "archive"),
        (["run", "a.zip"], "a.zip"),
        (["render", "nowhere"], "nowhere"),
        (["render", "RUN", "-o", "a.jpg"], "a.jpg"),
        (["render", "RUN", "-o", "no/a.png"], " no."),
        (["render", "RUN", "--frame", "9"], " 9."),
        (["render", "RUN", "--frame", "first"], "'first'"),
        (["render", "RUN", "--size", "big"], "'big'"),
        (["render", "RUN", "--size", "2x2"], "2 x 2"),
        (["render", "RUN", "--view", "up"], "'up'"),
        (["render", "RUN", "--up", "0,0,0"], "up "),
        (["render", "RUN", "--colour", "reddish"], "'reddish'"),
        (["render", "RUN", "-o", "a.gif", "--frame", "1"], "--frame"),
        (["render", "RUN", "-o", "a.png", "--frames-per-second", "9"], "--frames-per-second"),
        (["render", "."], "trajectory.vtkhdf"),
        (["check", "nowhere"], "nowhere"),
        (["check", "notes.txt"], "notes.txt"),
        (["check", "free.toml", "--body"], "free.toml"),
        (["check", "bad.obj", "--component", "x"], "'x'"),
        (["explain", "nowhere.toml"], "nowhere.toml."),
        (["explain", "free.toml", "--steps", "0"], "'0'"),
        (["explain", "RUN", "--steps", "2"], "--steps"),
    ],
)
def test_bad_input_is_a_sentence_and_a_remedy(capsys, tmp_path, free, words, sentence):
    (tmp_path / "broken.toml").write_text("[cloth\n")
    (tmp_path / "typo.toml").write_text(FREE.replace("[effects.inertia]", "[efects.inertia]"))
    (tmp_path / "wrong.toml").write_text(FREE.replace("[0.0, -9.81, 0.0]", '"down"'))
    (tmp_path / "unknown.toml").write_text(FREE + "[effects.seems]\n")
    (tmp_path / "inside.toml").write_text(SHEET.replace("0.31]", "0.2]"))
    (tmp_path / "bad.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 5 5 5\nf 1 2 3\nf 1 2 3\nf 2 3 4\n")
    bad = FREE.replace('mesh = "rectangle"\ncells = [4, 4]', 'mesh = "bad.obj"\nname = "bad"')
    (tmp_path / "faults.toml").write_text(bad)
    (tmp_path / "notes.txt").write_text("hello")
    lines = refused(capsys, *(str(free) if word == "RUN" else word for word in words))
    assert sentence in lines[0]
    assert not (tmp_path / "inside").exists()


def test_many_faults_of_a_mesh_are_two_lines_that_name_where_all_are(capsys, tmp_path):
    (tmp_path / "bad.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 5 5 5\nf 1 2 3\nf 1 2 3\nf 2 3 4\n")
    bad = FREE.replace('mesh = "rectangle"\ncells = [4, 4]', 'mesh = "bad.obj"\nname = "bad"')
    (tmp_path / "faults.toml").write_text(bad)
    assert refused(capsys, "run", "faults.toml")[0].endswith("(2 more: `clothsim check` lists them)")


def test_a_key_is_changed_from_the_command_line(capsys, tmp_path):
    assert main(["run", "free.toml", "--no-picture", "--quiet", "--set", "run.duration=0.02"]) == 0
    assert open_run(tmp_path / "free").times[-1] == 0.02
    assert "duration" in refused(capsys, "run", "free.toml", "--set", "run.duratoin=1")[1]
