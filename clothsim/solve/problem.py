"""Problem: a world and the energies whose sum each step minimises."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from clothsim.base.errors import InputError
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Constraint, Energy, contact_time
from clothsim.solve.linear.dependent_rows import Dependence, DependentRows
from clothsim.solve.linear.linear_system import System
from clothsim.solve.linear.sparsity import make_pattern
from clothsim.solve.newton.newton import NewtonSettings
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.integrators import BACKWARD_EULER, BDF2
from clothsim.solve.stepping.state import State, first_state
from clothsim.solve.stepping.stepping import Integrator, StepReport, advance
from clothsim.solve.timers import EffectCounters, Timers

STANDARD_GRAVITY = 9.81


@dataclass(frozen=True)
class Problem:
    """A world, its energies, and how a step is solved.

    Parameters
    ----------
    world : World
        Cloths and bodies.
    energies : mapping of str to Energy
        Terms of E(x) by name. One that is called "inertia" makes the steps dynamic; without it they are quasi-static.
    constraints : mapping of str to Constraint
        Dirichlet positions by name.
    dt : float
        Longest step [s].
    newton : NewtonSettings
        Tolerance and bounds of Newton's method.
    formula : {"bdf2", "backward_euler"}
        Time integrator of dynamic steps.
    linear : str
        Linear solver, as `solver.linear` of a scene.
    threads : int
        Of the linear solver; 0: all cores.

    Raises
    ------
    InputError
        Where there is no energy, dt is not positive, or the formula has another name.
    """

    world: World
    energies: Mapping[str, Energy]
    constraints: Mapping[str, Constraint] = field(default_factory=dict)
    dt: float = 0.01
    newton: NewtonSettings = field(default_factory=NewtonSettings)
    formula: str = BDF2
    linear: str = "auto"
    threads: int = 1

    def __post_init__(self) -> None:
        if not self.energies:
            raise InputError("The problem has no energy.", 'Give {"inertia": ..., "membrane": ...}.')
        for name, energy in self.energies.items():
            if not isinstance(energy, Energy):
                raise InputError(
                    f"energies[{name!r}] is {type(energy).__name__}, which is not an Energy.",
                    "Derive it from clothsim.engine.Energy.",
                )
        if not self.dt > 0:
            raise InputError(f"dt must be positive, not {self.dt}.", "Give seconds: dt=0.01.")
        if self.formula not in (BDF2, BACKWARD_EULER):
            raise InputError(f"formula is {self.formula!r}.", f'Give "{BDF2}" or "{BACKWARD_EULER}".')

    @cached_property
    def integrator(self) -> Integrator:
        """The integrator, with the sparsity pattern of the Newton matrix and its solver."""
        start = self.world.start()
        hessians = [energy.hessian(start) for energy in self.energies.values()]
        pattern = make_pattern(self.world.n_unknowns, self.world.triangles, hessians)
        system = System(pattern, self.linear, self.threads, dependent=rigid_rows(self.world))
        timers = Timers(effects={name: EffectCounters() for name in self.energies})
        formula = self.formula if "inertia" in self.energies else BACKWARD_EULER
        potential = Potential(dict(self.energies), timers, self.world.n_unknowns)
        least = least_contact_time(self.world, self.energies)
        steps = self.newton, self.dt
        return Integrator(
            self.world, potential, self.constraints, system, *steps, ramp=0.0, formula=formula, contact_time=least
        )

    def start(self) -> State:
        """The state of the world at time 0."""
        return first_state(self.world, self.dt)


def step(problem: Problem, state: State, until: float | None = None) -> StepReport:
    """Take one step.

    Parameters
    ----------
    problem : Problem
        What is minimised.
    state : State
        State before the step; it is not changed.
    until : float, optional
        Time that the step does not pass [s]; None: `problem.dt` after the state.

    Returns
    -------
    StepReport
        With `state` after the step, and `failure` where no try succeeded: the state is then that before it.
    """
    return advance(problem.integrator, state, state.time + problem.dt if until is None else until)


def rigid_rows(world: World) -> DependentRows:
    """The vertices of rigid bodies, which follow their coordinates."""
    parts = zip(world.rigid_slices, world.coordinate_slices, world.rigid, strict=True)
    follow = tuple(Dependence(rows, unknowns, body.weights) for rows, unknowns, body in parts)
    return DependentRows(follow, world.n_vertices)


def gravity_of(energies: Mapping[str, Energy]) -> float:
    """The acceleration by which speeds are called slow [m/s2]: of the energies, or the earth's where they have none."""
    acceleration = getattr(energies.get("gravity"), "acceleration", None)  # without an import of the effect
    size = 0.0 if acceleration is None else float(np.linalg.norm(acceleration))
    return size or STANDARD_GRAVITY


def least_contact_time(world: World, energies: Mapping[str, Energy]) -> float:
    """`contact_time` of the largest d_hat of the energies, or of the default one where there is none [s]."""
    given = [energy.d_hat for energy in energies.values() if hasattr(energy, "d_hat")]
    return contact_time(max(given, default=0.1 * world.cell), gravity_of(energies))
