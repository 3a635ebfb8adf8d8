"""Compared data of a study: positions of material points, or the heights of a cloth whose folds are chaotic.

And the sequence of its runs: what a statement on the error needs comes first.

Runs that differ by a hair at the start are compared first. Their folds are chaotic where the two end far apart against
what a finer dt and finer cells change: without those runs nothing is known of it, and positions stay compared.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.study.analysis import TOGETHER, Compared, next_points
from clothsim.study.evaluation import Gatherer, point_areas
from clothsim.study.parameters import INTEGRATOR
from clothsim.study.points import BASE, CONVERGENT, PRESETS, Bench, Point, point
from clothsim.study.reference_solution import Norm
from clothsim.study.workers import JITTER

TIGHT = 2
"""Level of the tolerance at which a run and its jittered twin are compared."""
CHAOTIC = 0.25
"""Difference of twin runs, over the effect of the larger refinement, above which the solution is not unique."""
GROWN = 100.0
"""Least growth of the difference of twins from their start, below which they are the same solution."""
SEEDS = 4
ENOUGH = {"base": 3, "finer": 2}
"""Least number of seeds of the base and of each finer run from which histograms of heights are compared."""


@dataclass(frozen=True)
class Observations:
    """The runs of a study and how they are compared.

    Parameters
    ----------
    gatherer : Gatherer
    areas : (n,) array
        Area of each material point [m2].
    up : (3,) array
        Direction of the heights.
    chaotic : bool or None
        None where it is not known.
    twins : float
        How far apart runs end that start a hair apart, in positions [m]; nan where they were not run.
    noise : float
        The same in what is compared [m].
    """

    gatherer: Gatherer
    areas: Floats
    up: Floats
    chaotic: bool | None = None
    twins: float = np.nan
    noise: float = 0.0

    @property
    def norm(self) -> Norm:
        """RMS over what is compared."""
        if self.chaotic:
            count = len(height_quantiles(self.gatherer.outcomes[BASE].positions, self.areas, self.up))
            return Norm(np.full(count, 1 / count))
        return Norm(self.areas / self.areas.sum())

    def fields(self) -> dict[Point, Floats]:
        """Compared data of each data point: with chaotic folds the mean over its seeds.

        A variant with another bending model is none: it tends to something else.
        """
        outcomes = [
            each for each in self.gatherer.outcomes.values() if not each.failed and each.point.variant != CONVERGENT
        ]
        if not self.chaotic:
            return {each.point: each.positions for each in outcomes if not each.point.seed}
        several: dict[Point, list[Floats]] = {}
        for each in outcomes:
            quantiles = height_quantiles(each.positions, self.areas, self.up)
            several.setdefault(replace(each.point, seed=0), []).append(quantiles)
        return {where: np.mean(each, axis=0) for where, each in several.items()}

    def compared(self) -> Compared:
        """The data to analyse; the base must be known."""
        gatherer, bench, fields = self.gatherer, self.gatherer.bench, self.fields()
        estimate = gatherer.outcomes[BASE].estimate
        parameters, done = bench.parameters, gatherer.field_seconds()
        seconds = {}
        for where in fields:
            alike = [s for p, s in done.items() if (p.levels, p.variant) == (where.levels, where.variant)]
            seconds[where] = float(np.median(alike)) if self.chaotic else done[where]  # the median of its seeds
        return Compared(fields, seconds, parameters, bench.base, self.norm, self.noise, estimate, bench.in_time)

    def seeds(self, where: Point) -> int:
        """Number of runs of a point that differ by their seed."""
        return sum(not each.failed and replace(each.point, seed=0) == where for each in self.gatherer.outcomes.values())

    def spread(self) -> float:
        """With chaotic folds: RMS distance of the base's seeds to their mean, over the root of their number [m]."""
        seeds = [height_quantiles(each.positions, self.areas, self.up) for each in self._base_outcomes()]
        mean = np.mean(seeds, axis=0)
        return float(np.sqrt(np.mean([self.norm(each - mean) ** 2 for each in seeds]) / max(1, len(seeds) - 1)))

    def invariants(self) -> dict[str, Any]:
        """Drape coefficient and energy of the base over its seeds: mean, spread, number."""
        triangles, first = [], 0
        material = self.gatherer.material
        for rest, faces in zip(material.rest, material.triangles, strict=True):
            triangles.append(faces + first)
            first += len(rest)
        runs, area = self._base_outcomes(), float(self.areas.sum())
        drapes = [shadow_over_area(each.positions, np.concatenate(triangles), area, self.up) for each in runs]
        energies = [each.energy for each in runs]
        return {
            name: {"mean": float(np.mean(values)), "spread": float(np.std(values)), "seeds": len(values)}
            for name, values in (("drape_coefficient", drapes), ("energy", energies))
        }

    def _base_outcomes(self) -> list[Any]:
        outcomes = self.gatherer.outcomes.values()
        return [each for each in outcomes if not each.failed and replace(each.point, seed=0) == BASE]


def observations(gatherer: Gatherer) -> Observations:
    """The runs so far, compared by positions."""
    return Observations(gatherer, point_areas(gatherer.material), np.array(gatherer.bench.base.up))


def with_twins(seen: Observations, needed: Sequence[Point]) -> Observations:
    """The observations with the verdict on chaos, from the twins and from all runs of `needed`: dt and cells finer."""
    gatherer, outcomes, norm = seen.gatherer, seen.gatherer.outcomes, seen.norm
    one, other = gatherer.bench.tight(TIGHT)
    if not (gatherer.good(one) and gatherer.good(other)):
        return seen
    twins = norm(outcomes[one].positions - outcomes[other].positions)
    seen = replace(seen, twins=twins, noise=twins)
    if not needed or not all(gatherer.good(each) for each in needed):
        return seen
    changes = [norm(outcomes[BASE].positions - outcomes[each].positions) for each in needed]
    start = JITTER * float(np.linalg.norm(np.ptp(np.concatenate(gatherer.material.rest), axis=0)))
    return replace(seen, chaotic=twins > CHAOTIC * max(changes) and twins > GROWN * start)


def enough_seeds(seen: Observations, needed: Sequence[Point]) -> bool:
    """True where heights are compared over enough seeds."""
    counts = [(BASE, ENOUGH["base"]), *((each, ENOUGH["finer"]) for each in needed)]
    return all(seen.seeds(where) >= least for where, least in counts)


def seeded(points: Sequence[Point]) -> list[Point]:
    """The points with each seed."""
    return [replace(where, seed=seed) for seed in range(1, SEEDS + 1) for where in points]


def one_parameter(names: Sequence[str], level: int) -> list[Point]:
    """The points with one of the parameters at a level."""
    return [point({name: level}) for name in names]


QUANTILES = 64
PIXELS = 1024


def height_quantiles(positions: Floats, areas: Floats, up: Floats) -> Floats:
    """The heights [m] below which equal fractions of the area lie, (QUANTILES, 1): height quantiles.

    The RMS difference of two of them is the 2-Wasserstein distance of the two histograms; their mean over seeds is the
    histograms' barycentre.
    """
    heights = positions @ up
    order = np.argsort(heights, kind="stable")
    quantiles = np.cumsum(areas[order]) - 0.5 * areas[order]
    wanted = (np.arange(QUANTILES) + 0.5) / QUANTILES * areas.sum()
    return np.interp(wanted, quantiles, heights[order])[:, None]


def shadow_over_area(positions: Floats, triangles: Ints, area: float, up: Floats) -> float:
    """The area of the shadow along `up` over `area`, the cloth's own [m2]; drawn with PIXELS along its longer side."""
    aside = np.linalg.svd(up[None])[2][1:]
    flat = positions @ aside.T
    low = flat.min(axis=0)
    scale = (PIXELS - 1) / max(float((flat.max(axis=0) - low).max()), np.finfo(float).tiny)
    image = Image.new("1", (PIXELS, PIXELS))
    draw = ImageDraw.Draw(image)
    for corners in ((flat - low) * scale)[triangles]:
        draw.polygon([tuple(corner) for corner in corners], fill=1)
    return float(np.asarray(image).sum() / scale**2 / area)


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
        names = list(gatherer.bench.parameters)
        gatherer.gather(seen.compared().least_certain(), LATE)
        gatherer.gather(seen.compared().points_together(TOGETHER[2:]), LATE)
        _other_settings(gatherer)
        gatherer.gather(
            [*one_parameter(names, -2), *one_parameter(names, 2), *gatherer.bench.other_formula((2,))], LATE
        )
        gatherer.gather(next_points(seen.compared(), COMBINATIONS), LATE)
        for _ in range(FINER):
            gatherer.gather(seen.compared().least_certain(), LATE)
        gatherer.gather(next_points(seen.compared(), COMBINATIONS), LATE)
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
    missing = []
    for where in dict.fromkeys(points):
        if where not in gatherer.outcomes:
            with suppress(InputError):
                bench.scene(where)
                missing.append(where)
    return missing


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


def _other_settings(gatherer: Gatherer) -> None:
    """The convergent bending model and the presets."""
    gatherer.gather([*gatherer.bench.variants(), *(Point(variant=name) for name in PRESETS)], LATE)
