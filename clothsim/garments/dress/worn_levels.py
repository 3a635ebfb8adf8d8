"""Levels at which the panels of a pattern are worn on the body that it was cut for.

Panels are drawn flat and apart. What hangs from the shoulders is worn higher than it is drawn: a front panel lies over
the chest, so that its waist comes to the waist although it is drawn near the hips; and the gaps between panels close.
"""

from collections import deque
from collections.abc import Callable, Mapping

import numpy as np

from clothsim import Pattern
from clothsim.base.arrays import Floats
from clothsim.garments.dress.closing import is_on_top
from clothsim.garments.dress.placement import is_of_arm
from clothsim.garments.inputs import BodyMesh
from clothsim.patterns import Panel
from transfer.body_frame import level_set

SIDE_OF_NECK = 0.05
"""Distance of the highest point of a shoulder from the middle of the body, as a fraction of its height."""
REACH = 0.05
"""Depth below that point up to which the top of a garment hangs from it, as a fraction of the body's height."""
SAMPLES = 60
"""Heights at which the front and the back of a body are sampled."""

Levels = Callable[[Floats], Floats]
"""Heights at which cloth is worn, of those at which it is drawn, (k,) [m] above the ground."""


def worn_levels(pattern: Pattern, body: BodyMesh, origin: float) -> Mapping[str, Levels]:
    """Levels of each panel that is neither of an arm nor sewn to the finished torso.

    Parameters
    ----------
    pattern : Pattern
        Pattern as placed round the body.
    body : BodyMesh
        The body that it was cut for. TransferError where it does not stand.
    origin : float
        Height of y = 0 of the pattern above the ground [m].
    """
    panels = {name: p for name, p in pattern.panels.items() if not is_of_arm(p) and not is_on_top(p)}
    tops = {name: float(panel.placed(panel.outline)[:, 1].max()) + origin for name, panel in panels.items()}
    middle = np.mean([panel.placed(panel.vertices)[:, 2].mean() for panel in panels.values()] or [0.0])
    lines = {front: hanging_line(body, front) for front in (True, False)}
    found: dict[str, Levels] = {}
    for root in sorted(panels, key=lambda name: -tops[name]):  # the highest of each garment first
        if root in found:
            continue
        shifts = _shifts(pattern, panels, root)
        on_shoulders = tops[root] > float(lines[True][1][0]) - REACH * body.height
        for name, shift in shifts.items():
            ahead = bool(panels[name].placed(panels[name].vertices)[:, 2].mean() > middle)
            found[name] = _levels(tops[root], shift, *lines[ahead]) if on_shoulders else _shifted(shift)
    return found


def _levels(top: float, shift: float, depths: Floats, heights: Floats) -> Levels:
    def levels(drawn: Floats) -> Floats:
        below = top - (drawn + shift)
        return np.interp(below, depths, heights) - np.maximum(below - depths[-1], 0.0) - np.minimum(below, 0.0)

    return levels


def _shifted(shift: float) -> Levels:
    return lambda drawn: drawn + shift


def _shifts(pattern: Pattern, panels: Mapping[str, Panel], root: str) -> dict[str, float]:
    """How much higher than drawn each panel sewn to `root` is once the gaps at its seams are closed, by name [m]."""
    shifts, queue = {root: 0.0}, deque([root])
    while queue:
        name = queue.popleft()
        gaps: dict[str, list[float]] = {}
        for stitch in pattern.stitches:
            for here, there in (stitch.sides, stitch.sides[::-1]):
                if here.panel == name and there.panel in panels and there.panel not in shifts:
                    ends = [
                        panels[side.panel].placed(panels[side.panel].edge_points(side.edge, np.array([0.5])))[0, 1]
                        for side in (here, there)
                    ]
                    gaps.setdefault(there.panel, []).append(float(ends[0] - ends[1]))
        for other, apart in gaps.items():
            shifts[other] = shifts[name] + float(np.mean(apart))
            queue.append(other)
    return shifts


def hanging_line(body: BodyMesh, front: bool) -> tuple[Floats, Floats]:
    """Lengths of cloth from the top of the shoulder down the front or the back of a body, and their heights, (k,) [m].

    The line spans what is hollow, up to the height at which the body protrudes most: from there it hangs straight.
    """
    parts = body.parts
    local, marks, trunk = parts.frame.local(body.positions), parts.landmarks, parts.trunk
    ring = level_set(local, body.triangles, local[:, 0], SIDE_OF_NECK * marks["crown"])
    points = np.concatenate([ring.starts, ring.ends])
    below_head = points[(points[:, 1] > marks["armpit"]) & (points[:, 1] < marks["neck"])]
    shoulder = below_head[np.argmax(below_head[:, 1])] if len(below_head) else np.array([0.0, marks["neck"], 0.0])
    heights = np.linspace(shoulder[1], marks["crotch"], SAMPLES)
    sign = 1.0 if front else -1.0
    out = sign * trunk.at(heights, trunk.centres)[:, 2] + trunk.at(heights, trunk.extents)[:, 1]
    out[0] = sign * shoulder[2]
    corners = [0]
    while corners[-1] < SAMPLES - 1:  # a convex line: from each corner the steepest way outward
        k = corners[-1]
        slopes = (out[k + 1 :] - out[k]) / (heights[k] - heights[k + 1 :])
        if slopes.max() <= 0:
            break
        corners.append(k + 1 + int(np.argmax(slopes)))
    lengths = np.hypot(np.diff(heights[corners]), np.diff(out[corners]))
    return np.concatenate([[0.0], np.cumsum(lengths)]), heights[corners]
