"""What the score would be if one thing or another were right, or left out of the model: where it is lost."""

from collections.abc import Callable, Sequence

import numpy as np

from clothsim.base.arrays import Floats
from tests.reality.borders import Lays, scatter_of_centres
from tests.reality.ensembles import fitted
from tests.reality.score import mean_scores, scored

HEADER = ("change", "score: simulated", "with spread", "skill: simulated", "with spread")
RIGHT: dict[str, tuple[int, ...]] = {
    "nothing": (),
    "coefficient": (0,),
    "n_eff": (1,),
    "sd r": (2,),
    "n_eff and sd r": (1, 2),
    "all three": (0, 1, 2),
}
"""Coordinates whose mean is replaced by that of the cloth."""


def rows(table: Sequence[Sequence[Sequence[float]]], lays: Sequence[Lays]) -> list[list[str]]:
    """Mean scores and skills with means that are right, with spreads that are, and with parts of the fit left out."""
    scatters = scatter_of_centres(lays)

    def ensembles(**left_out: bool) -> list[Floats]:
        return [fitted(table, each, scatter, **left_out).ensemble for each, scatter in zip(lays, scatters, strict=True)]

    whole = ensembles()

    def corrected(change: Callable[[Floats, Lays], Floats]) -> list[Floats]:
        return [change(ensemble, own) for ensemble, own in zip(whole, lays, strict=True)]

    cases = {
        f"mean corrected: {name}" if at else "none": corrected(lambda e, own, at=at: _moved(e, own, at))
        for name, at in RIGHT.items()
    }
    cases["spread of the fabric in place of the simulated one"] = corrected(_spread_as)
    cases["all ratios equally likely"] = ensembles(weigh=False)
    cases["outlines not shifted off centre"] = ensembles(centred=True)
    cases["all ratios equally likely, outlines not shifted"] = ensembles(weigh=False, centred=True)
    found = []
    for name, ensembles in cases.items():
        means, skills = mean_scores(scored(lays, ensembles))
        found.append([name, *(f"{value:.2f}" for value in means[:2]), *(f"{value:.1f}" for value in skills)])
    return found


def _moved(ensemble: Floats, own: Lays, coordinates: tuple[int, ...]) -> Floats:
    """The ensemble with the cloth's means of some coordinates."""
    moved, which = ensemble.copy(), list(coordinates)
    moved[:, which] += (own.others.mean(axis=0) - ensemble.mean(axis=0))[which]
    return moved


def _spread_as(ensemble: Floats, own: Lays) -> Floats:
    """The cloth's lays about the mean of the ensemble."""
    return np.asarray(ensemble.mean(axis=0) + own.others - own.others.mean(axis=0))
