"""Error of the time steps, bounded by two difference formulas and by the certificate of a run.

Backward Euler and BDF2 tend to the same limit as dt falls, from different sides of the same solution: where their
limits differ by more than both claim, neither claim holds.
"""

from collections.abc import Mapping
from dataclasses import replace

from clothsim.base.arrays import Floats
from clothsim.study.reference_solution import Limit, Norm, limit

SPREAD = 2.0
"""Error of the time steps over the distance of the base to runs with a finer dt, where those do not fall regularly."""


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
            doubt = _beyond_finest(best, second if best is own else own, other if best is own else sweep, norm)
        else:
            euler = second if best is own else own
            doubt = norm(best.field - euler.field) - (euler.error if euler.extrapolated else 0.0)
        return _doubted(replace(best, order=own.order, extrapolated=own.extrapolated), doubt)
    if other and second_order:
        apart = abs(norm(sweep[0] - next(iter(other.values()))) - norm(sweep[0] - own.field))
        return _doubted(own, apart)
    return own


def _beyond_finest(euler: Limit, bdf2: Limit, runs: Mapping[int, Floats], norm: Norm) -> float:
    """Distance of a limit of backward Euler to the finest run of BDF2, and the error of that.

    Where the runs of BDF2 do not fall as they should, their last difference is its error.
    """
    before, finest = (runs[level] for level in sorted(runs)[-2:])
    falls = max(bdf2.error, norm(finest - bdf2.field))
    return norm(euler.field - finest) + (falls if bdf2.extrapolated else norm(finest - before))


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
