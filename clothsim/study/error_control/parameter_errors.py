"""Errors of a run from differences of runs at several resolutions.

With an error A s^p a refinement by f moves the result by D = A s^p (1 - f^-p) and leaves D / (f^p - 1) of it
(Richardson 1911). Orders are assumed: with contact, buckling or flutter the differences of three runs give orders
between 0 and 3, which predict the next difference worse than one fixed order (docs/notes/tried.md). Only where the
differences of three runs point the same way, too, is the order observed. A scene with contact has lower orders: an
impact is not a smooth function of time, nor the edge of a contact region of the cells.

Three runs tell whether an order may be assumed at all. Coarser by two and by four in all (dt, cells, d_hat), two runs
move the result by D2 and D4 - D2. Where an error falls with an order p, the second difference is 2^p times the first;
where the differences do not fall about as assumed the pair tells nothing, and the error is not known. Of 39 runs of 12
scenes 34 had a number by the first difference alone, 10 of them off by more than two; with this check 8 have one, none
of them off by more (docs/results/accuracy.md). Lengths alone may fall by chance: a sheet on a ball moved by 17.8, 10.3
and 1.6 mm from one run to the next, each time in another direction. So the fields are compared as well.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from clothsim.study.error_control.resolution import COARSEST_STEP, Differences
from clothsim.study.parameters import D_HAT, PARAMETERS

SMOOTH = {name: each.assumed.smooth for name, each in PARAMETERS.items() if each.assumed and name != D_HAT}
"""Assumed orders without contact, where BDF2 and the cells have 2 in the limit."""
IN_CONTACT = {name: each.assumed.in_contact for name, each in PARAMETERS.items() if each.assumed}
"""Assumed orders with contact: BDF2 has 2 between impacts and 1 at them."""
ALL_SMOOTH, ALL_SMOOTH_LONG_STEPS, ALL_IN_CONTACT = 1.7, 1.45, 1.2
"""Orders of a refinement of all of which the parts are not known; the second where steps are above COARSEST_STEP."""
SURPRISE = 2.5
"""A refinement that moves the result by so many times what was expected: the error is not understood."""
LEAST_CALIBRATION = 0.1
"""Smallest factor by which a refinement that moved less than expected lowers the errors: chance may have helped."""


@dataclass(frozen=True)
class ParameterErrors:
    """Error of each parameter at a resolution.

    Parameters
    ----------
    sizes : mapping
        Size of each parameter relative to the coarsest run.
    errors : mapping
        RMS error that each parameter adds [m].
    calibration : float
        Factor by which the last difference of two runs exceeded the expected one.
    """

    sizes: Mapping[str, float]
    errors: Mapping[str, float]
    calibration: float = 1.0

    @property
    def total(self) -> float:
        """RMS error [m]; the fields of different parameters are taken as uncorrelated."""
        return root_sum(self.errors.values())

    @property
    def understood(self) -> bool:
        """True where the last refinement moved the result about as expected."""
        return self.calibration <= SURPRISE

    def at(self, sizes: Mapping[str, float]) -> "ParameterErrors":
        """Errors expected at other sizes."""
        order = orders(self.sizes)
        factors = {name: (sizes[name] / size) ** order[name] for name, size in self.sizes.items()}
        return replace(self, sizes=dict(sizes), errors={k: self.errors[k] * factors[k] for k in factors})

    def not_below(self, total: float) -> "ParameterErrors":
        """The errors raised in proportion where their total is below one known of a refinement of all [m]."""
        factor = max(1.0, total / self.total) if self.total > 0 else 1.0
        return replace(self, errors={name: factor * error for name, error in self.errors.items()})

    def expected_difference(self, sizes: Mapping[str, float]) -> float:
        """RMS distance expected between a run at these sizes and at those of the errors [m]."""
        new = self.at(sizes).errors
        return root_sum(abs(self.errors[name] - new[name]) for name in new)

    def after(self, sizes: Mapping[str, float], difference: float) -> "ParameterErrors":
        """Errors of a run at `sizes` whose RMS distance from the one before is `difference` [m].

        A larger difference than expected raises the errors of all that was refined; a smaller one lowers that of the
        parameter from which most was expected, and then the others, but none by more than the two differ.
        """
        expected = self.expected_difference(sizes)
        new = self.at(sizes).errors
        refined = [name for name, size in self.sizes.items() if sizes[name] < size]
        factor = difference / expected if expected > 0 else 1.0
        if factor >= 1:
            scales = dict.fromkeys(refined, factor)
        else:
            least = max(LEAST_CALIBRATION, factor)
            fallen = {name: self.errors[name] - new[name] for name in refined}
            scales = {}
            for name, size in fallen.items():
                smaller = sum(other**2 for other in fallen.values() if other < size)
                left = max(difference**2 - smaller, 0.0) ** 0.5
                scales[name] = min(1.0, max(least, left / size)) if size > 0 else 1.0
        return ParameterErrors(dict(sizes), {name: new[name] * scales.get(name, 1.0) for name in new}, factor)


def from_path(
    sizes: Mapping[str, float], differences: Mapping[str, float], refinements: Mapping[str, float]
) -> ParameterErrors:
    """Errors at the end of a path of runs that refines one parameter after the other.

    sizes: at its end; differences: RMS distance between the runs before and after each parameter was refined [m];
    refinements: factor by which each was refined.

    Examples
    --------
    >>> from_path({"dt": 0.5}, {"dt": 1e-3}, {"dt": 2.0}).errors["dt"] == 1e-3 / (2**1.8 - 1)
    True
    """
    order = orders(sizes)
    left = {name: moved / (refinements[name] ** order[name] - 1) for name, moved in differences.items()}
    return ParameterErrors(dict(sizes), left)


def orders(parameters: Collection[str]) -> Mapping[str, float]:
    """Assumed order of each parameter of a scene; one with a d_hat has contact."""
    return IN_CONTACT if D_HAT in parameters else SMOOTH


def from_all(difference: float, refinement: float, parameters: Collection[str], step: float) -> float:
    """RMS error [m] left by a refinement of all parameters that moved the result by the RMS distance `difference` [m].

    step: of the coarser run [s]: with long ones the order of BDF2 is not reached; parameters: with a d_hat the scene
    has contact.

    Examples
    --------
    >>> round(1e3 * from_all(1e-3, 2.0, ("dt", "d_hat"), 0.01), 2)
    0.77
    """
    smooth = ALL_SMOOTH if step <= COARSEST_STEP * (1 + 1e-9) else ALL_SMOOTH_LONG_STEPS
    return difference / (refinement ** (ALL_IN_CONTACT if D_HAT in parameters else smooth) - 1)


def root_sum(values: Iterable[float]) -> float:
    """Root of the sum of squares."""
    return float(np.sqrt(sum(value**2 for value in values)))


COARSER = (2, 4)
"""Factors by which the other two of three runs are coarser."""
ORDER, ORDER_IN_CONTACT = 1.5, 1.2
"""Assumed orders of a refinement of all parameters."""
FALL, FALL_IN_CONTACT = (2.0, 4.6), (1.65, 3.6)
"""Least and largest ratio of the differences where these orders may be assumed: 2.8 and 2.3 are theirs. Where the
differences fall by such a ratio for ever, the estimate is right to a factor of two."""


ALIGNED = 0.45
"""Cosine of two successive differences from which they are one error that shrinks, or that turns over (below its
negative). Between them a finer run shows something new: the wrinkles of a compressed strip, three times the error that
falling lengths alone promise."""


@dataclass(frozen=True)
class ThreeRuns:
    """Estimate of three runs.

    Parameters
    ----------
    error : float
        RMS error that the last difference leaves [m].
    reason : str
        Why the error is not known; empty where it is.
    aligned : bool
        True where the error is known and the differences have one direction.
    """

    error: float
    reason: str = ""
    aligned: bool = False


def from_three(differences: Differences, parameters: Collection[str]) -> ThreeRuns:
    """Estimate the error of a run by the two that are coarser by two and by four.

    Where the differences fall by a ratio r about as assumed and are aligned as fields, the runs are near their range of
    convergence: what is left of the last difference D is D / (r - 1) (Richardson 1911), and no more than D / (2^p - 1)
    with the assumed order p, as a ratio that is still small grows on the way to its limit. Differences of one shape
    that turn over leave D / (2^p - 1), except with contact. All others tell nothing.

    Parameters
    ----------
    differences : Differences
        Of the three runs.
    parameters : collection of str
        What is coarser; with a d_hat contact acted in a run.

    Returns
    -------
    ThreeRuns

    Examples
    --------
    >>> from_three(Differences(1e-3, 3e-3, alignment=0.9), ("dt", "cells"))
    ThreeRuns(error=0.0005, reason='', aligned=True)
    >>> from_three(Differences(1e-3, 1.1e-3), ("dt", "cells")).reason
    'a run coarser by two moves the result by 1 mm, one by four by another 1.1 mm: no order of convergence'
    """
    contact = D_HAT in parameters
    least, most = FALL_IN_CONTACT if contact else FALL
    fine, coarse = differences.fine, differences.coarse
    aligned = differences.alignment >= ALIGNED
    assumed = fine / (2.0 ** _order_of_all(parameters) - 1)
    near, far = (f"{1e3 * each:.2g} mm" for each in (fine, coarse))
    moved = f"a run coarser by two moves the result by {near}, one by four by another {far}"
    if not least * fine <= coarse <= most * fine:
        return ThreeRuns(assumed, f"{moved}: no order of convergence")
    if aligned:
        return ThreeRuns(min(fine / (coarse / fine - 1), assumed) if fine > 0 else 0.0, aligned=True)
    if contact or not differences.alignment <= -ALIGNED:
        return ThreeRuns(assumed, f"{moved} in another direction (cosine {differences.alignment:.2g})")
    return ThreeRuns(assumed)


def after_halving(error: float, parameters: Collection[str]) -> float:
    """Error that `from_three` expects where all of the parameters are halved, of a run with that error.

    Examples
    --------
    >>> round(after_halving(1.0, ("dt", "cells")), 3)
    0.354
    """
    return error / 2.0 ** _order_of_all(parameters)


def _order_of_all(parameters: Collection[str]) -> float:
    return ORDER_IN_CONTACT if D_HAT in parameters else ORDER
