"""Garment meshing: an offset surface of limbs, meshed by surface nets, trimmed to its borders and smoothed."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_positive
from clothsim.base.errors import InputError
from clothsim.mesh.generators.garments.body_limbs import SMOOTHING, body_limbs
from clothsim.mesh.generators.garments.cut import Cut, Edge, trimmed
from clothsim.mesh.generators.garments.implicit import Limb, lattice_union, limb, smooth_union
from clothsim.mesh.generators.garments.relax import both_halves, relaxed
from clothsim.mesh.generators.garments.skinning_weights import skinning_weights
from clothsim.mesh.generators.garments.surface_nets import half_surface
from clothsim.mesh.generators.mannequin.proportions import Figure, warped

FINEST, COARSEST = 0.006, 0.040
"""Bounds on the edge length of a garment [m]."""
LEAST_EASE, SAGITTA, MOST_EASE = 0.003, 3.0, 0.06
"""Least ease [m] of tiny triangles, its growth with edge^2 (chords cut into round limbs), and the largest ease [m]."""


@dataclass(frozen=True)
class Pattern:
    """Construction of a garment on the template.

    Parameters
    ----------
    joints : tuple of str
        The limbs of the body that these joints move are part of the surface.
    limbs : tuple of Limb
        Further limbs.
    cuts : tuple of Cut
        Parts that are cut away.
    low, high : (3,)
        Box around the garment [m].
    """

    joints: tuple[str, ...]
    limbs: tuple[Limb, ...]
    cuts: tuple[Cut, ...]
    low: tuple[float, float, float]
    high: tuple[float, float, float]


def garment_mesh(pattern: Pattern, figure: Figure, ease: float, edge: float) -> tuple[Floats, Ints]:
    """Mesh a garment on the mannequin of `figure`.

    Parameters
    ----------
    pattern : Pattern
        Construction on the template.
    figure : Figure
        Proportions to which the mesh is warped.
    ease : float
        Distance from the surface of the pattern on the template [m]; it grows with the figure.
    edge : float
        Edge length [m].

    Returns
    -------
    positions : (n, 3) float64
        [m].
    triangles : (m, 3) int64
        Facing outward.
    """
    _refuse(ease, edge)
    limbs = [one.limb for one in body_limbs() if set(one.joints) & set(pattern.joints)] + list(pattern.limbs)
    nodes = _lattice(pattern, ease, edge)
    values = lattice_union(limbs, nodes, SMOOTHING, ease + 3 * COARSEST) - ease
    for axis in range(3):  # closes the surface at the box; that part is cut away
        for side in (0, -1) if axis else (-1,):
            np.moveaxis(values, axis, 0)[side] = edge
    border = Edge(pattern.cuts)
    positions, triangles = trimmed(*half_surface(values, nodes), border)

    def field(points: Floats) -> tuple[Floats, Floats]:
        return smooth_union(limbs, points, SMOOTHING)

    positions, triangles = both_halves(*relaxed(positions, triangles, field, ease, cut=border))
    return warped(positions, skinning_weights(positions), figure), triangles


def _lattice(pattern: Pattern, ease: float, edge: float) -> tuple[Floats, Floats, Floats]:
    cell, room = 1.12 * edge, ease + 4 * edge
    x = np.arange(-0.5 * cell, pattern.high[0] + room, cell)
    y, z = (np.arange(pattern.low[k] - room, pattern.high[k] + room, cell) for k in (1, 2))
    return x, y, z


def _refuse(ease: float, edge: float) -> None:
    as_positive("ease", ease)
    as_positive("edge", edge)
    if not FINEST <= edge <= COARSEST:
        raise InputError(f"edge must be from {FINEST:g} to {COARSEST:g} m, not {edge:g}.")
    least = LEAST_EASE + SAGITTA * edge * edge
    if not least <= ease <= MOST_EASE:
        raise InputError(
            f"ease must be from {least:.4f} to {MOST_EASE:g} m where edge is {edge:g} m, not {ease:g}.",
            "With less ease its triangles would cut into the body.",
        )


def tube_limb(*rings: tuple[float, float, float, float]) -> Limb:
    """Make an upright limb through rings (z, y, half width, half depth) [m], from below, on one straight axis."""
    (z0, y0, *_), (z1, y1, *_) = rings[0], rings[-1]
    profile = [((z - z0) / (z1 - z0), wide, deep) for z, _, wide, deep in rings]
    return limb((0, y0, z0), (0, y1, z1), np.array([1.0, 0.0, 0.0]), profile, (0.03, 0.03))


def both_sides(left: Limb) -> tuple[Limb, Limb]:
    """Return a limb on the left and its mirror image."""
    return left, left.mirrored()
