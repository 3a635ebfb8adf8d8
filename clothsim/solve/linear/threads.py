"""Numbers of threads: of a step where a scene leaves it open, and one for NumPy's and SciPy's BLAS."""

import functools
from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import ThreadpoolController

from clothsim.base.parallel import available_cores

ONE_THREAD_BELOW = 20_000
"""Vertices below which a step gets one thread where the scene leaves the number open.

At 1,681 vertices a factorisation takes 4 ms on one thread and 52 ms of the processor on two, which wait for each other
actively; at 10,201 vertices two take 0.55 of its time on the clock; a run of the impact took 34 s on two, 28 s on one.
"""

MOST = 4
"""Threads that a step gets at most where the scene leaves the number open: most tasks of a step come in twos, and MKL's
own threads gain less than a sixth of it beyond, were their own speed-up perfect."""


def solver_threads(n_vertices: int, threads: int) -> int:
    """Threads of a step and its linear solver: those asked for, or with 0 as many as its size is worth.

    Examples
    --------
    >>> solver_threads(400, 2), solver_threads(400, 0)
    (2, 1)
    """
    return threads or (1 if n_vertices < ONE_THREAD_BELOW else min(MOST, available_cores()))


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keep NumPy's and SciPy's BLAS on one thread, and give the process its own number back.

    It sums vectors and small matrices here: a second thread gains nothing, waits actively on its core between calls (41
    seconds of the processor for 27), and adds in another order.
    """
    with blas_libraries().limit(limits=1):
        yield


@functools.cache
def blas_libraries() -> ThreadpoolController:
    """BLAS libraries that are loaded at the first call: NumPy's and SciPy's, which every module here imports.

    One that is loaded later is PARDISO's, whose threads are set at each of its calls.
    """
    return ThreadpoolController().select(user_api="blas")
