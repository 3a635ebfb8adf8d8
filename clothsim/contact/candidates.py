"""Pairs that could touch: built for a straight path with an inflation, reused until some vertex leaves it.

Two lists. The candidates come from a search in boxes along a whole Newton step, which may be long: they are many. The
close pairs are those of them that were near at one place. While no vertex is further than m <= `reach` from there, a
pair nearer than `limit` was nearer than limit + 2 m: sorted by distance, the first few are all that is looked at.
"""

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numba import njit

from clothsim.arrays import Floats, Ints
from clothsim.contact.barrier_kernels import near_pairs
from clothsim.contact.broad_phase import BoxTree, build_tree, overlapping, overlapping_self, refit
from clothsim.contact.ccd import edge_edge_limit, point_triangle_limit
from clothsim.contact.surface import ContactSurface, Primitives

SLACK = 0.9
"""Share of a distance that one step may use up (the conservative rescaling of additive CCD, Li et al. 2021)."""

PARALLEL = 1e-3
"""Square of the sine, at rest lengths, below which a pair of edges is mollified (Li et al. 2020, IPC, section 4.1)."""


@dataclass(frozen=True)
class Pairs:
    """Point-triangle pairs, `n_points` of them, then edge-edge pairs.

    elements (p, 4): rows of x: point and triangle, or the ends of both edges; weights (p,) [m2]: the area that each
    stands for; thresholds (p,) [m4]: |u x v|^2 below which edges are mollified, 0 for points and triangles.
    """

    elements: Ints
    weights: Floats
    thresholds: Floats
    n_points: int

    def __len__(self) -> int:
        return len(self.elements)

    def at(self, numbers: Ints) -> "Pairs":
        """The pairs of these numbers, in ascending order."""
        points = int(np.searchsorted(numbers, self.n_points))
        return Pairs(self.elements[numbers], self.weights[numbers], self.thresholds[numbers], points)


NONE = Pairs(np.zeros((0, 4), np.int64), np.zeros(0), np.zeros(0), 0)


class Candidates:
    """A cache over one surface; what it returns does not depend on what it holds. It also keeps count of its work.

    limit [m]: the pairs needed are those closer (d_hat and offset); reach [m]: how far a vertex may go from where a
    list was built before it is built anew; offset [m]: the distance that no pair goes below.
    """

    def __init__(self, surface: ContactSurface, limit: float, reach: float, offset: float = 0.0) -> None:
        self.surface = surface
        self.limit = limit
        self.reach = reach
        self.offset = offset
        self.seconds = {"candidates": 0.0, "CCD": 0.0}
        self.ccd_calls = 0
        self.builds = 0
        self.pairs = 0
        self._boxes = {name: _Boxes(surface.second, name) for name in ("points", "edges", "triangles")}
        self._own = self._boxes if surface.itself else {}
        self._areas = surface.edge_areas(surface.first.edges), surface.edge_areas(surface.second.edges)
        self._lengths = surface.rest_lengths(surface.first.edges), surface.rest_lengths(surface.second.edges)
        self.forget()

    def forget(self) -> None:
        """Build anew at the next call: a step then depends on its own start only, and a run can be resumed."""
        self._path: tuple[Floats, Floats] | None = None
        self._candidates = NONE
        self._close_at: Floats | None = None
        self._close = NONE
        self._order = np.zeros(0, np.int64)
        self._distances = np.zeros(0)
        self._near_at: Floats | None = None
        self._near = NONE
        self._gap = np.inf

    def near(self, x: Floats) -> Pairs:
        """The pairs closer than `limit` at x."""
        if self._near_at is not None and np.array_equal(x, self._near_at):
            return self._near
        start = perf_counter()
        close = self._close_to(x, self.limit)
        numbers, squared = near_pairs(x, close.elements, close.n_points, self.limit)
        self._near, self._near_at = close.at(numbers), x.copy()
        self._gap = float(np.sqrt(squared.min())) - self.offset if len(squared) else np.inf
        self.pairs = len(numbers)
        self.seconds["candidates"] += perf_counter() - start
        return self._near

    def within(self, x: Floats, distance: float) -> Pairs:
        """The pairs that are closer than `distance` [m] at x, at most limit + 2 reach."""
        close = self._close_to(x, distance)
        numbers, _ = near_pairs(x, close.elements, close.n_points, distance)
        return close.at(numbers)

    def minimum_gap(self, x: Floats) -> float:
        """The smallest distance of a pair less the offset [m] where it is below d_hat, else inf."""
        self.near(x)
        return self._gap

    def gap_change(self, x: Floats, dx: Floats) -> float:
        """The largest |g(x + dx) - g(x)| / g(x) of the pairs near before or after; g: the distance less the offset."""
        change = 0.0
        for place in (x + dx, x):
            near = self.near(place)
            before, after = (np.sqrt(near_pairs(at, near.elements, near.n_points, np.inf)[1]) for at in (x, x + dx))
            change = max(change, float((np.abs(after - before) / (before - self.offset)).max(initial=0.0)))
        return change

    def closest_pair(self, x: Floats) -> Ints:
        """The rows (4,) of the closest pair below `limit`; empty where there is none."""
        near = self.near(x)
        if not len(near):
            return np.zeros(0, np.int64)
        _, squared = near_pairs(x, near.elements, near.n_points, np.inf)
        return near.elements[int(squared.argmin())]

    def step_limit(self, x: Floats, dx: Floats) -> float:
        """The fraction of dx that is free of collision, by additive CCD over straight paths, in [0, 1]."""
        start = perf_counter()
        after = x + dx
        moved = max(self._moved(x), self._moved(after))
        pairs = self._sorted_out(moved / SLACK, self.offset) if moved <= self.reach else self._cover(x, after)
        searched = perf_counter()
        points, edges = pairs.elements[: pairs.n_points], pairs.elements[pairs.n_points :]
        fraction = point_triangle_limit(x, dx, points, self.offset, SLACK, 1.0)
        fraction = edge_edge_limit(x, dx, edges, self.offset, SLACK, fraction)
        self.ccd_calls += 1
        self.seconds["candidates"] += searched - start
        self.seconds["CCD"] += perf_counter() - searched
        return float(fraction)

    def _moved(self, x: Floats) -> float:
        """The farthest that a vertex is from where the close pairs were taken [m]."""
        return np.inf if self._close_at is None else strays(x[self.surface.rows], self._close_at, self._close_at)

    def _close_to(self, x: Floats, distance: float) -> Pairs:
        """Some pairs, among them all that are nearer than `distance` at x."""
        moved = self._moved(x)
        if moved > self.reach:
            candidates, moved = self._cover(x, x), 0.0
            within = self.limit + 2.0 * self.reach
            numbers, squared = near_pairs(x, candidates.elements, candidates.n_points, within)
            self._close, self._close_at = candidates.at(numbers), x[self.surface.rows]
            self._order = np.argsort(squared, kind="stable")
            self._distances = np.sqrt(squared[self._order])
        return self._sorted_out(moved, distance)

    def _sorted_out(self, moved: float, distance: float) -> Pairs:
        """The close pairs that may be nearer than `distance` where no vertex has moved further than `moved`."""
        count = int(np.searchsorted(self._distances, distance + 2.0 * moved, side="right"))
        return self._close.at(np.sort(self._order[:count]))

    def _cover(self, before: Floats, after: Floats) -> Pairs:
        """Every pair that can come closer than limit + 2 reach while the vertices go straight from one to the other."""
        rows = self.surface.rows
        start, end = before[rows], after[rows]
        if self._path is None or max(strays(points, *self._path) for points in (start, end)) > self.reach:
            self._path = start, end
            self._candidates = self._build(before, after, self.limit + 4.0 * self.reach)
            self.builds += 1
        return self._candidates

    def _build(self, before: Floats, after: Floats, grown: float) -> Pairs:
        """Every pair whose boxes on the way, one of them grown by so much [m], overlap."""
        surface, first, boxes = self.surface, self.surface.first, self._boxes
        if surface.itself:
            tree = boxes["triangles"].at(before, after)
            pairs = overlapping(tree, *_grown(before, after, first.points[:, None], grown))
            points = np.column_stack([first.points[pairs[:, 0]], first.triangles[pairs[:, 1]]])
            edge_pairs = overlapping_self(boxes["edges"].at(before, after, 0.5 * grown))
        else:
            tree = boxes["triangles"].at(before, after)
            cloth = overlapping(tree, *_grown(before, after, first.points[:, None], grown))
            tree = boxes["points"].at(before, after)
            body = overlapping(tree, *_grown(before, after, first.triangles, grown))
            points = np.concatenate(
                [
                    np.column_stack([first.points[cloth[:, 0]], surface.second.triangles[cloth[:, 1]]]),
                    np.column_stack([surface.second.points[body[:, 1]], first.triangles[body[:, 0]]]),
                ]
            )
            tree = boxes["edges"].at(before, after)
            edge_pairs = overlapping(tree, *_grown(before, after, first.edges, grown))
        points = points[_may_touch(points, 1, surface.labels, surface.allowed)]
        edges = np.column_stack([first.edges[edge_pairs[:, 0]], surface.second.edges[edge_pairs[:, 1]]])
        kept = _may_touch(edges, 2, surface.labels, surface.allowed)
        edges, (a, b) = edges[kept], edge_pairs[kept].T
        areas, lengths = self._areas, self._lengths
        return Pairs(
            np.concatenate([points, edges]),
            np.concatenate([surface.vertex_areas[points[:, 0]], areas[0][a] + areas[1][b]]) / 4,
            np.concatenate([np.zeros(len(points)), PARALLEL * (lengths[0][a] * lengths[1][b]) ** 2]),
            len(points),
        )


class _Boxes:
    """The tree over one kind of primitive: made once, its boxes set anew where the primitives have moved."""

    def __init__(self, primitives: Primitives, kind: str) -> None:
        elements = getattr(primitives, kind)
        self._elements = elements[:, None] if elements.ndim == 1 else elements
        self._tree: BoxTree | None = None
        self._at: tuple[Floats, Floats, float] | None = None

    def at(self, before: Floats, after: Floats, grown: float = 0.0) -> BoxTree:
        """The tree over the way before -> after, each box grown by `grown` [m]."""
        low, high = _grown(before, after, self._elements, grown)
        if self._tree is None:
            self._tree = build_tree(low, high)
        elif not (np.array_equal(low, self._at[0]) and np.array_equal(high, self._at[1])):  # type: ignore[index]
            self._tree = refit(self._tree, low, high)
        self._at = low, high, grown
        return self._tree


@njit(cache=True)
def _grown(before, after, elements, grown):
    """The boxes (m, 3), (m, 3) of elements (m, k) on the way before -> after, grown by `grown` on each side."""
    low, high = np.empty((len(elements), 3)), np.empty((len(elements), 3))
    for e in range(len(elements)):
        for k in range(3):
            low[e, k], high[e, k] = np.inf, -np.inf
            for i in elements[e]:
                low[e, k] = min(low[e, k], before[i, k], after[i, k])
                high[e, k] = max(high[e, k], before[i, k], after[i, k])
            low[e, k] -= grown
            high[e, k] += grown
    return low, high


@njit(cache=True)
def _may_touch(elements, split, labels, allowed):
    """Whether the vertices before and from `split` share none, and their objects may touch, (p,)."""
    kept = np.empty(len(elements), np.bool_)
    for e in range(len(elements)):
        kept[e] = allowed[labels[elements[e, 0]], labels[elements[e, split]]]
        for i in range(split):
            for j in range(split, 4):
                if elements[e, i] == elements[e, j]:
                    kept[e] = False
    return kept


@njit(cache=True)
def strays(points, start, end):
    """The largest distance of a point from its segment start -> end [m]."""
    most = 0.0
    for i in range(len(points)):
        length = along = 0.0
        for k in range(3):
            length += (end[i, k] - start[i, k]) ** 2
            along += (points[i, k] - start[i, k]) * (end[i, k] - start[i, k])
        share = min(max(along / length, 0.0), 1.0) if length > 0.0 else 0.0
        off = 0.0
        for k in range(3):
            off += (points[i, k] - start[i, k] - share * (end[i, k] - start[i, k])) ** 2
        most = max(most, off)
    return np.sqrt(most)
