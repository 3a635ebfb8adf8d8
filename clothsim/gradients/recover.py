"""Recovery of numbers from a drape: those of a scene for which it hangs as a target does.

The loss is minimised over the logarithms of the numbers by L-BFGS-B (Byrd, Lu, Nocedal & Zhu 1995, "A limited memory
algorithm for bound constrained optimization"), from several starts, each evaluation a whole run with its gradient.

Standard errors: the Hessian of a sum of squares at its minimum, by differences of its gradients, is 2 J'J over the
logarithms of the numbers (J of the residuals; what is left of them adds little, Gauss-Newton), and the covariance of
the logarithms sigma^2 (J'J)^-1, sigma^2 the misfit a residual (Seber & Wild 1989, Nonlinear Regression, section 2.1).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.inputs import with_remedies
from clothsim.gradients.loss_of_numbers import SPREAD, Evaluation, KeptResults, LossOfNumbers, problem_of
from clothsim.gradients.losses import Distance, Loss, Scan
from clothsim.gradients.parameters import full_path
from clothsim.patterns.pattern_mesh import PatternMesh
from clothsim.scene.assembly.scene_world import world_of
from clothsim.scene.scene import Scene

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
        Relative standard error of each number by path; inf if it is not determined, nan if the loss is not a sum
        of squares or a run beside the minimum cannot be taken.
    undetermined : tuple of mapping
        Combinations of logarithms that the target does not determine: weights by path.
    ratios : tuple of Ratio
        Ratios of numbers that are determined where the numbers are not.
    runs : int
        Runs that it took.
    precision : (k, k) array
        Inverse covariance of the logarithms; nan if it is not known.
    """

    errors: Mapping[str, float]
    undetermined: tuple[Mapping[str, float], ...]
    ratios: tuple[Ratio, ...]
    runs: int
    precision: Floats


def identifiability(problem: LossOfNumbers, logarithms: Floats, loss: float) -> Identifiability:
    """Examine the loss about its minimum: two runs for each number."""
    hessian = _hessian(problem, logarithms)
    if np.isnan(hessian).any():  # a run beside the minimum cannot be taken: its errors are not known
        return Identifiability(dict.fromkeys(problem.paths, float("nan")), (), (), 2 * len(problem.paths), hessian)
    curvatures, modes = np.linalg.eigh(hessian)
    weak = curvatures <= UNDETERMINED * max(curvatures[-1], 0.0)
    inverse = np.where(weak, 0.0, 1.0 / np.where(weak, 1.0, curvatures))
    # factor from the inverse Hessian of the loss, a sum of squares over a number, to a covariance
    count, mean_of = residuals_of(problem.loss) or (0, float("nan"))
    variance = 2 / mean_of * (loss * mean_of / max(count - len(problem.paths), 1))
    covariance = variance * (modes * inverse) @ modes.T
    precision = (modes * np.where(weak, 0.0, curvatures)) @ modes.T / max(variance, np.finfo(float).tiny)
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
    signed = [mode * np.sign(mode[np.abs(mode).argmax()]) for mode in free.T]  # the largest component positive
    combined = tuple(dict(zip(problem.paths, mode.tolist(), strict=True)) for mode in signed)
    return Identifiability(errors, combined, tuple(ratios), 2 * len(units), precision)


def _hessian(problem: LossOfNumbers, logarithms: Floats) -> Floats:
    rows = []
    for unit in np.eye(len(logarithms)):
        runs = [problem.evaluated(logarithms + sign * DIFFERENCE * unit) for sign in (1, -1)]
        if not all(np.isfinite(run.loss) for run in runs):
            return np.full((len(logarithms), len(logarithms)), np.nan)
        rows.append((runs[0].slope - runs[1].slope) / (2 * DIFFERENCE))
    hessian = np.array(rows)
    return 0.5 * (hessian + hessian.T)


def residuals_of(loss: Loss) -> tuple[int, int] | None:
    """Return the number of residuals of a loss, and what their squares are divided by; None for no sum of squares."""
    if isinstance(loss, Distance):
        return np.size(loss.target), len(loss.target)
    return (len(loss.points), len(loss.points)) if isinstance(loss, Scan) else None


NO_PRIOR = 1e6
"""Variance of the logarithm of a number that the prior does not name."""
MOST_RUNS = 60
"""Runs of one start, about."""
FAR = 10.0
"""Distance of a target in sizes of the scene beyond which it is refused."""
FAILED = 1e6
"""Relative loss that stands for a run that cannot be taken."""
AT_LIMIT = 1e-3
"""Distance of a logarithm to that of its limit below which the number lies at it."""
OPTIONS = {"maxfun": MOST_RUNS, "ftol": 1e-12, "gtol": 1e-8}


@dataclass(frozen=True)
class Recovery:
    """Numbers recovered from a target.

    Parameters
    ----------
    scene : Scene
        The scene with the numbers.
    values : mapping
        The numbers by path.
    errors : mapping
        Relative standard error of each, from the remaining misfit (`Identifiability.errors`).
    ratios : tuple of Ratio
        Known ratios of numbers that are not known themselves.
    undetermined : tuple of mapping
        Combinations of logarithms that the target does not determine: weights by path.
    at_limit : tuple of str
        Paths of numbers at an end of the range that was searched.
    best : Evaluation
        The run with the least loss.
    minima : tuple of float
        Least loss of each start.
    runs : int
        Number of all runs.
    prior : str
        Assumption about the numbers, and by how much it moved them; empty without a prior.
    """

    scene: Scene
    values: Mapping[str, float]
    errors: Mapping[str, float]
    ratios: tuple[Ratio, ...]
    undetermined: tuple[Mapping[str, float], ...]
    at_limit: tuple[str, ...]
    best: Evaluation
    minima: tuple[float, ...]
    runs: int
    prior: str = ""


@with_remedies()
def recover(
    scene: Scene,
    loss: Loss,
    free: Sequence[str],
    starts: int = 2,
    progress: Callable[[int, Evaluation], None] | None = None,
    seed: int = 0,
    pattern: PatternMesh | None = None,
    prior: bool = False,
    runs: str | Path = "",
) -> Recovery:
    """Find the parameters of a scene that minimise a loss.

    Parameters
    ----------
    scene : Scene
        Its parameters are the first start. The contact stiffness is held at that of its own run.
    loss : Loss
        `Distance` to positions with the numbering of the cloth, `Scan` of points, or another.
    free : sequence of str
        Paths of positive numbers, such as "effects.friction.coefficient"; keys of a fabric refer to the cloth. For a
        cloth from a pattern also "pattern.front.width", "pattern.front+back.height", "pattern.front.flare"
        (`pattern_numbers`), with a fixed start.
    starts : int
        Number of starts; those after the first differ from the scene by a factor of up to two, and numbers of the
        pattern by up to 5 %.
    progress : callable, optional
        Called after each run with the number of the start, from 1.
    seed : int
        Chooses the further starts.
    pattern : PatternMesh, optional
        The pattern of a cloth given by arrays, if numbers of the pattern are free.
    prior : bool
        Combine the bending stiffnesses with those of 618 measured fabrics of the cloth's weight (`bending_prior`), by
        normal distributions of their logarithms about the least loss. The prior then gives what the target does not
        determine.
    runs : str or Path
        Folder in which the results of runs are kept; the same search, where it was stopped, goes on from them. "":
        none are kept.

    Raises
    ------
    InputError
        For a number that cannot be varied, a scene without a gradient, a prior without a free bending stiffness, or a
        prior with a loss that is not a sum of squares.
    ClothsimError
        If the scene itself cannot be run.

    Examples
    --------
    >>> import clothsim
    >>> from clothsim.gradients.losses import Distance
    >>> from clothsim.gradients.recover import recover
    >>> def strip(youngs_modulus):
    ...     cloth = {"mesh": "rectangle", "size": [0.1, 0.3], "cells": [1, 3], "rotation_degrees": [90, 0, 0]}
    ...     effects = [clothsim.Membrane(), clothsim.Bending(), clothsim.Gravity(), clothsim.Pins(select="top")]
    ...     run = {"duration": 0.04, "frames_per_second": 25}
    ...     return clothsim.Scene(cloth | {"youngs_modulus": youngs_modulus}, effects=effects, run=run)
    >>> target = clothsim.simulate(strip(2e4), differentiable=True).cloth_positions()
    >>> found = recover(strip(3e4), Distance(target), ["youngs_modulus"], starts=1)
    >>> round(found.values["cloth.youngs_modulus"])
    20000
    """
    _refuse_far(scene, loss)
    if prior:
        bending_keys([full_path(name) for name in free])  # refuses where the prior says nothing
        if residuals_of(loss) is None:
            raise InputError("The prior needs a loss that is a sum of squares.", "Use a target of points.")
    problem = problem_of(scene, loss, free, pattern, KeptResults(runs))
    rng = np.random.default_rng(seed)
    ends, count = list[Evaluation](), 1
    for start in range(1, max(1, starts) + 1):
        offset = problem.spreads * rng.uniform(-1.0, 1.0, len(problem.paths)) if start > 1 else 0.0
        taken = _minimised(problem, problem.origin + offset, start, progress)
        ends.append(min(taken, key=lambda each: each.loss))
        count += len(taken)
    best = min(ends, key=lambda each: each.loss)
    if not np.isfinite(best.loss):
        raise ClothsimError(f"No run of the recovery succeeded: {best.failure}")
    logarithms = np.log(list(best.values.values()))
    known = identifiability(problem, logarithms, best.loss)
    far = np.abs(np.abs(logarithms - problem.origin) - problem.ranges) < AT_LIMIT
    found = Recovery(
        problem.scene_at(logarithms),
        best.values,
        known.errors,
        known.ratios,
        known.undetermined,
        tuple(path for path, limit in zip(problem.paths, far, strict=True) if limit),
        best,
        tuple(each.loss for each in ends),
        count + known.runs,
    )
    return _combine_with_prior(found, problem, logarithms, known.precision) if prior else found


def _combine_with_prior(found: Recovery, problem: LossOfNumbers, logarithms: Floats, precision: Floats) -> Recovery:
    """The numbers and errors given the prior of those that are stiffnesses of bending; the others have none."""
    if np.isnan(precision).any():
        raise ClothsimError("A run beside the minimum failed, so that the prior has no weight.", "Leave it out.")
    paths = problem.paths
    keys = bending_keys(paths)
    bending = list(keys)
    density = world_of(problem.scene).cloths[0].fabric.density
    before = bending_prior(tuple(keys.values()), density)
    mean, covariance = logarithms.copy(), np.eye(len(paths)) * NO_PRIOR
    mean[bending] = before.mean
    covariance[np.ix_(bending, bending)] = before.covariance
    after = LogNormal(mean, covariance).given(logarithms, precision)
    run = problem.evaluated(after.mean)
    if not np.isfinite(run.loss):
        raise ClothsimError(f"The run of the numbers with the prior failed: {run.failure}", "Leave the prior out.")
    spreads = np.sqrt(np.diag(after.covariance))
    moved = [f"{paths[k]} by {100 * np.expm1(after.mean[k] - logarithms[k]):+.2g} %" for k in bending]
    return replace(
        found,
        scene=problem.scene_at(after.mean),
        values=run.values,
        errors={path: float(s) if s * s < 0.5 * NO_PRIOR else np.inf for path, s in zip(paths, spreads, strict=True)},
        ratios=() if len(bending) == len(paths) else found.ratios,
        undetermined=() if len(bending) == len(paths) else found.undetermined,
        best=run,
        runs=found.runs + 1,
        prior=f"bending of {SOURCE} at {density:g} kg/m2, log-normal; it moved {', '.join(moved)}",
    )


def _refuse_far(scene: Scene, loss: Loss) -> None:
    """InputError for a target that no number of the scene could bring the cloth to: another unit, or another place."""
    target = loss.target if isinstance(loss, Distance) else loss.points if isinstance(loss, Scan) else None
    if target is None or not np.size(target):
        return
    world = world_of(scene)
    points = world.start() + world.origin
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    away = float(np.linalg.norm(np.median(np.asarray(target, np.float64), axis=0) - np.median(points, axis=0)))
    if not away <= FAR * size:
        raise InputError(
            f"The target is {away:.3g} m away from the scene, which is {size:.3g} m wide.",
            "Give its unit (scale, metres per unit), or move it to the cloth.",
        )


def _minimised(
    problem: LossOfNumbers, first: Floats, start: int, progress: Callable[[int, Evaluation], None] | None
) -> list[Evaluation]:
    """All runs of a minimisation from a first point."""
    taken, scale = list[Evaluation](), abs(problem.first.loss) or 1.0
    units = problem.spreads / np.log(SPREAD)  # the first step is one unit long

    def scaled(point: Floats) -> tuple[float, Floats]:
        each = problem.evaluated(units * point)
        taken.append(each)
        if progress is not None:
            progress(start, each)
        if not np.isfinite(each.loss):  # back towards what can be run
            return FAILED, point - problem.origin / units
        return each.loss / scale, units * each.slope / scale

    limits = np.stack([problem.origin - problem.ranges, problem.origin + problem.ranges], axis=1) / units[:, None]
    minimize(scaled, first / units, jac=True, method="L-BFGS-B", bounds=limits, options=OPTIONS)
    return taken


# Prior of bending stiffness by weight: a log-normal of 618 measured fabrics.
#
# The logarithms of D along warp, weft and bias are normal about lines in the logarithm of the weight, with the
# covariance of what is left: least squares over the cantilever tests of 618 fabrics of 0.015 to 0.87 kg/m2 (Feng,
# Huang, Wang et al. 2022, "Learning-based bending stiffness parameter estimation by a drape tester", ACM TOG 41). A
# curve in the weight is no better (1 to 3 % of the variance).

SOURCE = "618 fabrics of Feng et al. 2022"
AT_WEIGHT = 0.2
"""Weight at which `MEANS` stand [kg/m2]."""
MEANS = np.log([15.74e-6, 10.22e-6, 12.49e-6])
"""Of log D along warp, weft and bias, D in N m."""
POWERS = np.array([1.249, 1.111, 1.214])
"""Of the weight."""
COVARIANCE = np.array([[0.964, 0.601, 0.649], [0.601, 0.762, 0.524], [0.649, 0.524, 0.709]])
"""Of log D: standard deviations 0.98, 0.87 and 0.84, a factor of 2.3 to 2.7."""
WEIGHTS: dict[str, tuple[float, float, float]] = {
    "bending_warp": (1.0, 0.0, 0.0),
    "bending_weft": (0.0, 1.0, 0.0),
    "bending_bias": (0.0, 0.0, 1.0),
    "bending_stiffness": (0.5, 0.5, 0.0),
}
"""Keys of a fabric as combinations of the three logarithms."""


@dataclass(frozen=True)
class LogNormal:
    """Logarithms that are normal: mean (k,) and covariance (k, k)."""

    mean: Floats
    covariance: Floats

    def given(self, measured: Floats, precision: Floats) -> "LogNormal":
        """The distribution given a measurement of it.

        Parameters
        ----------
        measured : (k,) array
            Measured logarithms.
        precision : (k, k) array
            Inverse covariance of the measurement; 0 along what it does not tell.

        Examples
        --------
        >>> half = LogNormal(np.zeros(1), np.eye(1)).given(np.ones(1), np.eye(1))
        >>> half.mean, half.covariance
        (array([0.5]), array([[0.5]]))
        """
        prior = np.linalg.inv(self.covariance)
        covariance = np.linalg.inv(prior + precision)
        mean = np.asarray(covariance @ (prior @ self.mean + precision @ measured), np.float64)
        return LogNormal(mean, np.asarray(covariance, np.float64))


def bending_keys(paths: Sequence[str]) -> dict[int, str]:
    """The key of `WEIGHTS` of each path that is one of a cloth, by its number.

    InputError where there is none, or the density, by which the prior goes, is among the paths.
    """
    names = {k: path.rpartition(".")[2] for k, path in enumerate(paths) if path.startswith("cloth.")}
    found = {k: name for k, name in names.items() if name in WEIGHTS}
    if not found:
        raise InputError("The prior covers bending stiffnesses, and none is free.", f"Free {', '.join(WEIGHTS)}.")
    if any(path.endswith(".density") for path in paths):
        raise InputError("The prior is for a cloth of known weight, and the density is free.", "Weigh the cloth.")
    return found


def bending_prior(keys: tuple[str, ...], density: float) -> LogNormal:
    """The prior of keys of a fabric.

    Parameters
    ----------
    keys : tuple of str
        Some of `WEIGHTS`.
    density : float
        Weight of the cloth [kg/m2].

    Raises
    ------
    InputError
        For bending_stiffness beside bending_warp or bending_weft, which it replaces.

    Examples
    --------
    >>> prior = bending_prior(("bending_warp", "bending_weft"), 0.2)
    >>> (1e6 * np.exp(prior.mean)).round(1), np.sqrt(np.diag(prior.covariance)).round(2)
    (array([15.7, 10.2]), array([0.98, 0.87]))
    """
    if "bending_stiffness" in keys and len(keys) > 1:
        raise InputError("bending_stiffness replaces the other stiffnesses of bending.", "Free it, or them.")
    rows = np.array([WEIGHTS[key] for key in keys], np.float64)
    means = np.asarray(MEANS + POWERS * np.log(density / AT_WEIGHT), np.float64)
    return LogNormal(rows @ means, np.asarray(rows @ COVARIANCE @ rows.T, np.float64))
