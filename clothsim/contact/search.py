"""Every pair of a surface that may come near on a straight way: boxes in trees, then what tells the pairs apart."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.compiled import kernel
from clothsim.contact.broad_phase import BoxTree, Overlaps, build_tree, in_order, overlapping, overlapping_self, refit
from clothsim.contact.culling import that_may_meet
from clothsim.contact.surface import ContactSurface, Primitives

PARALLEL = 1e-3
"""Square of the sine, at rest lengths, below which a pair of edges is mollified (Li et al. 2020, IPC, section 4.1)."""


@dataclass(frozen=True)
class Pairs:
    """Point-triangle pairs, `n_points` of them, then edge-edge pairs.

    elements (p, 4): rows of x: point and triangle, or the ends of both edges; weights (p,) [m2]: the area that each
    stands for; thresholds (p,) [m4]: |u x v|^2 below which edges are mollified, 0 for points and triangles; keys (p,):
    ascending among the points and among the edges, one for each pair that a surface can have.
    """

    elements: Ints
    weights: Floats
    thresholds: Floats
    keys: Ints
    n_points: int

    def __len__(self) -> int:
        return len(self.elements)

    def at(self, numbers: Ints) -> "Pairs":
        """The pairs of these numbers, points before edges."""
        n_points = int((numbers < self.n_points).sum())
        elements, weights, thresholds = self.elements[numbers], self.weights[numbers], self.thresholds[numbers]
        return Pairs(elements, weights, thresholds, self.keys[numbers], n_points)


NONE = Pairs(np.zeros((0, 4), np.int64), np.zeros(0), np.zeros(0), np.zeros(0, np.int64), 0)

NOBODY: Overlaps = np.zeros(0, np.int64), np.zeros(0, np.int64)


def together(one: Pairs, other: Pairs) -> Pairs:
    """All pairs of two lists that have none in common, in the order of their keys: whence they come does not show."""
    both = Pairs(
        np.concatenate([one.elements, other.elements]),
        np.concatenate([one.weights, other.weights]),
        np.concatenate([one.thresholds, other.thresholds]),
        np.concatenate([one.keys, other.keys]),
        one.n_points + other.n_points,
    )
    return both.at(np.argsort(both.keys, kind="stable"))  # of two sorted lists: one merge


class Search:
    """The trees of one surface: made at the first search, their boxes set anew at each."""

    def __init__(self, surface: ContactSurface) -> None:
        self.surface = surface
        self._first, self._second = _Trees(surface.first), _Trees(surface.second)
        self._areas = surface.edge_areas(surface.first.edges), surface.edge_areas(surface.second.edges)
        self._lengths = surface.rest_lengths(surface.first.edges), surface.rest_lengths(surface.second.edges)

    def pairs(self, before: Floats, after: Floats, distance: float, of: np.ndarray | None = None) -> Pairs:
        """Every pair that may come nearer than `distance` [m] while all vertices go before -> after at one pace.

        of (N,): only the pairs that hang on one of these rows of x, all of which belong to the first group.
        """
        surface, first, second = self.surface, self.surface.first, self.surface.second
        end = after
        if surface.itself:  # what all have in common brings none nearer
            common = (after - before)[surface.rows].mean(axis=0)
            end = after - common if np.isfinite(common).all() else after
        mine = self._first.on(before, end, distance, of)
        theirs = self._second.on(before, end, 0.0)

        def met(found: Overlaps, a: Ints, b: Ints) -> Overlaps:
            return in_order(that_may_meet(*found, a, b, surface.labels, surface.allowed, before, after, distance))

        points = met(overlapping(mine("points"), theirs("triangles")), first.points[:, None], second.triangles)
        if surface.itself and of is None:
            edges = overlapping_self(self._first.on(before, end, 0.5 * distance)("edges"))
            return self._listed(points, NOBODY, met(edges, first.edges, second.edges))
        faces = met(overlapping(mine("triangles"), theirs("points")), first.triangles, second.points[:, None])
        edges = met(overlapping(mine("edges"), theirs("edges")), first.edges, second.edges)
        if surface.itself and of is not None:  # found from both sides where both have a row of these
            others = ~of[first.points[faces[1]]]
            points, faces = _joined(points, (faces[1][others], faces[0][others])), NOBODY
            once = (edges[0] < edges[1]) | ~of[first.edges[edges[1]]].any(axis=1)
            edges = in_order((edges[0].clip(max=edges[1])[once], edges[1].clip(min=edges[0])[once]))
        return self._listed(points, faces, edges)

    def _listed(self, points: Overlaps, faces: Overlaps, edges: Overlaps) -> Pairs:
        """Points of the first group with triangles of the second, triangles of the first with points, and edges."""
        first, second = self.surface.first, self.surface.second
        elements = (
            np.column_stack([first.points[points[0]], second.triangles[points[1]]]),
            np.column_stack([second.points[faces[1]], first.triangles[faces[0]]]),
            np.column_stack([first.edges[edges[0]], second.edges[edges[1]]]),
        )
        n_points = len(elements[0]) + len(elements[1])
        on_points = np.concatenate(elements[:2])[:, 0]
        areas = self._areas[0][edges[0]] + self._areas[1][edges[1]]
        lengths = self._lengths[0][edges[0]] * self._lengths[1][edges[1]]
        return Pairs(
            np.concatenate(elements),
            np.concatenate([self.surface.vertex_areas[on_points], areas]) / 4,
            np.concatenate([np.zeros(n_points), PARALLEL * lengths**2]),
            np.concatenate([kind << 60 | a << 30 | b for kind, (a, b) in enumerate((points, faces, edges))]),
            n_points,
        )


def _joined(one: Overlaps, other: Overlaps) -> Overlaps:
    return in_order((np.concatenate([one[0], other[0]]), np.concatenate([one[1], other[1]])))


class _Trees:
    """The trees over the points, edges and triangles of one group."""

    def __init__(self, primitives: Primitives) -> None:
        self._elements = {
            "points": primitives.points[:, None],
            "edges": primitives.edges,
            "triangles": primitives.triangles,
        }
        self._trees: dict[str, BoxTree] = {}
        self._boxes: dict[str, Floats] = {}

    def on(self, before: Floats, after: Floats, grown: float, of: np.ndarray | None = None) -> Callable[[str], BoxTree]:
        """Gives the tree of a kind, its boxes those on the way before -> after, grown by `grown` [m] on each side.

        of (N,): a small tree of those that hang on one of these rows of x.
        """

        def tree(kind: str) -> BoxTree:
            if of is not None:
                numbers = np.flatnonzero(of[self._elements[kind]].any(axis=1))
                boxes = _boxes(before, after, self._elements[kind][numbers], grown)
                few = build_tree(boxes[0], boxes[1])
                return replace(few, order=numbers[few.order])
            boxes = _boxes(before, after, self._elements[kind], grown)
            if kind not in self._trees:
                self._trees[kind] = build_tree(boxes[0], boxes[1])
            elif not np.array_equal(boxes, self._boxes[kind]):
                self._trees[kind] = refit(self._trees[kind], boxes[0], boxes[1])
            self._boxes[kind] = boxes
            return self._trees[kind]

        return tree


@kernel
def _boxes(before: Floats, after: Floats, elements: Ints, grown: float) -> Floats:
    """Lower and upper corners (2, m, 3) of elements (m, k) on the way before -> after, grown by `grown`."""
    boxes = np.empty((2, len(elements), 3))
    for e in range(len(elements)):
        for axis in range(3):
            low, high = np.inf, -np.inf
            for k in range(elements.shape[1]):
                i = elements[e, k]
                low = min(low, before[i, axis], after[i, axis])
                high = max(high, before[i, axis], after[i, axis])
            boxes[0, e, axis], boxes[1, e, axis] = low - grown, high + grown
    return boxes
