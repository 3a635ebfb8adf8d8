"""Memos: of a function of positions, evaluated again at the same points, and of what is found of a mesh."""

from collections.abc import Callable
from functools import wraps
from typing import Any, Generic, ParamSpec, TypeVar

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.vectors import equal

CAPACITY = 2
"""The start and the end of a step."""

MESHES = 4
"""Last arguments for which `known_for_arrays` has a result: a body, and the garments of an outfit."""

Result = TypeVar("Result")
P = ParamSpec("P")


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
        for argument, result in reversed(self._cached):  # most often the last one
            if equal(argument, x):
                return result
        return self.remember(x, compute(x))

    def known(self, x: Floats) -> Result | None:
        """Return the cached result for x (n, 3); None where there is none."""
        return next((result for argument, result in reversed(self._cached) if equal(argument, x)), None)

    def remember(self, x: Floats, result: Result) -> Result:
        """Cache a result for x (n, 3), which is copied, as the last one; return it."""
        if len(self._cached) == CAPACITY + self._oldest:
            del self._cached[self._oldest]
        self._cached.append((x.copy(), result))
        return result


def known_for_arrays(compute: Callable[P, Result]) -> Callable[P, Result]:
    """Decorate a function of arrays and plain values alone: its results for the last MESHES arguments are known.

    Arguments are copied and compared by value. Several scenes of a garment have one and the same body. Nobody may
    change a result.
    """
    cached: list[tuple[tuple[Any, ...], Result]] = []

    @wraps(compute)
    def known(*given: P.args, **named: P.kwargs) -> Result:
        arguments = (*given, *(value for pair in sorted(named.items()) for value in pair))
        for entry in reversed(cached):
            if len(entry[0]) == len(arguments) and all(map(_same, entry[0], arguments)):
                cached[:] = [*(each for each in cached if each is not entry), entry]  # the last to go
                return entry[1]
        result = compute(*given, **named)
        own = tuple(value.copy() if isinstance(value, np.ndarray) else value for value in arguments)
        cached.append((own, result))
        del cached[:-MESHES]
        return result

    return known


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.dtype == b.dtype and np.array_equal(a, b)
    return type(a) is type(b) and bool(a == b)
