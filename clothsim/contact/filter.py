"""Which pairs of a list may count: told by the distances they once had, and how far their vertices have gone since."""

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.contact.barrier_kernels import apart
from clothsim.contact.culling import ROUNDING
from clothsim.contact.distance import squared_distance
from clothsim.indexing import four_points
from clothsim.jit import kernel, natural, part


@kernel
def displaced(before: Floats, after: Floats, at: Floats, rows: Ints) -> Floats:
    """How far each of these rows of x is from `at` where a way begins or ends, the farther of the two, (N,) [m].

    before, after, at (N, 3) [m]. 0 for all other rows, inf for what is no number.
    """
    gone = np.zeros(len(at))
    for row in rows:
        i = natural(row)
        squared = max(_off(before, at, i), _off(after, at, i))
        gone[i] = np.sqrt(squared)
    return gone


@part
def _off(x: Floats, at: Floats, i: int) -> float:
    """The squared distance [m2] of a row from where it was."""
    a, b, c = x[i, 0] - at[i, 0], x[i, 1] - at[i, 1], x[i, 2] - at[i, 2]
    squared = a * a + b * b + c * c
    return squared if squared >= 0.0 else np.inf


@part
def _gone(elements: Ints, e: int, n_points: int, gone: Floats) -> float:
    """How much nearer the two of a pair may have come, if each row of x has gone so far (N,)."""
    a, b, c, d = gone[elements[e, 0]], gone[elements[e, 1]], gone[elements[e, 2]], gone[elements[e, 3]]
    if e < n_points:
        return a + max(b, c, d)
    return max(a, b) + max(c, d)


@kernel
def may_be_near(elements: Ints, n_points: int, distances: Floats, gone: Floats, near: float, factor: float) -> Ints:
    """The numbers of the pairs that were no further apart than `active` [m] and `factor` times what they have gone."""
    numbers = np.empty(len(elements), np.int64)
    count = 0
    for e in range(len(elements)):
        if distances[e] <= near + factor * _gone(elements, e, n_points, gone):
            numbers[count] = e
            count += 1
    return numbers[:count].copy()


@kernel
def near_among(x: Floats, elements: Ints, n_points: int, distances: Floats, gone: Floats, near: float) -> Ints:
    """The numbers of the pairs closer than `active` [m] at x (N, 3) [m].

    distances (p,) [m]: those that the pairs had where each row of x was before it has gone so far, gone (N,) [m]. They
    tell of most pairs that they are near, or that they are not.
    """
    numbers = np.empty(len(elements), np.int64)
    count = 0
    for e in range(len(elements)):
        change = _gone(elements, e, n_points, gone)
        if distances[e] > ROUNDING * (near + change):
            continue
        if not ROUNDING * (distances[e] + change) < near:
            points, is_edges = four_points(x, elements, e), e >= n_points
            if apart(points, is_edges, near) or not squared_distance(points, is_edges) < near * near:
                continue
        numbers[count] = e
        count += 1
    return numbers[:count].copy()


@kernel
def still_near(
    x: Floats, elements: Ints, n_points: int, distances: Floats, moved: np.ndarray, left: np.ndarray, near: float
) -> tuple[Ints, Floats]:
    """The numbers of the pairs closer than `active` [m] of which no row has `left` (N,), and their distances [m].

    Those in which a row has moved (N,) are measured anew at x (N, 3) [m].
    """
    numbers, measured = np.empty(len(elements), np.int64), np.empty(len(elements))
    count = 0
    for e in range(len(elements)):
        gone = has_moved = False
        for k in range(4):
            i = natural(elements[e, k])
            gone |= left[i]
            has_moved |= moved[i]
        if gone:
            continue
        distance = np.sqrt(squared_distance(four_points(x, elements, e), e >= n_points)) if has_moved else distances[e]
        if distance <= near:
            numbers[count], measured[count] = e, distance
            count += 1
    return numbers[:count].copy(), measured[:count].copy()


@kernel
def share_of_way(x: Floats, start: Floats, end: Floats, rows: Ints) -> float:
    """The share of the way start -> end (N, 3) [m] at which these rows of x are closest to it, in [0, 1]."""
    length = along = 0.0
    for i in rows:
        for k in range(3):
            length += (end[i, k] - start[i, k]) ** 2
            along += (x[i, k] - start[i, k]) * (end[i, k] - start[i, k])
    return min(max(along / length, 0.0), 1.0) if length > 0.0 else 0.0


@kernel
def keeps_to(x: Floats, start: Floats, end: Floats, rows: Ints, room: float) -> bool:
    """Whether no row of x is further than `room` [m] from where all have gone one and the same share of start -> end.

    x, start, end (N, 3) [m]; rows (n,): those that count. False for what is no number.
    """
    share = share_of_way(x, start, end, rows)
    for i in rows:
        off = 0.0
        for k in range(3):
            off += (x[i, k] - start[i, k] - share * (end[i, k] - start[i, k])) ** 2
        if not off <= room * room:
            return False
    return True


@kernel
def place_on_way(start: Floats, end: Floats, share: float) -> tuple[Floats, np.ndarray]:
    """Where all are at this share of their ways (N, 3) [m], and which rows have moved (N,)."""
    place, moved = start.copy(), np.zeros(len(start), np.bool_)
    for i in range(len(start)):
        for k in range(3):
            if start[i, k] != end[i, k]:
                place[i, k] += share * (end[i, k] - start[i, k])
                moved[i] |= share != 0.0
    return place, moved
