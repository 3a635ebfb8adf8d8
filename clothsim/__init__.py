"""clothsim: finite-element cloth with intersection-free contact.

    import clothsim
    run = clothsim.simulate(clothsim.load_scene("scenes/sphere.toml"), output="drape")
    run.positions(-1)      # (n, 3) [m]

Names are loaded when they are used, so that `import clothsim` costs nothing.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from clothsim.accuracy.study import Study, study_accuracy
    from clothsim.errors import ClothsimError, InputError
    from clothsim.fitting.fit import Fit, fit
    from clothsim.io.results import Run, open_run
    from clothsim.run.simulate import resume, simulate
    from clothsim.scene.cloth_arrays import BodyArrays as Body
    from clothsim.scene.cloth_arrays import ClothArrays as Cloth
    from clothsim.scene.effect_tables import Crease, Gust, Motion, PinGroup, Seam, SeamLine, Spring, Vortex
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

__version__ = "0.1.0"

_HOMES = {
    "ClothsimError": "clothsim.errors",
    "InputError": "clothsim.errors",
    "Fit": "clothsim.fitting.fit",
    "Run": "clothsim.io.results",
    "Scene": "clothsim.scene.scene",
    "Study": "clothsim.accuracy.study",
    "fit": "clothsim.fitting.fit",
    "load_scene": "clothsim.scene.toml_file",
    "open_run": "clothsim.io.results",
    "resume": "clothsim.run.simulate",
    "simulate": "clothsim.run.simulate",
    "study_accuracy": "clothsim.accuracy.study",
    "Body": "clothsim.scene.cloth_arrays:BodyArrays",
    "Cloth": "clothsim.scene.cloth_arrays:ClothArrays",
    "Crease": "clothsim.scene.effect_tables",
    "Gust": "clothsim.scene.effect_tables",
    "Motion": "clothsim.scene.effect_tables",
    "PinGroup": "clothsim.scene.effect_tables",
    "Seam": "clothsim.scene.effect_tables",
    "SeamLine": "clothsim.scene.effect_tables",
    "Spring": "clothsim.scene.effect_tables",
    "Vortex": "clothsim.scene.effect_tables",
    "Contact": "clothsim.scene.settings",
    "RunSettings": "clothsim.scene.settings",
    "Seed": "clothsim.scene.settings",
    "Solver": "clothsim.scene.settings",
    "Air": "clothsim.scene.typed_effects",
    "Bending": "clothsim.scene.typed_effects",
    "BodyContact": "clothsim.scene.typed_effects",
    "Damping": "clothsim.scene.typed_effects",
    "Fibres": "clothsim.scene.typed_effects",
    "Friction": "clothsim.scene.typed_effects",
    "Gravity": "clothsim.scene.typed_effects",
    "Inertia": "clothsim.scene.typed_effects",
    "Membrane": "clothsim.scene.typed_effects",
    "Pins": "clothsim.scene.typed_effects",
    "PlasticBending": "clothsim.scene.typed_effects",
    "Pressure": "clothsim.scene.typed_effects",
    "RestAngle": "clothsim.scene.typed_effects",
    "Seams": "clothsim.scene.typed_effects",
    "SelfContact": "clothsim.scene.typed_effects",
    "Springs": "clothsim.scene.typed_effects",
    "StrainLimit": "clothsim.scene.typed_effects",
}
"""The module of each name, and its name there where it is another."""

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
    "Fibres",
    "Fit",
    "Friction",
    "Gravity",
    "Gust",
    "Inertia",
    "InputError",
    "Membrane",
    "Motion",
    "PinGroup",
    "Pins",
    "PlasticBending",
    "Pressure",
    "RestAngle",
    "Run",
    "RunSettings",
    "Scene",
    "Seam",
    "SeamLine",
    "Seams",
    "Seed",
    "SelfContact",
    "Solver",
    "Spring",
    "Springs",
    "StrainLimit",
    "Study",
    "Vortex",
    "fit",
    "load_scene",
    "open_run",
    "resume",
    "simulate",
    "study_accuracy",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'clothsim' has no attribute {name!r}")
    module, _, other = _HOMES[name].partition(":")
    return getattr(importlib.import_module(module), other or name)
