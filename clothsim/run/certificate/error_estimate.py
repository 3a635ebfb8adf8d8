"""A posteriori error estimate of a run: time discretisation, Newton, contact gap."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from clothsim.physics.energies.protocols import ContactGap
from clothsim.solve.stepping.local_error import LEAST_FRACTION
from clothsim.solve.stepping.stepping import StepReport


@dataclass(frozen=True)
class ErrorEstimate:
    """Sums over all steps so far [m]; estimates of size, not bounds.

    Parameters
    ----------
    temporal : float
        Sum of the local errors of the difference formula (`step_error`), RMS over the vertices: the error at the end
        where perturbations neither grow nor decay, more than it where errors oscillate or are damped, less where a
        motion is unstable; nan without inertia.
    temporal_largest : float
        The same with the largest local error of a vertex in each step.
    newton : float
        Sum of `NewtonResult.remaining`; of the last solve alone without inertia.
    contact_gap : float
        Smallest gap at the last step as a fraction of d_hat: how far contact stands off; inf without contact.
    at_floor : int
        Steps of the shortest length whose local error was still too large.
    steps : int
        Number of steps; without any nothing is estimated.
    """

    temporal: float = 0.0
    temporal_largest: float = 0.0
    newton: float = 0.0
    contact_gap: float = np.inf
    at_floor: int = 0
    steps: int = 0

    def after(self, report: StepReport) -> Self:
        """Return the estimate after one more step."""
        energies = report.potential.energies.values()
        x, error = report.state.positions, report.error
        fractions = [np.inf]
        if report.minimum_gap < np.inf:
            fractions += [energy.minimum_gap(x) / energy.d_hat for energy in energies if isinstance(energy, ContactGap)]
        return replace(
            self,
            temporal=np.nan if error is None else report.state.temporal_error,
            temporal_largest=np.nan if error is None else self.temporal_largest + error.largest,
            newton=report.result.remaining + (0.0 if error is None else self.newton),
            contact_gap=float(min(fractions)),
            at_floor=self.at_floor + report.at_floor,
            steps=self.steps + 1,
        )

    def as_dict(self, asked: float = 0.0, completed: bool = True) -> dict[str, Any]:
        """Return the entry of the certificate; asked: the requested error [m], 0 where none was.

        A run that was not completed does not meet its request, whatever the error of its steps.
        """
        if not self.steps:
            parts = dict.fromkeys(("temporal", "temporal_largest", "newton", "contact_gap"), "not estimated (no step)")
            return {**parts, **({"asked": asked, "met": False} if asked else {})}
        static = bool(np.isnan(self.temporal))
        return {
            "temporal": "not estimated (quasi-static)" if static else self.temporal,
            "temporal_largest": "not estimated (quasi-static)" if static else self.temporal_largest,
            "newton": self.newton,
            "contact_gap": self.contact_gap if self.contact_gap < np.inf else "not estimated (no contact)",
            **({"asked": asked, "met": completed and not self.unmet(asked)} if asked else {}),
        }

    def unmet(self, error: float) -> str:
        """Return a message where the requested `error` [m] is exceeded, else an empty string; 0: none was requested."""
        if not error or not self.temporal > (1 + LEAST_FRACTION) * error:
            return ""
        why = f": {self.at_floor} steps had the shortest length allowed" if self.at_floor else ""
        return (
            f"The requested error of {error:g} m is exceeded{why}. "
            f'The estimate is {self.temporal:.2g} m. Set a larger solver.error, or integrator = "bdf2".'
        )
