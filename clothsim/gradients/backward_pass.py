"""Backward pass over the steps of a run: the adjoint of each step, and the gradient by states and prescribed positions.

Step k minimises E, so that G(x_k; past, lag, p) = dE/dx = 0 on the free rows, and v_k = (x_k - past.x)/past.dt. With
(lx, lv) = (dL/dx_k, dL/dv_k) over all rows and H the exact Hessian at x_k (docs/theory.md#gradients):

    w = lx + lv/past.dt,    H a = w on the free rows, a = 0 elsewhere
    d(past.x) = -lv/past.dt - d(a.G)/d(past.x),    d(past.v) = -d(a.G)/d(past.v),    d(x_(k-1)) = -d(a.G)/d(x_(k-1))
    d(prescribed rows of x_k) = w - H a,           dL/dp = -a . dG/dp
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.gradients.exact_system import exact_system, solved
from clothsim.gradients.past_differences import past_by_differences
from clothsim.gradients.recorded_step import RecordedStep, bound_to, free_rows
from clothsim.gradients.remembered_pairs import remember, with_remembered_pairs
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.protocols import PastSensitivity, SeesPast
from clothsim.physics.energies.step import Step
from clothsim.solve.linear.linear_system import System
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.stepping import Integrator


@dataclass(frozen=True)
class Adjoints:
    """Result of a backward pass.

    Parameters
    ----------
    forces : (K, n, 3) float64
        a of each step at the cloth vertices, the derivative of the loss by a force in that step [loss / N].
    prescribed : (K, N, 3) float64
        dL by the prescribed rows at the end of each step, 0 in the free ones [loss / m].
    start, velocities : (N, 3) float64
        dL by the positions and velocities at the start of the run.
    newton : (K,) float64
        -a . G of each step: what the loss would still change by if its solve were exact.
    """

    forces: Floats
    prescribed: Floats
    start: Floats
    velocities: Floats
    newton: Floats


def backward_pass(
    integrator: Integrator,
    steps: Sequence[RecordedStep],
    by_positions: Mapping[int, Floats],
    by_velocities: Mapping[int, Floats] | None = None,
    system: System | None = None,
) -> Adjoints:
    """Go backwards over recorded steps.

    Parameters
    ----------
    integrator : Integrator
        That of the run, with contact stiffnesses held.
    steps : sequence of RecordedStep
        All steps of the run in their order.
    by_positions, by_velocities : mapping of int to (N, 3) arrays
        dL by the positions and velocities after so many steps, 0 at the start.
    system : System, optional
        To factor with; None: the integrator's.

    Raises
    ------
    NoMinimumError
        Where a step did not end at a minimum.
    """
    integrator = with_remembered_pairs(integrator)
    n, rows = integrator.world.n_cloth, integrator.world.n_vertices
    x = [np.zeros((rows, 3)) for _ in range(len(steps) + 1)]
    v = [np.zeros((rows, 3)) for _ in range(len(steps) + 1)]
    for states, given in ((x, by_positions), (v, by_velocities or {})):
        for number, derivative in given.items():
            states[number] += derivative
    forces, held = np.zeros((len(steps), n, 3)), np.zeros((len(steps), rows, 3))
    newton = np.zeros(len(steps))
    for k in range(len(steps) - 1, -1, -1):
        record = steps[k]
        for near in steps[max(k - 1, 0) : k + 1]:
            remember(integrator, near)
        step, bound = bound_to(integrator, record)
        past, free = step.past, free_rows(integrator, record)
        by_velocity = velocity_part(v[k + 1], past.dt)
        w = x[k + 1] + by_velocity
        exact = exact_system(bound, record.solution, system or integrator.system, np.flatnonzero(~free))
        a = solved(exact, w, f"after step {k + 1}")
        held[k] = np.where(free[:, None], 0.0, w - exact.prescribed_rows_times(a))
        forces[k] = a[:n]
        newton[k] = -float(np.vdot(a, bound.gradient(record.solution)))
        seen = seen_past(integrator, bound, step, record.solution, a)
        seen["past_positions"] += by_velocity
        new, old = past_weights(record, integrator)
        x[k] -= seen["positions"] + new * seen["past_positions"]
        v[k] -= seen["velocities"] + new * seen["past_velocities"]
        if old:
            x[k - 1] += old * seen["past_positions"]
            v[k - 1] += old * seen["past_velocities"]
        x[k + 1] = v[k + 1] = np.zeros((0, 3))  # done with
    return Adjoints(forces, held, x[0], v[0], newton)


def velocity_part(by_velocities: Floats, dt: float) -> Floats:
    """Return dL/dx by way of v = (x - past.x)/dt; by past.x it is the negative."""
    return by_velocities / dt


def seen_past(integrator: Integrator, bound: Potential, step: Step, x: Floats, adjoint: Floats) -> dict[str, Floats]:
    """Return the sum over the energies of `PastSensitivity`, by the names of its parts, (N, 3) each."""
    total = {name: np.zeros_like(x) for name in PastSensitivity.__dataclass_fields__}
    for name, energy in bound.acting.items():
        own = integrator.potential.energies[name]
        if isinstance(energy, SeesPast):
            part = energy.past_sensitivity(step, x, adjoint)
        elif type(own).begin is Energy.begin or own.begin(step) is own:  # the same in each step
            continue
        else:
            part = past_by_differences(own.begin, step, x, adjoint)
        for slot in total:
            derivative = getattr(part, slot)
            if derivative is not None:
                total[slot] += derivative
    return total


def past_weights(record: RecordedStep, integrator: Integrator) -> tuple[float, float]:
    """Return the weights of x_(k-1) and -x_(k-2) in the past of a step: 1 and 0, or those of BDF2."""
    formula = record.formula(integrator)
    if formula.order == 1:
        return 1.0, 0.0
    r = formula.ratio
    return (1 + r) ** 2 / (1 + 2 * r), r**2 / (1 + 2 * r)
