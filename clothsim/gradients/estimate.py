"""How wrong a loss is: Newton's part, the time integrator's part, and the part of the contact barrier."""

from collections.abc import Sequence

import numpy as np

from clothsim.gradients.backward_pass import Adjoints
from clothsim.gradients.recorded_step import RecordedStep, bound_to
from clothsim.physics.energies.protocols import ContactGap, Lagged
from clothsim.solve.stepping.integrators import BACKWARD_EULER
from clothsim.solve.stepping.stepping import Integrator


def newton_error(adjoints: Adjoints) -> float:
    """Return L_converged - L = -sum a_k . G(x_k): what the loss would change by if every solve were exact."""
    return float(adjoints.newton.sum())


def time_error(integrator: Integrator, steps: Sequence[RecordedStep], adjoints: Adjoints) -> float:
    """Return an estimate of L_exact - L of a loss of positions with backward Euler: the leading error of each step.

    -sum a_k . M (A_(k+1) - A_k) with the accelerations A_k = (v_k - v_(k-1))/h, the last one extrapolated, and half of
    A_1 besides in the first step. It is of use on smooth motion, not at impacts nor near a zero of the error.

    Returns
    -------
    float
        nan for a quasi-static run, for BDF2, and for fewer than two steps.
    """
    dynamic = "inertia" in integrator.potential.energies
    if not dynamic or integrator.formula != BACKWARD_EULER or len(steps) < 2:
        return float("nan")
    n, masses = integrator.world.n_cloth, integrator.world.masses[:, None]
    accelerations = [(each.end.velocities[:n] - each.start.velocities[:n]) / each.dt for each in steps]
    accelerations.append(2 * accelerations[-1] - accelerations[-2])
    total = 0.0
    for k, a in enumerate(adjoints.forces):
        change = accelerations[k + 1] - accelerations[k] + (0.5 * accelerations[0] if k == 0 else 0.0)
        total -= float(np.vdot(a, masses * change))
    return total


def kappa_share(integrator: Integrator, steps: Sequence[RecordedStep], adjoints: Adjoints) -> float:
    """Return kappa dL/dkappa: the change of the loss for a barrier that is stiffer by a fraction, over that fraction.

    The forces of contact and of its friction are proportional to kappa.
    """
    total = 0.0
    for a, record in zip(adjoints.forces, steps, strict=True):
        _, bound = bound_to(integrator, record)
        for energy in bound.acting.values():
            if isinstance(energy, ContactGap | Lagged):
                total -= float(np.vdot(a, energy.gradient(record.solution)[: len(a)]))
    return total
