"""Error of a run by two coarser ones, whose differences tell whether an order of convergence may be assumed.

Coarser by two and by four in all (dt, cells, d_hat), two runs move the result by D2 and D4 - D2. Where an error falls
with an order p, the second difference is 2^p times the first. That order itself predicts badly (`parameter_errors`);
but where the differences do not fall about as assumed the pair tells nothing, and the error is not known. Of 39 runs of
12 scenes 34 had a number by the first difference alone, 10 of them off by more than two; with this check 8 have one,
none of them off by more (docs/howto/accuracy.md).
"""

from collections.abc import Collection
from dataclasses import dataclass

from clothsim.study.parameters import D_HAT

ORDER, ORDER_IN_CONTACT = 1.5, 1.2
"""Assumed orders of a joint refinement."""
FALL, FALL_IN_CONTACT = (2.0, 4.6), (1.65, 3.6)
"""Least and largest ratio of the differences where these orders may be assumed: 2.8 and 2.3 are theirs. Where the
differences fall by such a ratio for ever, the estimate is right to a factor of two."""


@dataclass(frozen=True)
class ThreeRuns:
    """Estimate of three runs.

    Parameters
    ----------
    error : float
        RMS error that the last difference leaves [m].
    reason : str
        Why the error is not known; empty where it is.
    """

    error: float
    reason: str = ""


def from_three(difference: float, coarser_difference: float, parameters: Collection[str]) -> ThreeRuns:
    """Estimate the error of a run.

    Parameters
    ----------
    difference : float
        RMS distance from the run that is coarser by two [m].
    coarser_difference : float
        That of this one from the run coarser by four [m].
    parameters : collection of str
        What is coarser; with a d_hat the scene has contact.

    Returns
    -------
    ThreeRuns

    Examples
    --------
    >>> from_three(1e-3, 3e-3, ("dt", "cells")).reason
    ''
    >>> from_three(1e-3, 1.1e-3, ("dt", "cells")).reason
    'a run coarser by two moves the result by 1 mm, one by four by another 1.1 mm: no order of convergence'
    """
    order, (least, most) = (ORDER_IN_CONTACT, FALL_IN_CONTACT) if D_HAT in parameters else (ORDER, FALL)
    error = difference / (2.0**order - 1)
    if least * difference <= coarser_difference <= most * difference:
        return ThreeRuns(error)
    moved, further = (f"{1e3 * each:.2g} mm" for each in (difference, coarser_difference))
    return ThreeRuns(
        error,
        f"a run coarser by two moves the result by {moved}, one by four by another {further}: no order of convergence",
    )
