"""clothsim: finite-element cloth with intersection-free contact.

    import clothsim
    run = clothsim.simulate(clothsim.load_scene("scenes/sphere.toml"), output="drape")
    run.positions(-1)      # (n, 3) [m]

Names are loaded when they are used, so that `import clothsim` costs nothing.
"""

from importlib import import_module as _import_module
from typing import TYPE_CHECKING as _TYPE_CHECKING

if _TYPE_CHECKING:
    from clothsim.accuracy.study import Study, study_accuracy
    from clothsim.adjoint.design import design
    from clothsim.adjoint.recover import recover
    from clothsim.dressing.dress import dress
    from clothsim.dressing.dressed import Dress
    from clothsim.errors import ClothsimError, InputError, IntersectionWarning
    from clothsim.fitting.fit import Fit, fit
    from clothsim.mesh.checks import Finding
    from clothsim.run.check import check
    from clothsim.run.results import Run, open_run
    from clothsim.run.resume import resume
    from clothsim.run.simulate import simulate
    from clothsim.run.simulation import Simulation
    from clothsim.run.simulation_state import SimulationError, SimulationState
    from clothsim.scene.cloth_arrays import BodyArrays as Body
    from clothsim.scene.cloth_arrays import ClothArrays as Cloth
    from clothsim.scene.cloth_arrays import RigidArrays as Rigid
    from clothsim.scene.effect_tables import Crease, Gust, Motion, PinGroup, Seam, SeamLine, Spring, Vortex
    from clothsim.scene.effects import register_effect
    from clothsim.scene.scene import Scene
    from clothsim.scene.settings import Contact, RunSettings, Seed, Solver
    from clothsim.scene.toml_file import load_scene
    from clothsim.scene.typed_effects import (
        Air,
        Bending,
        BodyContact,
        Damping,
        Fibres,
        Friction,
        Gravity,
        Inertia,
        Membrane,
        Pins,
        PlasticBending,
        Pressure,
        RestAngle,
        Seams,
        SelfContact,
        Springs,
        StrainLimit,
    )
    from clothsim.viewer.view import view

__version__ = "0.1.0"

_HOMES = {
    "Air": "clothsim.scene.typed_effects",
    "Bending": "clothsim.scene.typed_effects",
    "Body": "clothsim.scene.cloth_arrays:BodyArrays",
    "BodyContact": "clothsim.scene.typed_effects",
    "Cloth": "clothsim.scene.cloth_arrays:ClothArrays",
    "ClothsimError": "clothsim.errors",
    "Contact": "clothsim.scene.settings",
    "Crease": "clothsim.scene.effect_tables",
    "Damping": "clothsim.scene.typed_effects",
    "Dress": "clothsim.dressing.dressed",
    "Fibres": "clothsim.scene.typed_effects",
    "Finding": "clothsim.mesh.checks",
    "Fit": "clothsim.fitting.fit",
    "Friction": "clothsim.scene.typed_effects",
    "Gravity": "clothsim.scene.typed_effects",
    "Gust": "clothsim.scene.effect_tables",
    "Inertia": "clothsim.scene.typed_effects",
    "InputError": "clothsim.errors",
    "IntersectionWarning": "clothsim.errors",
    "Membrane": "clothsim.scene.typed_effects",
    "Motion": "clothsim.scene.effect_tables",
    "PinGroup": "clothsim.scene.effect_tables",
    "Pins": "clothsim.scene.typed_effects",
    "PlasticBending": "clothsim.scene.typed_effects",
    "Pressure": "clothsim.scene.typed_effects",
    "RestAngle": "clothsim.scene.typed_effects",
    "Rigid": "clothsim.scene.cloth_arrays:RigidArrays",
    "Run": "clothsim.run.results",
    "RunSettings": "clothsim.scene.settings",
    "Scene": "clothsim.scene.scene",
    "Seam": "clothsim.scene.effect_tables",
    "SeamLine": "clothsim.scene.effect_tables",
    "Seams": "clothsim.scene.typed_effects",
    "Seed": "clothsim.scene.settings",
    "SelfContact": "clothsim.scene.typed_effects",
    "Simulation": "clothsim.run.simulation",
    "SimulationError": "clothsim.run.simulation_state",
    "SimulationState": "clothsim.run.simulation_state",
    "Solver": "clothsim.scene.settings",
    "Spring": "clothsim.scene.effect_tables",
    "Springs": "clothsim.scene.typed_effects",
    "StrainLimit": "clothsim.scene.typed_effects",
    "Study": "clothsim.accuracy.study",
    "Vortex": "clothsim.scene.effect_tables",
    "check": "clothsim.run.check",
    "design": "clothsim.adjoint.design:design",
    "dress": "clothsim.dressing.dress",
    "fit": "clothsim.fitting.fit",
    "load_scene": "clothsim.scene.toml_file",
    "open_run": "clothsim.run.results",
    "recover": "clothsim.adjoint.recover:recover",
    "register_effect": "clothsim.scene.effects",
    "resume": "clothsim.run.resume",
    "simulate": "clothsim.run.simulate",
    "study_accuracy": "clothsim.accuracy.study",
    "view": "clothsim.viewer.view",
}
"""The module of each public name, and its name there where it is another."""

__all__ = [
    "Air",
    "Bending",
    "Body",
    "BodyContact",
    "Cloth",
    "ClothsimError",
    "Contact",
    "Crease",
    "Damping",
    "Dress",
    "Fibres",
    "Finding",
    "Fit",
    "Friction",
    "Gravity",
    "Gust",
    "Inertia",
    "InputError",
    "IntersectionWarning",
    "Membrane",
    "Motion",
    "PinGroup",
    "Pins",
    "PlasticBending",
    "Pressure",
    "RestAngle",
    "Rigid",
    "Run",
    "RunSettings",
    "Scene",
    "Seam",
    "SeamLine",
    "Seams",
    "Seed",
    "SelfContact",
    "Simulation",
    "SimulationError",
    "SimulationState",
    "Solver",
    "Spring",
    "Springs",
    "StrainLimit",
    "Study",
    "Vortex",
    "check",
    "design",
    "dress",
    "fit",
    "load_scene",
    "open_run",
    "recover",
    "register_effect",
    "resume",
    "simulate",
    "study_accuracy",
    "view",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'clothsim' has no attribute {name!r}")
    module, _, other = _HOMES[name].partition(":")
    return getattr(_import_module(module), other or name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
