"""Points of a study: levels of its knobs, and the outcome of a run."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Any

from clothsim import Scene, engine
from clothsim.base.arrays import Floats
from clothsim.engine import PRESETS, with_preset
from clothsim.study.knobs import IN_TIME, INTEGRATOR, Knob, any_knob, newton_knob


@dataclass(frozen=True)
class Point:
    """levels: (knob, level) of the knobs that are not at the base, sorted; or a variant; seed: of its jitter, 0: none.

    Made by `point`, so that equal settings are equal points. variant: a preset or one of VARIANTS.
    """

    levels: tuple[tuple[str, int], ...] = ()
    variant: str = ""
    seed: int = 0

    def level(self, knob: str) -> int:
        """The level of a knob."""
        return dict(self.levels).get(knob, 0)

    def label(self) -> str:
        """Short label of the point."""
        name = self.variant or ", ".join(f"{knob} {level:+d}" for knob, level in self.levels) or "base"
        return f"{name}, seed {self.seed}" if self.seed else name


def point(levels: Mapping[str, int], seed: int = 0) -> Point:
    """The point with these levels."""
    return Point(tuple(sorted((knob, level) for knob, level in levels.items() if level)), seed=seed)


BASE = Point()

CONVERGENT = "midedge"
VARIANTS = {CONVERGENT: ("effects.bending.model", CONVERGENT)}
"""Scenes with another limit: the key and its value."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of the run of a point.

    positions (n, 3): of the base's material points at the end [m]; seconds: of the processor, warm-up apart;
    wall_seconds; counts: Newton iterations, steps, peak bytes; energy [J]; estimate: error of the time steps and of
    Newton's end by the run's own certificate [m]; failed: why it is no data point, empty where it is one.
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
    """A scene under study: as the user gave it, with everything written out (see `knobs.fixed`), and its knobs."""

    given: Scene
    base: Scene
    knobs: Mapping[str, Knob]

    @property
    def convergent(self) -> bool:
        """True where the bending model converges to the fabric's own stiffness (docs/results/validation.md, A3)."""
        bending = self.given.effects.get("bending")
        return bending is None or bending.model == CONVERGENT

    @property
    def in_time(self) -> str:
        """The knob of the time steps; empty where the study has none."""
        return IN_TIME if IN_TIME in self.knobs else ""

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
            scene = (self.knobs.get(name) or any_knob(name)).put(self.base, scene, level)
        return scene

    def variants(self) -> list[Point]:
        """Those that the scene has and is not itself."""
        return [] if self.convergent else [Point(variant=CONVERGENT)]

    def other_formula(self, levels: Iterable[int]) -> list[Point]:
        """The scene with the other difference formula, at levels of its knob of time; none without inertia."""
        if "inertia" not in self.base.effects:
            return []
        finer = [{self.in_time: level} if self.in_time else {} for level in levels]
        return list(dict.fromkeys(point({INTEGRATOR: 1, **each}) for each in finer))

    def settings(self, where: Point) -> dict[str, Any]:
        """The values of the knobs at a point, or its preset; with a variant its name too."""
        if where.variant in PRESETS:
            return {"preset": where.variant}
        turned = {name: any_knob(name) for name, _ in where.levels}
        values = {name: knob.value(self.base, where.level(name)) for name, knob in {**self.knobs, **turned}.items()}
        return {**values, VARIANTS[where.variant][0].split(".")[-1]: where.variant} if where.variant else values

    def tight(self, level: int) -> tuple[Point, Point]:
        """A point with a tight tolerance, and its twin with a jittered start."""
        levels = {newton_knob(self.base): level}
        return point(levels), point(levels, seed=1)

    def key(self, where: Point) -> str:
        """A name for the settings of a point and its seed: equal settings have equal names, however they came about."""
        text = replace(self.scene(where), run=self.base.run).to_text()
        return sha256(f"{text} {where.seed}".encode()).hexdigest()[:16]


def written(name: str, value: Any) -> str:
    """A value of a knob for people: "dt 1/60 s", "cells 40x40", "tolerance 0.001 m/s"."""
    if name in ("dt",) and abs(1 / value - round(1 / value)) < 1e-6 / value and value < 1:
        return f"dt 1/{round(1 / value)} s"
    if isinstance(value, list | tuple):
        return f"{name} {'x'.join(str(count) for count in value)}"
    if name == "d_hat":
        return f"d_hat {1e3 * value:.3g} mm"
    unit = {"tolerance": " m/s", "eps_v": " m/s"}.get(name, "")
    return f"{name} {value:.3g}{unit}" if isinstance(value, float) else f"{name} {value}"
