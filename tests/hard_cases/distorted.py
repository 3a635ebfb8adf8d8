"""Recovery of sheets from large initial distortion: collapsed, stretched threefold, mirrored."""

from collections.abc import Mapping, Sequence

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.files.meshes.readers.obj import obj_text
from clothsim.geometry.kinematics.deformation_gradient import deformation_gradients
from clothsim.geometry.kinematics.stretch import principal_stretches
from clothsim.mesh.generators.shapes import rectangle
from clothsim.run.results import Run
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene
from tests.hard_cases.case import MOST_NEWTON, Case, all_of, energy_falls, scene_of

RECOVERED = 0.01
"""Strain that may be left at the end."""


def sheet(small: bool) -> tuple[Floats, Ints]:
    """A sheet of .3 m at rest."""
    return rectangle((0.3, 0.3), (8, 8) if small else (30, 30))


def files(small: bool, factors: Sequence[float]) -> Mapping[str, str]:
    """The sheet and its start: each coordinate times its factor."""
    rest, triangles = sheet(small)
    return {"sheet.obj": obj_text(rest, triangles), "start.obj": obj_text(rest * factors, triangles)}


def released(small: bool) -> Scene:
    """A free sheet of cotton; drag lets it settle.

    A jittered start of no width intersects itself, and has hinges folded beyond 180 degrees. Mid-edge bending is
    infinite at 180 degrees, so that nothing unfolds them: hinge bending is taken, and no self-contact.
    """
    return Scene(
        cloth={"mesh": "sheet.obj"},
        effects={"inertia": {}, "membrane": {}, "bending": {"model": "hinge"}, "damping": {"rate": 20.0}},
        solver={"dt": 0.01, "max_iterations": MOST_NEWTON},
        run={"duration": 0.5},
        seed={"from": "file", "file": "start.obj"},
    )


def recovered(run: Run) -> str:
    """Every triangle is as long and as wide as at rest."""
    world = build(scene_of(run)).world
    F = deformation_gradients(run.positions(-1), world.triangles, world.rest_shape_inverses)
    strain = float(np.abs(principal_stretches(F) - 1.0).max())
    return f"a triangle is still strained by {strain:.2g}" if strain > RECOVERED else ""


def case(name: str, title: str, *factors: float) -> Case:
    """The case of a start distorted by such factors along x, y and z."""
    check = all_of(recovered, energy_falls)
    return Case(name, title, released, check, crosses=True, files=lambda small: files(small, factors))


CASES = (
    case("B17a", "sheet starts squeezed to 1e-6 of its size", 1e-6, 1e-6, 1.0),
    case("B17b", "sheet starts squeezed to 1e-6 of its size along x", 1e-6, 1.0, 1.0),
    case("B17c", "sheet starts stretched to 3 times its size", 3.0, 3.0, 1.0),
    case("B17d", "sheet starts mirrored", -1.0, 1.0, 1.0),
)
