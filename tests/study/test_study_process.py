"""A study as a process: its end by SIGTERM, and the end of its workers with it."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic, sleep

import pytest

CHILDREN = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children")
pytestmark = pytest.mark.skipif(not CHILDREN.is_file(), reason="/proc lists the processes")
SCENE = """
[cloth]
mesh = "rectangle"
cells = [4, 4]
[effects.inertia]
[effects.membrane]
[effects.gravity]
[effects.pins]
select = "left"
[solver]
dt = 0.02
linear = "superlu"
[run]
duration = 4000.0
"""
PATIENCE = 60.0


def until(condition):
    """Wait for a condition, and return what it came to."""
    end = monotonic() + PATIENCE
    while not (found := condition()) and monotonic() < end:
        sleep(0.05)
    return found


def children(pid):
    return [int(each) for each in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def running(pid):
    """True for a process that is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.fixture
def study(tmp_path):
    """A study with two busy workers, (process, its workers)."""
    (tmp_path / "sheet.toml").write_text(SCENE)
    command = [sys.executable, "-m", "clothsim", "study", "sheet.toml", "-o", "out", "--budget", "1h", "--workers", "2"]
    home = str(Path(__file__).parents[2])
    environment = {**os.environ, "PYTHONPATH": home, "TMPDIR": str(tmp_path)}
    process = subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True)
    assert until(lambda: len(children(process.pid)) == 2)
    workers = children(process.pid)
    assert until(lambda: list(tmp_path.glob("clothsim-study-*/clothsim-study-*")))  # one is in a run
    yield process, workers
    for pid in (process.pid, *workers):
        if running(pid):
            os.kill(pid, signal.SIGKILL)
    process.communicate()


def test_sigterm_ends_the_workers_and_the_study_with_what_it_has(study, tmp_path):
    process, workers = study
    os.kill(process.pid, signal.SIGTERM)
    out, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert not [pid for pid in workers if running(pid)]
    result = json.loads((tmp_path / "out" / "study.json").read_text())
    assert result["stopped"] is True
    assert result["failed"] == []
    assert (result["headline"]["status"], result["headline"]["missing"]) == ("unfinished", ["base"])
    assert result["headline"]["needed_seconds"] is None
    assert "before the study was stopped" in out
    assert not list(tmp_path.glob("clothsim-study-*"))


def test_workers_end_with_a_study_that_is_killed(study):
    process, workers = study
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert until(lambda: not [pid for pid in workers if running(pid)])
