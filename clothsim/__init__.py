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
    from clothsim.errors import ClothsimError, InputError
    from clothsim.fitting.fit import Fit, fit
    from clothsim.run.results import Run, open_run
    from clothsim.run.simulate import resume, simulate
    from clothsim.run.simulation import Simulation, SimulationError
    from clothsim.run.simulation_state import SimulationState
    from clothsim.scene.scene import Scene
    from clothsim.scene.toml_file import load_scene

__version__ = "0.1.0"

_HOMES = {
    "ClothsimError": "clothsim.errors",
    "Fit": "clothsim.fitting.fit",
    "InputError": "clothsim.errors",
    "Run": "clothsim.run.results",
    "Scene": "clothsim.scene.scene",
    "Simulation": "clothsim.run.simulation",
    "SimulationError": "clothsim.run.simulation",
    "SimulationState": "clothsim.run.simulation_state",
    "Study": "clothsim.accuracy.study",
    "fit": "clothsim.fitting.fit",
    "load_scene": "clothsim.scene.toml_file",
    "open_run": "clothsim.run.results",
    "resume": "clothsim.run.simulate",
    "simulate": "clothsim.run.simulate",
    "study_accuracy": "clothsim.accuracy.study",
}
"""The module of each public name."""

__all__ = [
    "ClothsimError",
    "Fit",
    "InputError",
    "Run",
    "Scene",
    "Simulation",
    "SimulationError",
    "SimulationState",
    "Study",
    "fit",
    "load_scene",
    "open_run",
    "resume",
    "simulate",
    "study_accuracy",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'clothsim' has no attribute {name!r}")
    return getattr(_import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
