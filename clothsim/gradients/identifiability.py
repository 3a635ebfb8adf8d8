"""Standard errors of recovered numbers, and combinations of them that a target does not determine.

The Hessian of a sum of squares at its minimum, by differences of its gradients, is 2 J'J over the logarithms of the
numbers (J of the residuals; what is left of them adds little, Gauss-Newton), and the covariance of the logarithms
sigma^2 (J'J)^-1, sigma^2 the misfit a residual (Seber & Wild 1989, Nonlinear Regression, section 2.1).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.gradients.losses import Distance, Loss, Scan
from clothsim.gradients.recovery_problem import Problem

UNDETERMINED = 1e-4
"""Curvature of the loss along a combination of logarithms, over the largest, below which it is not determined."""
PRESENT = 1e-3
"""Square of the component of a number along an undetermined combination from which on it is not determined."""
DIFFERENCE = 1e-3
"""Difference of logarithms for the Hessian."""


@dataclass(frozen=True)
class Ratio:
    """The ratio of two numbers, that of `first` to that of `second`, with its relative standard error."""

    first: str
    second: str
    value: float
    error: float


@dataclass(frozen=True)
class Identifiability:
    """How well a target determines numbers.

    Parameters
    ----------
    errors : mapping
        Relative standard error of each number by path; inf where it is not determined, nan where the loss is no sum of
        squares.
    undetermined : tuple of mapping
        Combinations of logarithms that the target does not determine: weights by path.
    ratios : tuple of Ratio
        Ratios of numbers that are determined where the numbers are not.
    runs : int
        Runs that it took.
    """

    errors: Mapping[str, float]
    undetermined: tuple[Mapping[str, float], ...]
    ratios: tuple[Ratio, ...]
    runs: int


def identifiability(problem: Problem, logarithms: Floats, loss: float) -> Identifiability:
    """Examine the loss about its minimum: two runs for each number."""
    hessian = _hessian(problem, logarithms)
    curvatures, modes = np.linalg.eigh(hessian)
    weak = curvatures <= UNDETERMINED * max(curvatures[-1], 0.0)
    inverse = np.where(weak, 0.0, 1.0 / np.where(weak, 1.0, curvatures))
    covariance = _variance(problem, loss) * (modes * inverse) @ modes.T
    free = modes[:, weak]

    def error(direction: Floats) -> float:
        if ((direction @ free) ** 2).sum() > PRESENT:
            return float("inf")
        return float(np.sqrt(direction @ covariance @ direction))

    units = np.eye(len(problem.paths))
    errors = {path: error(units[k]) for k, path in enumerate(problem.paths)}
    values = problem.values(logarithms)
    ratios = []
    for i, j in combinations(range(len(units)), 2):
        first, second = problem.paths[i], problem.paths[j]
        of_both = error(units[i] - units[j])
        if errors[first] == errors[second] == np.inf and np.isfinite(of_both):
            ratios.append(Ratio(first, second, values[first] / values[second], of_both))
    combined = tuple(dict(zip(problem.paths, _positive(mode).tolist(), strict=True)) for mode in free.T)
    return Identifiability(errors, combined, tuple(ratios), 2 * len(units))


def _hessian(problem: Problem, logarithms: Floats) -> Floats:
    rows = []
    for unit in np.eye(len(logarithms)):
        slopes = [problem.evaluated(logarithms + sign * DIFFERENCE * unit).slope for sign in (1, -1)]
        rows.append((slopes[0] - slopes[1]) / (2 * DIFFERENCE))
    hessian = np.array(rows)
    return 0.5 * (hessian + hessian.T)


def _variance(problem: Problem, loss: float) -> float:
    """Factor from the inverse Hessian of the loss, a sum of squares over a number, to a covariance."""
    residuals = residuals_of(problem.loss)
    if residuals is None:
        return float("nan")
    count, mean_of = residuals
    variance = loss * mean_of / max(count - len(problem.paths), 1)
    return 2 / mean_of * variance


def residuals_of(loss: Loss) -> tuple[int, int] | None:
    """Return the number of residuals of a loss, and what their squares are divided by; None for no sum of squares."""
    if isinstance(loss, Distance):
        return np.size(loss.target), len(loss.target)
    return (len(loss.points), len(loss.points)) if isinstance(loss, Scan) else None


def _positive(mode: Floats) -> Floats:
    """The mode or its negative, the largest component positive."""
    return mode * np.sign(mode[np.abs(mode).argmax()])
