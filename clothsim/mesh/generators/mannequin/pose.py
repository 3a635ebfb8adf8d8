"""Poses of the mannequin: joint rotations and linear blend skinning."""

from collections.abc import Mapping, Sequence

import numpy as np

from clothsim.base.arrays import Floats, as_vector
from clothsim.base.errors import InputError
from clothsim.mesh.generators.mannequin.skeleton import ARM, JOINTS, PARENTS, other_side
from clothsim.mesh.motion import rotation_matrix

Turns = Mapping[str, Floats]
"""Rotation vectors [rad] by the name of the joint, in the axes of the rest pose."""


def _to(direction: Sequence[float]) -> Floats:
    """Shortest rotation from the left arm of the A-pose to `direction`."""
    aim = np.asarray(direction, np.float64) / np.linalg.norm(direction)
    axis = np.cross(ARM, aim)
    return np.arctan2(np.linalg.norm(axis), ARM @ aim) * axis / max(float(np.linalg.norm(axis)), 1e-12)


def _mirrored(turns: Turns) -> dict[str, Floats]:
    """Rotations of the other side: a rotation vector is an axial vector."""
    return {other_side(name): turn * (1.0, -1.0, -1.0) for name, turn in turns.items()}


def _both(turns: Turns) -> dict[str, Floats]:
    return {**turns, **_mirrored(turns)}


def _about_x(degrees: float) -> Floats:
    return np.radians(degrees) * np.array([1.0, 0.0, 0.0])


_BACK = {"left_shoulder": _to((0.30, 0.30, -0.90)), "left_hip": _about_x(-24), "left_knee": _about_x(8)}
_FORTH = {"left_shoulder": _to((0.30, -0.35, -0.88)), "left_elbow": _about_x(-18), "left_hip": _about_x(16)}
POSES: dict[str, dict[str, Floats]] = {
    "a": {},
    "t": _both({"left_shoulder": _to((1, 0, 0))}),
    "walk": {**_BACK, **_mirrored({**_FORTH, "left_knee": _about_x(26), "left_ankle": _about_x(-4)})},
    "reach": _both({"left_shoulder": _to((0.25, -0.92, -0.20))}),
    "arms_down": _both({"left_shoulder": _to((0.30, 0.02, -0.95))}),
}
"""Named poses: only the joints that rotate."""


def turns_of(pose: str, joints_degrees: Mapping[str, Sequence[float]] | None) -> dict[str, Floats]:
    """Return the rotations of a named pose, with those of `joints_degrees` in their place.

    joints_degrees: rotation vectors [degrees] by joint, in the axes of the rest pose: x to the left, y back, z up.
    InputError names an unknown pose or joint.
    """
    if not isinstance(pose, str) or pose not in POSES:
        raise InputError(f"pose must be one of {', '.join(POSES)}, not {pose!r}.")
    turns = dict(POSES[pose])
    if joints_degrees is None:
        return turns
    if not isinstance(joints_degrees, Mapping):
        raise InputError(f"joints_degrees must be a table of joints, not {joints_degrees!r}.")
    for name, degrees in joints_degrees.items():
        if name not in JOINTS:
            raise InputError(f"joints_degrees has no joint {name!r}.", f"Known: {', '.join(JOINTS)}.")
        turns[name] = np.radians(as_vector(f"joints_degrees.{name}", degrees))
    return turns


def posed(points: Floats, weights: Floats, joints: Floats, turns: Turns) -> Floats:
    """Pose `points (n, 3)` of the rest pose [m] by linear blend skinning: sum_j w_j G_j p.

    weights (n, j); joints (j, 3): positions of the joints in the rest pose [m]. G_j rotates about joint j, after its
    parents.
    """
    rotations, moves = np.empty((len(JOINTS), 3, 3)), np.empty((len(JOINTS), 3))
    for j, parent in enumerate(PARENTS):
        own = rotation_matrix(np.asarray(turns.get(JOINTS[j], np.zeros(3))))
        before, moved = (rotations[parent], moves[parent]) if parent >= 0 else (np.eye(3), np.zeros(3))
        rotations[j] = before @ own
        moves[j] = before @ (joints[j] - own @ joints[j]) + moved
    return np.einsum("nj,njk->nk", weights, np.einsum("jkl,nl->njk", rotations, points) + moves)
