"""Tangential smoothing of a mesh on an implicit surface, with Delaunay edge flips and edge collapses.

The mesh is the half x >= 0 of a symmetric one: its vertices with x = 0 stay there, as the other half balances them.
"""

from collections.abc import Callable

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.topology import border_edges, half_edges, interior_edges, unique_edges, vertex_rings

SHORT = 0.5
"""An edge is short below this fraction of the mean length of the edges at its ends."""


def collapsed(positions: Floats, triangles: Ints, held: np.ndarray) -> tuple[Floats, Ints]:
    """Collapse each short edge of the half mesh where the topology stays the same.

    held (n,): border vertices, which stay; those with x = 0 are merged among themselves only. Merged ends have exactly
    two common neighbours (one, along the middle), each with more than three neighbours; no new edge joins two vertices
    of a border or of the middle; no two collapses fraction a vertex.
    """
    middle = positions[:, 0] == 0
    fixed = held | middle
    starts, neighbours = vertex_rings(triangles, len(positions))
    into = np.arange(len(positions))
    touched = np.zeros(len(positions), bool)
    for v, w in _short_edges(positions, triangles, held, middle):
        of_v, of_w = (set(neighbours[starts[k] : starts[k + 1]].tolist()) for k in (v, w))
        shared, ring = of_v & of_w, list(of_v | of_w)
        new = np.array(sorted(of_v - of_w - {w}), np.int64)
        in_middle = bool(middle[v])
        joins = fixed[w] and (fixed[new] & ~(middle[new] & in_middle)).any()
        if joins or touched[ring].any() or len(shared) != (1 if in_middle else 2):
            continue
        if all(starts[k + 1] - starts[k] > 3 for k in shared):
            into[v] = w
            touched[ring] = True
    merged = into[triangles]
    remaining = merged[(merged != np.roll(merged, 1, axis=1)).all(axis=1)]
    used, renumbered = np.unique(remaining, return_inverse=True)
    return positions[used], renumbered.reshape(-1, 3).astype(np.int64)


def _short_edges(positions: Floats, triangles: Ints, held: np.ndarray, middle: np.ndarray) -> Ints:
    """Short edges (k, 2), shortest first, each from a vertex that may be merged into the other.

    All edges of a vertex with three neighbours count: such a vertex only makes slivers.
    """
    edges = unique_edges(triangles)
    lengths = np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1)
    total = np.bincount(edges.ravel(), np.repeat(lengths, 2), minlength=len(positions))
    degree = np.bincount(edges.ravel(), minlength=len(positions))
    mean = total / np.maximum(degree, 1)
    fraction = lengths / mean[edges].mean(axis=1)
    both = np.concatenate([edges, edges[:, ::-1]])
    v, w = both.T
    wanted = (np.tile(fraction, 2) < SHORT) | ((degree[v] == 3) & ~middle[v])
    short = np.flatnonzero(wanted & ~held[v] & (~middle[v] | middle[w]))
    return np.asarray(both[short[np.argsort(np.tile(fraction, 2)[short], kind="stable")]], np.int64)


Field = Callable[[Floats], tuple[Floats, Floats]]
"""Level-set function and its gradient: points (n, 3) -> (n,), (n, 3)."""


def on_surface(points: Floats, field: Field, level: float, steps: int = 2) -> Floats:
    """Move `points (n, 3)` along the gradient of `field` to its `level`, by Newton's method."""
    for _ in range(steps):
        value, gradient = field(points)
        slope = np.maximum((gradient * gradient).sum(axis=1), 0.04)
        points = points - ((value - level) / slope)[:, None] * gradient
    return points


def on_curve(points: Floats, field: Field, level: float, cut: Field, steps: int = 3) -> Floats:
    """Move `points (n, 3)` to where `field` is `level` and `cut` is 0, by shortest Newton steps."""
    for _ in range(steps):
        (f, of_f), (g, of_g) = field(points), cut(points)
        wanted = np.stack([f - level, g], axis=1)
        rows = np.stack([of_f, of_g], axis=1)
        gram = np.einsum("nik,njk->nij", rows, rows) + 1e-6 * np.eye(2)
        points = points - np.einsum("nik,ni->nk", rows, np.linalg.solve(gram, wanted[:, :, None])[:, :, 0])
    return points


def relaxed(
    positions: Floats, triangles: Ints, field: Field, level: float = 0.0, *, cut: Field | None = None, passes: int = 12
) -> tuple[Floats, Ints]:
    """Smooth the half mesh in `passes` rounds of flips and moves, with collapses of short edges in between.

    cut: level-set function whose zero is the border; None: the whole mesh is closed.
    """
    for _ in range(2):
        positions, triangles = _smooth(positions, triangles, field, level, cut, passes // 3)
        positions, triangles = collapsed(positions, triangles, _on_border(positions, triangles))
    positions, triangles = _smooth(positions, triangles, field, level, cut, passes // 3)
    held = _on_border(positions, triangles)
    return _put(positions, held, field, level, cut, 2), flipped(positions, triangles, positions[:, 0] == 0, held)


def _smooth(
    positions: Floats, triangles: Ints, field: Field, level: float, cut: Field | None, passes: int
) -> tuple[Floats, Ints]:
    middle, held = positions[:, 0] == 0, _on_border(positions, triangles)
    border = _border(triangles, middle)
    for _ in range(passes):
        triangles = flipped(positions, triangles, middle, held)
        moved = positions + 0.6 * (_neighbour_means(positions, triangles, border, held) - positions)
        moved[middle, 0] = 0.0
        positions = _put(moved, held, field, level, cut, 1)
    return positions, triangles


def _put(positions: Floats, held: np.ndarray, field: Field, level: float, cut: Field | None, steps: int) -> Floats:
    """Vertices projected to the surface, the `held` ones to the border as well."""
    put = positions.copy()
    put[~held] = on_surface(positions[~held], field, level, steps)
    if cut is not None:
        put[held] = on_curve(positions[held], field, level, cut, steps)
    put[positions[:, 0] == 0, 0] = 0.0
    return put


def _on_border(positions: Floats, triangles: Ints) -> np.ndarray:
    held = np.zeros(len(positions), bool)
    held[_border(triangles, positions[:, 0] == 0)] = True
    return held


def flipped(positions: Floats, triangles: Ints, middle: np.ndarray, held: np.ndarray) -> Ints:
    """Flip edges once towards Delaunay: those whose two opposite angles exceed pi, no two in one triangle.

    No flip joins two vertices of the middle plane, or two of the border, or leaves a vertex below four neighbours.
    """
    corners, pairs = interior_edges(triangles)
    start, end, one, two = corners.T
    excess = _angle(positions, one, start, end) + _angle(positions, two, start, end) - np.pi
    degree = np.bincount(unique_edges(triangles).ravel(), minlength=len(positions)) + 2 * middle
    good = (excess > 1e-3) & (degree[start] > 4) & (degree[end] > 4)
    good &= ~(middle[one] & middle[two]) & ~(held[one] & held[two])
    good &= ~_known(np.sort(corners[:, 2:], axis=1), unique_edges(triangles), len(positions))
    good &= _same_side(positions, corners)
    best = np.zeros(len(triangles))
    np.maximum.at(best, pairs[good].ravel(), np.repeat(excess[good], 2))
    good &= (excess >= best[pairs[:, 0]]) & (excess >= best[pairs[:, 1]])
    chosen = np.flatnonzero(good)
    _, lone = np.unique(np.sort(corners[chosen, 2:], axis=1), axis=0, return_index=True)
    chosen = chosen[np.sort(lone)]
    _, count = np.unique(pairs[chosen], return_counts=True)
    if (count > 1).any():  # equal excess in one triangle: the first is flipped
        _, keep = np.unique(pairs[chosen, 0], return_index=True)
        chosen = chosen[keep]
        chosen = chosen[~np.isin(pairs[chosen, 0], pairs[chosen, 1]) & _first(pairs[chosen, 1])]
    loses = np.bincount(np.concatenate([start[chosen], end[chosen]]), minlength=len(positions))
    chosen = chosen[(degree - loses)[corners[chosen, :2]].min(axis=1) >= 4]
    changed = triangles.copy()
    changed[pairs[chosen, 0]] = np.column_stack([start, two, one])[chosen]
    changed[pairs[chosen, 1]] = np.column_stack([two, end, one])[chosen]
    return changed


def both_halves(positions: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Return the whole mesh: the half, then its mirror image, joined in the vertices with x = 0."""
    own = positions[:, 0] > 0
    other = np.arange(len(positions))
    other[own] = len(positions) + np.arange(own.sum())
    return np.concatenate([positions, positions[own] * (-1.0, 1.0, 1.0)]), np.concatenate(
        [triangles, other[triangles[:, ::-1]]]
    )


def _border(triangles: Ints, middle: np.ndarray) -> Ints:
    """Border edges (b, 2) of the whole mesh that lie in its half."""
    edges = border_edges(triangles)[0]
    return edges[~middle[edges].all(axis=1)]


def _neighbour_means(positions: Floats, triangles: Ints, border: Ints, held: np.ndarray) -> Floats:
    """Mean of the neighbours of each vertex (n, 3), of those along the border for the `held` ones."""
    inner = half_edges(triangles)
    inner = inner[~held[inner[:, 0]]]
    back = half_edges(triangles)[:, ::-1]
    links = np.concatenate([inner, back[~held[back[:, 0]]], border, border[:, ::-1]])
    count = np.maximum(np.bincount(links[:, 0], minlength=len(positions)), 1)
    return np.column_stack(
        [np.bincount(links[:, 0], positions[links[:, 1], k], minlength=len(positions)) / count for k in range(3)]
    )


def _angle(positions: Floats, at: Ints, one: Ints, two: Ints) -> Floats:
    a, b = positions[one] - positions[at], positions[two] - positions[at]
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))


def _same_side(positions: Floats, corners: Ints) -> np.ndarray:
    """True where both triangles after the flip face as those before it: the four corners are nearly coplanar."""
    s, e, one, two = (positions[corners[:, k]] for k in range(4))
    before = np.cross(e - s, one - s) + np.cross(s - e, two - e)
    first, second = np.cross(two - s, one - s), np.cross(e - two, one - two)
    return ((before * first).sum(axis=1) > 0) & ((before * second).sum(axis=1) > 0)


def _known(pairs: Ints, edges: Ints, n: int) -> np.ndarray:
    return np.isin(pairs[:, 0] * n + pairs[:, 1], edges[:, 0] * n + edges[:, 1])


def _first(values: Ints) -> np.ndarray:
    first = np.zeros(len(values), bool)
    first[np.unique(values, return_index=True)[1]] = True
    return first
