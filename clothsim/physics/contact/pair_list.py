"""Pair list: point-triangle and edge-edge pairs in a unique order, with their areas and mollifier thresholds."""

from dataclasses import dataclass, fields

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel


@dataclass(frozen=True)
class Pairs:
    """Point-triangle pairs, `n_points` of them, then edge-edge pairs.

    Attributes
    ----------
    elements : (p, 4) int array
        Rows of x: point and triangle, or the ends of both edges.
    weights : (p,) array
        Area of each pair [m2].
    thresholds : (p,) array
        |u x v|^2 below which edges are mollified [m4], 0 for points and triangles.
    keys : (p,) int array
        Ascending, one for each pair that a surface can have.
    n_points : int
        Number of point-triangle pairs.
    """

    elements: Ints
    weights: Floats
    thresholds: Floats
    keys: Ints
    n_points: int

    def __len__(self) -> int:
        return len(self.elements)

    def subset(self, indices: Ints) -> "Pairs":
        """The pairs with these indices, ascending."""
        n_points = int(np.searchsorted(indices, self.n_points))
        taken = {name: getattr(self, name).take(indices, axis=0) for name in ARRAY_FIELDS}
        return Pairs(n_points=n_points, **taken)


ARRAY_FIELDS = tuple(field.name for field in fields(Pairs))[:-1]

NO_PAIRS = Pairs(np.zeros((0, 4), np.int64), np.zeros(0), np.zeros(0), np.zeros(0, np.int64), 0)


def merged(
    first_list: Pairs, indices: Ints, distances: Floats, second_list: Pairs, other_distances: Floats
) -> tuple[Pairs, Floats]:
    """Merge pairs `indices` (k,), ascending, of one list with all pairs of a disjoint one, and their distances.

    The result is sorted by the keys, so it does not depend on the origin of a pair. distances (k,), other_distances
    (q,) [m].
    """
    elements, weights, thresholds, keys, distances_of_both = _merged(
        *(first_list.elements, first_list.weights, first_list.thresholds, first_list.keys, indices, distances),
        *(second_list.elements, second_list.weights, second_list.thresholds, second_list.keys, other_distances),
    )
    n_points = int(np.searchsorted(indices, first_list.n_points)) + second_list.n_points
    return Pairs(elements, weights, thresholds, keys, n_points), distances_of_both


@kernel
def _merged(
    elements: Ints,
    weights: Floats,
    thresholds: Floats,
    keys: Ints,
    indices: Ints,
    distances: Floats,
    other_elements: Ints,
    other_weights: Floats,
    other_thresholds: Floats,
    other_keys: Ints,
    other_distances: Floats,
) -> tuple[Ints, Floats, Floats, Ints, Floats]:
    """Merge the arrays of both lists by their keys, which ascend in each."""
    n, q = len(indices), len(other_keys)
    rows, columns, new_keys = np.empty((n + q, 4), np.int64), np.empty((3, n + q)), np.empty(n + q, np.int64)
    i = j = 0
    for k in range(n + q):
        if j == q or (i < n and keys[indices[i]] < other_keys[j]):
            e = indices[i]
            for corner in range(4):
                rows[k, corner] = elements[e, corner]
            columns[0, k], columns[1, k], columns[2, k], new_keys[k] = weights[e], thresholds[e], distances[i], keys[e]
            i += 1
        else:
            for corner in range(4):
                rows[k, corner] = other_elements[j, corner]
            columns[0, k], columns[1, k], columns[2, k] = other_weights[j], other_thresholds[j], other_distances[j]
            new_keys[k] = other_keys[j]
            j += 1
    return rows, columns[0], columns[1], new_keys, columns[2]


@kernel
def concatenated_rows(a: Ints, i: Ints, b: Ints, j: Ints) -> Ints:
    """Rows i (p,) of a (n, k) beside rows j (p,) of b (m, l), (p, k + l)."""
    rows = np.empty((len(i), a.shape[1] + b.shape[1]), np.int64)
    for p in range(len(i)):
        for k in range(a.shape[1]):
            rows[p, k] = a[i[p], k]
        for k in range(b.shape[1]):
            rows[p, a.shape[1] + k] = b[j[p], k]
    return rows
