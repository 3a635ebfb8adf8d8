"""Richardson extrapolation of a sweep of refinements, and the error of its limit.

All fields are (n, k) arrays of the same n material points. Richardson 1911; Roache 1998, "Verification and Validation
in Computational Science and Engineering", chapter 5.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats

SANE = (0.5, 1.75)
"""Observed orders from that much to that many times the expected one are believed."""
SLOWEST = 0.25
"""Least order with which differences that hardly fall are taken to go on."""


@dataclass(frozen=True)
class Limit:
    """Limit of a one-knob sweep: field (n, k), its own error (RMS), observed order (nan where unknown).

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
