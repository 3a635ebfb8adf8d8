"""Limbs of the mannequin around its skeleton, with the dimensions of its figure [m], and skinning weights by them.

Each limb names the joints that move it, from its start to its end.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.mesh.generators.implicit_surface import Limb, limb
from clothsim.mesh.generators.mannequin.generator import JOINT_POSITIONS, JOINTS, joint, other_side

SMOOTHING = 0.014
X, Y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class BodyLimb:
    """Limb and the joints that move it, from its start to its end."""

    limb: Limb
    joints: tuple[str, ...]


def _joint_position(name: str) -> Floats:
    return JOINT_POSITIONS[joint(name)]


def _trunk() -> list[BodyLimb]:
    trunk = [
        (0.00, 0.112, 0.078), (0.12, 0.150, 0.097), (0.24, 0.149, 0.096), (0.43, 0.118, 0.084), (0.56, 0.122, 0.088),
        (0.74, 0.141, 0.101), (0.86, 0.135, 0.093), (1.00, 0.090, 0.064),
    ]  # fmt: skip
    seat, bust = np.array([0.068, 0.048, 0.868]), np.array([0.068, -0.052, 1.248])
    girdle = [(0.0, 0.052, 0.046), (0.5, 0.050, 0.042), (1.0, 0.050, 0.042)]
    neck = [(0.0, 0.068, 0.064), (0.4, 0.050, 0.054), (1.0, 0.047, 0.052)]
    made = [
        BodyLimb(limb((0, 0.006, 0.815), (0, 0.006, 1.395), X, trunk, (0.05, 0.04)), ("pelvis", "spine", "chest")),
        BodyLimb(limb((0, 0.024, 1.405), (0, 0.004, 1.530), X, neck, (0.03, 0.02)), ("neck",)),
        BodyLimb(_ball((0, 0.004, 1.597), (0.071, 0.088, 0.098)), ("head",)),
        BodyLimb(_ball((0, -0.030, 1.545), (0.050, 0.052, 0.066)), ("head",)),
    ]
    pair = [
        BodyLimb(_ball(seat, (0.074, 0.066, 0.080)), ("pelvis",)),
        BodyLimb(_ball(bust, (0.062, 0.044, 0.060)), ("chest",)),
        BodyLimb(
            limb((0.03, 0.022, 1.408), _joint_position("left_shoulder") - 0.01 * X, Y, girdle, (0.04, 0.04)), ("chest",)
        ),
    ]
    return made + pair + [_mirror(part) for part in pair]


def _left() -> list[BodyLimb]:
    shoulder, wrist, hip, ankle = (_joint_position(f"left_{name}") for name in ("shoulder", "wrist", "hip", "ankle"))
    along = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
    arm = [
        (0.0, 0.052, 0.050), (0.25, 0.045, 0.045), (0.53, 0.036, 0.035), (0.66, 0.038, 0.036), (1.0, 0.025, 0.020),
    ]  # fmt: skip
    hand = [(0.0, 0.026, 0.021), (0.45, 0.040, 0.023), (1.0, 0.035, 0.022)]
    leg = [
        (0.0, 0.070, 0.078), (0.13, 0.077, 0.085), (0.27, 0.073, 0.081), (0.47, 0.054, 0.059), (0.55, 0.050, 0.054),
        (0.68, 0.052, 0.057), (0.93, 0.031, 0.035), (1.0, 0.030, 0.035),
    ]  # fmt: skip
    foot = [(0.0, 0.033, 0.042), (0.45, 0.036, 0.036), (0.75, 0.042, 0.028), (1.0, 0.038, 0.024)]
    thumb = wrist + 0.035 * along + (0.0, -0.020, 0.0)
    return [
        BodyLimb(limb(shoulder, wrist, Y, arm, (0.04, 0.02)), ("left_shoulder", "left_elbow")),
        BodyLimb(limb(wrist, wrist + 0.120 * along, Y, hand, (0.02, 0.038)), ("left_wrist",)),
        BodyLimb(
            limb(
                thumb, thumb + 0.045 * along + (0, -0.022, 0), Y, [(0, 0.020, 0.018), (1, 0.017, 0.017)], (0.02, 0.018)
            ),
            ("left_wrist",),
        ),
        BodyLimb(limb(hip, ankle, X, leg, (0.07, 0.03)), ("left_hip", "left_knee")),
        BodyLimb(_ball((0.108, 0.035, 0.030), (0.031, 0.034, 0.034)), ("left_ankle",)),
        BodyLimb(limb((0.108, 0.012, 0.052), (0.122, -0.120, 0.024), X, foot, (0.03, 0.042)), ("left_ankle",)),
    ]


@lru_cache(maxsize=1)
def body_limbs() -> tuple[BodyLimb, ...]:
    """Return all limbs of the mannequin."""
    left = _left()
    return (*_trunk(), *left, *(_mirror(part) for part in left))


def _ball(centre: Floats | tuple, half_axes: tuple[float, float, float]) -> Limb:
    across, deep, tall = half_axes
    return limb(centre, centre, X, [(0.0, across, deep)], (tall, tall))


def _mirror(part: BodyLimb) -> BodyLimb:
    return BodyLimb(part.limb.mirrored(), tuple(other_side(name) for name in part.joints))


BLEND = 0.05
"""A limb farther from a point than its nearest limb by this much has no weight there [m]."""
BEND = 0.10
"""Length of limb over which one joint hands over to the next [m]."""


def skinning_weights(points: Floats) -> Floats:
    """Return the weight of each joint at `points (n, 3)` of the rest pose [m], (n, j).

    The weight of a limb is (1 - (d - d_min) / BLEND)^3, with d its distance and d_min that of the nearest limb; along a
    limb it passes from one joint to the next as a smooth step of length BEND around that joint.
    """
    limbs = body_limbs()
    distances = np.stack([one.limb.distance(points)[0] for one in limbs], axis=1)
    beyond = distances - distances.min(axis=1, keepdims=True)
    limb_weights = np.clip(1 - beyond / BLEND, 0.0, 1.0) ** 3
    weights = np.zeros((len(points), len(JOINTS)))
    for one, limb_weight in zip(limbs, limb_weights.T, strict=True):
        steps = [np.ones(len(points))]
        for name in one.joints[1:]:
            t = np.clip((points - JOINT_POSITIONS[joint(name)]) @ one.limb.axes[2] / BEND + 0.5, 0.0, 1.0)
            steps.append(t * t * (3 - 2 * t))
        parts = -np.diff(np.stack([*steps, np.zeros(len(points))]), axis=0)  # of the limb; they sum to 1
        for name, part in zip(one.joints, parts, strict=True):
            weights[:, joint(name)] += limb_weight * part
    return weights / weights.sum(axis=1, keepdims=True)
