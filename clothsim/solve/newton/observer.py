"""Observation of a Newton solve: a callback with each iterate."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats


@dataclass(frozen=True)
class Iterate:
    """One Newton iterate: x (N, 3) [m] and the step that led to it.

    Parameters
    ----------
    x : (N, 3) float64
        Positions [m].
    fraction : float
        Fraction of the step that was taken: 0 at the start, nan after a nonlinear elimination.
    speed : float
        |dx|_inf / dt of the full step [m/s]; nan where there was none.
    residual : float
        Largest force where the step began [N]; nan where it is unknown.
    """

    x: Floats
    fraction: float = 0.0
    speed: float = np.nan
    residual: float = np.nan


Observer = Callable[[Iterate], None]
"""Callback with the start of a solve, then with each iterate."""


def unobserved(iterate: Iterate) -> None:
    """Observe nothing."""
