"""Candidate search of a surface: broad phase over its trees, assembled to a pair list.

The broad phase finds element pairs of two trees that may come close on a linear path, culled by separating directions.
Overlap is closed: boxes that touch overlap. The pairs found depend on the elements alone, their order on the trees.
The four boxes of a node traverse the other tree together, down to the leaf nodes they overlap; there box is compared
with box. Most overlapping pairs are neighbours in one cloth: those are rejected at once and never listed.
"""

from typing import cast

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel, natural, part
from clothsim.base.parallel import together
from clothsim.physics.contact.bvh import (
    STACK_SIZE,
    WIDTH,
    BoxTree,
    build_tree,
    gather_queries,
    overlap_mask,
    overlapped_nodes,
    refit,
)
from clothsim.physics.contact.ccd import (
    ROUND_OFF_FACTOR,
    distance_unless_separated,
    have_common_vertex,
    relative_vertices,
    separated_by_centroids,
    vertex_rows,
)
from clothsim.physics.contact.pair_list import NO_PAIRS, Pairs
from clothsim.physics.contact.surface import ContactSurface, Primitives

FoundPairs = tuple[Ints, Ints, Floats]
"""First and second element of each pair and their distance [m], (p,) each."""


def candidate_pairs(
    first: BoxTree,
    second: BoxTree,
    inflation: float,
    labels: Ints,
    allowed: np.ndarray,
    before: Floats,
    after: Floats,
    distance: float,
    only: np.ndarray | None = None,
    without: np.ndarray | None = None,
) -> FoundPairs:
    """Elements i of the first and j of the second tree that may come close on a linear path.

    Points and triangles, triangles and points, or edges; in one and the same tree, i < j. Pairs with a common vertex
    are excluded.

    Parameters
    ----------
    first, second : BoxTree
        Trees over the elements; the same object for pairs within one tree.
    inflation : float
        Enlargement of the boxes of the first tree on each side [m].
    labels : (N,) int array
        Object of each row of x.
    allowed : (L, L) bool array
        Pairs of objects that may touch.
    before, after : (N, 3) array
        Ends of the path [m].
    distance : float
        Distance below which the elements must come somewhere on the path [m].
    only : (N,) bool array, optional
        Only elements i incident to one of these rows (in one and the same tree: or such j).
    without : (N,) bool array, optional
        No elements j incident to one of these rows.

    Returns
    -------
    FoundPairs
        i, j and the distance at the start of the path [m].
    """
    self_query, unrestricted = first is second, only is None and without is None
    if first.elements.shape[1] == 3:
        allowed = np.ascontiguousarray(allowed.T)
    conditions = labels, allowed, before, after, distance
    second_first = unrestricted and len(second.order) < len(first.order)  # the smaller tree queries the larger one
    query_tree, target_tree = (second, first) if second_first else (first, second)
    queried = np.ones(len(query_tree.order), bool) if only is None else query_tree.incident(only)
    skipped = queried  # in one and the same tree a pair of two queried elements would be found twice
    if not self_query:
        skipped = np.zeros(len(target_tree.order), bool) if without is None else target_tree.incident(without)
    query_arrays = query_tree.boxes, query_tree.elements, query_tree.order, queried
    other = target_tree.boxes, target_tree.elements, target_tree.order, skipped, target_tree.starts
    points_second = (first.elements.shape[1] == 3) != second_first
    after_query = self_query and unrestricted
    found = _candidate_pairs(*query_arrays, *other, inflation, self_query, after_query, points_second, *conditions)
    return (found[1], found[0], found[2]) if second_first else found


@kernel
def _candidate_pairs(
    boxes_a: Floats,
    elements_a: Ints,
    order_a: Ints,
    queried: np.ndarray,
    boxes: Floats,
    elements: Ints,
    order: Ints,
    skipped: np.ndarray,
    starts: Ints,
    inflation: float,
    self_query: bool,
    after_query: bool,
    second_first: bool,
    labels: Ints,
    allowed: np.ndarray,
    before: Floats,
    after: Floats,
    distance: float,
) -> tuple[Ints, Ints, Floats]:
    """Compiled part of `candidate_pairs`; queried (m,): elements i, by their leaves; skipped: elements j.

    self_query: a tree with itself, the smaller index first, and j is skipped only where it comes before i; after_query:
    all are queried, and only leaves j from the node of i on are visited; second_first: j comes before i in a pair's
    rows.
    """
    is_edges, distance_squared = elements.shape[1] == 2, (distance * ROUND_OFF_FACTOR) ** 2
    queries, bounds, stack = np.empty((WIDTH, 6)), np.empty(6), np.empty(STACK_SIZE, np.int64)
    hit_nodes, overlaps = np.empty(starts[1] + WIDTH, np.int64), np.empty(WIDTH * WIDTH * (starts[1] + 1), np.int64)
    found, distances, count = np.empty(1024, np.int64), np.empty(1024), 0
    for node in range((len(queried) + WIDTH - 1) // WIDTH):
        if not gather_queries(node, boxes_a, queried, inflation, queries, bounds):
            continue
        n_hits = overlapped_nodes(bounds, node, boxes, starts, after_query, stack, hit_nodes)
        n_overlaps = _overlapping_boxes(node, queries, boxes, hit_nodes, n_hits, overlaps)
        n_overlaps = _non_incident_pairs(
            overlaps, n_overlaps, elements_a, elements, skipped, self_query, second_first, is_edges
        )
        if count + n_overlaps > len(found):
            size = 2 * (count + n_overlaps)
            found, distances = _enlarged(found, count, size), _enlarged(distances, count, size)
        for n in range(n_overlaps):
            i, j = overlaps[n] >> 32, overlaps[n] & 0xFFFFFFFF
            one, other = order_a[i], order[j]
            swapped = self_query and other < one
            rows = _pair_rows(elements_a, i, elements, j, is_edges, swapped != second_first)
            if not allowed[labels[rows[0]], labels[rows[3]]]:
                continue
            x, y = relative_vertices(before, rows), relative_vertices(after, rows)
            if separated_by_centroids(x, y, is_edges, distance_squared):
                continue
            separation = distance_unless_separated(x, y, is_edges, distance_squared)
            if separation >= 0.0:
                found[count], distances[count] = other << 32 | one if swapped else one << 32 | other, separation
                count += 1
    first, second = np.empty(count, np.int64), np.empty(count, np.int64)
    for k in range(count):
        first[k], second[k] = found[k] >> 32, found[k] & 0xFFFFFFFF
    return first, second, distances[:count].copy()


@part
def _overlapping_boxes(node: int, queries: Floats, boxes: Floats, hit_nodes: Ints, n_hits: int, overlaps: Ints) -> int:
    """Write the leaf pairs of queries and boxes in the hit nodes that overlap, i << 32 | j; returns their number."""
    count = 0
    for m in range(n_hits):
        other = hit_nodes[m]
        for k in range(WIDTH):
            a, b, c, d, e, f = queries[k, 0], queries[k, 1], queries[k, 2], queries[k, 3], queries[k, 4], queries[k, 5]
            mask = overlap_mask(boxes, other, a, b, c, d, e, f)
            pair = (WIDTH * node + k) << 32 | WIDTH * other
            for j in range(WIDTH):  # branch-free: all four are written, only overlaps advance the counter
                overlaps[count] = pair | j
                count += mask >> j & 1
    return count


@part
def _non_incident_pairs(
    overlaps: Ints, n: int, a: Ints, b: Ints, skipped: np.ndarray, self_query: bool, second_first: bool, is_edges: bool
) -> int:
    """Keep the leaf pairs without a common vertex and without a skipped j; returns their number."""
    count = 0
    for k in range(n):
        pair = overlaps[k]
        i, j = pair >> 32, pair & 0xFFFFFFFF
        excluded = skipped[j] & ((not self_query) | (j <= i))
        overlaps[count] = pair
        count += not (excluded | have_common_vertex(_pair_rows(a, i, b, j, is_edges, second_first), is_edges))
    return count


@part
def _pair_rows(a: Ints, i: int, b: Ints, j: int, is_edges: bool, second_first: bool) -> tuple[int, int, int, int]:
    """Rows of x of the elements i of a and j of b, those of b first if second_first."""
    return vertex_rows(b, j, a, i, is_edges) if second_first else vertex_rows(a, i, b, j, is_edges)


@part
def _enlarged(found: np.ndarray, used: int, size: int) -> np.ndarray:
    """A copy of the used part in a longer array."""
    enlarged = np.empty(size, found.dtype)
    for k in range(used):  # element by element: a slice assignment takes 1.5 s more to compile, for its error message
        enlarged[k] = found[k]
    return enlarged


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


class CandidateSearch:
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
        before, after = surface.read(before), surface.read(after)
        only = None if only is None else surface.read(only)
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
        if not any(len(each) for each, _, _ in found):
            return NO_PAIRS, np.zeros(0)
        first, second = self.surface.first, self.surface.second
        orders = [lexicographic_order(a, b) for a, b, _ in found]
        ends = np.cumsum([len(order) for order in orders])
        n = int(ends[-1])
        columns = np.empty((n, 4), np.int64), np.empty(n), np.empty(n), np.empty(n, np.int64)
        pairs, distances = Pairs(*columns, n_points=int(ends[1])), np.empty(n)
        written = *columns, distances
        sides = (first.points, second.triangles), (second.points, first.triangles)
        for kind, (points, triangles) in enumerate(sides):
            at = int(ends[kind]) - len(orders[kind])
            _list_point_pairs(*written, at, kind, *found[kind], orders[kind], points, triangles, self._point_areas)
        of_edges = first.edges, second.edges, *self._areas, self._flat, *self._lengths
        _list_edge_pairs(*written, int(ends[1]), *found[2], orders[2], *of_edges)
        return pairs, distances


@kernel
def _list_point_pairs(
    elements: Ints,
    weights: Floats,
    thresholds: Floats,
    keys: Ints,
    distances: Floats,
    at: int,
    kind: int,
    a: Ints,
    b: Ints,
    found: Floats,
    order: Ints,
    points: Ints,
    triangles: Ints,
    areas: Floats,
) -> None:
    """Write pairs of points a and triangles b, in an order, and their distances to rows of a list from `at` on."""
    for n in range(len(order)):
        k, row = order[n], natural(at + n)
        point, triangle = points[a[k]], b[k]
        elements[row, 0], weights[row], thresholds[row], distances[row] = point, areas[point] / 4, 0.0, found[k]
        for corner in range(3):
            elements[row, 1 + corner] = triangles[triangle, corner]
        keys[row] = kind << 60 | a[k] << 30 | triangle


@kernel
def _list_edge_pairs(
    elements: Ints,
    weights: Floats,
    thresholds: Floats,
    keys: Ints,
    distances: Floats,
    at: int,
    a: Ints,
    b: Ints,
    found: Floats,
    order: Ints,
    edges: Ints,
    others: Ints,
    areas: Floats,
    other_areas: Floats,
    flat: np.ndarray,
    lengths: Floats,
    other_lengths: Floats,
) -> None:
    """Write pairs of edges a and b, in an order, and their distances to rows of a list from `at` on."""
    for n in range(len(order)):
        k, row = order[n], natural(at + n)
        i, j = a[k], b[k]
        for end in range(2):
            elements[row, end], elements[row, 2 + end] = edges[i, end], others[j, end]
        length = lengths[i] * other_lengths[j]
        weights[row] = 0.0 if flat[j] else (areas[i] + other_areas[j]) / 4
        thresholds[row], distances[row] = PARALLEL * (length * length), found[k]
        keys[row] = 2 << 60 | i << 30 | j


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
            path, known = self._paths[kind], self._moved  # two threads may ask for paths of their own
            if known is None or known[0] is not path:  # most often all kinds had the same path
                self._moved = known = path, _rows_differ(*path, *self._path)
            if known[1].any():
                refit(self._trees[kind], *self._path, known[1])
        self._paths[kind] = self._path
        return self._trees[kind]


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
