"""Trials of mutants: a copy of the tree with one change, and the tests of the changed file in a process of its own.

The process is forked from one that has loaded the libraries, and so begins at once. Kernels are cached in a folder of
this run, by a hash of their code and of the constants in them: one that a mutant changes is compiled anew. Modules are
compiled ahead with hashes of their sources (PEP 552), as two texts of one second and one length look the same else.
"""

import compileall
import contextlib
import os
import py_compile
import re
import resource
import shutil
import signal
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

LIBRARIES = ("numba", "scipy.sparse.linalg", "scipy.spatial", "scipy.optimize", "hypothesis", "ipctk", "h5py", "pytest")
SURVIVED, CAUGHT, TIME_OUT, NOT_RUN = "survived", "caught", "time-out", "not run"
WALL = 20
"""Seconds by the clock for each second of the processor that a trial may take: others use the machine too."""
MEMORY = 12 * 2**30
"""Bytes of address space."""


@dataclass(frozen=True)
class Verdict:
    """What the tests said of a mutant; by: the test that failed, or how the process ended; seconds of the processor."""

    word: str
    by: str
    seconds: float


class Bench:
    """A copy of a tree's sources and tests, in which one file at a time is changed."""

    def __init__(self, source: Path, folder: Path) -> None:
        self.root = folder / "tree"
        os.environ["NUMBA_CACHE_DIR"] = str(folder / "kernels")
        skipped = shutil.ignore_patterns("__pycache__", "*.pyc")
        for name in ("clothsim", "transfer", "tests", "scenes"):
            shutil.copytree(source / name, self.root / name, ignore=skipped, dirs_exist_ok=True)
        shutil.copy(source / "pyproject.toml", self.root)
        checked = py_compile.PycInvalidationMode.CHECKED_HASH
        compileall.compile_dir(self.root / "clothsim", quiet=2, invalidation_mode=checked)
        sys.dont_write_bytecode = True
        for name in LIBRARIES:
            __import__(name)

    def verdict(self, tests: Sequence[str], bound: int, file: str = "", text: str = "") -> Verdict:
        """Run tests, at most `bound` seconds of the processor, with `text` in the place of the file's."""
        before = (self.root / file).read_text() if file else ""
        try:
            if file:
                (self.root / file).write_text(text)
            return self._run(tests, bound)
        finally:
            if file:
                (self.root / file).write_text(before)

    def _run(self, tests: Sequence[str], bound: int) -> Verdict:
        report = self.root.parent / "report.txt"
        child = os.fork()
        if not child:
            self._child(tests, bound, report)
        _, status, usage = os.wait4(child, 0)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)  # what it started itself
        word, by = read_end(os.waitstatus_to_exitcode(status), report.read_text(errors="replace"))
        return Verdict(word, by, round(usage.ru_utime + usage.ru_stime, 1))

    def _child(self, tests: Sequence[str], bound: int, report: Path) -> None:
        """Become pytest in the copy of the tree; never returns."""
        code = 70
        try:
            os.setsid()
            descriptor = os.open(report, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(descriptor, 1)
            os.dup2(descriptor, 2)
            resource.setrlimit(resource.RLIMIT_CPU, (bound, bound))
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            signal.alarm(WALL * bound)
            for name in [name for name in sys.modules if name.partition(".")[0] in ("clothsim", "transfer", "tests")]:
                del sys.modules[name]
            os.chdir(self.root)
            sys.path[:] = [str(self.root), *(each for each in sys.path[1:] if each)]
            import pytest

            code = int(pytest.main(["-x", "-q", "--tb=no", "-p", "no:cacheprovider", "-p", "no:xdist", *tests]))
            loaded = sys.modules.get("clothsim")
            if loaded is not None and not str(loaded.__file__).startswith(str(self.root)):
                print(f"tests saw {loaded.__file__}")
                code = 70
            sys.stdout.flush()
        finally:
            os._exit(code)


def read_end(code: int, report: str) -> tuple[str, str]:
    """Verdict by the exit code of pytest (negative: a signal), and the test that failed."""
    if code == 0:
        return SURVIVED, ""
    if code in (-signal.SIGXCPU, -signal.SIGKILL, -signal.SIGALRM):
        return TIME_OUT, signal.Signals(-code).name
    if code < 0:
        return CAUGHT, signal.Signals(-code).name
    failed = re.findall(r"^(?:FAILED|ERROR) (\S+)", report, re.MULTILINE)
    if code in (1, 2) and failed:
        return CAUGHT, failed[0]
    return (CAUGHT, "an error of its import") if code in (2, 4) else (NOT_RUN, report.strip()[-300:])
