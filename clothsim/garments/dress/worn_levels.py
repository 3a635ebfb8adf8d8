"""Heights at which a pattern is worn on the body that it was cut for.

Panels are drawn flat. What hangs from the shoulders is worn higher than it is drawn: cloth that is as long as the way
over the chest or the back ends above the level at which it would hang straight.
"""

from collections.abc import Callable, Collection, Mapping

import numpy as np

from clothsim import Pattern
from clothsim.base.arrays import Floats
from clothsim.garments.dress.closing import is_on_top
from clothsim.garments.dress.placement import is_of_arm
from clothsim.garments.inputs import BodyMesh
from transfer.body_frame import level_set
from transfer.errors import TransferError

SIDE_OF_NECK = 0.05
"""Distance of the highest point of a shoulder from the middle of the body, as a fraction of its height."""
LIFT = 0.025
"""Depth of the top of a garment below that point, as a fraction of the body's height, up to which it is drawn too low;
what is drawn LIFT deeper is less so, and from three times LIFT on, as a strapless bodice, it is worn where it is."""
SAMPLES = 60
"""Heights at which a body is cut."""


def worn_levels(pattern: Pattern, body: BodyMesh, floor: float) -> Mapping[str, Callable[[Floats], Floats]]:
    """Functions from heights at which panels are drawn to those at which they are worn, (k,) [m] above the ground.

    With s(h) the length of cloth from the top of the shoulder down to a height h of the body, t the height of the top
    of a garment as it is drawn and t' as it is worn, what is drawn at y is worn at h: s(h) = s(t') + t - y.

    Parameters
    ----------
    pattern : Pattern
        Pattern as placed round the body.
    body : BodyMesh
        The body that it was cut for. TransferError where it does not stand.
    floor : float
        Height of y = 0 of the pattern above the ground [m].

    Returns
    -------
    mapping of str to callable
        By name, of the panels that are neither of an arm nor sewn to the finished torso.
    """
    panels = {name: p for name, p in pattern.panels.items() if not is_of_arm(p) and not is_on_top(p)}
    lengths, heights = hanging_line(body)
    found = {}
    for names in sewn_together(pattern, panels):
        top = max(float(panels[name].placed(panels[name].outline)[:, 1].max()) for name in names) + floor
        below, lift = float(heights[0]) - top, LIFT * body.height
        worn_top = top + float(np.interp(below, [0.0, lift, 3.0 * lift], [0.0, lift, 0.0]))
        start = _along(worn_top, heights, lengths)
        for name in names:
            found[name] = _worn(start + top, lengths, heights)
    return found


def _along(height: float, heights: Floats, lengths: Floats) -> float:
    """Length of cloth from the top of the shoulder down to a height [m]; negative above it."""
    beyond = max(height - heights[0], 0.0) + min(height - heights[-1], 0.0)
    return float(np.interp(-height, -heights, lengths)) - beyond


def _worn(total: float, lengths: Floats, heights: Floats) -> Callable[[Floats], Floats]:
    """h(y) with s(h) = total - y."""

    def worn(drawn: Floats) -> Floats:
        length = total - drawn
        beyond = np.maximum(length - lengths[-1], 0.0) + np.minimum(length - lengths[0], 0.0)
        return np.interp(length, lengths, heights) - beyond

    return worn


def sewn_together(pattern: Pattern, names: Collection[str]) -> list[set[str]]:
    """Sets of those panels that are joined by stitches between them."""
    pieces = [{name} for name in sorted(names)]
    for stitch in pattern.stitches:
        sides = {side.panel for side in stitch.sides}
        if sides <= set(names):
            joined = [piece for piece in pieces if piece & sides]
            pieces = [piece for piece in pieces if not piece & sides] + [set().union(*joined)]
    return pieces


def hanging_line(body: BodyMesh) -> tuple[Floats, Floats]:
    """Lengths of cloth from the top of the shoulders down to heights of a body, both (k,) [m].

    The mean of four lines: over the front and the back of both sides of the neck.
    """
    closed = body.closed
    parts = closed.parts
    local, marks = parts.frame.local(closed.positions), parts.landmarks
    tops, lines = [], []
    for side in (SIDE_OF_NECK, -SIDE_OF_NECK):
        ring = level_set(local, closed.triangles, local[:, 0], side * marks["crown"])
        segments = np.stack([ring.starts, ring.ends], axis=1)[:, :, 1:]  # (s, 2, 2): heights and depths
        segments = segments[
            (segments[:, :, 0] > marks["crotch"]).any(axis=1) & (segments[:, :, 0] < marks["neck"]).all(axis=1)
        ]
        if not len(segments):
            raise TransferError(f"{body.name} has no shoulders beside its neck.", "Give the pattern as it is cut.")
        corner = segments.reshape(-1, 2)[segments[:, :, 0].argmax()]
        tops.append(float(corner[0]))
        heights = np.linspace(corner[0], marks["crotch"], SAMPLES)
        lines += [length_over(heights, sign * corner[1], sign, segments) for sign in (1.0, -1.0)]
    top = float(np.mean(tops))
    heights = np.linspace(top, marks["crotch"], SAMPLES)
    return np.mean(lines, axis=0), heights


def length_over(heights: Floats, start: float, sign: float, segments: Floats) -> Floats:
    """Lengths of cloth over the segments (s, 2, 2) of a section down to heights (k,), spanning what is hollow.

    The upper convex hull of the outline, by gift wrapping, up to the height at which it protrudes most; from there the
    cloth hangs straight. start: depth of the top; sign: 1 for the front, -1 for the back.
    """
    out = np.full(len(heights), -np.inf)
    out[0] = start
    (a, b), (p, q) = segments[:, :, 0].T, sign * segments[:, :, 1].T
    for k, height in enumerate(heights[1:], start=1):
        cut = ((a - height) * (b - height) <= 0) & (a != b)
        if cut.any():
            t = (height - a[cut]) / (b[cut] - a[cut])
            out[k] = (p[cut] + t * (q[cut] - p[cut])).max()
    corners = [0]
    while corners[-1] < len(heights) - 1:
        k = corners[-1]
        slopes = (out[k + 1 :] - out[k]) / (heights[k] - heights[k + 1 :])
        if slopes.max() <= 0:
            break
        corners.append(k + 1 + int(np.argmax(slopes)))
    lengths = np.hypot(np.diff(heights[corners]), np.diff(out[corners]))
    at = np.concatenate([[0.0], np.cumsum(lengths)])
    below = np.maximum(heights[corners[-1]] - heights, 0.0)
    return np.interp(-heights, -heights[corners], at) + below
