"""What was found at the last places: a line search asks again for what it knows."""

from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

from clothsim.arrays import Floats
from clothsim.indexing import equal

CAPACITY = 2
"""Where a step begins and where it ends."""

What = TypeVar("What")


class Memo(Generic[What]):
    """The answers of a function of x alone, for the last PLACES at which it was asked."""

    def __init__(self) -> None:
        self._known: deque[tuple[Floats, What]] = deque(maxlen=CAPACITY)

    def at(self, x: Floats, find: Callable[[Floats], What]) -> What:
        """find(x), or what that was: to compare two places takes a hundredth of an energy."""
        for place, known in self._known:
            if equal(place, x):
                return known
        found = find(x)
        self._known.append((x.copy(), found))
        return found
