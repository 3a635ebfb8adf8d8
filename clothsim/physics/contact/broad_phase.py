"""Broad phase: element pairs of two trees that may come close on a linear path, culled by separating directions.

Overlap is closed: boxes that touch overlap. The pairs found depend on the elements alone, their order on the trees. The
four boxes of a node traverse the other tree together, down to the leaf nodes they overlap; there box is compared with
box. Most overlapping pairs are neighbours in one cloth: those are rejected at once and never listed.
"""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel, part
from clothsim.physics.contact.bvh import WIDTH, BoxTree
from clothsim.physics.contact.culling import (
    ROUND_OFF_FACTOR,
    distance_unless_separated,
    have_common_vertex,
    relative_vertices,
    separated_by_centroids,
    vertex_rows,
)
from clothsim.physics.contact.simd_boxes import overlap_mask

# 4-wide BVH traversal: four queries at a time.

STACK_SIZE = 128
"""Capacity of the traversal stack, 3 a level: more than for the 2^31 boxes that 31 bits distinguish."""


@part
def gather_queries(
    query_node: int, boxes: Floats, queried: np.ndarray, inflation: float, queries: Floats, bounds: Floats
) -> bool:
    """Copy the queried boxes of a node, inflated, to `queries`, their enclosing box to `bounds`; False if none."""
    start, any_queried = WIDTH * query_node, False
    for index in range(start, min(start + WIDTH, len(queried))):
        any_queried |= queried[index]
    if not any_queried:
        return False
    for side in range(6):
        bounds[side] = np.inf if side < 3 else -np.inf
    for k in range(WIDTH):
        present = start + k < len(queried) and queried[start + k]
        for axis in range(3):
            low = boxes[query_node, axis, k] - inflation if present else np.nan
            high = boxes[query_node, 3 + axis, k] + inflation if present else np.nan
            queries[k, axis], queries[k, 3 + axis] = low, high
            bounds[axis] = low if low < bounds[axis] else bounds[axis]
            bounds[3 + axis] = high if high > bounds[3 + axis] else bounds[3 + axis]
    return True


@part
def overlapped_nodes(
    box: Floats, query_node: int, boxes: Floats, starts: Ints, after_query: bool, stack: Ints, hit_nodes: Ints
) -> int:
    """Write the leaf nodes that contain a box overlapping `box` (6,) to `hit_nodes`; returns their number.

    after_query: only the query's own node and those after it on each level. The stack holds a node and, in its last
    eight bits, the level.
    """
    # as scalars: the compiler then knows that the arrays written to do not alias the box
    a, b, c, d, e, f = box[0], box[1], box[2], box[3], box[4], box[5]
    top = n_hits = 0
    if after_query or len(starts) == 2:
        hit_nodes[0], n_hits = (query_node if after_query else 0), 1
    else:
        stack[0], top = (starts[-1] - 1) << 8 | (len(starts) - 2), 1
    index, level = query_node, 1
    while top > 0 or (after_query and level < len(starts) - 1):
        first_child = 0
        if top > 0:
            top -= 1
            node, node_level = stack[top] >> 8, stack[top] & 255
        else:
            first_child, node_level = index + 1, level  # those after `index` in their parent
            index, level = index // WIDTH, level + 1
            node = starts[node_level] + index
        child = WIDTH * (node - starts[node_level])
        mask = overlap_mask(boxes, node, a, b, c, d, e, f)
        if child < first_child:
            mask = mask >> (first_child - child) << (first_child - child)
        for k in range(WIDTH):  # branch-free: all four are written, only hits advance the counter
            hit = mask >> k & 1
            if node_level == 1:
                hit_nodes[n_hits] = child + k
                n_hits += hit
            else:
                stack[top] = (starts[node_level - 1] + child + k) << 8 | (node_level - 1)
                top += hit
    return n_hits


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
