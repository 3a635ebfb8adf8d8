"""Points of a study: levels of its parameters, the outcome of a run, and the predicted seconds of one."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from hashlib import sha256
from typing import Any

from clothsim import Scene, engine
from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.inputs import did_you_mean
from clothsim.engine import with_cells
from clothsim.study.parameters import INTEGRATOR, TIME, Parameter, any_parameter, d_hats, newton_parameter


@dataclass(frozen=True)
class Point:
    """levels: (parameter, level) of those that are not at the base, sorted; or a variant; seed: of its jitter, 0: none.

    Made by `point`, so that equal settings are equal points. variant: a preset or one of VARIANTS.
    """

    levels: tuple[tuple[str, int], ...] = ()
    variant: str = ""
    seed: int = 0

    def level(self, parameter: str) -> int:
        """The level of a parameter."""
        return dict(self.levels).get(parameter, 0)

    def label(self) -> str:
        """Short label of the point."""
        name = self.variant or ", ".join(f"{parameter} {level:+d}" for parameter, level in self.levels) or "base"
        return f"{name}, seed {self.seed}" if self.seed else name


def point(levels: Mapping[str, int], seed: int = 0) -> Point:
    """The point with these levels."""
    return Point(tuple(sorted((parameter, level) for parameter, level in levels.items() if level)), seed=seed)


BASE = Point()

CONVERGENT = "midedge"
VARIANTS = {CONVERGENT: ("effects.bending.model", CONVERGENT)}
"""Scenes with another limit: the key and its value."""


@dataclass(frozen=True)
class PointOutcome:
    """Outcome of the run of a point.

    positions (n, 3): of the base's material points at the end [m]; seconds: of the processor, warm-up apart;
    wall_seconds; counts: Newton iterations, steps, peak bytes; energy [J]; estimate: error of the time steps and of
    Newton's end by the run's own certificate [m]; failed: why it is not a data point, empty where it is one.
    """

    point: Point
    positions: Floats
    seconds: float
    wall_seconds: float
    counts: Mapping[str, float]
    energy: float
    estimate: float
    failed: str = ""


@dataclass(frozen=True)
class Bench:
    """A scene under study: as the user gave it, with everything written out, and its parameters."""

    given: Scene
    base: Scene
    parameters: Mapping[str, Parameter]

    @property
    def convergent(self) -> bool:
        """True where the bending model converges to the fabric's own stiffness (docs/results/validation.md, A3)."""
        bending = self.given.effects.get("bending")
        return bending is None or bending.model == CONVERGENT

    @property
    def in_time(self) -> str:
        """The parameter of the time steps; empty where the study has none."""
        return TIME if TIME in self.parameters else ""

    def scene(self, where: Point) -> Scene:
        """The scene of a point, without its jitter. InputError where there is none.

        A preset keeps the scene's bending model unless that is the convergent one: another has another limit.
        """
        if where.variant in PRESETS:
            return engine.replace(with_preset(self.given, where.variant, self.convergent)[0], "solver.threads", 1)
        scene = self.base
        if where.variant:
            path, value = VARIANTS[where.variant]
            scene = engine.replace(scene, path, value)
        for name, level in where.levels:
            scene = (self.parameters.get(name) or any_parameter(name)).put(self.base, scene, level)
        return scene

    def variants(self) -> list[Point]:
        """Those that the scene has and is not itself."""
        return [] if self.convergent else [Point(variant=CONVERGENT)]

    def other_formula(self, levels: Iterable[int]) -> list[Point]:
        """The scene with the other difference formula, at levels of its parameter of time; none without inertia."""
        if "inertia" not in self.base.effects:
            return []
        finer = [{self.in_time: level} if self.in_time else {} for level in levels]
        return list(dict.fromkeys(point({INTEGRATOR: 1, **each}) for each in finer))

    def settings(self, where: Point) -> dict[str, Any]:
        """The values of the parameters at a point, or its preset; with a variant its name too."""
        if where.variant in PRESETS:
            return {"preset": where.variant}
        turned = {name: any_parameter(name) for name, _ in where.levels}
        refined = {**self.parameters, **turned}
        values = {name: parameter.value(self.base, where.level(name)) for name, parameter in refined.items()}
        return {**values, VARIANTS[where.variant][0].split(".")[-1]: where.variant} if where.variant else values

    def tight(self, level: int) -> tuple[Point, Point]:
        """A point with a tight tolerance, and its twin with a jittered start."""
        levels = {newton_parameter(self.base): level}
        return point(levels), point(levels, seed=1)

    def key(self, where: Point) -> str:
        """A name for the settings of a point and its seed: equal settings have equal names, however they came about."""
        text = replace(self.scene(where), run=self.base.run).to_text()
        return sha256(f"{text} {where.seed}".encode()).hexdigest()[:16]


def predicted_seconds(where: Point, done: Mapping[Point, float], parameters: Mapping[str, Parameter]) -> float:
    """Seconds of a point: those of the base times a factor for each parameter (the parameters' costs multiply).

    A parameter's factor is measured where a run has it alone at that level; else the growth between its two nearest
    levels goes on, or the parameter's own first guess where none is measured. The base must be done.
    """
    seconds = done[BASE]
    for name, level in where.levels:
        seconds *= _factor(parameters.get(name) or any_parameter(name), level, done)
    return seconds


def _factor(parameter: Parameter, level: int, done: Mapping[Point, float]) -> float:
    measured = {0: done[BASE]}
    alone = {each: point({parameter.name: each}) for each in range(-4, 5)}
    measured.update((each, done[where]) for each, where in alone.items() if where in done)
    if level in measured:
        return measured[level] / measured[0]
    nearest = min(measured, key=lambda each: abs(each - level))
    towards = 1 if level > nearest else -1
    inner = nearest - towards
    growth = parameter.growth
    if inner in measured:
        growth = max(1.0, (measured[nearest] / measured[inner]) ** towards)
    return measured[nearest] / measured[0] * growth ** (level - nearest)


# Presets: three resolutions, each with dt, cells and d_hat refined by two against the one before.
#
# Refined together they lie near the front of error against time on the scenes of `tests.known_answers.error_scenes`;
# one alone leaves the error of the others. The error of a run with a preset is estimated in that run, not tabulated.


BDF2 = "bdf2"


@dataclass(frozen=True)
class Preset:
    """Settings of a preset.

    Parameters
    ----------
    cells, d_hat : Fraction
        Factors of the scene's own cells, and of a d_hat that it gives.
    dt : float
        Time step [s].
    """

    cells: Fraction
    d_hat: Fraction
    dt: float


PRESETS = {
    "draft": Preset(Fraction(1, 2), Fraction(1), 0.02),
    "standard": Preset(Fraction(1), Fraction(1, 2), 0.01),
    "fine": Preset(Fraction(2), Fraction(1, 4), 0.005),
}
BENDING = "midedge"
"""Bending model of every preset, the one that converges."""


def with_preset(scene: Scene, name: str, models: bool = True) -> tuple[Scene, str]:
    """A scene with the settings of a preset.

    Parameters
    ----------
    scene : Scene
        Scene to change; it stays as it is.
    name : str
        A name of PRESETS.
    models : bool
        False: the scene's own bending model stays.

    Returns
    -------
    scene : Scene
        A cloth of a file keeps its mesh; a scene without bending gets none.
    settings : str
        The settings in words.

    Raises
    ------
    InputError
        For an unknown name.

    Examples
    --------
    >>> import clothsim
    >>> scene = clothsim.Scene(cloth={"mesh": "rectangle", "cells": [8, 8]})
    >>> with_preset(scene, "draft")[1]
    'cells x 1/2, dt 0.02 s, bdf2'
    """
    if name not in PRESETS:
        raise InputError(
            f"There is no preset {name!r}.", did_you_mean(name, PRESETS) or f"Known: {', '.join(PRESETS)}."
        )
    preset = PRESETS[name]
    settings = [f"dt {preset.dt:g} s", BDF2]
    try:
        scene = with_cells(scene, preset.cells, nearest=True)
        settings.insert(0, f"cells x {preset.cells}" if preset.cells != 1 else "the scene's own cells")
    except InputError as error:
        settings.insert(0, f"the mesh as it is ({error.sentence.rstrip('.')})")
    replaced = ("error", "tolerance", "newton_error_fraction")
    solver = {key: value for key, value in scene.solver.items() if key not in replaced}
    scene = replace(scene, solver={**solver, "dt": preset.dt, "integrator": BDF2})
    for contact, d_hat in d_hats(scene).items():
        scene = engine.replace(scene, f"effects.{contact}.d_hat", d_hat * float(preset.d_hat))
        settings.append(f"{contact} d_hat x {preset.d_hat}")
    if models and "bending" in scene.effects:
        scene = engine.replace(scene, "effects.bending.model", BENDING)
        settings.append(f"bending {BENDING}")
    return scene, ", ".join(settings)
