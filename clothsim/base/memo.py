"""Memo of a function of positions: a line search evaluates it again at the same points."""

from collections.abc import Callable
from typing import Generic, TypeVar

from clothsim.base.arrays import Floats
from clothsim.base.vectors import equal

CAPACITY = 2
"""The start and the end of a step."""

Result = TypeVar("Result")


class Memo(Generic[Result]):
    """Results of one function of x alone, for the last CAPACITY arguments.

    Parameters
    ----------
    keeps_first : bool
        Keep the first argument of all, too: the start of a solve, with which its end is compared.
    """

    def __init__(self, keeps_first: bool = False) -> None:
        self._cached: list[tuple[Floats, Result]] = []
        self._oldest = int(keeps_first)

    def at(self, x: Floats, compute: Callable[[Floats], Result]) -> Result:
        """Return compute(x), cached.

        Parameters
        ----------
        x : (n, 3) float64
            Compared by value; a comparison takes a hundredth of the time of an energy.
        compute : callable
            The function; the same one at each call.
        """
        for argument, result in self._cached:
            if equal(argument, x):
                return result
        return self.remember(x, compute(x))

    def known(self, x: Floats) -> Result | None:
        """Return the cached result for x (n, 3); None where there is none."""
        return next((result for argument, result in self._cached if equal(argument, x)), None)

    def remember(self, x: Floats, result: Result) -> Result:
        """Cache a result for x (n, 3), which is copied, as the last one; return it."""
        if len(self._cached) == CAPACITY + self._oldest:
            del self._cached[self._oldest]
        self._cached.append((x.copy(), result))
        return result
