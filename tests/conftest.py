"""Parallel test runs: each kernel is compiled once, and each module's fixtures are made once."""

import tempfile
from contextlib import suppress

import pytest
from small_scenes import EFFECTS, small_scene

MORE = {
    "pins": {"select": "corners"},
    "fibres": {"warp": 20.0},
    "strain_limit": {"limit": 2.0},
    "pressure": {"value": 0.1},
    "air": {},
    "self_contact": {},
    "friction": {},
}


def pytest_sessionstart(session):
    """Compile before there are workers: else all of them compile the same at once, at half a minute each."""
    if hasattr(session.config, "workerinput") or not getattr(session.config.option, "numprocesses", None):
        return
    from clothsim import simulate

    with tempfile.TemporaryDirectory() as folder, suppress(Exception):  # what does not work is for the tests to tell
        simulate(small_scene(effects=EFFECTS | MORE, run={"duration": 0.04, "frames_per_second": 25}), folder)


@pytest.fixture(scope="session", autouse=True)
def temporary_folders(tmp_path_factory):
    """Runs that are given no folder leave theirs beside the tests', of which pytest keeps three sessions."""
    folder = str(tmp_path_factory.mktemp("temporary"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TMPDIR", folder)
        patch.setattr(tempfile, "tempdir", folder)
        yield


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """A file's tests go to one worker, which makes the fixtures of the module once; --dist may ask for another way."""
    from xdist.scheduler import LoadFileScheduling

    return LoadFileScheduling(config, log) if config.getoption("dist") == "load" else None
