"""Polishing of a converged step: Newton steps with the exact Hessian down to round-off."""

from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.gradients.exact_system import exact_system, lowest_direction
from clothsim.physics.energies.base import Prescribed
from clothsim.solve.linear.direct_solver import NotPositiveDefiniteError
from clothsim.solve.linear.linear_system import System
from clothsim.solve.newton.newton import Newton, NewtonResult, NewtonSettings
from clothsim.solve.newton.potential import Potential

MOST_STEPS = 8
"""Bound on the Newton steps of a polish; two to four are usual."""
LEAST_GAIN = 0.5
"""Fraction of the residual that a step must leave at most: else round-off is reached."""


MOST_DESCENTS = 3
"""Bound on the descents of one step from states that are no minima."""
AMPLITUDES = tuple(1e-3 * 0.1**k for k in range(6))
"""Largest displacements of a vertex that are tried along the direction of least curvature [m]."""
DESCENT = NewtonSettings(tolerance=1e-8)
"""Settings of a descent; the tolerance is a length [m]."""


@dataclass(frozen=True)
class Polish:
    """Refinement of converged solves for `Integrator.refine`: at most `steps` Newton steps with the exact Hessian.

    Newton's method may end where the exact Hessian is not positive definite, beside a saddle of the energy, as its
    matrix is projected. From there it goes on to a minimum first: down along the direction of least curvature, then at
    steps below DESCENT's tolerance.
    """

    system: System
    steps: int = MOST_STEPS

    def __call__(self, potential: Potential, result: NewtonResult, target: Prescribed) -> NewtonResult:
        """Return the result with polished positions; a blocked one, or one beside a saddle, as it is."""
        x, residual, stable = self._polished(potential, result.x, target)
        for _ in range(MOST_DESCENTS):
            if stable:
                break
            x = self._beside(potential, x, target)
            below = Newton(potential, self.system, DESCENT, dt=1.0).minimise(x, target)
            if not below.outcome.converged:
                break
            x, residual, stable = self._polished(potential, below.x, target)
        return replace(result, x=x, residual=min(result.residual, residual)) if np.isfinite(residual) else result

    def _beside(self, potential: Potential, x: Floats, target: Prescribed) -> Floats:
        """Positions of lower energy along the direction of least curvature; x where there are none."""
        direction = lowest_direction(potential, x, self.system, target.vertices)
        if direction is None:
            return x
        start, side = potential.value(x), -1.0 if float(np.vdot(direction, potential.gradient(x))) > 0 else 1.0
        for amplitude in AMPLITUDES:
            dx = side * amplitude * direction
            if potential.step_limit(x, dx) == 1.0 and potential.value(x + dx) < start:
                return x + dx
        return x

    def _polished(self, potential: Potential, x: Floats, target: Prescribed) -> tuple[Floats, float, bool]:
        """Positions, the force that is left [N], and False where the exact Hessian is not positive definite."""
        best, residual = x, np.inf
        for _ in range(self.steps):
            gradient = potential.gradient(x)
            exact = exact_system(potential, x, self.system, target.vertices)
            left = _largest(gradient, exact.free)
            if not left < LEAST_GAIN * residual:
                return best, residual, True
            best, residual = x, left
            try:
                dx = exact.solve(-gradient)
            except NotPositiveDefiniteError:
                return best, residual, False
            if not dx.any() or potential.step_limit(x, dx) < 1.0 or not np.isfinite(potential.value(x + dx)):
                return best, residual, True
            x = x + dx
        left = _largest(potential.gradient(x), exact.free)
        return (x, left, True) if left < residual else (best, residual, True)


def _largest(gradient: Floats, free: np.ndarray) -> float:
    return float(np.abs(gradient[: len(free)][free]).max(initial=0.0))
