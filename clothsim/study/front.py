"""Pareto front of error against seconds, and selection of settings from it."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import TypeVar

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.study.points import Point, point
from clothsim.study.reference_solution import Norm

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
    """Every combination of swept levels, and its error if the knobs' own error fields {knob: {level: field}} add up.

    Fields, not numbers, are added: two errors of the same direction add, opposite ones cancel. The number of
    combinations is held to MOST_COMBINATIONS by leaving out the last levels of a knob: those furthest from the base.
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


def targets(errors: Sequence[float]) -> list[float]:
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
