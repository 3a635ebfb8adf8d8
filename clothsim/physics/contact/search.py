"""Candidate search of a surface: broad phase over its trees, assembled to a pair list."""

from typing import cast

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel, part
from clothsim.base.parallel import together
from clothsim.physics.contact.broad_phase import FoundPairs, candidate_pairs
from clothsim.physics.contact.bvh import BoxTree, build_tree, refit
from clothsim.physics.contact.pair_list import Pairs, concatenated_rows
from clothsim.physics.contact.surface import ContactSurface, Primitives

# Lexicographic order of index pairs by counting sort.

INSERTION_SIZE = 32
"""Length up to which insertion sort is fastest."""


def lexicographic_order(first: Ints, second: Ints) -> Ints:
    """Order (p,) of pairs by the first index, then the second: the result does not depend on the shape of a tree."""
    n = int(first.max(initial=-1)) + 1
    if 8 * len(first) < n:
        return np.lexsort((second, first))
    return _order(first, second, n)


@part
def _sort(values: Ints, start: int, end: int) -> None:
    """Sort values[start:end] in place: Shell sort, which up to INSERTION_SIZE is insertion sort."""
    gap = 1
    while gap * INSERTION_SIZE < end - start:
        gap = 3 * gap + 1
    while gap > 0:
        for k in range(start + gap, end):
            value, slot = values[k], k
            while slot >= start + gap and values[slot - gap] > value:
                values[slot] = values[slot - gap]
                slot -= gap
            values[slot] = value
        gap //= 3


@kernel
def _order(first: Ints, second: Ints, n: int) -> Ints:
    """Order of pairs by first, all below n, then second."""
    slots = np.zeros(n + 1, np.int64)  # of the next pair of i; at the end, of the first pair of i + 1
    for i in first:
        slots[i + 1] += 1
    for i in range(n):
        slots[i + 1] += slots[i]
    order = np.empty(len(first), np.int64)
    for k in range(len(first)):
        order[slots[first[k]]] = second[k] << 32 | k
        slots[first[k]] += 1
    start = 0
    for i in range(n):
        _sort(order, start, slots[i])
        start = slots[i]
    for k in range(len(order)):
        order[k] &= 0xFFFFFFFF
    return order


PARALLEL = 1e-3
"""Squared sine, at rest, below which a pair of edges is mollified (Li et al. 2020, IPC, section 4.1)."""

INDEX = (1 << 30) - 1
"""Bits of a key that hold the number of a primitive."""
NO_PAIRS_FOUND: FoundPairs = np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)


class Search:
    """Trees of one surface: built at the first search, refitted where something has moved."""

    def __init__(self, surface: ContactSurface) -> None:
        self.surface = surface
        self._first, self._second = _Trees(surface.first), _Trees(surface.second)
        self._areas = surface.edge_areas(surface.first.edges), surface.edge_areas(surface.second.edges)
        self._point_areas = surface.vertex_areas.copy()
        self._point_areas[surface.flat.points] = 0.0
        self._flat = surface.are_flat(surface.second.edges)
        self._lengths = surface.rest_lengths(surface.first.edges), surface.rest_lengths(surface.second.edges)

    def pairs(
        self, before: Floats, after: Floats, distance: float, only: np.ndarray | None = None
    ) -> tuple[Pairs, Floats]:
        """All pairs that may come closer than `distance` on a linear path of all vertices.

        Parameters
        ----------
        before, after : (N, 3) array
            Ends of the path [m].
        distance : float
            Distance [m].
        only : (N,) bool array, optional
            Only the pairs incident to one of these rows of x, all of which belong to the first group.

        Returns
        -------
        pairs : Pairs
            The pairs, sorted.
        distances : (p,) array
            Their distances at the start of the path [m].
        """
        surface = self.surface
        relative_end = after
        if surface.is_self_contact and only is None:  # a common translation changes no distance
            common = (after - before)[surface.rows].mean(axis=0)
            relative_end = after - common if np.isfinite(common).all() else after
        path = before.copy(), relative_end.copy()
        first_trees = self._first.set_path(path)
        second_trees = first_trees if surface.is_self_contact else self._second.set_path(path)

        def found(
            first_tree: BoxTree, second_tree: BoxTree, only: np.ndarray | None, without: np.ndarray | None = None
        ) -> FoundPairs:
            conditions = surface.labels, surface.allowed, before, after, distance
            return candidate_pairs(first_tree, second_tree, distance, *conditions, only, without)

        def points_and_triangles() -> tuple[FoundPairs, FoundPairs]:
            point_triangle = found(first_trees["points"], second_trees["triangles"], only)
            if surface.is_self_contact and only is None:
                return point_triangle, NO_PAIRS_FOUND
            excluded_points = only if surface.is_self_contact else None  # their pairs are in point_triangle
            return point_triangle, found(first_trees["triangles"], second_trees["points"], only, excluded_points)

        def edges() -> tuple[FoundPairs, FoundPairs]:
            return found(first_trees["edges"], second_trees["edges"], only), NO_PAIRS_FOUND

        (point_triangle, triangle_point), (edge_edge, _) = together(points_and_triangles, edges)
        swapped = triangle_point[1], triangle_point[0], triangle_point[2]
        if surface.is_self_contact:
            both = tuple(np.concatenate(two) for two in zip(point_triangle, swapped, strict=True))
            return self._assembled(cast("FoundPairs", both), NO_PAIRS_FOUND, edge_edge)
        return self._assembled(point_triangle, swapped, edge_edge)

    def of_keys(self, keys: Ints) -> Pairs:
        """The pairs with given `Pairs.keys`, ascending."""
        kinds = [keys[keys >> 60 == kind] for kind in range(3)]
        return self._assembled(*((own >> 30 & INDEX, own & INDEX, np.zeros(len(own))) for own in kinds))[0]

    def _assembled(self, *found: FoundPairs) -> tuple[Pairs, Floats]:
        """Pair list of points of the first group and triangles of the second, the reverse, and edges of both.

        The triangles of a point follow one another.
        """
        first, second = self.surface.first, self.surface.second
        orders = [lexicographic_order(a, b) for a, b, _ in found]
        points, others, edges = ((a[order], b[order]) for (a, b, _), order in zip(found, orders, strict=True))
        elements = (
            concatenated_rows(first.points[:, None], points[0], second.triangles, points[1]),
            concatenated_rows(second.points[:, None], others[0], first.triangles, others[1]),
            concatenated_rows(first.edges, edges[0], second.edges, edges[1]),
        )
        n_points = len(elements[0]) + len(elements[1])
        point_rows = np.concatenate(elements[:2])[:, 0]
        areas = self._areas[0][edges[0]] + self._areas[1][edges[1]]
        areas[self._flat[edges[1]]] = 0.0
        lengths = self._lengths[0][edges[0]] * self._lengths[1][edges[1]]
        pair_list = Pairs(
            np.concatenate(elements),
            np.concatenate([self._point_areas[point_rows], areas]) / 4,
            np.concatenate([np.zeros(n_points), PARALLEL * lengths**2]),
            np.concatenate([kind << 60 | a << 30 | b for kind, (a, b) in enumerate((points, others, edges))]),
            n_points,
        )
        distances = [each[order] for (_, _, each), order in zip(found, orders, strict=True)]
        return pair_list, np.concatenate(distances)


class _Trees:
    """Trees over the points, edges and triangles of one group, for one path."""

    def __init__(self, primitives: Primitives) -> None:
        self._elements = {
            "points": primitives.points[:, None],
            "edges": primitives.edges,
            "triangles": primitives.triangles,
        }
        self._trees: dict[str, BoxTree] = {}
        self._paths: dict[str, tuple[Floats, Floats]] = {}
        self._path = np.zeros((0, 3)), np.zeros((0, 3))
        self._moved: tuple[tuple[Floats, Floats], np.ndarray] | None = None

    def set_path(self, path: tuple[Floats, Floats]) -> "_Trees":
        """Set the path (N, 3) [m] of the trees; the arrays must not change afterwards."""
        self._path, self._moved = path, None
        return self

    def __getitem__(self, kind: str) -> BoxTree:
        if kind not in self._trees:
            self._trees[kind] = build_tree(self._elements[kind], *self._path)
        elif self._paths[kind] is not self._path:
            moved = self._moved_since(self._paths[kind])
            if moved.any():
                refit(self._trees[kind], *self._path, moved)
        self._paths[kind] = self._path
        return self._trees[kind]

    def _moved_since(self, path: tuple[Floats, Floats]) -> np.ndarray:
        """Rows of x (N,) whose path has changed; cached, as most often all kinds had the same path."""
        known = self._moved  # two threads may ask for paths of their own
        if known is None or known[0] is not path:
            self._moved = known = path, _rows_differ(*path, *self._path)
        return known[1]


@kernel
def _rows_differ(before: Floats, after: Floats, other_before: Floats, other_after: Floats) -> np.ndarray:
    """Rows in which two paths differ (N,); NaN differs from all."""
    differ = np.empty(len(before), np.bool_)
    for i in range(len(before)):
        same = True
        for k in range(3):
            same &= (before[i, k] == other_before[i, k]) & (after[i, k] == other_after[i, k])
        differ[i] = not same
    return differ
