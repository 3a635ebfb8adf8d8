"""Derivatives by the rest shape: by its vertices, and along fields such as those of a pattern's control points.

The start positions are held. Masses, rest shapes, hinges and the weights of contact pairs all follow the rest shape,
because the world and its energies are built from the varied one.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.gradients.backward_pass import Adjoints
from clothsim.gradients.differentiable_session import held_energies
from clothsim.gradients.variation import SECOND_ORDER, Variant, Variation
from clothsim.mesh.cloth import Cloth, triangle_planes
from clothsim.mesh.world import make_world
from clothsim.scene.assembly.scene_world import build_effects

if TYPE_CHECKING:
    from clothsim.gradients.run import Trace

STEP = 3e-5
"""Largest change of a rest position that differences take, as a fraction of the mean edge."""


def rest_along(run: "Trace", adjoints: Adjoints, cloth: int, field: Floats) -> float:
    """Return dL along a displacement field of the rest shape of one cloth.

    Parameters
    ----------
    run, adjoints
        The run and the adjoints of its steps.
    cloth : int
        Number of the cloth in the world.
    field : (n, 3) or (m, 3, 2) array
        Displacements of the rest positions [m]; of a flat pattern of the corners of its triangles in the plane.

    Raises
    ------
    InputError
        For a field of another shape.
    """
    session = run.session
    world = session.built.world
    own = world.cloths[cloth]
    wanted = own.material_coordinates.shape if own.flat else own.rest_positions.shape
    if field.shape != wanted:
        raise InputError(f"The field has the shape {field.shape}, the rest shape of {own.name!r} {wanted}.")
    largest = float(np.abs(field).max())
    if not largest:
        return 0.0
    edges = own.material_coordinates - np.roll(own.material_coordinates, 1, axis=1)

    def built(change: float) -> Variant:
        cloths = [_displaced(each, change * field) if k == cloth else each for k, each in enumerate(world.cloths)]
        varied = replace(make_world(cloths, world.prescribed_bodies, world.rigid), origin=world.origin)
        made = build_effects(session.scene, varied)
        return Variant(made.world, held_energies(made.energies, run.stiffness), made.constraints)

    size = STEP * float(np.linalg.norm(edges, axis=2).mean()) / largest
    variation = Variation(built, size, SECOND_ORDER, tuple(session.built.energies))
    return variation.derivative(session.integrator, run.steps, adjoints)


def rest_derivative(run: "Trace", adjoints: Adjoints) -> Floats:
    """Return dL by the rest positions of a single cloth that is no flat pattern, (n, 3): 12 n sets of energies."""
    cloths = run.session.built.world.cloths
    if len(cloths) != 1 or cloths[0].flat:
        raise InputError("cloth.rest is for one cloth with rest positions.", "Take Gradient.rest_along for a field.")
    out = np.zeros(cloths[0].rest_positions.shape)
    for index in np.ndindex(out.shape):
        field = np.zeros(out.shape)
        field[index] = 1.0
        out[index] = rest_along(run, adjoints, 0, field)
    return out


def _displaced(cloth: Cloth, field: Floats) -> Cloth:
    if cloth.flat:
        return replace(cloth, material_coordinates=cloth.material_coordinates + field)
    rest = cloth.rest_positions + field
    return replace(cloth, rest_positions=rest, material_coordinates=triangle_planes(rest, cloth.triangles))
