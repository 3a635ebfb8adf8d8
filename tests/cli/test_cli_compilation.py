"""Notice and clock of the compilation of kernels."""

import time
from types import SimpleNamespace

import pytest

from clothsim.cli import progress
from clothsim.cli.progress import CompilationClock, Lines, installed_clock, progress_on_stderr
from clothsim.run.step_reports import Progress


@pytest.fixture
def seconds(monkeypatch):
    """Time of the clock of compilation, set by the test."""
    at = SimpleNamespace(now=0.0)
    monkeypatch.setattr(progress, "perf_counter", lambda: at.now)
    return at


def _compilation_of(function):
    """Numba's event for a function."""
    return SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=function)})


def test_the_clock_counts_what_is_nested_once_and_what_is_under_way(seconds):
    clock, outer = CompilationClock(), _compilation_of(progress_on_stderr)
    inner = _compilation_of(CompilationClock.on_end)
    assert (clock.seconds(), clock.kernel) == (0.0, "")
    for now, notify, event in ((1.0, clock.on_start, outer), (2.0, clock.on_start, inner), (4.0, clock.on_end, inner)):
        seconds.now = now
        notify(event)
    assert (clock.seconds(), clock.kernel) == (3.0, "progress.progress_on_stderr")
    seconds.now = 6.0
    clock.on_end(outer)
    seconds.now = 60.0
    assert clock.seconds() == 5.0


def test_the_clock_listens_to_numba():
    from numba import njit

    compiled = njit(lambda x: x + 1.0)
    with installed_clock() as clock:
        compiled(1.0)
        first = clock.seconds()
        compiled(2.0)
        assert first > 0.0
        assert clock.seconds() == first


def test_the_time_left_excludes_compilation(monkeypatch, capsys):
    """Ten steps of one second, the second of which compiles for a thousand: nine, not a million, are left."""

    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LINES", 0.0)
    at = SimpleNamespace(now=0.0, compiled=0.0)
    lines = Lines(lambda: at.now - at.compiled)
    for step in (1, 2):
        at.now += 1.0 + 1000.0 * (step == 2)
        at.compiled += 1000.0 * (step == 2)
        lines(Progress(0.1 * step, 1.0, step, 4, 2e-3, 0.5, "moving", at.now))
    assert "8.0 s left" in capsys.readouterr().err


def test_the_notice_ends_with_the_first_step_and_comes_once(monkeypatch, capsys):
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LINES", 0.02)
    monkeypatch.setattr("clothsim.engine.kernels_are_compiled", lambda: False)
    with progress_on_stderr(quiet=False) as listener:
        for _ in range(500):
            time.sleep(0.01)
            err = capsys.readouterr().err
            if "compiling: 0 of" in err:
                break
        else:
            pytest.fail("no count was printed")
        listener(Progress(0.1, 1.0, 1, 4, 2e-3, 0.5, "moving", 0.1))
        time.sleep(0.1)
        capsys.readouterr()
        time.sleep(0.1)
        assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("quiet", "compiled"), [(True, False), (False, True)])
def test_nothing_is_printed_where_it_is_quiet_or_compiled(monkeypatch, capsys, quiet, compiled):
    monkeypatch.setattr("clothsim.engine.kernels_are_compiled", lambda: compiled)
    with progress_on_stderr(quiet):
        pass
    assert capsys.readouterr().err == ""
