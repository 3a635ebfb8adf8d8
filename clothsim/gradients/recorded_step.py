"""Record of a step, from which it is bound again as it was taken."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.energies.base import Step
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.integrators import BACKWARD_EULER, Formula, formula_of, prescribed
from clothsim.solve.stepping.state import State
from clothsim.solve.stepping.stepping import Integrator, StepReport, step_of
from clothsim.solve.timers import Timers


@dataclass(frozen=True)
class RecordedStep:
    """A step that was taken.

    Parameters
    ----------
    start, end : State
        States before and after it.
    dt : float
        Its length [s].
    solution : (N, 3) float64
        Minimiser of its energy [m]: the end but for the displacement that leaves an unstable equilibrium.
    restarted : bool
        True where backward Euler took the step of a run with BDF2.
    pairs : mapping of str to (p,) int arrays
        Keys of the contact pairs that are active at the solution, by effect.
    """

    start: State
    end: State
    dt: float
    solution: Floats
    restarted: bool
    pairs: Mapping[str, Ints]

    def formula(self, integrator: Integrator) -> Formula:
        """Return the difference formula of the step."""
        return formula_of(BACKWARD_EULER if self.restarted else integrator.formula, self.start, self.dt)

    def step(self, integrator: Integrator) -> Step:
        """Return the step as energies are bound to it."""
        return step_of(integrator, self.start, self.formula(integrator), self.dt, self.end.time)

    def fixed_rows(self, integrator: Integrator) -> Ints:
        """Return the cloth rows whose positions were prescribed, (k,)."""
        rows = prescribed(integrator.world, integrator.constraints.values(), self.end.time).vertices
        return rows[rows < integrator.world.n_cloth]


def recorded(start: State, report: StepReport) -> RecordedStep:
    """Return the record of a step from `start`."""
    x, contacts = report.result.x, report.potential.energies.items()
    pairs = {name: each.candidates.active(x).keys for name, each in contacts if isinstance(each, Barrier)}
    return RecordedStep(start, report.state, report.dt, x, report.restarted, pairs)


def untimed(potential: Potential) -> Potential:
    """Return a potential with timers of its own: what the backward pass does is no part of the run's account."""
    return replace(potential, timers=Timers())


def bound_to(integrator: Integrator, record: RecordedStep) -> tuple[Step, Potential]:
    """Return the step of a record and the potential bound to it.

    Raises
    ------
    AssertionError
        Where the solution is no minimum of it: the record is of another scene.
    """
    step = record.step(integrator)
    return step, untimed(integrator.potential).begin(step)


def free_rows(integrator: Integrator, record: RecordedStep) -> np.ndarray:
    """Return the mask (N,) of the rows that the step solved for."""
    free = np.zeros(integrator.world.n_vertices, bool)
    free[: integrator.world.n_cloth] = True
    free[record.fixed_rows(integrator)] = False
    return free
