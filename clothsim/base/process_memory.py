"""Processes: allocator settings, peak memory, seconds since a moment, and a function in a process of its own.

The last is for libraries that may end the process that calls them.
"""

import ctypes
import os
import pickle
import subprocess
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from time import perf_counter, process_time
from typing import Any

import numpy as np

from clothsim.base.errors import ClothsimError, InputError

if sys.platform != "win32":
    import resource

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
LARGEST_CACHED = 1 << 30


def keep_freed_memory() -> bool:
    """Set glibc's malloc to keep freed memory instead of returning it to the kernel; True on success.

    Every Newton iteration allocates the same element blocks. By default each is returned when freed, and every
    page then faults: 57,601 faults against 472 in 64 iterations at 32 x 32 cells, and half of the wall-clock time on a
    virtual machine. Without glibc nothing is done.
    """
    if not sys.platform.startswith("linux"):
        return False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):
        return False
    return bool(mallopt(M_MMAP_THRESHOLD, LARGEST_CACHED) and mallopt(M_TRIM_THRESHOLD, LARGEST_CACHED))


def peak_memory() -> int:
    """Return the largest resident memory of this process so far [bytes]; 0 where the system has no such counter."""
    if sys.platform == "win32":
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def held_bytes(thing: object, others: Iterable[object] = ()) -> int:
    """Sum the bytes of all arrays that an object refers to, each counted once.

    thing: visited through its fields, mappings and sequences; others: objects whose arrays are not counted.
    """
    known = set().union(*(_arrays(other) for other in others))
    return sum(size for owner, size in _arrays(thing).items() if owner not in known)


def _arrays(thing: object) -> dict[int, int]:
    """{identity of the memory: bytes} of the arrays reachable through fields, mappings and sequences."""
    sizes: dict[int, int] = {}
    seen: set[int] = set()
    todo = [thing]
    while todo:
        one = todo.pop()
        if id(one) in seen:
            continue
        seen.add(id(one))
        if isinstance(one, np.ndarray):
            while isinstance(one.base, np.ndarray):  # a view keeps its base alive
                one = one.base
            sizes[id(one)] = one.nbytes
        elif isinstance(one, Mapping):
            todo += one.values()
        elif isinstance(one, tuple | list | set | frozenset):
            todo += one
        elif type(one).__module__.partition(".")[0] not in ("builtins", "numpy", "numba"):
            todo += getattr(one, "__dict__", {}).values()
    return sizes


# Seconds since a moment: wall-clock time, and the CPU time of this process.


@dataclass(frozen=True)
class Stopwatch:
    """The moment at which it was made; CPU seconds are of all threads of this process, not of its children.

    Examples
    --------
    >>> watch = Stopwatch()
    >>> watch.wall_seconds() >= 0.0, watch.cpu_seconds() >= 0.0
    (True, True)
    """

    wall: float = field(default_factory=perf_counter)
    cpu: float = field(default_factory=process_time)

    def wall_seconds(self) -> float:
        """Wall-clock time since the moment [s]."""
        return perf_counter() - self.wall

    def cpu_seconds(self) -> float:
        """CPU time of this process since the moment [s]."""
        return process_time() - self.cpu


_CODE = """\
import pickle, sys
from importlib import import_module
module, name, arguments, memory = pickle.load(sys.stdin.buffer)
try:
    from resource import RLIMIT_AS, setrlimit
    setrlimit(RLIMIT_AS, (memory, memory))
except ImportError:
    pass  # not on Windows
try:
    answer = getattr(import_module(module), name)(*arguments)
except Exception as error:
    answer = error
pickle.dump(answer, sys.stdout.buffer)
"""


_FEW_THREADS = {"OPENBLAS_NUM_THREADS": "1", "PXR_WORK_THREAD_LIMIT": "1"}  # each reserves memory


def in_own_process(function: str, *arguments: Any, memory: int, seconds: float, what: str) -> Any:
    """The value of a function of a module, computed by another process.

    A library in C++ that meets a broken file may abort, or take memory without end. What comes back is not trusted less
    than the library is, in this process.

    Parameters
    ----------
    function : str
        "package.module:name"; its arguments and value can be pickled.
    memory : int
        Bound on the address space of the process [bytes].
    seconds : float
        Bound on its time [s].
    what : str
        Name of the file, for the sentence.

    Raises
    ------
    InputError
        The process was ended by the library or by a bound; and what the function raises, if it is a ClothsimError.
    """
    sent = pickle.dumps((*function.split(":"), arguments, memory))
    command, environment = [sys.executable, "-c", _CODE], {**os.environ, **_FEW_THREADS}
    try:
        done = subprocess.run(command, input=sent, capture_output=True, timeout=seconds, env=environment, check=False)
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{what} takes longer than {seconds:g} s to read.", "Export it again, or a part.") from error
    if done.returncode or not done.stdout:
        raise InputError(f"{what} is broken: the library that reads it ended.", "Export it again.")
    answer = pickle.loads(done.stdout)
    if isinstance(answer, ClothsimError):
        raise answer
    if isinstance(answer, Exception):
        reason = " ".join(str(answer).split())[:100] or type(answer).__name__
        raise InputError(f"{what} cannot be read ({reason}).", "Export it again.") from answer
    return answer
