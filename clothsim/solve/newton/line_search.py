"""Armijo backtracking below the step limit, and step extension along negative curvature."""

from collections.abc import Sequence

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.linalg import dot
from clothsim.solve.newton.potential import Potential

SUFFICIENT_DECREASE = 1e-4
MAX_HALVINGS = 50
ROUND_OFF = 32 * float(np.finfo(float).eps)
RESOLVED = 1e6
"""Multiple of the round-off of E above which a promised decrease must be observed; below it tiny steps always pass."""


def armijo(potential: Potential, x: Floats, dx: Floats, slope: float, limit: float) -> float:
    """Armijo line search: the first a = limit, limit/2, ... with E(x + a dx) <= E(x) + 1e-4 a slope.

    E is a sum of energies known to round-off only. Where the step promises little more than that, a rise below
    round-off is accepted; else a converged step would be rejected for the last bits of E.

    Parameters
    ----------
    potential : Potential
        Potential bound to the step.
    x, dx : (N, 3) float64
        Positions and direction [m].
    slope : float
        gradient . dx [J], below 0.
    limit : float
        Step limit in (0, 1].

    Returns
    -------
    float
        The accepted fraction of dx, or 0 where MAX_HALVINGS halvings found none.
    """
    values = potential.values(x)
    start, noise = sum(values), round_off(values)
    if limit * abs(slope) > RESOLVED * noise:
        noise = 0.0
    fraction = limit
    for _ in range(MAX_HALVINGS):
        if potential.value(x + fraction * dx) <= start + SUFFICIENT_DECREASE * fraction * slope + noise:
            return fraction
        fraction *= 0.5
    return 0.0


def round_off(values: Sequence[float]) -> float:
    """Return the round-off of E [J]: E is the sum of `values`, each of them known to its last digits."""
    return ROUND_OFF * sum(abs(value) for value in values)


def extended_fraction(potential: Potential, x: Floats, dx: Floats, longest: float) -> float:
    """Extend the step by doubling: the last of 1, 2, 4, ... up to `longest` that is admissible and still lowers E.

    For directions of negative curvature, whose length the quadratic model does not determine: a buckle would else grow
    by many small steps, each of them a factorisation. The slope at the current end is tested first, as a search for
    collisions along a long step costs more than a gradient.
    """
    fraction, value = 1.0, potential.value(x + dx)
    while 2.0 * fraction <= longest and dot(potential.gradient(x + fraction * dx), dx) < 0.0:
        further = 2.0 * fraction * dx
        if potential.step_limit(x, further) < 1.0:
            break
        longer = potential.value(x + further)
        if not longer < value:
            break
        fraction, value = 2.0 * fraction, longer
    return fraction
