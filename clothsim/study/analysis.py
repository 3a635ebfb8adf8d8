"""Error analysis of a study: errors, their uncertainty, sources and Pareto front."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TypeVar

import numpy as np

from clothsim import Scene
from clothsim.base.arrays import Floats
from clothsim.study.parameters import INTEGRATOR, SWITCH, Parameter
from clothsim.study.points import BASE, Point, point, predicted_seconds
from clothsim.study.reference_solution import (
    Limit,
    Norm,
    Reference,
    large_parameters,
    limit,
    not_below,
    reference,
    with_other_formula,
)

RESOLVED = 10.0
"""Least ratio of a resolved error to the reference's own error."""
TOGETHER = (1, -1, 2)
"""Levels at which parameters are refined together, the most telling first."""
ADDITIVE = 0.25
"""Interaction term over the base's error, up to which predicted combinations are believed."""


@dataclass(frozen=True)
class Compared:
    """The runs of a study as they are compared.

    Parameters
    ----------
    fields : dict
        Compared data {point: (n, k) array} of the data points, base included.
    seconds : dict
        Seconds of the processor {point: s}.
    parameters : dict
        The parameters of the study by name.
    base : Scene
        Scene of the base.
    norm : Norm
    noise : float
        RMS by which a run differs from itself [m].
    estimate : float
        Error of the time steps and of Newton's end by the certificate of the base [m].
    in_time : str
        Name of the parameter of the time steps; empty where there is none.
    """

    fields: Mapping[Point, Floats]
    seconds: Mapping[Point, float]
    parameters: Mapping[str, Parameter]
    base: Scene
    norm: Norm
    noise: float
    estimate: float
    in_time: str

    @property
    def always(self) -> tuple[str, ...]:
        """The parameters without which no error is stated: that of the time steps, and cells."""
        return tuple(name for name in (self.in_time, "cells") if name)

    def sweeps(self) -> dict[str, dict[int, Floats]]:
        """The one-parameter runs {parameter: {level: field}} of the parameters that have a finer one."""
        sweeps: dict[str, dict[int, Floats]] = {name: {} for name in self.parameters}
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
                {0: start, **sweep},
                self.parameters[name].ratio,
                self.parameters[name].order(self.base),
                norm,
                self.noise,
            )
            for name, sweep in self.sweeps().items()
        }
        if self.in_time in limits:
            own = limits[self.in_time]
            other, norm = self.other_formula(), self.norm
            sweep = {0: self.fields[BASE], **self.sweeps()[self.in_time]}
            if other:
                turned = SWITCH.put(self.base, self.base, 1)
                order = self.parameters[self.in_time].order(turned) or 1.0
                second_order = turned.solver_settings.integrator == "bdf2"
                own = with_other_formula(sweep, own, other, order, second_order, norm)
            limits[self.in_time] = not_below(self.estimate, sweep, own, other, norm)
        return limits

    def together(self) -> tuple[str, ...]:
        """The parameters to refine together."""
        return large_parameters(self.fields[BASE], self.limits(), self.always, self.norm)

    def points_together(self, levels: Sequence[int]) -> list[Point]:
        """The runs of those parameters together, at levels; none where there are fewer than two."""
        names = self.together()
        return [point(dict.fromkeys(names, level)) for level in levels] if len(names) > 1 else []

    def least_certain(self) -> list[Point]:
        """The next finer run of the parameter whose limit is least certain."""
        limits = self.limits()
        if not limits:
            return []
        worst = max(limits, key=lambda name: limits[name].error)
        return [point({worst: max(self.sweeps()[worst]) + 1})]


@dataclass(frozen=True)
class Findings:
    """reference; errors {point: RMS}, largest {point: max} and seconds of the data points [m, s].

    bars {parameter: what it adds to the base's error}; remainder: what they leave of it, nan without a run of several;
    front: points, the cheapest first.
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
    combined = {
        level: fields[point(dict.fromkeys(names, level))]
        for level in TOGETHER
        if point(dict.fromkeys(names, level)) in fields
    }
    ratios = {name: compared.parameters[name].ratio for name in limits}
    estimate = reference(start, compared.sweeps(), limits, combined, names, ratios, norm, compared.noise)
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
        norm(whole - sum(parts.values(), start=np.zeros_like(whole))) if estimate.combined else np.nan,
        tuple(points[row] for row in rows),
    )


def summed_errors(compared: Compared) -> tuple[list[Point], list[float]]:
    """Combinations of swept levels, and the errors that they would have if the parameters' own errors added up.

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
    merged = [{parameter: level for part in each.values() for parameter, level in part.levels} for each in combinations]
    return [point(levels) for levels in merged], errors


def next_points(compared: Compared, most: int) -> list[Point]:
    """Combinations on the front that the one-parameter runs predict; none where no limit is known."""
    if not compared.sweeps():
        return []
    points, errors = summed_errors(compared)
    costs = [predicted_seconds(where, compared.seconds, compared.parameters) for where in points]
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
    for target in round_targets([error / unit for error in safe]):
        row = cheapest_within(target * unit, seconds, safe)
        if row is not None and points[row] not in chosen:
            where = points[row]
            chosen[where] = Recommendation(target * unit, where, findings.errors[where], findings.seconds[where])
    return list(chosen.values())


def half(findings: Findings, compared: Compared) -> Recommendation | None:
    """The cheapest data point with half the base's error; without one, the cheapest predicted.

    None without either, where the reference is less certain than that, and no prediction where the parameters' errors
    do not add up.
    """
    target = 0.5 * findings.errors[BASE]
    if findings.reference.error > target:
        return None
    points = list(findings.errors)
    seconds, errors = [findings.seconds[where] for where in points], [findings.errors[where] for where in points]
    row = cheapest_within(target, seconds, errors)
    if row is not None:
        return Recommendation(target, points[row], errors[row], seconds[row])
    if not findings.reference.limits or not findings.reference.interaction <= ADDITIVE * findings.errors[BASE]:
        return None
    others, guesses = summed_errors(compared)
    costs = [predicted_seconds(where, findings.seconds, compared.parameters) for where in others]
    row = cheapest_within(target, costs, guesses)
    return None if row is None else Recommendation(target, others[row], guesses[row], costs[row], measured=False)


T = TypeVar("T")
MOST_COMBINATIONS = 20_000
ROUND = (1.0, 2.0, 5.0)
WORTH = 0.9


def pareto_front(seconds: Sequence[float], errors: Sequence[float]) -> list[int]:
    """The rows that no other beats in both, from the cheapest on; of equal ones the first."""
    front: list[int] = []
    best = np.inf
    for row in sorted(range(len(seconds)), key=lambda row: (seconds[row], errors[row])):
        if errors[row] < best:
            front.append(row)
            best = errors[row]
    return front


def predicted_errors(own: Mapping[str, Mapping[T, Floats]], norm: Norm) -> tuple[list[dict[str, T]], list[float]]:
    """Every combination of swept levels, and its error if the own error fields {parameter: {level: field}} add up.

    Fields, not numbers, are added: two errors of the same direction add, opposite ones cancel. The number of
    combinations is held to MOST_COMBINATIONS by leaving out the last levels of a parameter: those furthest from the
    base.
    """
    levels = {name: list(fields) for name, fields in own.items()}
    while np.prod([len(each) for each in levels.values()]) > MOST_COMBINATIONS:
        longest = max(levels, key=lambda name: len(levels[name]))
        levels[longest] = levels[longest][:-1]
    flat = [own[name][level] for name in levels for level in levels[name]]
    gram = np.array([[norm.inner(one, other) for other in flat] for one in flat])
    starts = np.cumsum([0, *(len(each) for each in levels.values())])
    index_tuples = product(*(range(len(each)) for each in levels.values()))
    combinations, errors = [], []
    for indices in index_tuples:
        rows = [start + k for start, k in zip(starts[:-1], indices, strict=True)]
        combinations.append({name: levels[name][k] for name, k in zip(levels, indices, strict=True)})
        errors.append(float(np.sqrt(max(0.0, gram[np.ix_(rows, rows)].sum()))))
    return combinations, errors


def worth_trying(
    combinations: Sequence[Mapping[str, int]], errors: Sequence[float], seconds: Sequence[float], most: int
) -> list[Point]:
    """The combinations on the predicted front, at most `most` of them, spread evenly over it.

    One whose error is not below WORTH times that of the one before it is not worth a run.
    """
    selected: list[int] = []
    for row in pareto_front(seconds, errors):
        if not selected or errors[row] < WORTH * errors[selected[-1]]:
            selected.append(row)
    chosen = np.unique(np.linspace(0, len(selected) - 1, min(most, len(selected))).round().astype(int))
    return [point(combinations[selected[k]]) for k in chosen]


def round_targets(errors: Sequence[float]) -> list[float]:
    """1, 2, 5, 10 ... of the unit, from the first above the smallest of `errors` to the first above the largest."""
    low, high = min(errors), max(errors)
    if not 0 < low < np.inf:
        return []
    decades = range(int(np.floor(np.log10(low))) - 1, int(np.ceil(np.log10(high))) + 1)
    series = [step * 10.0**decade for decade in decades for step in ROUND]
    first = next(each for each in series if each >= low)
    last = next((each for each in series if each >= high), series[-1])
    return [float(f"{each:.0e}") for each in series if first <= each <= last]


def cheapest_within(target: float, seconds: Sequence[float], errors: Sequence[float]) -> int | None:
    """The cheapest row whose error is at most `target`; None where there is none."""
    within = [row for row in range(len(errors)) if errors[row] <= target]
    return min(within, key=lambda row: seconds[row]) if within else None
