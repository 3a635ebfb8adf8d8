"""Richardson extrapolation of a sweep of refinements, and the error of its limit.

All fields are (n, k) arrays of the same n material points. Richardson 1911; Roache 1998, "Verification and Validation
in Computational Science and Engineering", chapter 5.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats

SANE = (0.5, 1.75)
"""Observed orders from that much to that many times the expected one are believed."""
SLOWEST = 0.25
"""Least order with which differences that hardly fall are taken to go on."""


@dataclass(frozen=True)
class Limit:
    """Limit of a one-parameter sweep: field (n, k), its own error (RMS), observed order (nan where unknown).

    extrapolated: False where the finest run stands in for the limit. doubt: least error of what is made of it (RMS).
    """

    field: Floats
    error: float
    order: float
    extrapolated: bool
    doubt: float = 0.0


@dataclass(frozen=True)
class Norm:
    """RMS over material points weighted by their area: sqrt(sum w |f|^2), sum w = 1; weights (n,)."""

    weights: Floats

    def __call__(self, field: Floats) -> float:
        """The norm of a field (n, k)."""
        return float(np.sqrt(self.weights @ (field**2).sum(axis=1)))

    def inner(self, one: Floats, other: Floats) -> float:
        """The inner product that goes with it."""
        return float(self.weights @ (one * other).sum(axis=1))


def observed_order(coarse: Floats, middle: Floats, fine: Floats, ratio: float, norm: Norm) -> float:
    """log(|coarse - middle| / |middle - fine|) / log(ratio); nan where a difference is zero."""
    before, after = norm(coarse - middle), norm(middle - fine)
    return float(np.log(before / after) / np.log(ratio)) if before > 0 and after > 0 else np.nan


def limit(sweep: Mapping[int, Floats], ratio: float, expected: float | None, norm: Norm, noise: float = 0.0) -> Limit:
    """The limit of fields by level, of which 0 and a finer one are there.

    With three successive levels q0, q1, q2 and an observed order p that is SANE: q* = q2 + (q2 - q1)/(ratio^p - 1); its
    error is taken as its difference to the same formula one level coarser, over ratio^p (the next term falls at least
    so fast), and as that to the same formula with the expected order, whichever is larger. With two levels the expected
    order is used, and the whole correction is the error. Otherwise, and where the last difference is below `noise`, the
    finest run is the limit, and its last difference the error; where the differences do not fall as they should, what
    is left to come if they fall with the order SLOWEST.
    """
    levels = sorted(sweep)
    finest = levels[-1]
    fine, middle = sweep[finest], sweep[levels[-2]]
    last = norm(fine - middle)
    coarse = sweep.get(finest - 2) if levels[-2] == finest - 1 else None
    order = np.nan if coarse is None else observed_order(coarse, middle, fine, ratio, norm)
    if expected is None or last <= noise or levels[-2] != finest - 1:
        return Limit(fine, last, order, False)
    if coarse is None:
        step = (fine - middle) / (ratio**expected - 1)
        return Limit(fine + step, norm(step), order, True)
    if not SANE[0] <= order <= SANE[1] * expected:
        slow = max(SLOWEST, order) if order < SANE[0] else expected
        return Limit(fine, max(last, last / (ratio**slow - 1)), order, False)
    factor = ratio**order
    field, before = fine + (fine - middle) / (factor - 1), middle + (middle - coarse) / (factor - 1)
    other_order = last * abs(1 / (factor - 1) - 1 / (ratio**expected - 1))
    return Limit(field, max(norm(field - before) / factor, other_order), order, True)


SPREAD = 2.0
"""Error of the time steps over the distance of the base to runs with a finer dt, where those do not fall regularly."""


# Error of the time steps, bounded by two difference formulas and by the certificate of a run: backward Euler and BDF2
# tend to the same limit as dt falls, from different sides of the same solution: where their limits differ by more than
# both claim, neither claim holds.


def with_other_formula(
    sweep: Mapping[int, Floats], own: Limit, other: Mapping[int, Floats], order: float, second_order: bool, norm: Norm
) -> Limit:
    """The limit in dt from a sweep of the scene's formula and from runs of the other one.

    Parameters
    ----------
    sweep : dict
        Fields {level of dt: (n, k) array} with the scene's own formula, 0 included.
    own : Limit
        Limit of `sweep`.
    other : dict
        Fields {level of dt: (n, k) array} with the other formula.
    order : float
        Order of the other formula.
    second_order : bool
        True where the other one is BDF2.
    norm : Norm

    Returns
    -------
    Limit
        That of the smaller error of the two. Its error is at least its distance to what the other formula shows: to the
        finest run of BDF2 with the error of that, or to the limit of backward Euler less its error where it falls as it
        should. That is its `doubt`, which no other runs of the same formula take away. Formulas that do not meet do not
        resolve the motion: backward Euler damps a vibration of the membrane, and seems to converge, long before dt is
        short enough to follow it. With a single run of BDF2 its distance to a base of backward Euler stands for the
        error of the base.
    """
    if len(other) > 1:
        second = limit(other, 2, order, norm)
        best = own if own.error <= second.error else second
        if (best is own) == second_order:  # backward Euler, against BDF2
            # distance of a limit of backward Euler to the finest run of BDF2, and the error of that
            bdf2 = second if best is own else own
            runs = other if best is own else sweep
            before, finest = (runs[level] for level in sorted(runs)[-2:])
            falls = max(bdf2.error, norm(finest - bdf2.field))
            doubt = norm(best.field - finest) + (falls if bdf2.extrapolated else norm(finest - before))
        else:
            euler = second if best is own else own
            doubt = norm(best.field - euler.field) - (euler.error if euler.extrapolated else 0.0)
        return _doubted(replace(best, order=own.order, extrapolated=own.extrapolated), doubt)
    if other and second_order:
        apart = abs(norm(sweep[0] - next(iter(other.values()))) - norm(sweep[0] - own.field))
        return _doubted(own, apart)
    return own


def not_below(
    estimate: float, sweep: Mapping[int, Floats], own: Limit, other: Mapping[int, Floats], norm: Norm
) -> Limit:
    """The limit with an error that reaches up to the certificate's `estimate` [m], unless a finer dt shows less.

    Three levels of dt that fall with a believed order show it. Else both formulas with a finer dt do: then the error
    reaches up to SPREAD times the furthest that one of their runs lies from the base.
    """
    if own.extrapolated and own.order == own.order:
        return own
    start = sweep[0]
    doubt = estimate - norm(start - own.field)
    if max(other, default=0) > 0:
        finer = [*(sweep[level] for level in sweep if level > 0), *(other[level] for level in other if level >= 0)]
        doubt = min(doubt, SPREAD * max(norm(start - each) for each in finer))
    return _doubted(own, doubt)


def _doubted(each: Limit, doubt: float) -> Limit:
    """The limit with an error of at least `doubt` [m]."""
    return replace(each, error=max(each.error, doubt), doubt=max(each.doubt, doubt))


# Runs in which the largest parameters are refined together: errors of single parameters add up only where each has a
# cause of its own. A start inside d_hat is pushed out by the barrier, and a finer dt, finer cells and a smaller d_hat
# all show that same push: their sum counts it three times. So the parameters with the largest errors, and dt and cells
# in any case, are refined together, and what that run shows replaces the sum: an interaction term.

LARGE = 0.1
"""A parameter is refined with the others where its error is at least this fraction of the largest."""
CONFIRMED = 0.25
"""Two runs confirm a product of two errors where they differ by at most this fraction of it."""
ORDERS = (1.0, 2.0)
"""Range of the order with which the parameters' errors fall together."""


@dataclass(frozen=True)
class Reference:
    """field (n, k); error: its own (RMS); limits: of each parameter; interaction: size of the interaction term.

    names: the parameters that were refined together; combined: number of runs with them; with none, `interaction` is
    what the sum may count twice.
    """

    field: Floats
    error: float
    limits: Mapping[str, Limit]
    interaction: float
    names: tuple[str, ...]
    combined: int


@dataclass(frozen=True)
class _Estimate:
    """Interaction term (n, k), and the error of all that the parameters add (RMS)."""

    interaction: Floats
    error: float


def large_parameters(base: Floats, limits: Mapping[str, Limit], always: Sequence[str], norm: Norm) -> tuple[str, ...]:
    """The parameters to refine together: those of `always` that have a limit, and the others with a LARGE error."""
    adds = {name: norm(base - each.field) for name, each in limits.items()}
    least = LARGE * max(adds.values(), default=0.0)
    return tuple(name for name in limits if name in always or (adds[name] >= least and adds[name] > 0))


def reference(
    base: Floats,
    sweeps: Mapping[str, Mapping[int, Floats]],
    limits: Mapping[str, Limit],
    combined: Mapping[int, Floats],
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
        Fields of the one-parameter runs, {parameter: {level: (n, k) array}}.
    limits : dict
        Limit of each sweep.
    combined : dict
        Fields {level: (n, k) array} of the runs with all parameters of `names` at that level.
    names : sequence of str
        Parameters that are refined together.
    ratios : dict
        Ratio of each parameter's levels.
    norm : Norm
    noise : float
        RMS by which a run differs from itself.

    Returns
    -------
    Reference
        c is what the parameters of `names` add only together: a product of two errors where two runs of several confirm
        that; else from the finest run of several, or by a limit of the runs of several themselves, whichever has the
        smaller error. Where the other one is further away than it claims, that distance is the error. Without a run of
        several the error holds all parameters but the largest, for they may be counted twice.
    """
    field = base + sum((each.field - base for each in limits.values()), start=np.zeros_like(base))
    known = {level: each for level, each in combined.items() if all(level in sweeps.get(name, {}) for name in names)}
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
    best = _best(base, known, shifts, combined, chosen, [ratios[name] for name in names], norm, noise)
    error, interaction = _rss([rest, best.error]), norm(best.interaction)
    return Reference(field + best.interaction, error, limits, interaction, tuple(names), len(known))


def _best(
    base: Floats,
    known: Mapping[int, Floats],
    shifts: Mapping[int, Floats],
    combined: Mapping[int, Floats],
    limits: Mapping[str, Limit],
    ratios: Sequence[float],
    norm: Norm,
    noise: float,
) -> _Estimate:
    """The estimate to take, from runs of several of levels at which the sum `shifts` of the parameters is known."""
    finest, apart = max(known), _rss([each.error for each in limits.values()])
    mismatches = {level: known[level] - base - shifts[level] for level in known}
    # the order with which the sum of the errors falls, from its shift at the finest level
    whole = norm(sum((each.field - base for each in limits.values()), start=np.zeros_like(base)))
    left = 1.0 - norm(shifts[finest]) / whole if whole > 0 else 0.0
    order = float(np.clip(-np.log2(left) / finest, *ORDERS)) if left > 0 else ORDERS[1]
    estimates = _product(mismatches, list(limits.values()), ratios, apart, norm)
    if not estimates:
        # the mismatch of the finest run of several, times the whole error over what that level removes of it; where it
        # counts one push of the single limits three times, it counts its doubt three times too
        factor = 1.0 / (1.0 - 2.0 ** (-order * finest))
        summed, mismatch = shifts[finest], mismatches[finest]
        removed = norm(summed)
        scale = min(1.0, norm(summed + mismatch) / removed) if removed > 0 else 1.0
        estimates = [_Estimate(factor * mismatch, _rss([scale * apart, factor * norm(mismatch)]))]
        estimates += _limit_of_combined(base, combined, order, limits, norm, noise)
    best, *others = sorted(estimates, key=lambda each: each.error)
    excess = [norm(best.interaction - each.interaction) - each.error for each in others]
    return _Estimate(best.interaction, max([best.error, *excess, *(each.doubt for each in limits.values())]))


def _rss(values: Sequence[float], *more: float) -> float:
    return float(np.sqrt(sum(each**2 for each in (*values, *more))))


def _limit_of_combined(
    base: Floats, combined: Mapping[int, Floats], order: float, limits: Mapping[str, Limit], norm: Norm, noise: float
) -> list[_Estimate]:
    """The limit of the runs of several as one sweep, where three levels have a believed order or fall faster.

    Differences that fall faster may do so by chance: the finest run is then the limit, and its error at least what the
    first difference leaves of it with the expected order.
    """
    sweep = {0: base, **combined}
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
    """Interaction of two parameters as a product of their errors, where a coarser and a finer run of both agree on it.

    A parameter of order p keeps the fraction f = ratio^(-p level) of its base error, so a run of several differs from
    the sum of the two alone by c (1 - f_k)(1 - f_l). An order that was not observed counts as 1.
    """
    if len(limits) != 2 or len(mismatches) < 2:
        return []
    orders = [each.order if each.extrapolated and np.isfinite(each.order) else 1.0 for each in limits]
    interactions = []
    for level in sorted(mismatches):
        kept = [ratio ** (-level * order) for ratio, order in zip(ratios, orders, strict=True)]
        interactions.append(mismatches[level] / ((1.0 - kept[0]) * (1.0 - kept[1])))
    doubt = norm(interactions[-1] - interactions[-2])
    return [_Estimate(interactions[-1], _rss([apart, doubt]))] if doubt <= CONFIRMED * norm(interactions[-1]) else []
