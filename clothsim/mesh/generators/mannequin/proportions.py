"""Proportions of a mannequin, and the warp of the template to them."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial

import numpy as np

from clothsim.base.arrays import Floats, as_positive
from clothsim.base.errors import InputError
from clothsim.mesh.generators.mannequin.skeleton import JOINT_POSITIONS, JOINTS, joint

TEMPLATE_HEIGHT = 1.69085
"""From the soles to the crown of the template [m]; a test measures it."""
TEMPLATE_SOLE = 0.00413
"""Height of its lowest point [m]."""
LEVELS = {
    "ankle": 0.075,
    "knee": 0.475,
    "hips": 0.880,
    "waist": 1.065,
    "chest": 1.225,
    "shoulders": 1.362,
    "neck": 1.43,
}
"""Heights on the template [m] at which the factors of the proportions hold, with smooth steps in between."""
ARMS_WITH_CHEST = 0.8
"""Fraction of the growth of the chest that the shoulders follow, so that the arms stay outside of it."""
TRUNK_AXIS = 0.006
"""y of the axis from which depths grow [m]."""


@dataclass(frozen=True)
class Proportions:
    """Height [m], and factors of the measures that the template has at that height.

    chest, waist, hips: girths; shoulder_width: between the shoulder joints, which a wider chest moves out as well;
    limb_girth: of arms and legs.
    """

    height: float = 1.7
    chest: float = 1.0
    waist: float = 1.0
    hips: float = 1.0
    shoulder_width: float = 1.0
    limb_girth: float = 1.0

    def __post_init__(self) -> None:
        for field in fields(self):
            low, high = RANGES[field.name]
            value = as_positive(field.name, getattr(self, field.name))
            if not low <= value <= high:
                unit = " m" if field.name == "height" else ", a factor of the default mannequin's"
                raise InputError(f"{field.name} must be from {low:g} to {high:g}{unit}, not {value:g}.")


RANGES = {
    "height": (0.5, 2.5),
    "chest": (0.8, 1.35),
    "waist": (0.75, 1.6),
    "hips": (0.8, 1.45),
    "shoulder_width": (0.95, 1.15),
    "limb_girth": (0.75, 1.2),
}
"""Bounds of each measure: beyond them the warped template would fold."""


def warped(points: Floats, weights: Floats, proportions: Proportions) -> Floats:
    """Warp `points (n, 3)` of the template [m] with skinning `weights (n, j)` to proportions, in the rest pose.

    Trunk and legs grow about the middle plane by factors of their height above the ground, arms about their axes; head,
    hands and feet keep their shape. The weights blend these maps; then all is scaled to their height.
    """
    moved = np.zeros_like(points)
    for name, weight in zip(JOINTS, weights.T, strict=True):
        near = np.flatnonzero(weight)
        moved[near] += weight[near, None] * _choose_warp(name)(points[near], proportions)
    return (moved - (0.0, 0.0, TEMPLATE_SOLE)) * (proportions.height / TEMPLATE_HEIGHT)


def warped_joints(proportions: Proportions) -> Floats:
    """Return the joints of a mannequin, (j, 3) [m]."""
    return warped(JOINT_POSITIONS, np.eye(len(JOINTS)), proportions)


def _choose_warp(name: str) -> Callable[[Floats, Proportions], Floats]:
    """Warp of the part of the body that the joint `name` moves."""
    part = name.removeprefix("left_").removeprefix("right_")
    side = name.removesuffix(part)
    if part in ("shoulder", "elbow"):
        return partial(_arm, side=side)
    if part == "wrist":
        return partial(_follow_joint, joint(name), partial(_arm, side=side))
    if part in ("neck", "head"):
        return partial(_follow_joint, joint("neck"), _column)
    return partial(_follow_joint, joint(name), _column) if part == "ankle" else _column


def _follow_joint(
    row: int, warp: Callable[[Floats, Proportions], Floats], points: Floats, proportions: Proportions
) -> Floats:
    """`points` translated with the joint in row `row`."""
    return points + warp(JOINT_POSITIONS[row : row + 1], proportions) - JOINT_POSITIONS[row]


def _column(points: Floats, proportions: Proportions) -> Floats:
    """Trunk and legs: x and y times factors of z."""
    shoulders = proportions.shoulder_width + ARMS_WITH_CHEST * (proportions.chest - 1)
    wide = [
        proportions.limb_girth,
        proportions.limb_girth,
        proportions.hips,
        proportions.waist,
        proportions.chest,
        shoulders,
        1.0,
    ]
    deep = [*wide[:5], 0.5 * (1 + proportions.chest), 1.0]
    z = points[:, 2]
    moved = points.copy()
    moved[:, 0] *= _steps(z, wide)
    moved[:, 1] = TRUNK_AXIS + (points[:, 1] - TRUNK_AXIS) * _steps(z, deep)
    return moved


def _arm(points: Floats, proportions: Proportions, side: str) -> Floats:
    """Arm: moved with its shoulder, its section times limb_girth."""
    shoulder, wrist = JOINT_POSITIONS[joint(f"{side}shoulder")], JOINT_POSITIONS[joint(f"{side}wrist")]
    along = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
    offset = points - shoulder
    axial = (offset @ along)[:, None] * along
    return _column(shoulder[None], proportions) + axial + proportions.limb_girth * (offset - axial)


def _steps(z: Floats, factors: list[float]) -> Floats:
    """Factors at LEVELS, with smooth steps in between (n,)."""
    levels, values = np.array(list(LEVELS.values())), np.array(factors)
    k = np.clip(np.searchsorted(levels, z) - 1, 0, len(levels) - 2)
    t = np.clip((z - levels[k]) / (levels[k + 1] - levels[k]), 0.0, 1.0)
    return values[k] + t * t * (3 - 2 * t) * (values[k + 1] - values[k])
