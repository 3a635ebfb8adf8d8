"""Sequence of a study's runs: what a statement on the error needs comes first."""

from dataclasses import replace

from clothsim.base.errors import InputError
from clothsim.study.analysis import TOGETHER, next_points
from clothsim.study.evaluation import Gatherer
from clothsim.study.observations import (
    TIGHT,
    Observations,
    enough_seeds,
    observations,
    one_parameter,
    seeded,
    with_twins,
)
from clothsim.study.parameters import INTEGRATOR
from clothsim.study.points import BASE, PRESETS, Bench, Point, point

COMBINATIONS = 6
LATE = 0.35
"""Largest fraction of the remaining budget for one of the runs that refine a statement."""
FINER = 3
"""Number of further levels that are run of the parameter whose limit is least certain, one at a time."""


def first_refinements(bench: Bench) -> list[Point]:
    """The finer dt and the finer cells, without which no error is stated; those that the study has."""
    return one_parameter([name for name in (bench.in_time, "cells") if name in bench.parameters], 1)


def gathered(gatherer: Gatherer) -> Observations:
    """Run what fits into the budget, in the order of what it tells; without the base nothing more."""
    bench, needed = gatherer.bench, first_refinements(gatherer.bench)
    gatherer.gather([BASE, *bench.other_formula((0,))])
    if not gatherer.good(BASE):
        return observations(gatherer)
    gatherer.gather(needed)
    gatherer.gather([*bench.tight(TIGHT), *one_parameter(list(bench.parameters), 1), *bench.other_formula((1,))])
    gatherer.gather([*one_parameter(list(bench.parameters), -1), *bench.other_formula((-1,))])
    gatherer.gather(needed)  # where coarser runs show that they fit after all
    seen = with_twins(observations(gatherer), needed)
    if seen.chaotic:
        # the runs of chaotic folds: seeds of the base and of every finer run
        gatherer.gather(seeded([BASE, *needed]))
        gatherer.gather(seeded(one_parameter(list(gatherer.bench.parameters), 1)), LATE)
        _other_settings(gatherer)
        return replace(seen, noise=seen.spread())
    gatherer.gather(seen.compared().points_together(TOGETHER[:1]))
    gatherer.gather(seen.compared().points_together(TOGETHER[1:2]))
    if all(gatherer.good(each) for each in needed):
        _gather_detail(gatherer, seen)
    return seen


def missing_points(seen: Observations) -> list[Point]:
    """The possible runs that a statement on the error needs and that are not known yet."""
    gatherer, bench = seen.gatherer, seen.gatherer.bench
    needed = first_refinements(bench)
    points = [BASE, *bench.other_formula((0, 1)), *needed, *bench.tight(TIGHT)]
    points += one_parameter(list(bench.parameters), 1)
    if seen.chaotic:
        points += seeded([BASE, *needed])
    else:
        names = [name for each in needed for name, _ in each.levels]
        names += seen.compared().together() if gatherer.good(BASE) else ()
        points.append(point(dict.fromkeys(names, 1)))
    return [where for where in dict.fromkeys(points) if where not in gatherer.outcomes and _possible(bench, where)]


def unanswered(seen: Observations) -> list[str]:
    """What a statement on the error lacks.

    Names of parameters without a finer run, dt and cells also where that run failed; "integrator" without runs of the
    other difference formula; "twins" where chaos was not looked for; with chaotic folds "seeds" where those are too
    few.
    """
    gatherer, bench = seen.gatherer, seen.gatherer.bench
    needed = first_refinements(bench)
    names = [
        name
        for name in bench.parameters
        if not (gatherer.good if point({name: 1}) in needed else gatherer.outcomes.__contains__)(point({name: 1}))
    ]
    if not all(each in gatherer.outcomes for each in bench.other_formula((0, 1))):
        names.append(INTEGRATOR)
    if not all(each in gatherer.outcomes for each in bench.tight(TIGHT)):
        names.append("twins")
    return [*names, "seeds"] if seen.chaotic and not enough_seeds(seen, needed) else names


def _gather_detail(gatherer: Gatherer, seen: Observations) -> None:
    """Finer runs of what is least certain, further levels, and combinations that may be worth their time."""
    names = list(gatherer.bench.parameters)
    gatherer.gather(seen.compared().least_certain(), LATE)
    gatherer.gather(seen.compared().points_together(TOGETHER[2:]), LATE)
    _other_settings(gatherer)
    gatherer.gather([*one_parameter(names, -2), *one_parameter(names, 2), *gatherer.bench.other_formula((2,))], LATE)
    gatherer.gather(next_points(seen.compared(), COMBINATIONS), LATE)
    for _ in range(FINER):
        gatherer.gather(seen.compared().least_certain(), LATE)
    gatherer.gather(next_points(seen.compared(), COMBINATIONS), LATE)


def _other_settings(gatherer: Gatherer) -> None:
    """The convergent bending model and the presets."""
    gatherer.gather([*gatherer.bench.variants(), *(Point(variant=name) for name in PRESETS)], LATE)


def _possible(bench: Bench, where: Point) -> bool:
    try:
        bench.scene(where)
    except InputError:
        return False
    return True
