"""Every pair of a surface that may come near on a straight way: boxes in trees, then what tells the pairs apart."""

from typing import cast

import numpy as np

from clothsim.arrays import Floats
from clothsim.contact.broad_phase import Met, that_may_meet
from clothsim.contact.bvh import BoxTree, build_tree, refit
from clothsim.contact.pair_list import Pairs, side_by_side
from clothsim.contact.pair_order import in_order
from clothsim.contact.surface import ContactSurface, Primitives
from clothsim.jit import kernel

PARALLEL = 1e-3
"""Square of the sine, at rest lengths, below which a pair of edges is mollified (Li et al. 2020, IPC, section 4.1)."""

NOBODY: Met = np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)


class Search:
    """The trees of one surface: made at the first search, their boxes set anew where something has moved."""

    def __init__(self, surface: ContactSurface) -> None:
        self.surface = surface
        self._first, self._second = _Trees(surface.first), _Trees(surface.second)
        self._areas = surface.edge_areas(surface.first.edges), surface.edge_areas(surface.second.edges)
        self._lengths = surface.rest_lengths(surface.first.edges), surface.rest_lengths(surface.second.edges)

    def pairs(
        self, before: Floats, after: Floats, distance: float, of: np.ndarray | None = None
    ) -> tuple[Pairs, Floats]:
        """Every pair that may come nearer than `distance` [m] while all vertices go before -> after at one pace.

        And their distances (p,) [m] before. of (N,): only the pairs that hang on one of these rows of x, all of which
        belong to the first group.
        """
        surface = self.surface
        end = after
        if surface.itself and of is None:  # what all have in common brings none nearer
            common = (after - before)[surface.rows].mean(axis=0)
            end = after - common if np.isfinite(common).all() else after
        way = before.copy(), end.copy()
        mine = self._first.on(way)
        theirs = mine if surface.itself else self._second.on(way)

        def met(one: BoxTree, other: BoxTree, of: np.ndarray | None, but: np.ndarray | None = None) -> Met:
            way = surface.labels, surface.allowed, before, after, distance
            return that_may_meet(one, other, distance, *way, of, but)

        of_points = met(mine["points"], theirs["triangles"], of)
        of_edges = met(mine["edges"], theirs["edges"], of)
        if surface.itself and of is None:
            return self._listed(of_points, NOBODY, of_edges)
        others = of if surface.itself else None  # the pairs of the points asked for are found
        of_faces = met(mine["triangles"], theirs["points"], of, others)
        if surface.itself:
            second_first = of_faces[1], of_faces[0], of_faces[2]
            both = tuple(np.concatenate(two) for two in zip(of_points, second_first, strict=True))
            return self._listed(cast(Met, both), NOBODY, of_edges)
        return self._listed(of_points, of_faces, of_edges)

    def _listed(self, *found: Met) -> tuple[Pairs, Floats]:
        """Points of the first group with triangles of the second, triangles of the first with points, and edges."""
        first, second = self.surface.first, self.surface.second
        orders = [in_order(a, b) for a, b, _ in found]
        points, faces, edges = ((a[order], b[order]) for (a, b, _), order in zip(found, orders, strict=True))
        elements = (
            side_by_side(first.points[:, None], points[0], second.triangles, points[1]),
            side_by_side(second.points[:, None], faces[1], first.triangles, faces[0]),
            side_by_side(first.edges, edges[0], second.edges, edges[1]),
        )
        n_points = len(elements[0]) + len(elements[1])
        on_points = np.concatenate(elements[:2])[:, 0]
        areas = self._areas[0][edges[0]] + self._areas[1][edges[1]]
        lengths = self._lengths[0][edges[0]] * self._lengths[1][edges[1]]
        listed = Pairs(
            np.concatenate(elements),
            np.concatenate([self.surface.vertex_areas[on_points], areas]) / 4,
            np.concatenate([np.zeros(n_points), PARALLEL * lengths**2]),
            np.concatenate([kind << 60 | a << 30 | b for kind, (a, b) in enumerate((points, faces, edges))]),
            n_points,
        )
        distances = [each[order] for (_, _, each), order in zip(found, orders, strict=True)]
        return listed, np.concatenate(distances)


class _Trees:
    """The trees over the points, edges and triangles of one group, on one way."""

    def __init__(self, primitives: Primitives) -> None:
        self._elements = {
            "points": primitives.points[:, None],
            "edges": primitives.edges,
            "triangles": primitives.triangles,
        }
        self._trees: dict[str, BoxTree] = {}
        self._ways: dict[str, tuple[Floats, Floats]] = {}
        self._way = np.zeros((0, 3)), np.zeros((0, 3))
        self._since: tuple[tuple[Floats, Floats], np.ndarray] | None = None

    def on(self, way: tuple[Floats, Floats]) -> "_Trees":
        """The trees are asked for on this way (N, 3) [m] from now on; it stays as it is."""
        self._way, self._since = way, None
        return self

    def __getitem__(self, kind: str) -> BoxTree:
        if kind not in self._trees:
            self._trees[kind] = build_tree(self._elements[kind], *self._way)
        elif self._ways[kind] is not self._way:
            moved = self._moved_since(self._ways[kind])
            if moved.any():
                refit(self._trees[kind], *self._way, moved)
        self._ways[kind] = self._way
        return self._trees[kind]

    def _moved_since(self, way: tuple[Floats, Floats]) -> np.ndarray:
        """Which rows of x (N,) go another way now; most often all kinds were last asked for on the same."""
        if self._since is None or self._since[0] is not way:
            self._since = way, _differ(*way, *self._way)
        return self._since[1]


@kernel
def _differ(before: Floats, after: Floats, other_before: Floats, other_after: Floats) -> np.ndarray:
    """Which rows of two ways differ (N,); NaN differs from all."""
    differ = np.empty(len(before), np.bool_)
    for i in range(len(before)):
        same = True
        for k in range(3):
            same &= (before[i, k] == other_before[i, k]) & (after[i, k] == other_after[i, k])
        differ[i] = not same
    return differ
