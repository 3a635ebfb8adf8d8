"""Discretisation parameters: refinable settings, their expected orders of convergence, how far they are trusted.

A level is a number of refinements: 0 is the base, +1 one finer, -1 one coarser. A new parameter is one line of
PARAMETERS.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from typing import Any

from clothsim import Scene, engine
from clothsim.base.errors import InputError
from clothsim.base.inputs import refuse_unknown
from clothsim.engine import with_cells

CONTACTS = ("body_contact", "self_contact")
"""Effects that have a d_hat."""
TIME, CELLS, D_HAT = "dt", "cells", "d_hat"
"""The parameters that a request for an error refines."""


@dataclass(frozen=True)
class Assumed:
    """Orders that are assumed of differences of two runs without and with contact, and how far they are trusted.

    farthest: the largest refinement beyond the finest run so far.
    """

    smooth: float
    in_contact: float
    farthest: int


@dataclass(frozen=True)
class Parameter:
    """name; unit of its value; ratio: by what a level divides its value; order: expected slope of the error in it.

    at: the value at a level and the scene with it, from the base scene and the scene to change; InputError, whose
    sentence is the reason, where the scene has no such parameter or level. order None: the error falls faster than any
    power of the value, or is not a smooth function of it: nothing is extrapolated. growth: first guess of what a level
    costs; assumed: of a parameter that a request for an error refines.
    """

    name: str
    unit: str
    ratio: float
    order: Callable[[Scene], float | None]
    at: Callable[[Scene, Scene, int], tuple[Any, Scene]]
    growth: float
    assumed: Assumed | None = None

    def put(self, base: Scene, scene: Scene, level: int) -> Scene:
        """`scene` with this parameter at a level of `base`."""
        return self.at(base, scene, level)[1] if level else scene

    def value(self, base: Scene, level: int) -> Any:
        """The parameter's value at a level of `base`."""
        return self.at(base, base, level)[0]


def d_hats(scene: Scene) -> dict[str, float]:
    """The d_hat of each contact effect that gives a number [m]."""
    values = {name: scene.effects[name].d_hat for name in CONTACTS if name in scene.effects}
    return {name: float(value) for name, value in values.items() if not isinstance(value, str)}


def steps_per_frame(scene: Scene) -> tuple[int, float]:
    """Number of steps a frame of `scene`, and duration of a frame [s]."""
    run = scene.run_settings
    frame = min(1 / run.frames_per_second, run.duration)
    return max(1, ceil(frame / scene.solver_settings.dt - 1e-9)), frame


def with_explicit_lengths(scene: Scene, energies: Mapping[str, Any]) -> Scene:
    """`scene` with what it leaves to the mesh written out, so that a finer mesh changes the mesh alone.

    The d_hat of each contact that is on, one of its `energies`; dt as the steps that a frame is divided into.
    """
    for name, energy in energies.items():
        if hasattr(scene.effects.get(name), "d_hat"):
            scene = engine.replace(scene, f"effects.{name}.d_hat", float(energy.d_hat))
    if "error" not in scene.solver:
        pieces, frame = steps_per_frame(scene)
        scene = engine.replace(scene, "solver.dt", frame / pieces)
    return engine.replace(scene, "solver.threads", 1)


def _dt(base: Scene, scene: Scene, level: int) -> tuple[float, Scene]:
    pieces, frame = steps_per_frame(base)
    steps = pieces * Fraction(2) ** level
    if steps.denominator != 1:
        raise InputError(f"a frame of {frame:g} s has {pieces} steps at the base, and each frame ends a step")
    return frame / int(steps), engine.replace(scene, "solver.dt", frame / int(steps))


def _cells(base: Scene, scene: Scene, level: int) -> tuple[Any, Scene]:
    factor = Fraction(2) ** level
    cells = with_cells(base, factor).cloths[0]["cells"]
    value = list(cells) if isinstance(cells, tuple) else cells
    return value, with_cells(scene, factor) if level else scene


def _tolerance(base: Scene, scene: Scene, level: int) -> tuple[float, Scene]:
    if base.solver_settings.balanced:
        raise InputError("Newton's method stops by solver.newton_error_fraction")
    value = base.solver_settings.tolerance / 4.0**level
    return value, engine.replace(scene, "solver.tolerance", value)


def _newton_error_fraction(base: Scene, scene: Scene, level: int) -> tuple[float, Scene]:
    if not base.solver_settings.balanced:
        raise InputError("the scene gives solver.tolerance, not newton_error_fraction")
    value = base.solver_settings.stop_fraction / 4.0**level
    return value, engine.replace(scene, "solver.newton_error_fraction", value)


def newton_parameter(base: Scene) -> str:
    """Name of the parameter of Newton's stop that a scene has."""
    return "newton_error_fraction" if base.solver_settings.balanced else "tolerance"


def _d_hat(base: Scene, scene: Scene, level: int) -> tuple[float, Scene]:
    values = {name: value / 2.0**level for name, value in d_hats(base).items()}
    if not values:
        raise InputError("the scene has no contact")
    for name, value in values.items():
        scene = engine.replace(scene, f"effects.{name}.d_hat", value)
    return next(iter(values.values())), scene


def _eps_v(base: Scene, scene: Scene, level: int) -> tuple[float, Scene]:
    value = base.effects["friction"].eps_v if "friction" in base.effects else "auto"
    if isinstance(value, str):
        raise InputError("the scene has no friction that creeps")
    return value / 2.0**level, engine.replace(scene, "effects.friction.eps_v", value / 2.0**level)


def _iterations(base: Scene, scene: Scene, level: int) -> tuple[int, Scene]:
    if "friction" not in base.effects:
        raise InputError("the scene has no friction")
    iterations = base.effects["friction"].iterations * Fraction(2) ** level
    if iterations.denominator != 1:
        raise InputError("friction is lagged once already")
    return int(iterations), engine.replace(scene, "effects.friction.iterations", int(iterations))


def _order_in_time(scene: Scene) -> float:
    return 2.0 if scene.solver_settings.integrator == "bdf2" else 1.0


PARAMETERS = {
    parameter.name: parameter
    for parameter in (
        Parameter(TIME, "s", 2, _order_in_time, _dt, 1.8, Assumed(1.8, 1.5, 4)),
        Parameter(CELLS, "", 2, lambda scene: 2.0, _cells, 6.0, Assumed(2.0, 2.0, 2)),
        Parameter("tolerance", "m/s", 4, lambda scene: None, _tolerance, 1.1),
        Parameter("newton_error_fraction", "", 4, lambda scene: None, _newton_error_fraction, 1.2),
        Parameter(D_HAT, "m", 2, lambda scene: 1.0, _d_hat, 1.3, Assumed(1.2, 1.2, 4)),
        Parameter("eps_v", "m/s", 2, lambda scene: 1.0, _eps_v, 1.1),
        Parameter("iterations", "", 2, lambda scene: None, _iterations, 1.9),
    )
}


def _integrator(base: Scene, scene: Scene, level: int) -> tuple[str, Scene]:
    own = base.solver_settings.integrator
    if not level:
        return own, scene
    if level != 1 or "inertia" not in base.effects:
        raise InputError("there is no other difference formula")
    other = "backward_euler" if own == "bdf2" else "bdf2"
    return other, engine.replace(scene, "solver.integrator", other)


INTEGRATOR = "integrator"
SWITCH = Parameter(INTEGRATOR, "", 1, lambda scene: None, _integrator, 1.2)
"""The other difference formula, level 1: not finer, but another path to the same limit in dt."""


def any_parameter(name: str) -> Parameter:
    """A parameter of PARAMETERS, or the switch of the integrator."""
    return SWITCH if name == INTEGRATOR else PARAMETERS[name]


def usable(base: Scene, names: list[str] | None) -> tuple[dict[str, Parameter], dict[str, str]]:
    """Parameters of a scene, and the reason for each missing one. InputError for an unknown name."""
    refuse_unknown("parameters", names or [], PARAMETERS)
    available, missing = {}, {}
    for name in names or PARAMETERS:
        try:
            PARAMETERS[name].value(base, 0)
            PARAMETERS[name].value(base, 1)
            available[name] = PARAMETERS[name]
        except InputError as error:
            missing[name] = error.sentence.rstrip(".")
    if not available:
        raise InputError(f"There is nothing to refine: {'; '.join(missing.values())}.", "Name other parameters.")
    return available, missing


def written(name: str, value: Any) -> str:
    """A value of a parameter for people: "dt 1/60 s", "cells 40x40", "tolerance 0.001 m/s"."""
    if name == TIME and abs(1 / value - round(1 / value)) < 1e-6 / value and value < 1:
        return f"dt 1/{round(1 / value)} s"
    if isinstance(value, list | tuple):
        return f"{name} {'x'.join(str(count) for count in value)}"
    if name == D_HAT:
        return f"d_hat {1e3 * value:.3g} mm"
    unit = PARAMETERS[name].unit if name in PARAMETERS else ""
    return f"{name} {value:.3g} {unit}".rstrip() if isinstance(value, float) else f"{name} {value}"
