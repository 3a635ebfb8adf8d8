"""Runs that fail, at the command line: the place, the iterates, the archive that replays them."""

import re
import shutil

import numpy as np
import pytest
from command_line import FREE, refused, with_keywords

from clothsim.base.record import read_summary
from clothsim.cli import main
from clothsim.render import marks
from clothsim.run import pictures

PRESS = """
[cloth]
mesh = "rectangle"
size = [0.5, 0.5]
cells = [4, 4]
position = [0, 0, 0.008]
[[body]]
name = "press"
mesh = "slab"
size = [1, 1, 0.1]
position = [0, 0, 0.06]
motion = { velocity = [0, 0, -0.2] }
[[body]]
name = "table"
mesh = "slab"
size = [1, 1, 0.1]
position = [0, 0, -0.05]
[effects.inertia]
[effects.membrane]
[effects.body_contact]
d_hat = 0.01
[solver]
dt = 0.02
threads = 1
linear = "superlu"
[run]
duration = 0.1
"""


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CLOTHSIM_RENDERER", "ray")
    (tmp_path / "free.toml").write_text(FREE)


def test_a_failed_run_leaves_its_place_its_iterates_and_what_to_do(capsys, tmp_path, monkeypatch):
    for module, draw in ((marks, marks.draw_closeup), (pictures, pictures.draw_frame)):
        monkeypatch.setattr(module, draw.__name__, with_keywords(draw, {"size": (128, 96)}))
    (tmp_path / "press.toml").write_text(PRESS)
    assert main(["run", "press.toml"]) == 1
    out = capsys.readouterr().out
    failure = read_summary(tmp_path / "press/summary.json")["failure"]
    assert failure["remedy"] in out.splitlines()
    assert (tmp_path / "press/failure.png").read_bytes().startswith(b"\x89PNG")
    assert f"resume press --dump-iterates {failure['step']}" in out
    assert main(["resume", "press", "--no-picture", "--dump-iterates", str(failure["step"])]) == 1
    assert not (tmp_path / "press/failure.png").exists()
    with np.load(tmp_path / f"press/iterates_{failure['step']}.npz", allow_pickle=False) as iterates:
        assert iterates["positions"].shape[1:] == (25 + 16, 3)
    assert re.search("cloth is pinched between (press and table|table and press)", capsys.readouterr().out)


def test_a_bundle_is_replayed_with_one_command(capsys, tmp_path):
    (tmp_path / "press.toml").write_text(PRESS)
    assert main(["run", "press.toml", "--no-picture", "--quiet"]) == 1
    first = read_summary(tmp_path / "press/summary.json")
    assert main(["bundle", "press", "-o", "sent.zip"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].endswith("clothsim resume sent.zip")
    shutil.rmtree(tmp_path / "press")
    assert main(["resume", "sent.zip", "--no-picture", "--dump-iterates", str(first["failure"]["step"])]) == 1
    assert f"failed: {first['reason']}" in capsys.readouterr().out
    assert read_summary(tmp_path / "sent/summary.json")["failure"] == first["failure"]
    assert (tmp_path / f"sent/iterates_{first['failure']['step']}.npz").is_file()
    assert "sent already exists." in refused(capsys, "resume", "sent.zip")[0]
    assert main(["resume", "sent.zip", "-o", "other", "--no-picture", "--quiet"]) == 1


def test_iterates_of_a_step_that_never_came_are_missed(capsys, tmp_path):
    assert main(["run", "free.toml", "--no-picture", "--dump-iterates", "99"]) == 0
    assert "iterates_99.npz" in capsys.readouterr().out
    assert "Step 3 cannot be dumped: 8 steps are done." in refused(capsys, "resume", "free", "--dump-iterates", "3")[0]
    assert "--dump-iterates is 'two'" in refused(capsys, "run", "free.toml", "--dump-iterates", "two")[0]


@pytest.mark.parametrize(
    "words", [["run", "scene.toml", "-o", ""], ["fit", "a.obj", "--to", ""], ["run", "-o", "", "x"]]
)
def test_an_empty_word_after_an_option_is_refused(words, tmp_path, monkeypatch, capsys):
    """The directory of an unset variable would be the current one."""
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    assert main(words) == 2
    assert "is empty" in capsys.readouterr().err
    assert not list(here.iterdir())


@pytest.mark.parametrize("command", ["check", "run", "explain", "export", "farm plan", "view", "study"])
def test_a_name_that_is_too_long_is_bad_input(command, capsys):
    """It ended as a fault of clothsim: OSError, File name too long."""
    words = [*command.split(), f"{'a' * 300}.toml", *(["-o", "out.glb"] if command in ("export", "farm plan") else [])]
    refused(capsys, *words)


def test_control_characters_of_a_name_are_spelled_out(tmp_path, capsys):
    (tmp_path / "red\x1b[31m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    main(["check", "red\x1b[31m.obj"])
    out = capsys.readouterr().out
    assert r"red\x1b[31m.obj" in out
    assert "\x1b" not in out
