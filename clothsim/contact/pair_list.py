"""The pairs that contact looks at, as one list in an order of its own."""

from dataclasses import dataclass, fields

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.jit import kernel


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


def together(one: Pairs, numbers: Ints, distances: Floats, other: Pairs, others: Floats) -> tuple[Pairs, Floats]:
    """Those of one list with these numbers (k,), which ascend, and all of another, with which they have none in common.

    They are in the order of their keys: whence they come does not show. distances (k,), others (q,) [m]: what is known
    of both; of all together the second answer.
    """
    elements, weights, thresholds, keys, known = _merged(
        *(one.elements, one.weights, one.thresholds, one.keys, numbers, distances),
        *(other.elements, other.weights, other.thresholds, other.keys, others),
    )
    n_points = int(np.searchsorted(numbers, one.n_points)) + other.n_points
    return Pairs(elements, weights, thresholds, keys, n_points), known


@kernel
def _merged(
    elements: Ints,
    weights: Floats,
    thresholds: Floats,
    keys: Ints,
    numbers: Ints,
    distances: Floats,
    other_elements: Ints,
    other_weights: Floats,
    other_thresholds: Floats,
    other_keys: Ints,
    other_distances: Floats,
) -> tuple[Ints, Floats, Floats, Ints, Floats]:
    """The arrays of both, by their keys, which ascend in each."""
    n, q = len(numbers), len(other_keys)
    rows, each, new_keys = np.empty((n + q, 4), np.int64), np.empty((3, n + q)), np.empty(n + q, np.int64)
    i = j = 0
    for k in range(n + q):
        if j == q or (i < n and keys[numbers[i]] < other_keys[j]):
            e = numbers[i]
            for corner in range(4):
                rows[k, corner] = elements[e, corner]
            each[0, k], each[1, k], each[2, k], new_keys[k] = weights[e], thresholds[e], distances[i], keys[e]
            i += 1
        else:
            for corner in range(4):
                rows[k, corner] = other_elements[j, corner]
            each[0, k], each[1, k], each[2, k] = other_weights[j], other_thresholds[j], other_distances[j]
            new_keys[k] = other_keys[j]
            j += 1
    return rows, each[0], each[1], new_keys, each[2]


@kernel
def side_by_side(a: Ints, i: Ints, b: Ints, j: Ints) -> Ints:
    """Rows i (p,) of a (n, k) and j (p,) of b (m, l), (p, k + l)."""
    rows = np.empty((len(i), a.shape[1] + b.shape[1]), np.int64)
    for p in range(len(i)):
        for k in range(a.shape[1]):
            rows[p, k] = a[i[p], k]
        for k in range(b.shape[1]):
            rows[p, a.shape[1] + k] = b[j[p], k]
    return rows
