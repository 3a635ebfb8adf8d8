"""How wrong a run is, as far as it can tell by itself: time steps, Newton, the gap of contact."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from clothsim.energies.protocols import ContactGap
from clothsim.sim.step_size import LEAST_FRACTION
from clothsim.sim.stepping import StepReport


@dataclass(frozen=True)
class ErrorEstimate:
    """Sums over all steps so far [m]; they bound nothing, but tell the size.

    temporal, temporal_largest: what the difference formula added, by `step_error`, as RMS over the vertices and as the
    most at one: the error of the end where motions neither grow apart nor are forgotten, more than it where errors
    turn about or are damped, and less where a motion is unstable; nan where there is no inertia. newton: the last
    Newton step of each solve times the rate at which Newton came closer; of the last solve alone where there is no
    inertia. contact_gap: the smallest gap at the last step as share of its d_hat, inf where nothing touches: how far
    contact stands off. at_floor: steps that were as short as they may be and still added too much. steps: how many
    there were; of none nothing is estimated.
    """

    temporal: float = 0.0
    temporal_largest: float = 0.0
    newton: float = 0.0
    contact_gap: float = np.inf
    at_floor: int = 0
    steps: int = 0

    def after(self, report: StepReport) -> Self:
        """The estimate after one more step."""
        energies = report.potential.energies.values()
        x, error = report.state.positions, report.error
        shares = [np.inf]
        if report.minimum_gap < np.inf:
            shares += [energy.minimum_gap(x) / energy.d_hat for energy in energies if isinstance(energy, ContactGap)]
        return replace(
            self,
            temporal=np.nan if error is None else report.state.temporal_error,
            temporal_largest=np.nan if error is None else self.temporal_largest + error.largest,
            newton=report.result.remaining + (0.0 if error is None else self.newton),
            contact_gap=float(min(shares)),
            at_floor=self.at_floor + report.at_floor,
            steps=self.steps + 1,
        )

    def as_dict(self, asked: float = 0.0, completed: bool = True) -> dict[str, Any]:
        """As the certificate keeps it; asked: the error that was asked for [m], 0 where none was.

        What a run that was not completed asked for is not met, whatever the steps that it took.
        """
        if not self.steps:
            parts = dict.fromkeys(("temporal", "temporal_largest", "newton", "contact_gap"), "not estimated (no step)")
            return {**parts, **({"asked": asked, "met": False} if asked else {})}
        static = bool(np.isnan(self.temporal))
        return {
            "temporal": "not estimated (quasi-static)" if static else self.temporal,
            "temporal_largest": "not estimated (quasi-static)" if static else self.temporal_largest,
            "newton": self.newton,
            "contact_gap": self.contact_gap if self.contact_gap < np.inf else "not estimated (nothing touches)",
            **({"asked": asked, "met": completed and not self.missed(asked)} if asked else {}),
        }

    def missed(self, error: float) -> str:
        """What the user must know where the `error` asked for [m] was not kept, else empty; 0: none was asked for."""
        if not error or not self.temporal > (1 + LEAST_FRACTION) * error:
            return ""
        why = f": {self.at_floor} steps were as short as they may be" if self.at_floor else ""
        return (
            f"The error asked for, {error:g} m, was not kept{why}. "
            f'The estimate is {self.temporal:.2g} m. Ask for less accuracy, or take integrator = "bdf2".'
        )
