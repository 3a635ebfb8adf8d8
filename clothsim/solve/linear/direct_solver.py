"""Interface of direct solvers for the symmetric positive definite Newton matrix."""

import abc

from clothsim.base.arrays import Floats
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
        Number of threads; 0: by size (`threads.solver_threads`).
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
