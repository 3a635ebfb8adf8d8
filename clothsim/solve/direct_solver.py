"""What a direct solver of the Newton matrix does."""

import abc

from clothsim.arrays import Floats
from clothsim.solve.sparsity import Pattern


class NotPositiveDefiniteError(Exception):
    """The factorisation met a pivot that is not positive."""


EXACT = 1e-10
"""The error, in the norm of the matrix, that may be left where nothing else is asked for; double leaves less."""


class LinearSolver(abc.ABC):
    """Solves A x = b for one sparsity and many values."""

    name: str
    threads: int = 1
    wanted_threads: int = 1
    """Threads that it would take, were its library not sequential."""

    @abc.abstractmethod
    def __init__(self, pattern: Pattern, threads: int) -> None:
        """Analyse the pattern; threads 0: all cores."""

    def restart(self) -> None:  # noqa: B027 - most have nothing to forget
        """Forget what earlier matrices have shown: a step then depends on its own start only."""

    @abc.abstractmethod
    def factorise(self, data: Floats) -> None:
        """Factorise the matrix of `data` in the pattern; NotPositiveDefiniteError if it is not positive definite."""

    @abc.abstractmethod
    def back_solve(self, b: Floats) -> Floats:
        """x of the matrix last factorised, or near it: the same linear map for every b, symmetric and positive."""

    def solve(self, data: Floats, b: Floats, accuracy: float = EXACT) -> Floats:
        """Factorise, then solve. accuracy: what is left of the error, in the norm of the matrix, where it is chosen."""
        self.factorise(data)
        return self.back_solve(b)
