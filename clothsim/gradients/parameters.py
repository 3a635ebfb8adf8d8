"""Derivatives by the numbers of a scene: what each of them builds, and differences of it."""

from typing import TYPE_CHECKING

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.gradients.backward_pass import Adjoints
from clothsim.gradients.differentiable_session import held_energies
from clothsim.gradients.scene_values import affected_effects, is_of_fabric, value_at, with_value
from clothsim.gradients.variation import FOURTH_ORDER, SECOND_ORDER, Variant, Variation
from clothsim.scene.assembly.meshes import FABRIC
from clothsim.scene.assembly.scene_world import build

if TYPE_CHECKING:
    from clothsim.gradients.run import Trace

RELATIVE_STEP, OF_FABRIC = 1e-5, 3e-5
"""Change of a number as a fraction of itself, or of the largest of a vector; that of a fabric, in which the energy is
linear or nearly so."""
LEAST_STEP = 1e-6
"""Change of a number that is 0."""


def full_path(name: str) -> str:
    """Return the path of a number; a key of a fabric is meant of the cloth."""
    return f"cloth.{name}" if name in FABRIC else name


def scene_derivative(run: "Trace", adjoints: Adjoints, path: str) -> Floats:
    """Return dL by the number or numbers at a path of the scene, () or (k,).

    Raises
    ------
    InputError
        For a path that names no number.
    """
    session = run.session
    scene, integrator = session.scene, session.integrator
    value = value_at(scene, session.built.world, path)
    affected = affected_effects(path, tuple(session.built.energies))
    relative, stencil = (OF_FABRIC, SECOND_ORDER) if is_of_fabric(path) else (RELATIVE_STEP, FOURTH_ORDER)
    size = relative * float(np.abs(value).max(initial=0.0)) or LEAST_STEP
    out = np.zeros(value.shape)
    for index in np.ndindex(value.shape):

        def built(change: float, index: tuple[int, ...] = index) -> Variant:
            changed = value.copy()
            changed[index] += change
            made = build(with_value(scene, path, changed))
            return Variant(made.world, held_energies(made.energies, run.stiffness), made.constraints)

        out[index] = Variation(built, size, stencil, affected).derivative(integrator, run.steps, adjoints)
    return out
