"""Polishing of a converged step: Newton steps with the exact Hessian down to round-off."""

from dataclasses import dataclass, replace

import numpy as np

from clothsim.adjoint.exact_system import exact_system
from clothsim.arrays import Floats
from clothsim.energies.constraint import Prescribed
from clothsim.solve.direct_solver import NotPositiveDefiniteError
from clothsim.solve.linear_system import System
from clothsim.solve.newton import NewtonResult
from clothsim.solve.potential import Potential

MOST_STEPS = 8
"""Bound on the Newton steps of a polish; two to four are usual."""
LEAST_GAIN = 0.5
"""Fraction of the residual that a step must leave at most: else round-off is reached."""


@dataclass(frozen=True)
class Polish:
    """Refinement of converged solves for `Integrator.refine`: at most `steps` Newton steps with the exact Hessian."""

    system: System
    steps: int = MOST_STEPS

    def __call__(self, potential: Potential, result: NewtonResult, target: Prescribed) -> NewtonResult:
        """Return the result with polished positions; an unstable or blocked one as it is."""
        x, residual = result.x, np.inf
        for _ in range(self.steps):
            gradient = potential.gradient(x)
            exact = exact_system(potential, x, self.system, target.vertices)
            left = _largest(gradient, exact.free)
            if not left < LEAST_GAIN * residual:
                break
            best, residual = x, left
            try:
                dx = exact.solve(-gradient)
            except NotPositiveDefiniteError:
                break
            if not dx.any() or potential.step_limit(x, dx) < 1.0 or not np.isfinite(potential.value(x + dx)):
                break
            x = x + dx
        else:
            left = _largest(potential.gradient(x), exact.free)
            best, residual = (x, left) if left < residual else (best, residual)
        return replace(result, x=best, residual=min(result.residual, residual)) if np.isfinite(residual) else result


def _largest(gradient: Floats, free: np.ndarray) -> float:
    return float(np.abs(gradient[: len(free)][free]).max(initial=0.0))
