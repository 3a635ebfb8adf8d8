"""Trunk, legs and arms of a standing body: their axes, girths and extents, and which vertices belong to which.

Hands, feet and head are the points farthest from the body's middle along the surface; the crotch is the bend of the
shortest path from foot to foot, an armpit that of the path from a hand to the foot on its side. An arm is the part
nearer to its hand along the surface than its armpit is, whatever its pose; trunk and legs are cut by horizontal planes.
"""

from dataclasses import dataclass

import numpy as np

from transfer.body_frame import BodyFrame, body_frame
from transfer.landmarks import bend, tips
from transfer.level_sets import Ring, girth, level_set
from transfer.triangle_surface import Floats, Ints, largest_component, vertex_components

SECTIONS = 24
"""Sections of the trunk, of a leg and of an arm."""
HAND = 0.22
"""Fraction of the length of an arm that is its hand: no rings are taken there, where fingers branch."""
FOOT = 0.05
"""Height of the lowest section of a leg as a fraction of the height of the crotch."""


@dataclass(frozen=True)
class Tube:
    """Sections along a limb or the trunk.

    Attributes
    ----------
    levels : ndarray (k,)
        Increasing parameters: heights [m] of the trunk and the legs, fractions of the length of an arm from its hand.
    centres : ndarray (k, 3)
        Centroids in the body's frame [m].
    extents : ndarray (k, 2)
        Half widths to the side and to the front [m].
    girths : ndarray (k,)
        Tape lengths [m].
    """

    levels: Floats
    centres: Floats
    extents: Floats
    girths: Floats

    def at(self, levels: Floats, values: Floats) -> Floats:
        """`values` (k, ...) interpolated at `levels`; constant beyond the ends."""
        columns = values.reshape(len(values), -1).T
        result = np.stack([np.interp(levels, self.levels, column) for column in columns], axis=-1)
        return result.reshape(np.shape(levels) + values.shape[1:])


@dataclass(frozen=True)
class BodyParts:
    """Parts of a body in its frame.

    Attributes
    ----------
    frame : BodyFrame
    landmarks : dict of str to float
        Heights of crotch, armpit, neck and crown above the ground [m].
    trunk : Tube
    legs, arms : tuple of Tube
        Left, right.
    hands : ndarray (2, n)
        Distance of each vertex from either hand along the surface as a fraction of that of the armpit.
    tips : ndarray (2, 3)
        Finger tips in the body's frame [m].
    """

    frame: BodyFrame
    landmarks: dict[str, float]
    trunk: Tube
    legs: tuple[Tube, Tube]
    arms: tuple[Tube, Tube]
    hands: Floats
    tips: Floats


def body_parts(positions: Floats, triangles: Ints, up: Floats | None = None) -> BodyParts:
    """Find the parts of the largest component of a standing body, (n, 3) and (m, 3).

    TransferError where it does not stand on two legs, or has other than two arms.
    """
    labels = vertex_components(triangles, len(positions))
    faces = triangles[labels[triangles[:, 0]] == largest_component(triangles, labels)]
    frame = body_frame(positions, faces, up)
    local = frame.local(positions)
    extremes, predecessors, distances = tips(local, faces)
    order = np.argsort(local[extremes, 1])  # feet, hands, head
    by_side = [order[k : k + 2][np.argsort(-local[extremes[order[k : k + 2]], 0])] for k in (0, 2)]
    (foot, other_foot), both_hands = by_side
    crotch = local[bend(local, predecessors[foot], extremes[foot], extremes[other_foot]), 1]
    pits = [
        bend(local, predecessors[hand], extremes[hand], extremes[sole])
        for hand, sole in zip(both_hands, (foot, other_foot), strict=True)
    ]
    # One length for both arms: where they are level the bend is a broad one and lies now here, now there.
    reach = np.mean([distances[hand][pit] for hand, pit in zip(both_hands, pits, strict=True)])
    hands = np.stack([distances[hand] / reach for hand in both_hands])
    armpit = float(np.mean(local[pits, 1]))
    body = faces[(hands[:, faces] > 1.0).any(axis=2).all(axis=0)]
    crown = frame.height
    neck = neck_height(local, body, armpit, crown)
    landmarks = {"crotch": float(crotch), "armpit": armpit, "neck": neck, "crown": crown}
    trunk = tube_of(local, body, local[:, 1], np.linspace(crotch + 0.01 * crown, 0.99 * crown, SECTIONS))
    heights = np.linspace(FOOT * crotch, 0.97 * crotch, SECTIONS)
    legs = tuple(
        tube_of(local, faces[(sign * local[faces, 0] > 0).all(axis=1)], local[:, 1], heights) for sign in (1, -1)
    )
    fractions = np.linspace(HAND, 1.0, SECTIONS)
    arms = tuple(tube_of(local, faces, along, fractions) for along in hands)
    return BodyParts(
        frame, landmarks, trunk, (legs[0], legs[1]), (arms[0], arms[1]), hands, local[extremes[both_hands]]
    )


def neck_height(local: Floats, body: Ints, armpit: float, crown: float) -> float:
    """Height of the least girth between the armpits and the head's middle [m]."""
    heights = np.linspace(armpit + 0.3 * (crown - armpit), armpit + 0.75 * (crown - armpit), 24)
    girths = [girth(level_set(local, body, local[:, 1], height)) for height in heights]
    return float(heights[int(np.argmin(girths))])


def tube_of(local: Floats, triangles: Ints, field: Floats, levels: Floats) -> Tube:
    """Sections of the triangles at `levels` (k,) of `field` (n,), smoothed by their neighbours."""
    rings = [(level, level_set(local, triangles, field, level)) for level in levels]
    kept = [(level, ring) for level, ring in rings if len(ring.starts) > 2]
    centres = smoothed(np.stack([ring.centre for _, ring in kept]))
    extents = smoothed(np.stack([half_widths(ring) for _, ring in kept]))
    girths = smoothed(np.array([girth(ring) for _, ring in kept]))
    return Tube(np.array([level for level, _ in kept]), centres, extents, girths)


def half_widths(ring: Ring) -> Floats:
    """Half of the ring's extents to the side and to the front, (2,) [m]."""
    points = np.concatenate([ring.starts, ring.ends])
    return np.asarray(np.ptp(points, axis=0)[[0, 2]] / 2.0)


def smoothed(values: Floats) -> Floats:
    """Means of three neighbours of `values` (k, ...), the ends kept."""
    result = values.copy()
    result[1:-1] = (values[:-2] + 2.0 * values[1:-1] + values[2:]) / 4.0
    return result
