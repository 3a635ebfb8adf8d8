"""Reference solution of a study by Richardson extrapolation, and its own error.

All fields are (n, k) arrays of the same n material points. To leading order a result is
q = q* + sum_k a_k + sum_kl c_kl, where a_k is knob k's own error and c_kl what two knobs add only together. One-knob
sweeps give the a_k by Richardson's extrapolation (Richardson 1911; Roache 1998, "Verification and Validation in
Computational Science and Engineering", chapter 5), and a run with all knobs moved together gives the c_kl.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clothsim.arrays import Floats

SANE = (0.5, 1.75)
"""Observed orders from that much to that many times the expected one are believed."""


@dataclass(frozen=True)
class Limit:
    """Limit of a one-knob sweep: field (n, k), its own error (RMS), observed order (nan where unknown).

    extrapolated: False where the finest run stands in for the limit.
    """

    field: Floats
    error: float
    order: float
    extrapolated: bool


@dataclass(frozen=True)
class Reference:
    """field (n, k); error: its own (RMS); limits: of each knob; cross: size of what the knobs add only together.

    joint: number of runs with two knobs changed that measure it; with none, cross is an estimate.
    """

    field: Floats
    error: float
    limits: Mapping[str, Limit]
    cross: float
    joint: int


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
    so fast). With two levels the expected order is used, and the whole correction is the error. Otherwise, and where
    the last difference is below `noise`, the finest run is the limit, and its last difference the error.
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
        return Limit(fine, max(last, last / (ratio**expected - 1)), order, False)
    factor = ratio**order
    field, before = fine + (fine - middle) / (factor - 1), middle + (middle - coarse) / (factor - 1)
    return Limit(field, norm(field - before) / factor, order, True)


def largest_pair(base: Floats, limits: Mapping[str, Limit], norm: Norm) -> tuple[str, ...]:
    """The two knobs with the largest errors at the base, the larger one first; fewer where there are fewer."""
    return tuple(sorted(limits, key=lambda name: norm(base - limits[name].field), reverse=True)[:2])


def reference(
    base: Floats,
    sweeps: Mapping[str, Mapping[int, Floats]],
    limits: Mapping[str, Limit],
    joint: Mapping[int, Floats],
    ratios: Mapping[str, float],
    norm: Norm,
    noise: float = 0.0,
) -> Reference:
    """The reference from one-knob sweeps {knob: {level: field}}, their limits, and runs of two knobs together.

    q* = q_base + sum_k (q_k* - q_base) + c, where c is what the `largest_pair` of knobs adds only together. joint:
    {level: field} with both at that level, which gives c by the orders of the two. The reference's own error: that of
    each limit, and of c its spread over two joint runs; with one joint run, c itself; with none, what c would be if the
    two errors, relative to the base's size, were multiplied. noise: RMS by which a run differs from itself.
    """
    field = base + sum((each.field - base for each in limits.values()), start=np.zeros_like(base))
    pair = largest_pair(base, limits, norm)
    known = [level for level in sorted(joint) if len(pair) == 2 and all(level in sweeps[name] for name in pair)]
    crosses = [
        _cross(base, [sweeps[name][level] for name in pair], joint[level], level, pair, limits, ratios)
        for level in known
    ]
    cross, doubt = np.zeros_like(base), 0.0
    if len(crosses) >= 2:
        cross, doubt = crosses[-1], norm(crosses[-1] - crosses[-2])
    elif crosses:
        doubt = norm(crosses[0])
    elif len(pair) == 2:
        errors = [norm(base - limits[name].field) for name in pair]
        centred = base - norm.weights @ base
        doubt = errors[0] * errors[1] / max(norm(centred), np.finfo(float).tiny)
    own = [each.error for each in limits.values()]
    error = float(np.sqrt(sum(each**2 for each in own) + doubt**2 + noise**2))
    return Reference(field + cross, error, limits, norm(crosses[-1]) if crosses else doubt, len(crosses))


def _cross(
    base: Floats,
    alone: Sequence[Floats],
    together: Floats,
    level: int,
    pair: tuple[str, ...],
    limits: Mapping[str, Limit],
    ratios: Mapping[str, float],
) -> Floats:
    """c at the base from a run with both knobs at `level`, and from each of them alone there.

    A knob of order p keeps the fraction f = ratio^(-p level) of its base error, so the joint run differs
    from the sum of the two alone by c (1 - f_k)(1 - f_l). An order that was not observed counts as 1.
    """
    mismatch = together + base - alone[0] - alone[1]
    orders = [limits[name].order if limits[name].extrapolated else 1.0 for name in pair]
    orders = [order if np.isfinite(order) else 1.0 for order in orders]
    fractions = [ratios[name] ** (-level * order) for name, order in zip(pair, orders, strict=True)]
    return mismatch / ((1.0 - fractions[0]) * (1.0 - fractions[1]))
