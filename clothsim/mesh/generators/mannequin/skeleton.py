"""Skeleton of the mannequin: joints, their parents and their positions in the rest pose (an A).

z is up, the feet are on z = 0, the face looks along -y, and so the left hand is at +x.
"""

import numpy as np

from clothsim.base.arrays import Floats, Ints

ARM_FALL = np.radians(50.0)
"""Angle of the arms of the A-pose below the horizontal."""
ARM = np.array([np.cos(ARM_FALL), 0.0, -np.sin(ARM_FALL)])
"""Direction of the left arm, from the shoulder to the hand."""

_SHOULDER = np.array([0.166, 0.014, 1.362])
_HIP, _ANKLE = np.array([0.086, 0.004, 0.875]), np.array([0.108, 0.016, 0.075])
_LEFT: dict[str, tuple[str, Floats]] = {
    "shoulder": ("chest", _SHOULDER),
    "elbow": ("shoulder", _SHOULDER + 0.27 * ARM),
    "wrist": ("elbow", _SHOULDER + 0.51 * ARM),
    "hip": ("pelvis", _HIP),
    "knee": ("hip", 0.5 * (_HIP + _ANKLE)),
    "ankle": ("knee", _ANKLE),
}
_MIDDLE: dict[str, tuple[str, Floats]] = {
    "pelvis": ("", np.array([0.0, 0.0, 0.930])),
    "spine": ("pelvis", np.array([0.0, 0.008, 1.050])),
    "chest": ("spine", np.array([0.0, 0.012, 1.180])),
    "neck": ("chest", np.array([0.0, 0.022, 1.410])),
    "head": ("neck", np.array([0.0, 0.008, 1.500])),
}


def mirrored(points: Floats) -> Floats:
    """Return `points (..., 3)` mirrored about the plane x = 0."""
    return points * (-1.0, 1.0, 1.0)


def _joints() -> dict[str, tuple[str, Floats]]:
    table = dict(_MIDDLE)
    for side in ("left", "right"):
        for name, (parent, position) in _LEFT.items():
            own = parent if parent in _MIDDLE else f"{side}_{parent}"
            table[f"{side}_{name}"] = (own, position if side == "left" else mirrored(position))
    return table


_TABLE = _joints()
JOINTS: tuple[str, ...] = tuple(_TABLE)
"""Names of the joints; a parent comes before its children."""
PARENTS: Ints = np.array([JOINTS.index(parent) if parent else -1 for parent, _ in _TABLE.values()], np.int64)
"""Parent of each joint (j,), -1 for the root."""
JOINT_POSITIONS: Floats = np.array([position for _, position in _TABLE.values()])
"""Position of each joint in the rest pose (j, 3) [m]."""


def joint(name: str) -> int:
    """Return the row of the joint `name`."""
    return JOINTS.index(name)


def other_side(name: str) -> str:
    """Return the name of the joint on the other side; that of a middle joint is its own."""
    if name.startswith("left_"):
        return "right_" + name.removeprefix("left_")
    return "left_" + name.removeprefix("right_") if name.startswith("right_") else name
