"""Which joints move a point of space: weights >= 0 that sum to 1, smooth, and zero away from the joint's limbs."""

import numpy as np

from clothsim.arrays import Floats
from clothsim.mesh.generators.garments.body_limbs import BodyLimb, body_limbs
from clothsim.mesh.generators.mannequin.skeleton import JOINTS, PLACES, joint

BLEND = 0.05
"""A limb farther from a point than its nearest limb by this much has no part in it [m]."""
BEND = 0.10
"""The length of limb over which the next joint takes over [m]."""


def skinning_weights(points: Floats) -> Floats:
    """The weight of each joint at `points (n, 3)` of the rest pose [m], (n, j).

    A limb's share is (1 - (d - d_min) / BLEND)^3, with d its distance and d_min that of the nearest limb; along a limb
    the share goes from one joint to the next as a smooth step of length BEND round that joint.
    """
    flesh = body_limbs()
    distances = np.stack([one.limb.distance(points)[0] for one in flesh], axis=1)
    beyond = distances - distances.min(axis=1, keepdims=True)
    shares = np.clip(1 - beyond / BLEND, 0.0, 1.0) ** 3
    weights = np.zeros((len(points), len(JOINTS)))
    for one, share in zip(flesh, shares.T, strict=True):
        for name, part in zip(one.joints, _parts(one, points), strict=True):
            weights[:, joint(name)] += share * part
    return weights / weights.sum(axis=1, keepdims=True)


def _parts(flesh: BodyLimb, points: Floats) -> Floats:
    """How much of a limb each of its joints moves, (joints, n); they sum to 1."""
    along = flesh.limb.axes[2]
    reached = [np.ones(len(points))]
    for name in flesh.joints[1:]:
        t = np.clip((points - PLACES[joint(name)]) @ along / BEND + 0.5, 0.0, 1.0)
        reached.append(t * t * (3 - 2 * t))
    reached.append(np.zeros(len(points)))
    return -np.diff(np.stack(reached), axis=0)
