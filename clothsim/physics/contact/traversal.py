"""4-wide BVH traversal: four queries at a time."""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import part
from clothsim.physics.contact.bvh import WIDTH
from clothsim.physics.contact.simd_boxes import overlap_mask

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
