"""Reference solution from runs of one knob and from runs in which the largest knobs are refined together.

Errors of single knobs add up only where each has a cause of its own. A start inside d_hat is pushed out by the barrier,
and a finer dt, finer cells and a smaller d_hat all show that same push: their sum counts it three times. So the knobs
with the largest errors, and dt and cells in any case, are refined together, and what that run shows replaces the sum.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.study.reference_solution import Limit, Norm, limit

LARGE = 0.1
"""A knob is refined with the others where its error is at least this fraction of the largest."""
CONFIRMED = 0.25
"""Two runs confirm a product of two errors where they differ by at most this fraction of it."""
ORDERS = (1.0, 2.0)
"""Range of the order with which the knobs' errors fall together."""


@dataclass(frozen=True)
class Reference:
    """field (n, k); error: its own (RMS); limits: of each knob; cross: size of what the knobs add only together.

    names: the knobs that were refined together; joint: number of runs with them; with none, `cross` is what the sum may
    count twice.
    """

    field: Floats
    error: float
    limits: Mapping[str, Limit]
    cross: float
    names: tuple[str, ...]
    joint: int


@dataclass(frozen=True)
class _Estimate:
    """What the knobs add only together (n, k), and the error of all that they add (RMS)."""

    cross: Floats
    error: float


def large_knobs(base: Floats, limits: Mapping[str, Limit], always: Sequence[str], norm: Norm) -> tuple[str, ...]:
    """The knobs to refine together: those of `always` that have a limit, and the others with a LARGE error."""
    adds = {name: norm(base - each.field) for name, each in limits.items()}
    least = LARGE * max(adds.values(), default=0.0)
    return tuple(name for name in limits if name in always or (adds[name] >= least and adds[name] > 0))


def reference(
    base: Floats,
    sweeps: Mapping[str, Mapping[int, Floats]],
    limits: Mapping[str, Limit],
    joint: Mapping[int, Floats],
    names: Sequence[str],
    ratios: Mapping[str, float],
    norm: Norm,
    noise: float = 0.0,
) -> Reference:
    """The reference q* = q_base + sum_k (q_k* - q_base) + c.

    Parameters
    ----------
    base : (n, k) array
        Field of the base.
    sweeps : dict
        Fields of the one-knob runs, {knob: {level: (n, k) array}}.
    limits : dict
        Limit of each sweep.
    joint : dict
        Fields {level: (n, k) array} of the runs with all knobs of `names` at that level.
    names : sequence of str
        Knobs that are refined together.
    ratios : dict
        Ratio of each knob's levels.
    norm : Norm
    noise : float
        RMS by which a run differs from itself.

    Returns
    -------
    Reference
        c is what the knobs of `names` add only together: a product of two errors where two joint runs confirm that;
        else from the finest joint run, or by a limit of the joint runs themselves, whichever has the smaller error.
        Where the other one is further away than it claims, that distance is the error. Without a joint run the error
        holds all knobs but the largest, for they may be counted twice.
    """
    field = base + sum((each.field - base for each in limits.values()), start=np.zeros_like(base))
    known = {level: each for level, each in joint.items() if all(level in sweeps.get(name, {}) for name in names)}
    own = {name: each.error for name, each in limits.items()}
    rest = _rss([own[name] for name in limits if name not in names], noise)
    apart = _rss([own[name] for name in names])
    if len(names) < 2:
        return Reference(field, _rss([rest, apart]), limits, 0.0, tuple(names), 0)
    if not any(level > 0 for level in known):
        adds = sorted(norm(base - limits[name].field) for name in names)
        doubt = float(sum(adds[:-1]))
        return Reference(field, _rss([rest, apart, doubt]), limits, doubt, tuple(names), 0)
    chosen = {name: limits[name] for name in names}
    shifts = {level: sum((sweeps[name][level] - base for name in names), start=np.zeros_like(base)) for level in known}
    best = _best(base, known, shifts, joint, chosen, [ratios[name] for name in names], norm, noise)
    return Reference(field + best.cross, _rss([rest, best.error]), limits, norm(best.cross), tuple(names), len(known))


def _best(
    base: Floats,
    known: Mapping[int, Floats],
    shifts: Mapping[int, Floats],
    joint: Mapping[int, Floats],
    limits: Mapping[str, Limit],
    ratios: Sequence[float],
    norm: Norm,
    noise: float,
) -> _Estimate:
    """The estimate to take, from the joint runs `known` of levels at which the sum `shifts` of the knobs is known."""
    finest, apart = max(known), _rss([each.error for each in limits.values()])
    mismatches = {level: known[level] - base - shifts[level] for level in known}
    order = _joint_order(base, shifts[finest], finest, limits, norm)
    estimates = _product(mismatches, list(limits.values()), ratios, apart, norm) or [
        _scaled(shifts[finest], mismatches[finest], 1.0 / (1.0 - 2.0 ** (-order * finest)), apart, norm),
        *_limit_of_joint(base, joint, order, limits, norm, noise),
    ]
    best, *others = sorted(estimates, key=lambda each: each.error)
    excess = [norm(best.cross - each.cross) - each.error for each in others]
    return _Estimate(best.cross, max([best.error, *excess, *(each.doubt for each in limits.values())]))


def _rss(values: Sequence[float], *more: float) -> float:
    return float(np.sqrt(sum(each**2 for each in (*values, *more))))


def _joint_order(base: Floats, summed: Floats, level: int, limits: Mapping[str, Limit], norm: Norm) -> float:
    """The order with which the sum of the errors falls, from its shift at `level`: within ORDERS."""
    whole = norm(sum((each.field - base for each in limits.values()), start=np.zeros_like(base)))
    left = 1.0 - norm(summed) / whole if whole > 0 else 0.0
    return float(np.clip(-np.log2(left) / level, *ORDERS)) if left > 0 else ORDERS[1]


def _scaled(summed: Floats, mismatch: Floats, factor: float, apart: float, norm: Norm) -> _Estimate:
    """The mismatch of the finest joint run, times the whole error over what that level removes of it.

    The errors of the single limits are scaled as the sum of the knobs is by the joint run: where it counts one push
    three times, it counts its doubt three times too.
    """
    removed = norm(summed)
    scale = min(1.0, norm(summed + mismatch) / removed) if removed > 0 else 1.0
    return _Estimate(factor * mismatch, _rss([scale * apart, factor * norm(mismatch)]))


def _limit_of_joint(
    base: Floats, joint: Mapping[int, Floats], order: float, limits: Mapping[str, Limit], norm: Norm, noise: float
) -> list[_Estimate]:
    """The limit of the joint runs as one sweep, where three levels have a believed order or fall faster.

    Differences that fall faster may do so by chance: the finest run is then the limit, and its error at least what the
    first difference leaves of it with the expected order.
    """
    sweep = {0: base, **joint}
    found = limit(sweep, 2, order, norm, noise)
    if not np.isfinite(found.order):
        return []
    error = found.error
    if not found.extrapolated:
        if found.order <= order:
            return []
        finest = max(sweep)
        first = norm(sweep[finest - 2] - sweep[finest - 1])
        error = max(error, first / (2.0**order * (2.0**order - 1.0)))
    whole = sum((each.field - base for each in limits.values()), start=np.zeros_like(base))
    return [_Estimate(found.field - base - whole, error)]


def _product(
    mismatches: Mapping[int, Floats], limits: Sequence[Limit], ratios: Sequence[float], apart: float, norm: Norm
) -> list[_Estimate]:
    """What two knobs add together as a product of their errors, where a coarser and a finer joint run agree on it.

    A knob of order p keeps the fraction f = ratio^(-p level) of its base error, so a joint run differs from the sum of
    the two alone by c (1 - f_k)(1 - f_l). An order that was not observed counts as 1.
    """
    if len(limits) != 2 or len(mismatches) < 2:
        return []
    orders = [each.order if each.extrapolated and np.isfinite(each.order) else 1.0 for each in limits]
    crosses = []
    for level in sorted(mismatches):
        kept = [ratio ** (-level * order) for ratio, order in zip(ratios, orders, strict=True)]
        crosses.append(mismatches[level] / ((1.0 - kept[0]) * (1.0 - kept[1])))
    doubt = norm(crosses[-1] - crosses[-2])
    return [_Estimate(crosses[-1], _rss([apart, doubt]))] if doubt <= CONFIRMED * norm(crosses[-1]) else []
