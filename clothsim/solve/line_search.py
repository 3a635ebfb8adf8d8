"""Armijo backtracking below the largest admissible step; longer steps where E curves downward."""

from collections.abc import Sequence

import numpy as np

from clothsim.arrays import Floats
from clothsim.linalg import dot
from clothsim.solve.potential import Potential

SUFFICIENT_DECREASE = 1e-4
MAX_HALVINGS = 50
ROUND_OFF = 32 * float(np.finfo(float).eps)
RESOLVED = 1e6
"""Multiple of the round-off from which a promised decrease must show: else a wrong direction passes by tiny steps."""


def armijo(potential: Potential, x: Floats, dx: Floats, slope: float, limit: float) -> float:
    """The first fraction a = limit, limit/2, ... with E(x + a dx) <= E(x) + 1e-4 a slope, or 0 if there is none.

    slope = gradient . dx [J] < 0. The sum of energies is known to its round-off only, so where the step promises little
    more than that, a rise below it is no rise: without this a converged step would be refused for the last bits of E.
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
    """What of E(x) is noise [J]: E is the sum of `values`, and each of them is known to its last digits only."""
    return ROUND_OFF * sum(abs(value) for value in values)


def extended_fraction(potential: Potential, x: Floats, dx: Floats, longest: float) -> float:
    """1, 2, 4, ... up to `longest`: the last that is free of collision, and with which E(x + a dx) still fell.

    For directions of negative curvature, of which Newton knows the sign and not the length: a buckle grows by many
    small steps otherwise, each of them a factorisation. Where E rises already at x + dx, nothing longer is looked at:
    to search a long way for collisions costs more than a gradient.
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
