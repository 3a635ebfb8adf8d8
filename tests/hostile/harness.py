"""A case in a process of its own: its output as it comes, its time and memory, what it leaves outside of its folder.

The process is forked from this one, which has imported the commands: a case costs what it does, not what Python does.
"""

import contextlib
import io
import os
import resource
import select
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from pathlib import Path

import clothsim
from clothsim import engine, files, gradients, patterns, render
from clothsim.base.errors import MissingPackageError
from clothsim.cli import main, on_demand
from tests.hostile.case import MOST_SECONDS, Case, Outcome, checked

WALL = 10 * MOST_SECONDS
"""Largest time on the clock, of a machine that others use too [s]."""
BEAT = 0.05
"""Pause between two looks at a process [s]."""
ADDRESS_SPACE = 12 << 30
"""Bound on a process that would take the machine down [bytes]."""
OUTSIDE = "outside/thesis.txt"
"""What lies beside the folder of a case, and must stay as it is."""


def preload() -> None:
    """Import what commands import when they run, so that each process begins with it."""
    for door in (clothsim, engine, files, patterns, render, gradients, on_demand):
        for name in door.__all__:
            with contextlib.suppress(ImportError, MissingPackageError):
                getattr(door, name)


def run_case(case: Case, place: Path) -> Outcome:
    """Run a case in `place`, an empty directory."""
    folder = place / "here"
    folder.mkdir()
    (place / "outside").mkdir()
    (place / OUTSIDE).write_text("all my work")
    case.make(folder)
    before = _listed(place)
    for words in case.before:
        _watched(Case(case.name, words, ""), folder)
    code, text, figures = _watched(case, folder)
    outcome = checked(case, folder, code, text, figures)
    changed = {name for name in before ^ _listed(place) if not name[0].startswith("here")}
    if changed and not outcome.wrong:
        return Outcome(outcome.got, *figures, f"outside of its folder: {sorted(changed)[0][0]}", text)
    return outcome


def run_here(case: Case, folder: Path) -> Outcome:
    """Run a case in this process; its time is that of the process, its memory is not known."""
    case.make(folder)
    out, home, begun = io.StringIO(), Path.cwd(), time.process_time()
    os.chdir(folder)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            code = main(case.line)
    except SystemExit as end:
        code = int(end.code or 0)
    finally:
        os.chdir(home)
    return checked(case, folder, code, out.getvalue(), (time.process_time() - begun, 0.0, 0.0))


def _listed(place: Path) -> set[tuple[str, int]]:
    """Names and sizes of all that is there."""
    return {(str(path.relative_to(place)), path.lstat().st_size if path.is_file() else 0) for path in place.rglob("*")}


def _watched(case: Case, folder: Path) -> tuple[int | None, str, tuple[float, float, float]]:
    """Exit code (None: it did not end), output, and (seconds, silence, memory) of a command."""
    reading, writing = os.pipe()
    process = os.fork()
    if not process:
        os.close(reading)
        _become(case, folder, writing)
    os.close(writing)
    text, silence, signals = bytearray(), 0.0, list(case.interrupt)
    begun, last = time.monotonic(), 0.0
    for piece in _pieces(reading, begun):
        spent = _processor_time(process)
        if piece:
            text += piece
            silence, last = max(silence, spent - last), spent
        if signals and (folder / signals[0][1]).exists():
            os.kill(process, signals.pop(0)[0])
        if spent > MOST_SECONDS or time.monotonic() - begun > WALL:
            os.kill(process, signal.SIGKILL)
            os.wait4(process, 0)
            os.close(reading)
            return None, text.decode(errors="replace"), (spent, max(silence, spent - last), 0.0)
    os.close(reading)
    _, status, used = os.wait4(process, 0)
    spent = used.ru_utime + used.ru_stime
    silence = max(silence, spent - last)
    return os.waitstatus_to_exitcode(status), text.decode(errors="replace"), (spent, silence, 1024.0 * used.ru_maxrss)


def _pieces(reading: int, begun: float) -> Iterator[bytes]:
    """What comes out of a pipe until it is closed, and b"" after each pause."""
    while True:
        ready, _, _ = select.select([reading], [], [], BEAT)
        if not ready:
            yield b""
            continue
        piece = os.read(reading, 1 << 16)
        if not piece:
            return
        yield piece


def _processor_time(process: int) -> float:
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except OSError:
        return 0.0


def _become(case: Case, folder: Path, writing: int) -> None:
    """Be the process of a case: never returns."""
    code = 70
    try:
        os.setsid()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        for stream in (1, 2):
            os.dup2(writing, stream)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        sys.stdout, sys.stderr = (
            io.TextIOWrapper(io.FileIO(k, "w"), "utf-8", "replace", write_through=True) for k in (1, 2)
        )
        os.chdir(folder)
        temporary = folder / "tmp"
        temporary.mkdir(exist_ok=True)
        os.environ["TMPDIR"] = tempfile.tempdir = str(temporary)
        os.environ["CLOTHSIM_RENDERER"] = "ray"
        resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
        for name, most in case.limits.items():
            kind = getattr(resource, f"RLIMIT_{name}")
            resource.setrlimit(kind, (most, resource.getrlimit(kind)[1]))
        code = main(case.line)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(OSError, ValueError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)
