"""What a Newton solve shows to one who watches it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from clothsim.arrays import Floats


@dataclass(frozen=True)
class Iterate:
    """Where Newton stands, x (N, 3) [m], and the step that led there.

    fraction of the step that was taken: 0 at the start, nan where a few vertices were brought to rest by themselves;
    speed |dx|_inf/dt of the whole step [m/s]; residual: the largest force where the step began [N]; nan where there was
    no step, or none was known.
    """

    x: Floats
    fraction: float = 0.0
    speed: float = np.nan
    residual: float = np.nan


Observer = Callable[[Iterate], None]
"""Called with the start of a solve, then with each iterate."""


def unobserved(iterate: Iterate) -> None:
    """Nobody watches."""
