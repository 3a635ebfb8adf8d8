"""Measures of a process: allocator settings, peak memory, bytes of an object, seconds since a moment."""

import ctypes
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from time import perf_counter, process_time

import numpy as np

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
