"""Four boxes walk through a tree as one, to the fours that they meet."""

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.contact.bvh import FOUR
from clothsim.contact.simd_boxes import that_overlap
from clothsim.jit import part

DEPTH = 128
"""Deepest stack of a walk, 3 a level: more than the 2^31 boxes that 31 bits tell apart."""


@part
def gathered(four: int, boxes: Floats, asked: np.ndarray, grown: float, group: Floats, whole: Floats) -> bool:
    """The boxes of a four that are asked for, grown, to `group`, and the one that holds them; whether there are any."""
    start, some = FOUR * four, False
    for place in range(start, min(start + FOUR, len(asked))):
        some |= asked[place]
    if not some:
        return False
    for side in range(6):
        whole[side] = np.inf if side < 3 else -np.inf
    for k in range(FOUR):
        mine = start + k < len(asked) and asked[start + k]
        for axis in range(3):
            low = boxes[four, axis, k] - grown if mine else np.nan
            high = boxes[four, 3 + axis, k] + grown if mine else np.nan
            group[k, axis], group[k, 3 + axis] = low, high
            whole[axis] = low if low < whole[axis] else whole[axis]
            whole[3 + axis] = high if high > whole[3 + axis] else whole[3 + axis]
    return True


@part
def fours_met(box: Floats, four: int, boxes: Floats, starts: Ints, later: bool, stack: Ints, met: Ints) -> int:
    """Write the fours of elements that hold a box which meets `box` (6,) to `met`; how many it is.

    later: only from this four on: itself, and what comes after it on each level. The stack holds a four and, in its
    last eight bits, the level.
    """
    a, b, c, d, e, f = box[0], box[1], box[2], box[3], box[4], box[5]  # as numbers: what is written is no box
    top = n_met = 0
    if later or len(starts) == 2:
        met[0], n_met = (four if later else 0), 1
    else:
        stack[0], top = (starts[-1] - 1) << 8 | (len(starts) - 2), 1
    place, level = four, 1
    while top > 0 or (later and level < len(starts) - 1):
        above = 0
        if top > 0:
            top -= 1
            node, at = stack[top] >> 8, stack[top] & 255
        else:
            above, at = place + 1, level  # those after `place` in the four that holds it
            place, level = place // FOUR, level + 1
            node = starts[at] + place
        child = FOUR * (node - starts[at])
        hits = that_overlap(boxes, node, a, b, c, d, e, f)
        if child < above:
            hits = hits >> (above - child) << (above - child)
        for k in range(FOUR):  # all four are written, and count if they are met: no branch to foresee
            hit = hits >> k & 1
            if at == 1:
                met[n_met] = child + k
                n_met += hit
            else:
                stack[top] = (starts[at - 1] + child + k) << 8 | (at - 1)
                top += hit
    return n_met
