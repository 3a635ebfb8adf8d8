"""The pairs that contact looks at, as one list in an order of its own."""

from dataclasses import dataclass, fields

import numpy as np

from clothsim.arrays import Floats, Ints


@dataclass(frozen=True)
class Pairs:
    """Point-triangle pairs, `n_points` of them, then edge-edge pairs.

    elements (p, 4): rows of x: point and triangle, or the ends of both edges; weights (p,) [m2]: the area that each
    stands for; thresholds (p,) [m4]: |u x v|^2 below which edges are mollified, 0 for points and triangles; keys (p,):
    ascending, one for each pair that a surface can have.
    """

    elements: Ints
    weights: Floats
    thresholds: Floats
    keys: Ints
    n_points: int

    def __len__(self) -> int:
        return len(self.elements)

    def at(self, numbers: Ints) -> "Pairs":
        """The pairs of these numbers, which ascend."""
        n_points = int(np.searchsorted(numbers, self.n_points))
        taken = {name: getattr(self, name).take(numbers, axis=0) for name in ARRAYS}
        return Pairs(n_points=n_points, **taken)


ARRAYS = tuple(field.name for field in fields(Pairs))[:-1]

NONE = Pairs(np.zeros((0, 4), np.int64), np.zeros(0), np.zeros(0), np.zeros(0, np.int64), 0)


def together(one: Pairs, other: Pairs) -> tuple[Pairs, Ints]:
    """All pairs of two lists that have none in common, in the order of their keys: whence they come does not show.

    And the places in the first list before which those of the second are put.
    """
    places = np.searchsorted(one.keys, other.keys)
    if not len(other):
        return one, places
    both = {name: np.insert(getattr(one, name), places, getattr(other, name), axis=0) for name in ARRAYS}
    return Pairs(n_points=one.n_points + other.n_points, **both), places
