"""Error analysis of a study: errors, their uncertainty, sources and Pareto front."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clothsim import Scene
from clothsim.base.arrays import Floats
from clothsim.study.cost_model import predicted_seconds
from clothsim.study.front import cheapest_within, pareto_front, predicted_errors, targets, worth_trying
from clothsim.study.joint_refinement import Reference, large_knobs, reference
from clothsim.study.knobs import INTEGRATOR, SWITCH, Knob
from clothsim.study.points import BASE, Point, point
from clothsim.study.reference_solution import Limit, Norm, limit
from clothsim.study.time_error import not_below, with_other_formula

RESOLVED = 10.0
"""Least ratio of a resolved error to the reference's own error."""
JOINT = (1, -1, 2)
"""Levels at which knobs are refined together, the most telling first."""
ADDITIVE = 0.25
"""What the knobs add only together, over the base's error, up to which predicted combinations are believed."""


@dataclass(frozen=True)
class Compared:
    """The runs of a study as they are compared.

    Parameters
    ----------
    fields : dict
        Compared data {point: (n, k) array} of the data points, base included.
    seconds : dict
        Seconds of the processor {point: s}.
    knobs : dict
        The knobs of the study by name.
    base : Scene
        Scene of the base.
    norm : Norm
    noise : float
        RMS by which a run differs from itself [m].
    estimate : float
        Error of the time steps and of Newton's end by the certificate of the base [m].
    in_time : str
        Name of the knob of the time steps; empty where there is none.
    """

    fields: Mapping[Point, Floats]
    seconds: Mapping[Point, float]
    knobs: Mapping[str, Knob]
    base: Scene
    norm: Norm
    noise: float
    estimate: float
    in_time: str

    @property
    def always(self) -> tuple[str, ...]:
        """The knobs without which no error is stated: that of the time steps, and cells."""
        return tuple(name for name in (self.in_time, "cells") if name)

    def sweeps(self) -> dict[str, dict[int, Floats]]:
        """The one-knob runs {knob: {level: field}} of the knobs that have a finer one."""
        sweeps: dict[str, dict[int, Floats]] = {name: {} for name in self.knobs}
        for where, each in self.fields.items():
            if len(where.levels) == 1 and not where.variant and where.levels[0][0] in sweeps:
                name, level = where.levels[0]
                sweeps[name][level] = each
        return {name: sweep for name, sweep in sweeps.items() if max(sweep, default=0) > 0}

    def other_formula(self) -> dict[int, Floats]:
        """The runs with the other difference formula, by the level of the time steps."""
        return {
            where.level(self.in_time): each
            for where, each in self.fields.items()
            if where.level(INTEGRATOR)
            and not where.variant
            and {name for name, _ in where.levels} <= {INTEGRATOR, self.in_time}
        }

    def limits(self) -> dict[str, Limit]:
        """The limit of each sweep; that in time by both difference formulas, and not below the certificate."""
        start, norm = self.fields[BASE], self.norm
        limits = {
            name: limit(
                {0: start, **sweep}, self.knobs[name].ratio, self.knobs[name].order(self.base), norm, self.noise
            )
            for name, sweep in self.sweeps().items()
        }
        if self.in_time in limits:
            limits[self.in_time] = self._limit_in_time(limits[self.in_time])
        return limits

    def _limit_in_time(self, own: Limit) -> Limit:
        other, norm = self.other_formula(), self.norm
        sweep = {0: self.fields[BASE], **self.sweeps()[self.in_time]}
        if other:
            turned = SWITCH.put(self.base, self.base, 1)
            order = self.knobs[self.in_time].order(turned) or 1.0
            second_order = turned.solver_settings.integrator == "bdf2"
            own = with_other_formula(sweep, own, other, order, second_order, norm)
        return not_below(self.estimate, sweep, own, other, norm)

    def together(self) -> tuple[str, ...]:
        """The knobs to refine together."""
        return large_knobs(self.fields[BASE], self.limits(), self.always, self.norm)

    def joint_points(self, levels: Sequence[int]) -> list[Point]:
        """The runs of those knobs together, at levels; none where there are fewer than two."""
        names = self.together()
        return [point(dict.fromkeys(names, level)) for level in levels] if len(names) > 1 else []

    def least_certain(self) -> list[Point]:
        """The next finer run of the knob whose limit is least certain."""
        limits = self.limits()
        if not limits:
            return []
        worst = max(limits, key=lambda name: limits[name].error)
        return [point({worst: max(self.sweeps()[worst]) + 1})]


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


def findings(compared: Compared) -> Findings:
    """Errors, front and limits."""
    fields, norm, start = compared.fields, compared.norm, compared.fields[BASE]
    limits, names = compared.limits(), compared.together()
    joint = {
        level: fields[point(dict.fromkeys(names, level))]
        for level in JOINT
        if point(dict.fromkeys(names, level)) in fields
    }
    ratios = {name: compared.knobs[name].ratio for name in limits}
    estimate = reference(start, compared.sweeps(), limits, joint, names, ratios, norm, compared.noise)
    errors = {where: norm(each - estimate.field) for where, each in fields.items()}
    largest = {where: float(np.linalg.norm(each - estimate.field, axis=1).max()) for where, each in fields.items()}
    whole = start - estimate.field
    parts = {name: start - each.field for name, each in limits.items()}
    points = list(fields)
    rows = pareto_front([compared.seconds[where] for where in points], [errors[where] for where in points])
    return Findings(
        estimate,
        errors,
        largest,
        compared.seconds,
        {name: norm(part) for name, part in parts.items()},
        norm(whole - sum(parts.values(), start=np.zeros_like(whole))) if estimate.joint else np.nan,
        tuple(points[row] for row in rows),
    )


def predicted(compared: Compared) -> tuple[list[Point], list[float]]:
    """Combinations of swept levels, and the errors that they would have if the knobs' own errors added up.

    The time steps are one axis: their levels with either difference formula.
    """
    limits, sweeps, start = compared.limits(), compared.sweeps(), compared.fields[BASE]
    own: dict[str, dict[Point, Floats]] = {}
    for name, each in limits.items():
        fields = {0: start, **sweeps[name]}
        own[name] = {point({name: level}): fields[level] - each.field for level in sorted(fields, key=abs)}
        if name == compared.in_time:
            other = compared.other_formula()
            for level in sorted(other, key=abs):
                own[name][point({name: level, INTEGRATOR: 1})] = other[level] - each.field
    combinations, errors = predicted_errors(own, compared.norm)
    merged = [{knob: level for part in each.values() for knob, level in part.levels} for each in combinations]
    return [point(levels) for levels in merged], errors


def next_points(compared: Compared, most: int) -> list[Point]:
    """Combinations on the front that the one-knob runs predict; none where no limit is known."""
    if not compared.sweeps():
        return []
    points, errors = predicted(compared)
    costs = [predicted_seconds(where, compared.seconds, compared.knobs) for where in points]
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


def half(findings: Findings, compared: Compared) -> Recommendation | None:
    """The cheapest data point with half the base's error; without one, the cheapest predicted.

    None without either, where the reference is less certain than that, and no prediction where the knobs' errors do not
    add up.
    """
    target = 0.5 * findings.errors[BASE]
    if findings.reference.error > target:
        return None
    points = list(findings.errors)
    seconds, errors = [findings.seconds[where] for where in points], [findings.errors[where] for where in points]
    row = cheapest_within(target, seconds, errors)
    if row is not None:
        return Recommendation(target, points[row], errors[row], seconds[row])
    if not findings.reference.limits or not findings.reference.cross <= ADDITIVE * findings.errors[BASE]:
        return None
    others, guesses = predicted(compared)
    costs = [predicted_seconds(where, findings.seconds, compared.knobs) for where in others]
    row = cheapest_within(target, costs, guesses)
    return None if row is None else Recommendation(target, others[row], guesses[row], costs[row], measured=False)
