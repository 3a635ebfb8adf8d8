"""Skinning weights of points in space: >= 0, sum 1, smooth, and zero away from the limbs of a joint."""

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.mesh.generators.garments.body_limbs import BodyLimb, body_limbs
from clothsim.mesh.generators.mannequin.skeleton import JOINT_POSITIONS, JOINTS, joint

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
        for name, part in zip(one.joints, _parts(one, points), strict=True):
            weights[:, joint(name)] += limb_weight * part
    return weights / weights.sum(axis=1, keepdims=True)


def _parts(part: BodyLimb, points: Floats) -> Floats:
    """Fraction of a limb that each of its joints moves, (joints, n); they sum to 1."""
    along = part.limb.axes[2]
    steps = [np.ones(len(points))]
    for name in part.joints[1:]:
        t = np.clip((points - JOINT_POSITIONS[joint(name)]) @ along / BEND + 0.5, 0.0, 1.0)
        steps.append(t * t * (3 - 2 * t))
    steps.append(np.zeros(len(points)))
    return -np.diff(np.stack(steps), axis=0)
