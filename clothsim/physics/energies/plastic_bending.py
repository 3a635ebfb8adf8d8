"""Yield of bending: the effect `plastic_bending` (`plastic_hinges` has the flow).

The yield y is given as a curvature kappa, which is a property of the fabric and not of the mesh, or as the angle of a
hinge. Hinges of edge length |e| between areas A1 and A2 take y = kappa (A1 + A2)/|e|, triangles of the mid-edge model
the angle over the mean (A1 + A2)/|e| of the hinges in their curvature.
"""

from collections.abc import Mapping

import numpy as np

from clothsim.base.errors import InputError
from clothsim.keys.typed_effects import PlasticBending
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off
from clothsim.physics.energies.example import Example, Idle


def plastic_bending(world: World, keys: PlasticBending, *, built: Mapping[str, Energy] | None = None) -> Energy | Off:
    """Permanent folds beyond a yield angle or curvature; off without yield or bending.

    built: the energies built so far, with the bending whose angles are shifted.

    Raises
    ------
    InputError
        For both kinds of yield, or a bending model without rest angles.
    """
    degrees, curvature = keys.yield_angle_degrees, keys.yield_curvature
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
    from clothsim.physics.energies.plastic_hinges import NAME, PlasticBendingEnergy

    hinges = hinges_of_bending(NAME, bending)
    strains, weights = hinges.strains_of_angles()
    stiff = world.hinges.stiffness > 0
    widths = world.hinges.areas[stiff] / world.hinges.edge_lengths[stiff]
    if isinstance(hinges, HingeBending):
        yields = curvature * widths if curvature else np.full(len(widths), np.radians(degrees))
    else:
        yields = np.full(len(weights), curvature) if curvature else np.radians(degrees) / hinges.widths(widths)
    rest, none = hinges.rest_angles, np.zeros(len(widths))
    flow = hinges, strains, weights, yields, keys.hardening, np.zeros((len(weights), strains.shape[0] // len(weights)))
    return PlasticBendingEnergy(hinges.vertices, rest, none, 0.0, rest, *flow)


EXAMPLE = Example(
    keys={"yield_angle_degrees": 1.0, "hardening": 0.3},
    in_scene={"yield_angle_degrees": 1.0},
    zero={"hardening": 0.5},
    idle=Idle(always={"yield_angle_degrees": 179.0}, sometimes={"yield_angle_degrees": 0.02}, searches=True),
)
