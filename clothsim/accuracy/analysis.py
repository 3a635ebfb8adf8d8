"""Error analysis of a study: errors, their uncertainty, sources and Pareto front."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from clothsim.accuracy.cost_model import predicted_seconds
from clothsim.accuracy.front import (
    cheapest_within,
    pareto_front,
    predicted_errors,
    targets,
    worth_trying,
)
from clothsim.accuracy.knobs import Knob
from clothsim.accuracy.points import BASE, Point, point
from clothsim.accuracy.reference_solution import Limit, Norm, Reference, largest_pair, limit, reference
from clothsim.arrays import Floats
from clothsim.scene.scene import Scene

RESOLVED = 10.0
"""Least ratio of a resolved error to the reference's own error."""


@dataclass(frozen=True)
class Findings:
    """reference; errors {point: RMS}, largest {point: max} and seconds of the data points [m, s].

    bars {knob: what it adds to the base's error}; remainder: what they leave of it, nan without a joint run; front:
    points, the cheapest first.
    """

    reference: Reference
    errors: Mapping[Point, float]
    largest: Mapping[Point, float]
    seconds: Mapping[Point, float]
    bars: Mapping[str, float]
    remainder: float
    front: tuple[Point, ...]

    @property
    def valid(self) -> bool:
        """True where the reference's own error is below a tenth of the smallest error."""
        return RESOLVED * self.reference.error <= min(self.errors.values())

    def resolved(self, where: Point) -> bool:
        """True where an error is RESOLVED."""
        return self.errors[where] >= RESOLVED * self.reference.error


def sweeps_of(fields: Mapping[Point, Floats], knobs: Mapping[str, Knob]) -> dict[str, dict[int, Floats]]:
    """The one-knob runs {knob: {level: field}} of the knobs that have a finer one."""
    sweeps: dict[str, dict[int, Floats]] = {name: {} for name in knobs}
    for where, each in fields.items():
        if len(where.levels) == 1 and not where.variant and where.levels[0][0] in sweeps:
            name, level = where.levels[0]
            sweeps[name][level] = each
    return {name: sweep for name, sweep in sweeps.items() if max(sweep, default=0) > 0}


def limits_of(
    fields: Mapping[Point, Floats], knobs: Mapping[str, Knob], base: Scene, norm: Norm, noise: float
) -> dict[str, Limit]:
    """The limit of each sweep."""
    return {
        name: limit({0: fields[BASE], **sweep}, knobs[name].ratio, knobs[name].order(base), norm, noise)
        for name, sweep in sweeps_of(fields, knobs).items()
    }


def joint_points(limits: Mapping[str, Limit], base: Floats, norm: Norm) -> list[Point]:
    """Joint runs for the interaction of the two largest errors: both coarser, both finer."""
    pair = largest_pair(base, limits, norm)
    return [point(dict.fromkeys(pair, level)) for level in (-1, 1)] if len(pair) == 2 else []


def finer_point(fields: Mapping[Point, Floats], limits: Mapping[str, Limit]) -> list[Point]:
    """The next finer run of the knob whose limit is least certain."""
    if not limits:
        return []
    worst = max(limits, key=lambda name: limits[name].error)
    alone = [where.level(worst) for where in fields if [name for name, _ in where.levels] == [worst]]
    return [point({worst: max(alone) + 1})]


def findings(
    fields: Mapping[Point, Floats],
    seconds: Mapping[Point, float],
    knobs: Mapping[str, Knob],
    base: Scene,
    norm: Norm,
    noise: float,
) -> Findings:
    """Errors, front and limits from the fields (n, k) and CPU seconds of the data points, base included."""
    sweeps, limits = sweeps_of(fields, knobs), limits_of(fields, knobs, base, norm, noise)
    start = fields[BASE]
    pair = largest_pair(start, limits, norm)
    joint = {}
    for level in (-1, 1):
        together = point(dict.fromkeys(pair, level))
        if len(pair) == 2 and together in fields:
            joint[level] = fields[together]
    estimate = reference(start, sweeps, limits, joint, {name: knobs[name].ratio for name in limits}, norm, noise)
    errors = {where: norm(each - estimate.field) for where, each in fields.items()}
    largest = {where: float(np.linalg.norm(each - estimate.field, axis=1).max()) for where, each in fields.items()}
    whole = start - estimate.field
    parts = {name: start - each.field for name, each in limits.items()}
    points = list(fields)
    rows = pareto_front([seconds[where] for where in points], [errors[where] for where in points])
    return Findings(
        estimate,
        errors,
        largest,
        seconds,
        {name: norm(part) for name, part in parts.items()},
        norm(whole - sum(parts.values(), start=np.zeros_like(whole))) if estimate.joint else np.nan,
        tuple(points[row] for row in rows),
    )


def predicted(
    fields: Mapping[Point, Floats], limits: Mapping[str, Limit], norm: Norm
) -> tuple[list[Point], list[float]]:
    """Combinations of swept levels and the errors that they would have if the knobs' own errors added up."""
    own: dict[str, dict[int, Floats]] = {}
    for name, each in limits.items():
        own[name] = {0: fields[BASE] - each.field}
        for where, field in fields.items():
            if len(where.levels) == 1 and where.levels[0][0] == name:
                own[name][where.levels[0][1]] = field - each.field
    combinations, errors = predicted_errors(own, norm)
    return [point(levels) for levels in combinations], errors


def next_points(
    fields: Mapping[Point, Floats],
    seconds: Mapping[Point, float],
    limits: Mapping[str, Limit],
    knobs: Mapping[str, Knob],
    norm: Norm,
    most: int,
) -> list[Point]:
    """Combinations on the front that the one-knob runs predict."""
    points, errors = predicted(fields, limits, norm)
    costs = [predicted_seconds(where, seconds, knobs) for where in points]
    return worth_trying([dict(where.levels) for where in points], errors, costs, most)


@dataclass(frozen=True)
class Recommendation:
    """For an error of at most `target` [m]: a point, the error it had, its seconds; measured: it was run."""

    target: float
    point: Point
    error: float
    seconds: float
    measured: bool = True


def recommendations(findings: Findings, unit: float) -> list[Recommendation]:
    """For errors of 1, 2, 5 ... times `unit` [m]: the cheapest data point that keeps them with the reference's own.

    Where one point is the answer for several errors, only the smallest of them is listed.
    """
    points = list(findings.errors)
    safe = [findings.errors[where] + findings.reference.error for where in points]
    seconds = [findings.seconds[where] for where in points]
    chosen: dict[Point, Recommendation] = {}
    for target in targets([error / unit for error in safe]):
        row = cheapest_within(target * unit, seconds, safe)
        if row is not None and points[row] not in chosen:
            where = points[row]
            chosen[where] = Recommendation(target * unit, where, findings.errors[where], findings.seconds[where])
    return list(chosen.values())


def half(
    findings: Findings,
    fields: Mapping[Point, Floats],
    knobs: Mapping[str, Knob],
    norm: Norm,
) -> Recommendation | None:
    """The cheapest data point with half the base's error; without one, the cheapest predicted.

    None without either, and where the reference is less certain than that.
    """
    target = 0.5 * findings.errors[BASE]
    if findings.reference.error > target:
        return None
    points = list(findings.errors)
    seconds, errors = [findings.seconds[where] for where in points], [findings.errors[where] for where in points]
    row = cheapest_within(target, seconds, errors)
    if row is not None:
        return Recommendation(target, points[row], errors[row], seconds[row])
    limits = findings.reference.limits
    if not limits:
        return None
    others, guesses = predicted(fields, limits, norm)
    costs = [predicted_seconds(where, findings.seconds, knobs) for where in others]
    row = cheapest_within(target, costs, guesses)
    return None if row is None else Recommendation(target, others[row], guesses[row], costs[row], measured=False)
