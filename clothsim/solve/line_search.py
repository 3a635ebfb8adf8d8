"""Armijo backtracking below the largest admissible step."""

import numpy as np

from clothsim.arrays import Floats
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
    start, noise = sum(values), ROUND_OFF * sum(abs(value) for value in values)
    if limit * abs(slope) > RESOLVED * noise:
        noise = 0.0
    fraction = limit
    for _ in range(MAX_HALVINGS):
        if potential.value(x + fraction * dx) <= start + SUFFICIENT_DECREASE * fraction * slope + noise:
            return fraction
        fraction *= 0.5
    return 0.0
