"""Interface of direct solvers for the symmetric positive definite Newton matrix, and its number of threads."""

import abc
import functools
from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import ThreadpoolController

from clothsim.base.arrays import Floats
from clothsim.base.parallel import available_cores
from clothsim.solve.linear.sparsity import SparsityPattern


class NotPositiveDefiniteError(Exception):
    """Factorisation stopped at a pivot that is not positive."""


EXACT = 1e-10
"""Default bound on the relative error in the norm of the matrix; a double-precision factor leaves less."""


class LinearSolver(abc.ABC):
    """Solver of A x = b for one sparsity pattern and many sets of values.

    Parameters
    ----------
    pattern : SparsityPattern
        Sparsity of the upper triangle; analysed once.
    threads : int
        Number of threads; 0: by size (`direct_solver.solver_threads`).
    dissected : bool
        Factorise a large matrix in two domains, which threads take side by side, where the solver can.
    """

    name: str
    threads: int = 1
    wanted_threads: int = 1
    """Threads that it would take, were its library not sequential."""

    @abc.abstractmethod
    def __init__(self, pattern: SparsityPattern, threads: int, dissected: bool = False) -> None:
        """Analyse the pattern; threads 0: by size."""

    def restart(self) -> None:  # noqa: B027 - most solvers have no state
        """Drop what was learnt from earlier matrices, so that a step depends on its own start only."""

    @abc.abstractmethod
    def factorise(self, data: Floats) -> None:
        """Factorise the matrix of `data` in the pattern.

        Raises
        ------
        NotPositiveDefiniteError
            If the matrix is not positive definite, or not finite.
        """

    @abc.abstractmethod
    def back_solve(self, b: Floats) -> Floats:
        """Solve with the matrix last factorised, exactly or approximately.

        Returns
        -------
        (3 n,) float64
            M b, the same linear map M for every b; M is symmetric and positive definite, so it may precondition.
        """

    def solve(self, data: Floats, b: Floats, accuracy: float = EXACT) -> Floats:
        """Factorise the matrix of `data` and solve for b (3 n,).

        Parameters
        ----------
        accuracy : float
            Bound on |x - A^-1 b|_A / |A^-1 b|_A, where the solver can choose it.

        Raises
        ------
        NotPositiveDefiniteError
            If the matrix is not positive definite, or not finite.
        """
        self.factorise(data)
        return self.back_solve(b)


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
