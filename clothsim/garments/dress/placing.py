"""Placement of a pattern in front of and behind a body: axes, height and origin of both."""

from dataclasses import replace

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.garments.dress.facing import front_of, turn_to_front, usual_front
from clothsim.garments.inputs import Figure
from clothsim.patterns import PatternMesh

ORIGINS = ("auto", "floor", "waist")
ORIGIN_HEIGHT = 0.677
"""Height of the origin of Garment-Pattern-Generator's body (the template of SMPL) as a fraction of its own height."""
BELOW, LOW = 0.1, 0.6
"""Depth of a pattern below y = 0 and height of its top above it [m] that make the floor an unlikely origin."""
ASIDE = 0.2
"""Distance of a body from the vertical axis [m] beyond which the pattern follows it."""


def placed_on(mesh: PatternMesh, body: Figure, origin: str = "auto") -> tuple[PatternMesh, tuple[str, ...]]:
    """The mesh placed on a body, and notes.

    Parameters
    ----------
    mesh : PatternMesh
        Panels as placed in the file, y upward.
    body : Figure
        The body, y or z upward.
    origin : str
        Level y = 0 of the file: "floor", the lowest vertex of the body (GarmentCode), or "waist", the origin of SMPL's
        template (Garment-Pattern-Generator); "auto": the floor, unless the panels lie round y = 0.

    Raises
    ------
    InputError
        Another origin.
    """
    chosen, notes = chosen_origin(mesh.positions[:, 1], origin), []
    lowest = float(mesh.positions[:, 1].min())
    if chosen == "waist" and origin == "auto":
        notes.append(f"panels lie {-lowest:.2f} m below y = 0: read as made round the waist (origin = waist)")
    levels = body.positions @ body.up
    level = float(levels.min()) + height_of_origin(body, chosen)
    across = np.eye(3)[[k for k in range(3) if body.up[k] == 0]]
    middles = [float((points.min() + points.max()) / 2) for points in (body.positions @ axis for axis in across)]
    shift = level * body.up
    if np.linalg.norm(middles) > ASIDE:
        shift = shift + middles[0] * across[0] + middles[1] * across[1]
        notes.append("the body is away from the vertical axis: the pattern follows it")
    positions = _upright(mesh.positions, body.up)
    front = front_of(body)
    if front @ usual_front(body.up) < 1:
        positions = turn_to_front(body, front).apply(positions)
        facing = ", ".join(f"{value:.2f}" for value in front)
        notes.append(f"the body faces ({facing}) by its feet: the pattern is turned to it")
    positions = positions + shift
    return replace(mesh, positions=positions), tuple(notes)


def chosen_origin(heights: Floats, origin: str) -> str:
    """Level y = 0 of a pattern whose points have the heights (k,) [m] in it: "floor" or "waist"."""
    if origin not in ORIGINS:
        raise InputError(f"origin is {origin!r}.", f"Known: {', '.join(ORIGINS)}.")
    if origin != "auto":
        return origin
    return "waist" if heights.min() < -BELOW and heights.max() < LOW else "floor"


def height_of_origin(body: Figure, origin: str) -> float:
    """Height of the origin of a pattern, "floor" or "waist", above the floor of a body [m]."""
    return ORIGIN_HEIGHT * float(np.ptp(body.positions @ body.up)) if origin == "waist" else 0.0


def _upright(positions: Floats, up: Floats) -> Floats:
    """Positions with y upward turned so that `up` is: y to z about the x axis, or as they are."""
    return positions if up[1] else positions[:, [0, 2, 1]] * [1, -1, 1]
