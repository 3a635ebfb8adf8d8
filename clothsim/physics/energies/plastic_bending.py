"""Yield of bending: the effect `plastic_bending` (`plastic_hinges` has the flow).

The yield y is given as a curvature kappa, which is a property of the fabric and not of the mesh, or as the angle of a
hinge. Hinges of edge length |e| between areas A1 and A2 take y = kappa (A1 + A2)/|e|, triangles of the mid-edge model
the angle over the mean (A1 + A2)/|e| of the hinges in their curvature.
"""

from collections.abc import Mapping

import numpy as np

from clothsim.base.arrays import as_positive
from clothsim.base.errors import InputError
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off
from clothsim.physics.energies.example import Example, Idle


def plastic_bending(
    world: World,
    *,
    yield_angle_degrees: float = 0.0,
    yield_curvature: float = 0.0,
    hardening: float = 0.0,
    built: Mapping[str, Energy] | None = None,
) -> Energy | Off:
    """Permanent folds beyond a yield angle or curvature.

    Parameters
    ----------
    yield_angle_degrees : float
        Yield angle of a hinge; 0: none.
    yield_curvature : float
        Yield curvature of the cloth [1/m]; 0: none. At most one of both is given.
    hardening : float
        Kinematic hardening relative to the bending stiffness.
    built : mapping, optional
        The energies built so far, with the bending whose angles are shifted.

    Returns
    -------
    PlasticBending, or Off without yield or bending.

    Raises
    ------
    InputError
        For both kinds of yield, or a bending model without rest angles.
    """
    degrees = as_positive("effects.plastic_bending.yield_angle_degrees", yield_angle_degrees, zero=True)
    curvature = as_positive("effects.plastic_bending.yield_curvature", yield_curvature, zero=True)
    ratio = as_positive("effects.plastic_bending.hardening", hardening, zero=True)
    if degrees and curvature:
        sentence = "effects.plastic_bending has both yield_angle_degrees and yield_curvature."
        raise InputError(sentence, "Give one of them.")
    if not degrees and not curvature:
        return Off("no yield is given")
    bending = (built or {}).get("bending")
    if bending is None:
        return Off("the scene has no bending")
    from clothsim.physics.energies.hinge_bending import HingeBending  # after the last Off: no kernel for a zero
    from clothsim.physics.energies.hinge_moments import hinges_of_bending
    from clothsim.physics.energies.plastic_hinges import NAME, PlasticBending

    hinges = hinges_of_bending(NAME, bending)
    strains, weights = hinges.strains_of_angles()
    stiff = world.hinges.stiffness > 0
    widths = world.hinges.areas[stiff] / world.hinges.edge_lengths[stiff]
    if isinstance(hinges, HingeBending):
        yields = curvature * widths if curvature else np.full(len(widths), np.radians(degrees))
    else:
        yields = np.full(len(weights), curvature) if curvature else np.radians(degrees) / hinges.widths(widths)
    rest, none = hinges.rest_angles, np.zeros(len(widths))
    plastic = np.zeros((len(weights), strains.shape[0] // len(weights)))
    return PlasticBending(hinges.vertices, rest, none, 0.0, rest, strains, weights, yields, ratio, plastic)


EXAMPLE = Example(
    keys={"yield_angle_degrees": 1.0, "hardening": 0.3},
    in_scene={"yield_angle_degrees": 1.0},
    zero={"hardening": 0.5},
    idle=Idle(always={"yield_angle_degrees": 179.0}, sometimes={"yield_angle_degrees": 0.02}),
)
