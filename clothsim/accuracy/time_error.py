"""Error of the time steps, bounded by two difference formulas and by the certificate of a run.

Backward Euler and BDF2 tend to the same limit as dt falls, from different sides of the same solution: where their
limits differ by more than both claim, neither claim holds.
"""

from collections.abc import Mapping
from dataclasses import replace

from clothsim.accuracy.reference_solution import Limit, Norm, limit
from clothsim.arrays import Floats

AGREES = 0.5
"""Two limits agree where their distance is at most this fraction of the error of the time steps."""


def with_other_formula(
    base: Floats, own: Limit, other: Mapping[int, Floats], order: float, second_order: bool, norm: Norm
) -> Limit:
    """The limit in dt from a sweep of the scene's formula and from runs of the other one.

    Parameters
    ----------
    base : (n, k) array
        Field of the base.
    own : Limit
        Limit of the sweep with the scene's own formula.
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
        That of the smaller error of the two. Its error is at least their distance less the error of the other. With a
        single run of BDF2 its distance to a base of backward Euler stands for the error of the base.
    """
    if len(other) > 1:
        second = limit(other, 2, order, norm)
        best, rest = sorted((own, second), key=lambda each: each.error)
        apart = norm(best.field - rest.field) - rest.error
        return replace(best, error=max(best.error, apart), order=own.order, extrapolated=own.extrapolated)
    if other and second_order:
        apart = abs(norm(base - next(iter(other.values()))) - norm(base - own.field))
        return replace(own, error=max(own.error, apart))
    return own


def not_below(estimate: float, base: Floats, own: Limit, other: Mapping[int, Floats], norm: Norm) -> Limit:
    """The limit with an error that reaches up to the certificate's `estimate` [m], unless a finer dt shows less.

    It does where three levels of dt fall with a believed order, or where the other formula with a finer dt agrees.
    """
    adds = norm(base - own.field)
    finest = max(other, default=0)
    agrees = finest > 0 and norm(other[finest] - own.field) <= AGREES * adds
    if agrees or (own.extrapolated and own.order == own.order):
        return own
    return replace(own, error=max(own.error, estimate - adds))
