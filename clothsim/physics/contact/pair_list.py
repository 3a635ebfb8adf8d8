"""Pair lists: point-triangle and edge-edge pairs in a unique order, with areas and thresholds; distinct features."""

from dataclasses import dataclass, fields

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel, natural, part
from clothsim.base.vectors import four_points, minus
from clothsim.physics.contact.distance import point_triangle_closest, point_triangle_region, segment_closest


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
        if len(indices) == len(self):
            return self
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


# Distinct contact features: the barrier of a point against a surface by inclusion and exclusion.
#
# A point p close to a shared edge is equally far from both triangles; the sum of the barriers of all triangles would
# push it twice there, and up to six times at a vertex. Over the triangles T, edges E and vertices V of a surface,
#
#     E(p) = sum_T b(d_t) - sum_E (n_e - 1) b(d_e) + sum_V (1 - n_v + sum_{e at v} (n_e - 1)) b(d_v),
#
# n the number of triangles at an edge or vertex (Li et al. 2023, "Convergent incremental potential contact", section
# 3.2: the smooth maximum without duplicates). Where all features that contain the closest point have the same distance,
# their coefficients sum to 1: over a flat face the sum is b of the distance to its plane, wherever p is. Each term is
# as smooth as a distance and the coefficients are constant, so the energy has no jump where the closest feature
# changes.
#
# All triangles at a feature are at most as far as the feature: the list of active triangles of p is all that is needed.
# Terms with one closest point are merged; most cancel, so that a point over a flat face has one pair.


FACE = 6
"""Region of `point_triangle_region` inside the triangle."""


def distinct(x: Floats, pairs: Pairs, limit: float) -> Pairs:
    """Pairs with one term for each closest feature; weight: its area times its coefficient, which may be negative.

    x (N, 3) [m]; pairs: all that are closer than `limit` [m]; the triangles of a point follow one another. Pairs of
    zero weight are left out. An edge or vertex to which no triangle is closest is a triangle with a corner repeated.
    """
    elements, weights, thresholds, n_points = distinct_terms(
        x, pairs.elements, pairs.weights, pairs.thresholds, pairs.n_points, limit
    )
    return Pairs(elements, weights, thresholds, np.arange(len(weights)), n_points)


@kernel
def distinct_terms(x, elements, weights, thresholds, n, limit):
    """Rows (q, 4), weights (q,) and thresholds (q,) of the terms of pairs (p, 4), and the number of those of points.

    The first n pairs are of a point and a triangle.
    """
    slots, features = _tables(elements, n)
    room = 6 * n + len(elements)
    out, out_weights, out_thresholds = np.empty((room, 4), np.int64), np.empty(room), np.zeros(room)
    count, start = 0, 0
    while start < n:
        end = start + 1
        while end < n and elements[end, 0] == elements[start, 0]:
            end += 1
        first = count
        if weights[start] != 0.0:
            count = _terms_of_point(features, slots, out, count, x, elements, start, end, limit)
        for k in range(first, count):
            out_weights[k] = weights[start] * out[k, 0]
            out[k, 0] = elements[start, 0]
        start = end
    n_points = count
    for e in range(n, len(elements)):
        if weights[e] != 0.0:
            for k in range(4):
                out[count, k] = elements[e, k]
            out_weights[count], out_thresholds[count] = weights[e], thresholds[e]
            count += 1
    return out[:count].copy(), out_weights[:count].copy(), out_thresholds[:count].copy(), n_points


@part
def _tables(elements, n):
    """Room for the features of the point with the most triangles: slots of a hash table, all -1, and the features.

    Of a feature: ends, triangles, triangles less one of its edges, coefficient, a triangle it is closest of, slot.
    """
    longest, start = 0, 0
    for e in range(n):
        start = e if elements[e, 0] != elements[start, 0] else start
        longest = max(longest, e - start + 1)
    size = 16
    while size < 12 * longest:
        size *= 2
    return np.full(size, -1, np.int64), np.empty((6 * longest, 7), np.int64)


@part
def _terms_of_point(features, slots, out, count, x, elements, start, end, limit):
    """Rows of the terms of one point, coefficients in place of the point; returns their number with those before."""
    if end == start + 1:
        return _write(out, count, elements, start, 1)
    found, count = _closest_of_triangles(features, slots, out, count, x, elements, start, end)
    _exclude_edges(features, slots, found, x, elements[start, 0], limit)
    for k in range(found):
        coefficient = features[k, 4] + _vertex_coefficient(features, k, x, elements[start, 0], limit)
        if coefficient != 0 and features[k, 5] >= 0:
            count = _write(out, count, elements, features[k, 5], coefficient)
        elif coefficient != 0:
            count = _write_feature(out, count, features, k, coefficient)
        slots[features[k, 6]] = -1
    return count


@part
def _write(out, count, elements, e, coefficient):
    """Row of triangle e, with its coefficient in place of the point."""
    out[count, 0] = coefficient
    for k in range(1, 4):
        out[count, k] = elements[e, k]
    return count + 1


@part
def _write_feature(out, count, features, k, coefficient):
    """Row of a feature to which no triangle is closest."""
    out[count, 0], out[count, 1] = coefficient, features[k, 0]
    out[count, 2] = out[count, 3] = features[k, 1]
    return count + 1


@part
def _closest_of_triangles(features, slots, out, count, x, elements, start, end):
    """List the edges and vertices of the triangles; count each for the triangle that it is closest of.

    Returns the number of features, and that of rows in `out`, to which the faces are written.
    """
    found = 0
    for e in range(start, end):
        u, v, w = point_triangle_closest(*four_points(x, elements, e))
        region = point_triangle_region(u, v, w)
        if region == FACE:
            count = _write(out, count, elements, e, 1)
        for k in range(6):  # three vertices, then the edges ab, bc, ca
            a = elements[e, 1 + k % 3]
            b = a if k < 3 else elements[e, 1 + (k + 1) % 3]
            feature, found = _feature(features, slots, found, min(a, b), max(a, b))
            features[feature, 2] += 1
            if region == k:
                features[feature, 4] += 1
                features[feature, 5] = e if features[feature, 5] < 0 else features[feature, 5]
    return found, count


@part
def _exclude_edges(features, slots, found, x, point, limit):
    """Subtract edges of more than one triangle from their closest features; count them for their ends."""
    for k in range(found):
        a, b, extra = features[k, 0], features[k, 1], features[k, 2] - 1
        if a == b or extra == 0:
            continue
        r, e = _from(x, a, point), _from(x, a, b)
        t = segment_closest(r, e)
        first, _ = _feature(features, slots, found, a, a)
        second, _ = _feature(features, slots, found, b, b)
        features[first, 3] += extra
        features[second, 3] += extra
        x_, y_, z_ = r[0] - t * e[0], r[1] - t * e[1], r[2] - t * e[2]
        if x_ * x_ + y_ * y_ + z_ * z_ < limit * limit:
            closest = first if t == 0.0 else (second if t == 1.0 else k)
            features[closest, 4] -= extra


@part
def _vertex_coefficient(features, k, x, point, limit):
    """Coefficient of a vertex closer than `limit`, 0 for an edge."""
    if features[k, 0] != features[k, 1]:
        return 0
    r = _from(x, features[k, 0], point)
    close = r[0] * r[0] + r[1] * r[1] + r[2] * r[2] < limit * limit
    return 1 - features[k, 2] + features[k, 3] if close else 0


@part
def _from(x, a, b):
    """x_b - x_a."""
    i, j = natural(a), natural(b)
    return minus((x[j, 0], x[j, 1], x[j, 2]), (x[i, 0], x[i, 1], x[i, 2]))


@part
def _feature(features, slots, found, a, b):
    """Index of the edge a < b or vertex a = b, appended where it is new, and the number of features (hash table)."""
    slot = (a * 73856093 ^ b * 19349663) & (len(slots) - 1)
    while slots[slot] >= 0:
        k = slots[slot]
        if features[k, 0] == a and features[k, 1] == b:
            return k, found
        slot = (slot + 1) & (len(slots) - 1)
    slots[slot] = found
    features[found, 0], features[found, 1], features[found, 2], features[found, 3] = a, b, 0, 0
    features[found, 4], features[found, 5], features[found, 6] = 0, -1, slot
    return found, found + 1
