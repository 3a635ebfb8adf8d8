"""Generators "shirt", "skirt" and "trousers", for the mannequin of the same figure in its "a" pose."""

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_positive
from clothsim.base.errors import InputError
from clothsim.mesh.generators.garments.cut import cut
from clothsim.mesh.generators.garments.garment_mesh import Pattern, both_sides, garment_mesh, tube_limb
from clothsim.mesh.generators.garments.implicit import limb
from clothsim.mesh.generators.mannequin.proportions import Figure
from clothsim.mesh.generators.mannequin.skeleton import ARM, JOINT_POSITIONS, joint

_TRUNK = ("pelvis", "spine", "chest", "neck", "head")
_ARMS = ("left_shoulder", "right_shoulder")
_LEGS = ("left_hip", "right_hip")
_SHOULDER = JOINT_POSITIONS[joint("left_shoulder")]
_Y = np.array([0.0, 1.0, 0.0])
UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)


def shirt(
    height: float = 1.7,
    chest: float = 1.0,
    waist: float = 1.0,
    hips: float = 1.0,
    shoulder_width: float = 1.0,
    limb_girth: float = 1.0,
    ease: float = 0.012,
    edge: float = 0.018,
    sleeve: float = 0.20,
) -> tuple[Floats, Ints]:
    """Shirt with sleeves, straight from chest to hip, open at the neck, the hem and the cuffs.

    Parameters
    ----------
    height, chest, waist, hips, shoulder_width, limb_girth : float
        Figure, see `mannequin`.
    ease : float
        Smallest distance from the body [m].
    edge : float
        Edge length [m].
    sleeve : float
        From the shoulder joint to the cuff, for a height of 1.7 m [m].

    Raises
    ------
    InputError
        Naming a bad key.
    """
    figure = Figure(height, chest, waist, hips, shoulder_width, limb_girth)
    length = _within("sleeve", sleeve, 0.13, 0.46)
    trunk = tube_limb((0.83, 0.010, 0.164, 0.114), (1.04, 0.010, 0.150, 0.105), (1.25, 0.010, 0.143, 0.103))
    wide = [(0.0, 0.050, 0.048), (0.5, 0.056, 0.052), (1.0, 0.050, 0.048)]
    tip = _SHOULDER + 0.54 * ARM
    sleeve_limb = limb(_SHOULDER, tip, _Y, wide, (0.03, 0.03))
    cuts = (
        cut((DOWN, (0, 0, 0.84))),
        cut(((0, -0.36, 0.93), (0, 0.02, 1.452))),
        cut((ARM, _SHOULDER + length * ARM), ((1, 0, 0), (0.195, 0, 0))),
    )
    wrist = _SHOULDER + (length + 0.02) * ARM
    pattern = Pattern(
        _TRUNK + _ARMS, (trunk, *both_sides(sleeve_limb)), cuts, (0, -0.13, 0.82), (wrist[0] + 0.05, 0.14, 1.50)
    )
    return garment_mesh(pattern, figure, ease, edge)


def skirt(
    height: float = 1.7,
    chest: float = 1.0,
    waist: float = 1.0,
    hips: float = 1.0,
    shoulder_width: float = 1.0,
    limb_girth: float = 1.0,
    ease: float = 0.008,
    edge: float = 0.018,
    hem: float = 0.50,
) -> tuple[Floats, Ints]:
    """Flared skirt from the waist to `hem` [m] above the ground, for a height of 1.7 m; other keys as for `shirt`."""
    figure = Figure(height, chest, waist, hips, shoulder_width, limb_girth)
    low = _within("hem", hem, 0.15, 0.75)
    cone = tube_limb((0.12, 0.010, 0.290, 0.240), (0.78, 0.010, 0.180, 0.135), (1.10, 0.010, 0.112, 0.080))
    cuts = (cut((DOWN, (0, 0, low))), cut((UP, (0, 0, 1.055))))
    pattern = Pattern(("pelvis", "spine", *_LEGS), (cone,), cuts, (0, -0.24, low - 0.02), (0.30, 0.26, 1.08))
    return garment_mesh(pattern, figure, ease, edge)


def trousers(
    height: float = 1.7,
    chest: float = 1.0,
    waist: float = 1.0,
    hips: float = 1.0,
    shoulder_width: float = 1.0,
    limb_girth: float = 1.0,
    ease: float = 0.008,
    edge: float = 0.018,
    hem: float = 0.12,
) -> tuple[Floats, Ints]:
    """Trousers from the waist to `hem` [m] above the ground, for a height of 1.7 m; other keys as for `shirt`."""
    figure = Figure(height, chest, waist, hips, shoulder_width, limb_girth)
    low = _within("hem", hem, 0.10, 0.60)
    profile = [(0.0, 0.060, 0.070), (0.5, 0.056, 0.064), (1.0, 0.054, 0.058)]
    leg = limb(
        JOINT_POSITIONS[joint("left_hip")], (0.115, 0.012, 0.05), np.array([1.0, 0.0, 0.0]), profile, (0.03, 0.03)
    )
    cuts = (cut((DOWN, (0, 0, low))), cut((UP, (0, 0, 1.045))))
    pattern = Pattern(("pelvis", "spine", *_LEGS), both_sides(leg), cuts, (0, -0.13, low - 0.02), (0.19, 0.15, 1.07))
    return garment_mesh(pattern, figure, ease, edge)


def _within(name: str, value: float, least: float, most: float) -> float:
    """`value` [m] within its bounds; InputError names it."""
    length = as_positive(name, value)
    if not least <= length <= most:
        raise InputError(f"{name} must be from {least:g} to {most:g} m, not {length:g}.")
    return length
