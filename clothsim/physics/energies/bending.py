"""Bending stiffness: the effect `bending`, with a choice of models."""

import importlib
from dataclasses import fields, replace

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.geometry.kinematics.curvature import angles_of_curvature, threads_in_triangles
from clothsim.keys.fabric import CURLS
from clothsim.keys.typed_effects import Bending
from clothsim.mesh.cloth import Hinges
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off
from clothsim.physics.energies.example import Example
from clothsim.physics.energies.key_values import over_cloth

MODELS = {
    "midedge": "clothsim.physics.energies.midedge_bending:midedge_bending",
    "hinge": "clothsim.physics.energies.hinge_bending:hinge_bending",
    "quadratic": "clothsim.physics.energies.quadratic_bending:quadratic_bending",
}
"""Bending models by name: the function that builds the energy of hinges of a world, imported when it is chosen."""


HYSTERETIC = "clothsim.physics.energies.midedge_softening:hysteretic_bending"
"""The mid-edge model of fabrics with hysteresis in bending, and maybe a slope."""
SOFTENING = "clothsim.physics.energies.midedge_softening:softening_bending"
"""The mid-edge model of fabrics whose bending has a slope."""


def bending(world: World, keys: Bending) -> Energy | Off:
    """The bending energy of all cloths, over the hinges that have a stiffness; off without such.

    "midedge" has the curvature by triangle: convergent on any mesh, with the material's Poisson ratio. The error of
    "hinge" (springs on dihedral angles) and "quadratic" (constant Hessian) does not vanish with the mesh
    (docs/results/validation.md, A3), and they know the fabric's bending_stiffness and curl alone.

    Raises
    ------
    InputError
        For an angle, short_waves, bending_slope or bending_hysteresis that the model does not take.
    """
    turned = not (isinstance(keys.angle_degrees, float | int) and keys.angle_degrees == 0)
    weighted = keys.short_waves not in (0.0, Bending().short_waves)
    for key, given in {"angle_degrees": turned, "short_waves": weighted}.items():
        if given and keys.model != "midedge":
            raise InputError(
                f'effects.bending.{key} has no effect with model = "{keys.model}".', 'It is for "midedge".'
            )
    hinges = world.hinges
    if not len(hinges.vertices):
        return Off("the cloth has no interior edge")
    stiff = hinges.stiffness > 0
    if not stiff.any():
        return Off("bending stiffness is zero")
    stiff_hinges = Hinges(*(getattr(hinges, field.name)[stiff] for field in fields(hinges)))
    sloped = any((world.per_triangle(f"slope_along_{way}") != 0).any() for way in ("warp", "weft", "bias"))
    looped = any((world.per_triangle(f"hysteresis_along_{way}") != 0).any() for way in ("warp", "weft"))
    if (sloped or looped) and keys.model != "midedge":
        key = "bending_slope" if sloped else "bending_hysteresis"
        raise InputError(f'cloth.{key} has no effect with effects.bending.model = "{keys.model}".', 'Take "midedge".')
    module, function = (HYSTERETIC if looped else SOFTENING if sloped else MODELS[keys.model]).split(":")
    build = getattr(importlib.import_module(module), function)
    angles = np.radians(over_cloth("effects.bending.angle_degrees", keys.angle_degrees, world))
    if any(world.per_triangle(name).any() for name in CURLS):
        stiff_hinges = curled(stiff_hinges, world, angles)
    if keys.model != "midedge":
        return build(stiff_hinges, world)
    return build(stiff_hinges, world, angles, keys.short_waves)


MOST_CURL = np.pi / 2
"""Largest angle at an edge that natural curl may add [rad]: four edges around a roll."""


def curled(hinges: Hinges, world: World, angles: Floats) -> Hinges:
    """Hinges with the rest angles that the fabrics' curl adds, angles (m,) of the warp [rad].

    All that the models do is relative to the rest angles, so those of a surface of the fabric's curvature are its rest
    shape: on each hinge the angle that such a quadratic surface has there, against the normal for a curl towards it.
    """
    warp, weft = (world.per_triangle(name) for name in CURLS)
    by_threads = np.column_stack([warp, np.zeros(len(warp)), weft])
    curvatures = np.einsum("mki,mk->mi", threads_in_triangles(world, angles), by_threads)
    added = angles_of_curvature(world, hinges, curvatures)
    largest = float(np.abs(added).max(initial=0.0))
    if largest > MOST_CURL:
        raise InputError(
            f"The rest curvature of the cloth turns an edge of its mesh by {np.degrees(largest):.3g} degrees.",
            f"Its radius needs cells that are finer by {largest / MOST_CURL:.3g}; rest_curvature_* are in 1/m.",
        )
    return replace(hinges, rest_angles=hinges.rest_angles - added)


EXAMPLE = Example(zero={}, zero_scene={"cloth": {"bending_stiffness": 0}})
