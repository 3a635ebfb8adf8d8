"""The memory of the process: freed memory kept, and the most that it ever had."""

import ctypes
import sys

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
LARGEST_KEPT = 1 << 30


def keep_freed_memory() -> bool:
    """Tell glibc's malloc to keep what is freed instead of handing it back; True where it took the advice.

    Every Newton iteration allocates the same element blocks anew. By default each goes back to the kernel when freed,
    and every page faults again: 57,601 faults against 472 in 64 iterations at 32 x 32 cells, and half of the wall time
    on a virtual machine. Elsewhere than on glibc nothing is done.
    """
    if not sys.platform.startswith("linux"):
        return False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):
        return False
    return bool(mallopt(M_MMAP_THRESHOLD, LARGEST_KEPT) and mallopt(M_TRIM_THRESHOLD, LARGEST_KEPT))


def peak_memory() -> int:
    """The largest resident memory of this process so far [bytes]; 0 where the system does not tell."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak
