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
    from clothsim.scene.scene import Scene
    from clothsim.scene.toml_file import load_scene

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
}

__all__ = [
    "ClothsimError",
    "Fit",
    "InputError",
    "Run",
    "Scene",
    "Study",
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
    return getattr(importlib.import_module(_HOMES[name]), name)
