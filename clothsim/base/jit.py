"""Just-in-time compilation: `kernel` for functions that Python calls, `part` for those that only kernels call.

A cold start is spent in the compiler, and half of that not on the loops: each function that Python can call gets two
wrappers, and all wrappers of all that it calls are compiled again inside of it. So only kernels get one. A `part`
stays a Python function for Python: it can be called, slowly, to look at it or to test it.

Machine code is cached in the user's cache folder, under a hash of all that it was compiled from (`kernel_cache`):
whoever edits a kernel, a part or a constant has nothing to delete. NUMBA_CACHE_DIR chooses another folder.

A kernel releases Python's lock while it runs, so that two of them run on two threads (`parallel`).
"""

from collections.abc import Callable
from typing import Any

from numba import njit
from numba.extending import register_jitable

from clothsim.base.interruption import held_back
from clothsim.base.kernel_cache import KernelCache, KernelCompiler, PartCompiler


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function that Python calls, with float64 C arrays, int64 and float, once for each set of types.

    Parameters
    ----------
    function : callable
        Scalar code and loops, as numba compiles them.

    Returns
    -------
    numba.core.dispatcher.Dispatcher
        Compiled when it is called; the function itself where NUMBA_DISABLE_JIT is set.
    """
    compiled = njit(error_model="numpy", no_cfunc_wrapper=True, nogil=True, pipeline_class=KernelCompiler)(function)
    if compiled is not function:
        compiled._cache = KernelCache(compiled)  # as cache=True does, with numba's own
        compiled.compile = held_back(compiled.compile)  # which loads, too
    return compiled


part = register_jitable(error_model="numpy", no_cfunc_wrapper=True, pipeline_class=PartCompiler)
"""A function that kernels call. Compiled with them, never for a literal number: 1 is an int64 like any other."""

inlined = njit(error_model="numpy", inline="always")
"""A part that is put into its callers before they are typed: where a call would hide a straight loop from LLVM."""


@inlined
def natural(i):
    """Return the index i, which is not negative.

    Numba tests at each access whether an index counts from the end, unless it can prove the sign, which it cannot for
    an index that was read from an array.
    """
    return max(i, 0)


LANES = 16
"""Elements that a kernel takes side by side. Number i of the element in lane l of such a group stands at i LANES + l: a
loop over l without a branch or a call becomes vector instructions (with 8 lanes it is unrolled before LLVM looks for
them). In such a loop numbers and tuples may be handed on to parts, arrays only to what is `inlined`."""
