"""clothsim: finite-element cloth with intersection-free contact.

    import clothsim
    run = clothsim.simulate(clothsim.load_scene("scenes/sphere.toml"), output="drape")
    run.positions(-1)      # (n, 3) [m]

Names are loaded when they are used, so that `import clothsim` costs nothing.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from clothsim.drape import resume, simulate
    from clothsim.errors import ClothsimError, InputError
    from clothsim.fitting.fit import Fit, fit
    from clothsim.io.run import Run, open_run
    from clothsim.scene.scene import Scene
    from clothsim.scene.toml import load_scene
    from clothsim.study.accuracy.study import Study, study_accuracy

__version__ = "0.1.0"

_HOMES = {
    "ClothsimError": "clothsim.errors",
    "InputError": "clothsim.errors",
    "Fit": "clothsim.fitting.fit",
    "Run": "clothsim.io.run",
    "Scene": "clothsim.scene.scene",
    "Study": "clothsim.study.accuracy.study",
    "fit": "clothsim.fitting.fit",
    "load_scene": "clothsim.scene.toml",
    "open_run": "clothsim.io.run",
    "resume": "clothsim.drape",
    "simulate": "clothsim.drape",
    "study_accuracy": "clothsim.study.accuracy.study",
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
