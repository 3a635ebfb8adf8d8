"""Verlet list: cached distance against accumulated displacement."""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel, natural, part
from clothsim.base.vectors import four_points
from clothsim.physics.contact.barrier_kernels import boxes_apart
from clothsim.physics.contact.ccd import ROUND_OFF_FACTOR
from clothsim.physics.contact.distance import distance_squared


@kernel
def displacement_norms(
    before: Floats, after: Floats, reference: Floats, rows: Ints, n_first: int
) -> tuple[Floats, float, float]:
    """Distance of each of `rows` of x from its reference position, the larger at both ends of a path, (N,) [m].

    before, after, reference (N, 3) [m]. 0 for all other rows, inf for non-finite positions. And the largest of the
    first n_first rows and of the others, which are most often of bodies that stand still.
    """
    displacement, first, second = np.zeros(len(reference)), 0.0, 0.0
    for k in range(len(rows)):
        i = natural(rows[k])
        norm_squared = max(_offset_squared(before, reference, i), _offset_squared(after, reference, i))
        if norm_squared > 0.0:
            displacement[i] = np.sqrt(norm_squared)
            if k < n_first:
                first = max(first, displacement[i])
            else:
                second = max(second, displacement[i])
    return displacement, first, second


@part
def _offset_squared(x: Floats, reference: Floats, i: int) -> float:
    """Squared distance [m2] of a row from its reference position; inf where it is not finite."""
    a, b, c = x[i, 0] - reference[i, 0], x[i, 1] - reference[i, 1], x[i, 2] - reference[i, 2]
    norm_squared = a * a + b * b + c * c
    return norm_squared if norm_squared >= 0.0 else np.inf


@part
def _approach_bound(elements: Ints, e: int, n_points: int, displacement: Floats) -> float:
    """Bound on the decrease of a pair's distance for these displacements (N,) of the rows of x."""
    a, b, c, d = (
        displacement[elements[e, 0]],
        displacement[elements[e, 1]],
        displacement[elements[e, 2]],
        displacement[elements[e, 3]],
    )
    if e < n_points:
        return a + max(b, c, d)
    return max(a, b) + max(c, d)


@kernel
def pairs_possibly_within(
    elements: Ints, n_points: int, distances: Floats, displacement: Floats, approach: float, limit: float, factor: float
) -> Ints:
    """Indices of the pairs with a cached distance of at most limit [m] + factor times their approach bound.

    approach: the largest approach bound of any pair, `displacement` (N,) [m] being that of the rows of x.
    """
    indices, reach = np.empty(len(elements), np.int64), limit + factor * approach
    count = 0
    for e in range(len(elements)):
        if distances[e] > reach:  # whichever rows they are of
            continue
        if distances[e] <= limit + factor * _approach_bound(elements, e, n_points, displacement):
            indices[count] = e
            count += 1
    return indices[:count].copy()


@kernel
def active_among(
    x: Floats, elements: Ints, n_points: int, distances: Floats, displacement: Floats, approach: float, limit: float
) -> Ints:
    """Indices of the pairs closer than `limit` [m] at x (N, 3) [m].

    distances (p,) [m] are cached at reference positions from which each row of x has since moved by `displacement` (N,)
    [m], and no pair by more than `approach` together: most pairs are decided by these, only the others are measured.
    """
    indices, reach = np.empty(len(elements), np.int64), ROUND_OFF_FACTOR * (limit + approach)
    count = 0
    for e in range(len(elements)):
        if distances[e] > reach:  # whichever rows they are of
            continue
        change = _approach_bound(elements, e, n_points, displacement)
        if distances[e] > ROUND_OFF_FACTOR * (limit + change):
            continue
        if not ROUND_OFF_FACTOR * (distances[e] + change) < limit:
            points, is_edges = four_points(x, elements, e), e >= n_points
            if boxes_apart(points, is_edges, limit) or not distance_squared(points, is_edges) < limit * limit:
                continue
        indices[count] = e
        count += 1
    return indices[:count].copy()


@kernel
def retained_pairs(
    x: Floats, elements: Ints, n_points: int, distances: Floats, moved: np.ndarray, outside: np.ndarray, limit: float
) -> tuple[Ints, Floats]:
    """Indices of the pairs closer than `limit` [m] without a row `outside` (N,) the skin, and their distances [m].

    Pairs with a row that has moved (N,) are measured at x (N, 3) [m].
    """
    indices, measured = np.empty(len(elements), np.int64), np.empty(len(elements))
    count = 0
    for e in range(len(elements)):
        excluded = has_moved = False
        for k in range(4):
            i = natural(elements[e, k])
            excluded |= outside[i]
            has_moved |= moved[i]
        if excluded:
            continue
        distance = np.sqrt(distance_squared(four_points(x, elements, e), e >= n_points)) if has_moved else distances[e]
        if distance <= limit:
            indices[count], measured[count] = e, distance
            count += 1
    return indices[:count].copy(), measured[:count].copy()


@kernel
def path_end(x: Floats, dx: Floats, fraction: float) -> tuple[Floats, bool]:
    """x + fraction dx (N, 3) [m], and whether all of it is finite."""
    end, finite = np.empty_like(x), True
    for i in range(len(x)):
        for k in range(3):
            end[i, k] = x[i, k] + fraction * dx[i, k]
            finite &= end[i, k] - end[i, k] == 0.0
    return end, finite


@kernel
def path_fraction(x: Floats, start: Floats, end: Floats, rows: Ints) -> float:
    """Fraction in [0, 1] of the path start -> end (N, 3) [m] at which these rows of x are closest to it."""
    length = projection = 0.0
    for i in rows:
        for k in range(3):
            length += (end[i, k] - start[i, k]) ** 2
            projection += (x[i, k] - start[i, k]) * (end[i, k] - start[i, k])
    return min(max(projection / length, 0.0), 1.0) if length > 0.0 else 0.0


@kernel
def follows_path(x: Floats, start: Floats, end: Floats, rows: Ints, margin: float) -> bool:
    """True where all rows of x are within `margin` [m] of a linear path at one common fraction.

    x, start, end (N, 3) [m]; rows (n,): the rows that count. False for non-finite positions.
    """
    fraction = path_fraction(x, start, end, rows)
    for i in rows:
        offset_squared = 0.0
        for k in range(3):
            offset_squared += (x[i, k] - start[i, k] - fraction * (end[i, k] - start[i, k])) ** 2
        if not offset_squared <= margin * margin:
            return False
    return True


@kernel
def point_on_path(start: Floats, end: Floats, fraction: float) -> tuple[Floats, np.ndarray]:
    """Positions (N, 3) [m] at this fraction of the path, and the rows that differ from the start (N,)."""
    positions, moved = start.copy(), np.zeros(len(start), np.bool_)
    for i in range(len(start)):
        for k in range(3):
            if start[i, k] != end[i, k]:
                positions[i, k] += fraction * (end[i, k] - start[i, k])
                moved[i] |= fraction != 0.0
    return positions, moved
