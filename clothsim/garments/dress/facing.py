"""Direction that a body faces, from its feet; patterns are placed for one that faces z."""

import numpy as np
from scipy.spatial.transform import Rotation

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.garments.inputs import Figure
from transfer.body_frame import body_frame
from transfer.errors import TransferError

ASIDE_DEGREES = 20.0
"""Angle from the usual direction up to which a body counts as facing it: feet turned out do not turn a garment."""
SHORTEST, TALLEST = 0.1, 10.0
"""Height of a body that a pattern can be for [m]."""
FARTHEST = 1e5
"""Largest coordinate of a body [m]: beyond, the distance of contact would lose its digits."""


def refuse_unsuitable(body: Figure) -> None:
    """InputError for a body of no person's size, or so far away that contact would lose its digits."""
    extent, farthest = float(np.ptp(body.positions @ body.up)), float(np.abs(body.positions).max())
    if not farthest <= FARTHEST:
        raise InputError(f"{body.name} has a vertex {farthest:.3g} m from the origin.", "Move it to the origin.")
    if not SHORTEST <= extent <= TALLEST:
        raise InputError(
            f"{body.name} is {extent:.3g} m tall; patterns are sewn on bodies of {SHORTEST:g} to {TALLEST:g} m.",
            "Give its unit: --scale METRES_PER_UNIT.",
        )


def usual_front(up: Floats) -> Floats:
    """Direction that bodies of a vertical axis face, (3,): z where y is up, -y where z is."""
    return np.array([0.0, 0.0, 1.0]) if up[1] else np.array([0.0, -1.0, 0.0])


def front_of(body: Figure) -> Floats:
    """Unit direction that a body faces, (3,): that of its feet where it is far from the usual one, else the usual."""
    usual = usual_front(body.up)
    try:
        front = body_frame(body.positions, body.triangles, body.up).front
    except TransferError:  # no feet to go by
        return usual
    return usual if front @ usual > np.cos(np.radians(ASIDE_DEGREES)) else np.asarray(front, np.float64)


def turn_to_front(body: Figure, front: Floats) -> Rotation:
    """Rotation about the vertical that takes the usual front to `front`."""
    usual = usual_front(body.up)
    angle = np.arctan2(np.cross(usual, front) @ body.up, usual @ front)
    return Rotation.from_rotvec(angle * body.up)
