"""The figure of a mannequin: its height and its proportions, and where they carry the points of the template."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial

import numpy as np

from clothsim.arrays import Floats, as_positive
from clothsim.errors import InputError
from clothsim.mesh.generators.mannequin.skeleton import JOINTS, PLACES, joint

TEMPLATE_HEIGHT = 1.69085
"""From the soles to the crown of the template [m]; a test measures it."""
TEMPLATE_SOLE = 0.00413
"""The height of its lowest point [m]."""
LEVELS = {
    "ankle": 0.075,
    "knee": 0.475,
    "hips": 0.880,
    "waist": 1.065,
    "chest": 1.225,
    "shoulders": 1.362,
    "neck": 1.43,
}
"""Where on the template [m] the factors of a figure hold; between them they go over as smooth steps."""
ARMS_WITH_CHEST = 0.8
"""How much of the growth of the chest the shoulders share, so that the arms are not drowned in it."""
TRUNK_AXIS = 0.006
"""y of the axis from which depths grow [m]."""


@dataclass(frozen=True)
class Figure:
    """The height [m] and what is different from the template at that height, as factors of its own measures.

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
"""The least and the most of each measure: a template can be carried no farther without folding."""


def warped(points: Floats, weights: Floats, figure: Figure) -> Floats:
    """Where `points (n, 3)` of the template [m] with skinning `weights (n, j)` are on a figure, in the rest pose.

    Trunk and legs grow about the middle plane by factors of their height above the ground, arms about their axes; head,
    hands and feet keep their shape. The weights blend these maps; then all is scaled to the figure's height.
    """
    moved = np.zeros_like(points)
    for name, weight in zip(JOINTS, weights.T, strict=True):
        near = np.flatnonzero(weight)
        moved[near] += weight[near, None] * _map_of(name)(points[near], figure)
    return (moved - (0.0, 0.0, TEMPLATE_SOLE)) * (figure.height / TEMPLATE_HEIGHT)


def warped_joints(figure: Figure) -> Floats:
    """Where the joints are on a figure, (j, 3) [m]."""
    return warped(PLACES, np.eye(len(JOINTS)), figure)


def _map_of(name: str) -> Callable[[Floats, Figure], Floats]:
    """What the part of the body that the joint `name` moves does when the figure changes."""
    part = name.removeprefix("left_").removeprefix("right_")
    side = name.removesuffix(part)
    if part in ("shoulder", "elbow"):
        return partial(_arm, side=side)
    if part == "wrist":
        return partial(_moved_with, joint(name), partial(_arm, side=side))
    if part in ("neck", "head"):
        return partial(_moved_with, joint("neck"), _column)
    return partial(_moved_with, joint(name), _column) if part == "ankle" else _column


def _moved_with(place: int, carry: Callable[[Floats, Figure], Floats], points: Floats, figure: Figure) -> Floats:
    """`points` moved as `carry` moves the joint in row `place`."""
    return points + carry(PLACES[place : place + 1], figure) - PLACES[place]


def _column(points: Floats, figure: Figure) -> Floats:
    """Trunk and legs: x and y times factors of z."""
    shoulders = figure.shoulder_width + ARMS_WITH_CHEST * (figure.chest - 1)
    wide = [figure.limb_girth, figure.limb_girth, figure.hips, figure.waist, figure.chest, shoulders, 1.0]
    deep = [*wide[:5], 0.5 * (1 + figure.chest), 1.0]
    z = points[:, 2]
    moved = points.copy()
    moved[:, 0] *= _steps(z, wide)
    moved[:, 1] = TRUNK_AXIS + (points[:, 1] - TRUNK_AXIS) * _steps(z, deep)
    return moved


def _arm(points: Floats, figure: Figure, side: str) -> Floats:
    """An arm: moved with its shoulder, its section times limb_girth."""
    shoulder, wrist = PLACES[joint(f"{side}shoulder")], PLACES[joint(f"{side}wrist")]
    along = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
    offset = points - shoulder
    axial = (offset @ along)[:, None] * along
    return _column(shoulder[None], figure) + axial + figure.limb_girth * (offset - axial)


def _steps(z: Floats, factors: list[float]) -> Floats:
    """The factors at LEVELS, between them smooth steps (n,)."""
    levels, values = np.array(list(LEVELS.values())), np.array(factors)
    k = np.clip(np.searchsorted(levels, z) - 1, 0, len(levels) - 2)
    t = np.clip((z - levels[k]) / (levels[k + 1] - levels[k]), 0.0, 1.0)
    return values[k] + t * t * (3 - 2 * t) * (values[k + 1] - values[k])
