"""Energy score of predicted drapes, and the skill over rivals that know no mechanics.

A prediction is an ensemble of (coefficient, n_eff, sd r), a measured lay y is scored by mean |X - y| - mean |X - X'|/2
(Gneiting, Raftery 2007), each coordinate over the fabric's own sd. Skill is (best rival - simulated)/(best rival -
ceiling): 0 no use, 1 as good as the other lays of the fabric.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats
from tests.reality.borders import Lays

RESIDUALS = 12
"""Residuals that each other fabric lends to a rival's spread."""


@dataclass(frozen=True)
class Scored:
    """Energy scores of one fabric; lower is better."""

    fabric: int
    lays: int
    simulated: float
    dressed: float
    fitted_lay: float
    quadratic: float
    ceiling: float

    @property
    def rival(self) -> float:
        """The best of the rivals."""
        return min(self.fitted_lay, self.quadratic)

    def skill(self, score: float) -> float:
        """Skill of a score; without meaning where a rival is better than the ceiling, as it may be with few lays."""
        return (self.rival - score) / (self.rival - self.ceiling)


def energy_score(ensemble: Floats, lays: Floats, scale: Floats) -> float:
    """Mean energy score of lays (k, 3) under an ensemble (m, 3), each coordinate over `scale (3,)`.

    Examples
    --------
    >>> round(energy_score(np.zeros((4, 3)), np.array([[3.0, 4.0, 0.0]]), np.ones(3)), 12)
    5.0
    """
    x, y = ensemble / scale, lays / scale
    apart = np.linalg.norm(x[:, None] - y[None], axis=2).mean()
    return float(apart - 0.5 * np.linalg.norm(x[:, None] - x[None], axis=2).mean())


def scored(all_lays: Sequence[Lays], ensembles: Sequence[Floats]) -> list[Scored]:
    """Scores of every fabric; ensembles (m, 3) in the order of the fabrics."""
    pooled = np.sqrt(np.mean([each.others.var(axis=0, ddof=1) for each in all_lays if len(each.others) > 4], axis=0))
    found = []
    for k, own in enumerate(all_lays):
        others = [each for j, each in enumerate(all_lays) if j != k]
        scale = own.others.std(axis=0, ddof=1) if len(own.others) > 4 else pooled
        spread = np.concatenate([_thinned(each.others - each.centre) for each in others])
        curve, about = _quadratic(others, own.centre[0])
        middle = ensembles[k].mean(axis=0) + spread - spread.mean(axis=0)
        scores = [
            energy_score(candidate, own.others, scale)
            for candidate in (ensembles[k], middle, own.centre + spread, curve + about)
        ]
        found.append(Scored(own.fabric, len(own.others), *scores, _ceiling(own.others, scale)))
    return found


def mean_scores(scores: Sequence[Scored]) -> tuple[list[float], list[float]]:
    """Means over fabrics of simulated, dressed, best rival and ceiling, and the skills of the first two of them.

    The best rival is chosen for each fabric after its lays are known: no single predictor can do that.
    """
    means = [_mean(scores, name) for name in ("simulated", "dressed", "rival", "ceiling")]
    return means, [(means[2] - value) / (means[2] - means[3]) for value in means[:2]]


def skills_over_one_rival(scores: Sequence[Scored]) -> tuple[list[float], list[float]]:
    """Mean scores of either rival, and the skills of simulated and dressed over the one that is better in the mean."""
    rivals = [_mean(scores, name) for name in ("fitted_lay", "quadratic")]
    best, ceiling = min(rivals), _mean(scores, "ceiling")
    return rivals, [(best - _mean(scores, name)) / (best - ceiling) for name in ("simulated", "dressed")]


def _mean(scores: Sequence[Scored], name: str) -> float:
    """Mean over the fabrics of the score of that name."""
    return float(np.mean([getattr(each, name) for each in scores]))


def _thinned(values: Floats) -> Floats:
    """At most `RESIDUALS` rows, evenly over the order in which they are."""
    return values[np.unique(np.linspace(0, len(values) - 1, RESIDUALS).round().astype(int))]


def _quadratic(others: Sequence[Lays], coefficient: float) -> tuple[Floats, Floats]:
    """n_eff and sd r as quadratics of the coefficient over other fabrics' means, and the residuals of their lays."""
    means = np.array([each.others.mean(axis=0) for each in others])
    fits = [np.polyfit(means[:, 0], means[:, j], 2) for j in (1, 2)]

    def at(c: Floats | float) -> Floats:
        return np.stack([np.asarray(c), *(np.polyval(fit, c) for fit in fits)], axis=-1)

    residuals = []
    for each in others:
        rest = _thinned(each.others)
        residual = rest - at(rest[:, 0])
        residual[:, 0] = rest[:, 0] - each.centre[0]
        residuals.append(residual)
    return at(coefficient), np.concatenate(residuals)


def _ceiling(lays: Floats, scale: Floats) -> float:
    """Mean score of each lay under the others."""
    rows = np.arange(len(lays))
    return float(np.mean([energy_score(lays[rows != k], lays[k : k + 1], scale) for k in rows]))
