"""Implicit surface of tapered capsules (limbs) and their smooth union, and its triangles by surface nets, smoothed.

The function is negative inside and a distance near the surface. A limb is a straight axis with elliptic sections whose
half axes r(t) follow a cubic through its knots; its ends are half ellipsoids. With m the vector from the nearest point
of the axis, k0 = |m / r| and k1 = |m / r^2|, its distance is approximated by k0 (k0 - 1) / k1, exact to first order at
the surface of an ellipsoid.
The union is f = -s log sum_i exp(-f_i / s): symmetric in the limbs, smooth, never above the sharp union.

Surface nets (Gibson 1998) of the half x >= 0 of a mirror-symmetric level set f = 0, in whole arrays: one vertex for
each lattice cell that the surface crosses, at the mean of the crossings of its edges; one quad for each lattice edge
that it crosses, between the four cells around that edge. The first column of cells lies across x = 0: by symmetry its
vertices are on the plane, and no quad is its own mirror image. The mesh is smoothed along the surface, with Delaunay
edge flips and edge collapses; vertices with x = 0 stay there, as the other half balances them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.generators.shapes import cut_quads
from clothsim.mesh.topology import border_edges, half_edges, interior_edges, unique_edges, vertex_rings

RANGE = 0.25
"""Distance beyond which a limb is ignored [m]."""


@dataclass(frozen=True)
class Limb:
    """Tapered capsule.

    start (3,) [m]; axes (3, 3): rows across, deep, along; length [m]; caps (2,) [m]; knots (k,): positions along the
    axis of the half axes radii (k, 2) [m]; slopes (k, 2): their derivatives.
    """

    start: Floats
    axes: Floats
    length: float
    caps: tuple[float, float]
    knots: Floats
    radii: Floats
    slopes: Floats

    def distance(self, points: Floats) -> tuple[Floats, Floats]:
        """Return an approximate signed distance (n,) [m] of `points (n, 3)` to the surface, and its gradient (n, 3)."""
        m = (points - self.start) @ self.axes.T
        along = np.clip(m[:, 2], 0.0, self.length)
        r, widening = self._radii(along, m[:, 2])
        m[:, 2] -= along
        a = m / r
        b = a / r
        k0 = np.maximum(np.sqrt(np.einsum("ni,ni->n", a, a)), 1e-12)
        k1 = np.maximum(np.sqrt(np.einsum("ni,ni->n", b, b)), 1e-9)
        by_k0, by_k1 = ((2 * k0 - 1) / (k1 * k0))[:, None], (-k0 * (k0 - 1) / k1**3)[:, None]
        slope = by_k0 * (a / r) + by_k1 * (b / (r * r))
        by_radius = -(by_k0 * (a * a) + 2 * by_k1 * (b * b)) / r
        slope[:, 2] += np.einsum("ni,ni->n", by_radius[:, :2], widening)
        return k0 * (k0 - 1) / k1, slope @ self.axes

    def box(self) -> tuple[Floats, Floats]:
        """Return the lowest and the highest corner (3,) [m] of a bounding box."""
        ends = np.stack([self.start, self.start + self.length * self.axes[2]])
        room = max(self.radii.max(), *self.caps)
        return ends.min(axis=0) - room, ends.max(axis=0) + room

    def mirrored(self) -> "Limb":
        """Return the mirror image about the plane x = 0."""
        across = np.array([-1.0, 1.0, 1.0])
        return replace(self, start=across * self.start, axes=across * self.axes)

    def _radii(self, along: Floats, position: Floats) -> tuple[Floats, Floats]:
        """Half axes (n, 3) at `along (n,)`, and the growth along the axis of those of the section (n, 2)."""
        if len(self.knots) == 1:
            ball = np.append(self.radii[0], self.caps[0])
            return np.broadcast_to(ball, (len(along), 3)), np.zeros((len(along), 2))
        k = np.clip(np.searchsorted(self.knots, along, side="right") - 1, 0, len(self.knots) - 2)
        span = (self.knots[k + 1] - self.knots[k])[:, None]
        t = (along - self.knots[k])[:, None] / span
        change = self.radii[k + 1] - self.radii[k]
        c1, c2 = span * self.slopes[k], 3 * change - span * (2 * self.slopes[k] + self.slopes[k + 1])
        c3 = span * (self.slopes[k] + self.slopes[k + 1]) - 2 * change
        section = self.radii[k] + t * (c1 + t * (c2 + t * c3))
        widening = (c1 + t * (2 * c2 + 3 * t * c3)) / span
        beside = (position > 0) & (position < self.length)
        cap = np.where(position > 0.5 * self.length, self.caps[1], self.caps[0])
        return np.column_stack([section, cap]), widening * beside[:, None]


def limb(
    start: ArrayLike, end: ArrayLike, across: Floats, profile: Sequence[Sequence[float]], caps: tuple[float, float]
) -> Limb:
    """Make a limb from `start (3,)` to `end (3,)` [m]; where they coincide, an ellipsoid upright along z.

    across (3,): direction of the first half axis, made normal to the axis; profile: rows (fraction of the length, half
    axis across, half axis deep [m]); caps: lengths of its ends beyond the axis [m].
    """
    first, last = np.asarray(start, np.float64), np.asarray(end, np.float64)
    length = float(np.linalg.norm(last - first))
    along = (last - first) / length if length else np.array([0.0, 0.0, 1.0])
    side = np.asarray(across, np.float64) - np.dot(across, along) * along
    side /= np.linalg.norm(side)
    table = np.asarray(profile, np.float64)
    knots, radii = length * table[:, 0], table[:, 1:]
    slopes = np.zeros_like(radii)
    if len(knots) > 2:  # of the parabola through three knots; flat at the ends, where the caps begin
        step, rise = np.diff(knots)[:, None], np.diff(radii, axis=0)
        each = rise / step
        slopes[1:-1] = (each[:-1] * step[1:] + each[1:] * step[:-1]) / (step[1:] + step[:-1])
    return Limb(first, np.stack([side, np.cross(along, side), along]), length, caps, knots, radii, slopes)


def smooth_union(limbs: Sequence[Limb], points: Floats, smoothing: float) -> tuple[Floats, Floats]:
    """Return f (n,) [m] and its gradient (n, 3) of the union of `limbs`, at `points (n, 3)`; smoothing: s [m].

    A limb whose box is more than RANGE away adds less than s exp(-RANGE / s) and is left out; far from all, f is RANGE.
    """
    total, gradient = np.full(len(points), np.exp(-RANGE / smoothing)), np.zeros((len(points), 3))
    for one in limbs:
        low, high = one.box()
        near = np.flatnonzero(((points > low - RANGE) & (points < high + RANGE)).all(axis=1))
        if len(near):
            distance, slope = one.distance(points[near])
            fraction = np.exp(-np.maximum(distance, -RANGE) / smoothing)
            total[near] += fraction
            gradient[near] += fraction[:, None] * slope
    return -smoothing * np.log(total), gradient / total[:, None]


def lattice_union(limbs: Sequence[Limb], nodes: tuple[Floats, Floats, Floats], smoothing: float, band: float) -> Floats:
    """Return f [m] of the union at the nodes of a lattice (x, y, z), to s exp(-band / s) where f is below `band`."""
    total = np.full([len(axis) for axis in nodes], np.exp(-band / smoothing))
    for one in limbs:
        low, high = one.box()
        part = tuple(
            slice(*np.searchsorted(axis, (low[k] - band, high[k] + band)).tolist()) for k, axis in enumerate(nodes)
        )
        points = np.stack(np.meshgrid(*(axis[p] for axis, p in zip(nodes, part, strict=True)), indexing="ij"), axis=3)
        distance = one.distance(points.reshape(-1, 3))[0].reshape(points.shape[:3])
        total[part] += np.exp(-np.maximum(distance, -RANGE) / smoothing)
    return np.asarray(-smoothing * np.log(total), np.float64)


_CORNERS = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1), (1, 1, 1)])
_EDGES = ((0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7))


def _is_split(code: int) -> bool:
    """True where the inside corners (the bits of `code`) or the outside ones are not connected by edges of the cell."""
    for wanted in (1, 0):
        left = [c for c in range(8) if (code >> c & 1) == wanted]
        visited, todo = set(left[:1]), left[:1]
        while todo:
            here = todo.pop()
            step = [c for edge in _EDGES if here in edge for c in edge if c in left and c not in visited]
            visited.update(step)
            todo.extend(step)
        if len(visited) < len(left):
            return True
    return False


_SPLIT = np.array([_is_split(code) for code in range(256)])


def half_surface(f: Floats, nodes: tuple[Floats, Floats, Floats]) -> tuple[Floats, Ints]:
    """Mesh the surface inside the lattice.

    Parameters
    ----------
    f : (nx, ny, nz) float64
        Level-set function at the nodes.
    nodes : tuple
        Ascending x, y and z of the lattice [m]; x[0] = -x[1], and the surface must not reach the other sides.

    Returns
    -------
    positions : (n, 3) float64
        Vertices with x >= 0 [m].
    triangles : (m, 3) int64
        Facing towards growing f; a manifold.
    """
    # A cell whose inside or outside corners are connected only across a diagonal, as at a thin ridge between the nodes,
    # would let sheets touch: it loses its shallowest inside corner.
    f = f.copy()
    f[0] = f[1]  # exactly symmetric, whatever the rounding
    for _ in range(64):
        corner = _corners(f)
        code = ((corner < 0) << np.arange(8)).sum(axis=3)
        bad = np.argwhere(_SPLIT[code])
        if not len(bad):
            break
        values = corner[tuple(bad.T)]
        shallow = np.where(values < 0, values, -np.inf).argmax(axis=1)
        f[tuple((bad + _CORNERS[shallow]).T)] = 1e-9
        f[:2] = f[:2].max(axis=0)
    number, positions = _cell_vertices(f, nodes)
    quads = np.concatenate([_quads(f < 0, number, axis) for axis in range(3)])
    first, second = (np.linalg.norm(positions[quads[:, k]] - positions[quads[:, k + 2]], axis=1) for k in (0, 1))
    return positions, cut_quads(quads, (second < first * (1 - 1e-6)).astype(np.int64))


def _corners(f: Floats) -> Floats:
    """Values at the 8 corners of each cell, (nx, ny, nz, 8)."""
    return np.stack([f[tuple(slice(c, f.shape[k] - 1 + c) for k, c in enumerate(cs))] for cs in _CORNERS], axis=3)


def _cell_vertices(f: Floats, nodes: tuple[Floats, Floats, Floats]) -> tuple[Ints, Floats]:
    """Number of the vertex of each cell, -1 for none, and the vertices."""
    corner = _corners(f)
    inside = corner < 0
    crossed = inside.any(axis=3) & ~inside.all(axis=3)
    number = np.full(crossed.shape, -1, np.int64)
    number[crossed] = np.arange(crossed.sum())
    values = corner[crossed]
    total, count = np.zeros((len(values), 3)), np.zeros(len(values))
    for a, b in _EDGES:
        cut = (values[:, a] < 0) != (values[:, b] < 0)
        fraction = values[cut, a] / (values[cut, a] - values[cut, b])
        total[cut] += _CORNERS[a] + fraction[:, None] * (_CORNERS[b] - _CORNERS[a])
        count[cut] += 1
    cell, fraction = np.argwhere(crossed), total / count[:, None]
    low = np.column_stack([nodes[k][cell[:, k]] for k in range(3)])
    high = np.column_stack([nodes[k][cell[:, k] + 1] for k in range(3)])
    positions = low + fraction * (high - low)
    positions[cell[:, 0] == 0, 0] = 0.0
    return number, positions


def _quads(inside: np.ndarray, number: Ints, axis: int) -> Ints:
    """Quads (q, 4) of the crossed lattice edges along `axis`, facing outward."""
    one, two = (axis + 1) % 3, (axis + 2) % 3
    ends = np.moveaxis(inside, axis, 0)
    crossed = np.moveaxis(ends[:-1] != ends[1:], 0, axis)
    node = np.argwhere(crossed)
    node = node[(node[:, one] > 0) & (node[:, two] > 0)]  # left out: the mirror images at the first node of x
    if axis == 0:
        node = node[node[:, 0] > 0]
    around = []
    for shift_one, shift_two in ((1, 1), (0, 1), (0, 0), (1, 0)):
        cell = node.copy()
        cell[:, one] -= shift_one
        cell[:, two] -= shift_two
        around.append(number[tuple(cell.T)])
    quads = np.column_stack(around)
    outward = inside[tuple(node.T)]
    return np.where(outward[:, None], quads, quads[:, ::-1])


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
    border, n = _border(triangles, middle), len(positions)
    for _ in range(passes):
        triangles = flipped(positions, triangles, middle, held)
        inner, back = half_edges(triangles), half_edges(triangles)[:, ::-1]  # the held have neighbours along the border
        links = np.concatenate([inner[~held[inner[:, 0]]], back[~held[back[:, 0]]], border, border[:, ::-1]])
        count = np.maximum(np.bincount(links[:, 0], minlength=n), 1)
        sums = [np.bincount(links[:, 0], positions[links[:, 1], k], minlength=n) for k in range(3)]
        moved = positions + 0.6 * (np.column_stack([each / count for each in sums]) - positions)
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
    across = np.sort(corners[:, 2:], axis=1)
    good &= ~np.isin(across @ [len(positions), 1], unique_edges(triangles) @ [len(positions), 1])
    s, e, a, b = (positions[corners[:, k]] for k in range(4))
    normal = np.cross(e - s, a - s) + np.cross(s - e, b - e)  # both triangles after the flip face as those before it
    for flip in (np.cross(b - s, a - s), np.cross(e - b, a - b)):
        good &= (normal * flip).sum(axis=1) > 0
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
        first = np.isin(np.arange(len(chosen)), np.unique(pairs[chosen, 1], return_index=True)[1])
        chosen = chosen[~np.isin(pairs[chosen, 0], pairs[chosen, 1]) & first]
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


def _angle(positions: Floats, at: Ints, one: Ints, two: Ints) -> Floats:
    a, b = positions[one] - positions[at], positions[two] - positions[at]
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))
