"""An energy that refuses long steps for a while."""

from dataclasses import dataclass, replace

import numpy as np

from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.hessians import ElementHessian


@dataclass(frozen=True)
class Hurdle(Energy):
    """Refuses steps that are longer than `longest` while their start lies in [since, until) [s]."""

    longest: float
    since: float = 0.0
    until: float = np.inf
    refuses: bool = False

    def begin(self, step):
        return replace(self, refuses=step.dt > self.longest and self.since <= step.time < self.until)

    def value(self, x):
        return 0.0

    def gradient(self, x):
        return np.full_like(x, np.nan) if self.refuses else np.zeros_like(x)

    def hessian(self, x, project=True):
        return ElementHessian(np.zeros((0, 1), np.int64), np.zeros((0, 3, 3)))
