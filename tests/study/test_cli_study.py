"""`clothsim study` on an analytic scene: printed text and bad input."""

import json
import os
import re
import signal

import pytest
from analytic_study import Runners, answer

from clothsim.base.errors import InputError
from clothsim.cli import main
from clothsim.cli.study_command import as_seconds, study_progress, terminated
from clothsim.scene.scene import scene_from_text
from clothsim.study.evaluation import StudyProgress

SCENE = """
[cloth]
mesh = "rectangle"
size = [1.0, 0.5]
cells = [4, 2]
[effects.inertia]
[effects.membrane]
[effects.gravity]
[solver]
dt = 0.02
integrator = "backward_euler"
[run]
duration = 0.2
"""


@pytest.fixture
def sheet(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sheet.toml").write_text(SCENE)
    runners = Runners()
    from clothsim.study import study

    original = study.study_accuracy
    monkeypatch.setattr("clothsim.study_accuracy", lambda *args, **keys: original(*args, **keys, runners=runners))
    return runners


def test_it_answers_the_question(sheet, capsys, tmp_path):
    assert main(["study", "sheet.toml", "--parameters", "dt, cells", "--budget", "1h", "-o", "out"]) == 0
    out = capsys.readouterr().out
    assert "The error of this scene is 44 mm" in out
    assert "Half of that error: " in out
    assert "for <= " in out
    assert {"study.json", "study.md", "study.png"} <= {file.name for file in (tmp_path / "out").iterdir()}


def test_json_is_all_of_stdout(sheet, capsys):
    words = ["--parameters", "dt,cells", "--budget", "1h", "--json", "--set", "solver.dt=0.04"]
    assert main(["study", "sheet.toml", *words]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["base"]["settings"]["dt"] == pytest.approx(0.04)
    assert result["budget"] == 3600


def test_a_budget_that_is_too_small_is_exit_1_and_what_is_needed(sheet, capsys):
    sheet.reply = lambda job: answer(job, seconds=2.5 * scene_from_text(job.scene).cloth["cells"][0] ** 2)
    assert main(["study", "sheet.toml", "--parameters", "dt,cells", "--budget", "90s", "--json"]) == 1
    printed = capsys.readouterr()
    headline = json.loads(printed.out)["headline"]
    assert (headline["known"], headline["status"], headline["error"]) == (False, "unfinished", None)
    assert headline["missing"] == ["cells"]
    shown_seconds = float(re.search(r"--budget (\d+)s", printed.err)[1])
    assert 160 < headline["needed_seconds"] <= shown_seconds < 1.15 * headline["needed_seconds"]
    assert "The error of this scene is" not in printed.err


def test_sigterm_is_noticed_and_its_handler_put_back():
    before = signal.getsignal(signal.SIGTERM)
    with terminated() as stopped:
        assert not stopped()
        os.kill(os.getpid(), signal.SIGTERM)
        assert stopped()
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["missing.toml"], "There is no scene file missing.toml"),
        (["sheet.toml", "--budget", "soon"], "--budget is 'soon'"),
        (["sheet.toml", "--parameters", "dtt"], "parameters has no key 'dtt'"),
        (["sheet.toml", "--parameters", ","], "--parameters names nothing"),
        (["sheet.toml", "--workers", "0"], "--workers is '0'"),
    ],
)
def test_bad_input_is_two_lines(sheet, words, sentence, capsys):
    assert main(["study", *words]) == 2
    err = capsys.readouterr().err.splitlines()
    assert sentence in err[-2]
    assert not sheet.jobs


@pytest.mark.parametrize(("text", "seconds"), [("90", 90), ("120s", 120), ("1.5min", 90), ("2 h", 7200)])
def test_times(text, seconds):
    assert as_seconds("--budget", text) == seconds


@pytest.mark.parametrize("text", ["0s", "-1", "1e3", "ten", ""])
def test_bad_times(text):
    with pytest.raises(InputError):
        as_seconds("--budget", text)


def test_progress_lines_are_few(capsys):
    with study_progress(quiet=False) as on_progress:
        for second in range(20):
            on_progress(StudyProgress(second, 20, float(second), 120.0, "dt +1"))
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "0.0 s of 2:00 min: 0 runs done, 20 to go (dt +1)"
    assert len(lines) == 4
