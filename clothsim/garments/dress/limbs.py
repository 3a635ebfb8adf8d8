"""Limbs: which one is between the sides of a seam, which panels are the tube of a leg, poses to sew in.

Strings that run through a limb draw both sides of a seam to the far side of it, or leave the seam open: an inseam
between thighs that nearly touch, a wide skirt beside forearms. The garment is then sewn again with the legs parted or
the arms raised, and these come back under contact, as a person steps into trousers.
"""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from clothsim.base.arrays import Floats
from clothsim.base.triangles import unique_edges
from clothsim.engine import components
from clothsim.garments.dress.sewing_state import SewingState, body_hits
from clothsim.garments.fit.guaranteed_path import smoothed
from clothsim.garments.inputs import BodyMesh
from clothsim.patterns import MeshedSeam, PatternMesh
from transfer.errors import TransferError
from transfer.part_warp import arm_axis, part_weights
from transfer.signed_distance import BodySurface, body_surface


class Wearer(NamedTuple):
    """A body in a pose, its surface, and its way back to its own pose, (k, n, 3) [m]; none where it is in that."""

    body: BodyMesh
    surface: BodySurface
    way: Floats = np.zeros((0, 0, 3))


SIDES = ("left", "right")
HAND, FOREARM = 0.25, 0.6
"""Distances from the tip of an arm to the ends of its hand and of its forearm, as fractions of that of the armpit."""
TORSO = "torso"


def limb_names(body: BodyMesh) -> np.ndarray:
    """Name of the limb that each vertex of a body is of, (n,); "body" where it is not a standing body."""
    body = body.own_pose or body
    names = np.full(len(body.positions), "body", dtype="<U13")
    try:
        parts = body.parts
    except TransferError:
        return names
    local = parts.frame.local(body.positions)
    names[:] = TORSO
    names[local[:, 1] > parts.landmarks["neck"]] = "head"
    weights = part_weights(parts, local)
    for k, side in enumerate(SIDES):
        names[weights.legs[k] > 0.5] = f"{side} leg"
        names[weights.arms[k] > 0.5] = f"{side} arm"
        names[parts.hands[k] < FOREARM] = f"{side} forearm"
        names[parts.hands[k] < HAND] = f"{side} hand"
    return names


def limbs_between(state: SewingState, seams: Iterable[MeshedSeam], wearer: Wearer, farther: float) -> tuple[str, ...]:
    """Limbs that strings of some seams run through, longer than `farther` [m], those that most run through first.

    Of the wrap of what a body wears already: "clothes on the left arm".
    """
    pairs = np.concatenate([np.zeros((0, 2), np.int64), *(state.pairs(seam) for seam in seams)])
    ends = state.positions[pairs[state.distances(pairs) > farther]]
    hit = body_hits(ends, wearer.surface) if len(ends) else np.zeros(0, np.int64)
    body = wearer.body
    vertices = body.triangles[hit[hit >= 0], 0]
    limbs = limb_names(body)[vertices]
    names = np.where(vertices < len(body.bare.positions), limbs, np.char.add("clothes on the ", limbs))
    found, counts = np.unique(names, return_counts=True)
    return tuple(str(found[k]) for k in np.argsort(-counts, kind="stable"))


def legs_beside(state: SewingState, body: BodyMesh) -> tuple[str, ...]:
    """The legs where springs hold a seam that reaches below the crotch: wide cloth lies in folds between them."""
    try:
        crotch = body.floor + body.parts.landmarks["crotch"]
    except TransferError:  # it has no legs
        return ()
    low = [(state.positions[state.pairs(state.mesh.seams[k])] @ body.up < crotch).any() for k in state.open_seams]
    return ("left leg", "right leg") if any(low) else ()


SECTORS = 24
"""Directions from the axis of the body, or of a leg, in all of which a line round it lies."""


SAMPLES = 16
"""Points of a segment that are seen from the axis."""


def goes_round(segments: Floats) -> bool:
    """True where segments (s, 2, 2) lie in every direction from the origin, in sectors of 360 / SECTORS degrees."""
    points = segments[:, :1] + np.linspace(0, 1, SAMPLES)[:, None] * (segments[:, 1:] - segments[:, :1])
    angle = np.arctan2(points[..., 1], points[..., 0]).ravel()
    return len(np.unique(np.floor(angle / (2 * np.pi) * SECTORS).astype(np.int64) % SECTORS)) == SECTORS


TUBE_LEVELS = (0.1, 0.2, 0.3, 0.45)
"""Levels at which panels are cut to see whether they close, as fractions of their height."""


def form_a_tube(mesh: PatternMesh, names: list[str], up: Floats) -> bool:
    """True where panels as placed, with the strings between them, go round their own middle at a level.

    Those of a trouser leg do, with its inseam; the gores of a skirt on one side of the body do not.
    """
    inside = set(names)
    pairs = [seam.pairs for seam in mesh.seams if {side.panel for side in seam.stitch.sides} <= inside]
    if not pairs:
        return False
    triangles = np.concatenate([mesh.triangles[mesh.faces[name]] for name in names])
    heights, across = mesh.positions @ up, np.flatnonzero(up == 0)
    low, high = heights[triangles].min(), heights[triangles].max()
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2)
    for fraction in TUBE_LEVELS:
        above = heights[sides] - (low + fraction * (high - low))
        cut = (above[..., 0] > 0) != (above[..., 1] > 0)  # of a triangle with a corner on the level, two sides or none
        share = (above[cut][:, 0] / (above[cut][:, 0] - above[cut][:, 1]))[:, None]
        ends = mesh.positions[sides[cut]]
        cloth = ((1 - share) * ends[:, 0] + share * ends[:, 1]).reshape(-1, 2, 3)  # two sides of a triangle are cut
        level = low + fraction * (high - low)
        strings = [np.zeros((0, 2, 3))]  # of each seam that reaches the level the nearest
        for rows in pairs:
            middles = heights[rows].mean(axis=1)
            if middles.min() <= level <= middles.max():
                strings.append(mesh.positions[rows[[np.argmin(np.abs(middles - level))]]])
        lines = np.concatenate([cloth, *strings])[..., across]
        if len(lines) and goes_round(lines - lines.reshape(-1, 2).mean(axis=0)):
            return True
    return False


SPLIT = np.linspace(1.0, 0.85, 30)
"""Levels at which the legs are tried to be two pieces of the body, as fractions of the height of its crotch."""


LEG = 0.8
"""Height to which a piece of a leg reaches, at least, as a fraction of that at which the legs are cut off."""
ROOM = 0.003
"""Distance between the thighs in which cloth can lie, as a fraction of the body's height: 5 mm."""
THIN = 0.015
"""Half the height of the slice in which it is measured, as a fraction of the height of the crotch."""


def height_of_parting(body: BodyMesh) -> float:
    """Height of the highest level below the crotch at which cloth can lie between the thighs [m].

    That of the crotch where there is none. TransferError where it is not a standing body.
    """
    parts = body.parts
    local, crotch = parts.frame.local(body.positions), parts.landmarks["crotch"]
    side = _side_of_legs(body, local)
    for level in SPLIT * crotch:
        near = np.abs(local[:, 1] - level) < THIN * crotch
        left, right = (local[near & (side == sign), 0] for sign in (1, -1))
        if len(left) and len(right) and left.min() - right.max() > ROOM * parts.landmarks["crown"]:
            return float(level)
    return float(crotch)


def _side_of_legs(body: BodyMesh, local: Floats) -> Floats:
    """1 for each vertex of the left, -1 for one of the right: a thigh may reach across the middle of the body.

    The legs are two pieces of the body below its crotch, or up to a few millimetres lower where its mesh is coarse.
    What else is there, such as a shoe or a wrap of trousers, is of the nearer one.
    """
    side = np.asarray(np.sign(local[:, 0]), np.float64)
    for level in SPLIT * body.parts.landmarks["crotch"]:
        below = local[:, 1] < level
        label = components(body.triangles[below[body.triangles].all(axis=1)], len(local))
        top = np.zeros(label.max() + 1)
        np.maximum.at(top, label[below], local[below, 1])
        long = below & (top[label] > LEG * level)
        feet = [np.argmin(np.where(long & (side == sign), local[:, 1], np.inf)) for sign in (1, -1)]
        if long[feet].all() and label[feet[0]] != label[feet[1]]:
            for foot, sign in zip(feet, (1, -1), strict=True):
                side[label == label[foot]] = sign
            of_legs = np.isin(label, label[feet])
            others = np.flatnonzero(below & ~of_legs)
            side[others] = side[of_legs][cKDTree(local[of_legs]).query(local[others])[1]]
            break
    return side


PARTING = np.radians(12.0)
"""Angle by which each leg is turned outward [rad]."""
ROOT = 0.1
"""Height below the crotch in which the turn grows, as a fraction of the crotch's."""
LEAST_RAISE = np.radians(10.0)
"""Arms that hang less below the horizontal stay [rad]."""
SPREAD = 0.03
"""Standard deviation of the averages of the turn over a wrap [m]."""
STATIONS = 7
"""Poses on the way back."""


def sewing_pose(wearer: Wearer, limbs: Iterable[str]) -> tuple[Wearer, str]:
    """The body with those limbs out of the way that seams were open about, and what was done; "" where nothing helps.

    Legs are parted, also where the torso is between, as at a crotch; arms are raised to the horizontal.
    """
    found = " ".join(limbs)
    legs = PARTING if "leg" in found or TORSO in found else 0.0
    arms = 0.0
    if "arm" in found or "hand" in found:
        with suppress(TransferError):  # there are none
            axes = np.array([arm_axis(wearer.body.parts, side) for side in (0, 1)])
            along = axes[:, 0] - axes[:, -1]
            arms = float(np.arctan2(-along[:, 1], np.abs(along[:, 0])).mean())  # below the horizontal
    if arms <= LEAST_RAISE:
        arms = 0.0
    changes = [
        *([f"the legs parted by {np.degrees(legs):.0f} degrees each"] if legs else []),
        *([f"the arms raised by {np.degrees(arms):.0f} degrees"] if arms else []),
    ]
    if not changes:
        return wearer, ""
    with_arms = _weights_of_arms(wearer.body)
    way = np.stack([_posed(wearer.body, with_arms, t * legs, t * arms) for t in np.linspace(1.0, 0.0, STATIONS)])
    body = replace(wearer.body, positions=way[0], own_pose=wearer.body.own_pose or wearer.body)
    return Wearer(body, body_surface(body.positions, body.triangles), way), " and ".join(changes)


def _weights_of_arms(body: BodyMesh) -> Floats:
    """How far each vertex of a body goes with either arm, (2, n), averaged over the wrap of what it wears.

    Else raised arms pull spikes out of what lies between them and the trunk.
    """
    of_arms = part_weights(body.parts, body.parts.frame.local(body.positions)).arms
    if body.like is None:
        return of_arms
    bare = len(body.like.positions)
    edges = unique_edges(body.triangles[(body.triangles >= bare).all(axis=1)])
    length = float(np.median(np.linalg.norm(body.positions[edges[:, 0]] - body.positions[edges[:, 1]], axis=1)))
    rounds = int(np.ceil((2.0 * SPREAD / length) ** 2))  # each moves half of a value by an edge: variance length^2 / 4
    of_arms[:, bare:] = smoothed(of_arms.T, body.triangles, rounds)[bare:].T
    return of_arms


def _posed(body: BodyMesh, of_arms: Floats, legs: float, arms: float) -> Floats:
    """Vertices of a body whose legs are turned outward and whose arms upward by angles [rad], (n, 3) [m].

    of_arms (2, n): how far each vertex goes with either arm. A leg is sheared: each vertex moves sideward by what its
    depth below the crotch asks for, so that horizontal sections stay as they are and a leg never meets itself. An arm
    turns about its shoulder, by less where it blends with the trunk.
    """
    parts = body.parts
    local = parts.frame.local(body.positions)
    crotch = parts.landmarks["crotch"]
    depth = np.maximum(crotch - local[:, 1], 0.0)
    reach = np.where(depth < ROOT * crotch, depth**2 / (2 * ROOT * crotch), depth - ROOT * crotch / 2)
    side = _side_of_legs(body, local)
    moved = local.copy()
    moved[:, 0] += np.tan(legs) * side * reach * (1.0 - of_arms.sum(axis=0).clip(0.0, 1.0))
    for k, outward in enumerate((1.0, -1.0)):
        pivot = arm_axis(parts, k)[-1]
        turn = Rotation.from_rotvec((outward * arms * of_arms[k])[:, None] * np.array([0.0, 0.0, 1.0]))
        moved = turn.apply(moved - pivot) + pivot
    return np.ascontiguousarray(parts.frame.world(moved))
