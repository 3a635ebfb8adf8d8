"""Positions, velocities and energies at the end of a step."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError
from clothsim.mesh.world import World
from clothsim.solve.stepping.failure import Failure
from clothsim.solve.stepping.mechanical_energy import mechanical_energy
from clothsim.solve.stepping.state import State, Switch
from clothsim.solve.stepping.stepping import StepReport


class SimulationError(ClothsimError):
    """A step that cannot be taken.

    Attributes
    ----------
    failure : Failure
        The cause, the element by its name, its position, and the remedy, as in the summary of a failed run.
    """

    def __init__(self, failure: Failure) -> None:
        self.failure = failure
        super().__init__(failure.reason, failure.remedy)


@dataclass(frozen=True)
class SimulationState:
    """The state of a scene at the end of a step, in the coordinates of the scene; its arrays are read-only.

    Attributes
    ----------
    time : float
        End of the step [s].
    dt : float
        Length of the step [s]; 0 at the start.
    step, frame : int
        Number of steps and of frames that are done.
    positions, velocities : dict of str to (n, 3) array
        Vertices of each cloth by its name [m], [m/s].
    bodies : dict of str to (n, 3) array
        Vertices of each body by its name [m].
    newton_iterations : int
        Newton iterations of the step.
    minimum_gap : float
        Smallest distance in contact that is below d_hat [m]; inf where nothing is that close.
    kinetic_energy : float
        Of all cloths [J]; 0 where the scene has no inertia.
    at_rest : bool
        True where the cloth was at rest at the end of the last frame, and slow since then.
    unstable : tuple of Switch
        Unstable equilibria in which the step ended: growth rate, vertex and displacement by which each was left.
    energies : dict of str to float
        Value of each energy of the step [J]; that of "inertia", "damping", "air" and "friction" belongs to the step
        and is no stored energy. Empty at the start.
    mechanical_energy : float
        Kinetic and stored energy [J], also that of the springs of static friction; 0 at the start.
    """

    time: float
    dt: float
    step: int
    frame: int
    positions: Mapping[str, Floats]
    velocities: Mapping[str, Floats]
    bodies: Mapping[str, Floats]
    newton_iterations: int = 0
    minimum_gap: float = float("inf")
    kinetic_energy: float = 0.0
    at_rest: bool = False
    unstable: tuple[Switch, ...] = ()
    energies: Mapping[str, float] = field(default_factory=dict)
    mechanical_energy: float = 0.0


def starting_state(world: World, state: State) -> SimulationState:
    """The state between two steps as users see it, without what belongs to the step before."""
    return SimulationState(
        time=state.time,
        dt=0.0,
        step=state.step,
        frame=state.frame,
        positions=_by_name(world, state.positions + world.origin, "cloth"),
        velocities=_by_name(world, state.velocities, "cloth"),
        bodies=_by_name(world, state.positions + world.origin, "body"),
        at_rest=state.at_rest,
    )


def state_after(world: World, report: StepReport) -> SimulationState:
    """The state at the end of a step as users see it."""
    state, acting = report.state, report.potential.acting
    at_end = starting_state(world, state)
    speeds = (state.velocities[: world.n_unknowns] ** 2).sum(axis=1)
    return replace(
        at_end,
        dt=report.dt,
        newton_iterations=report.result.iterations,
        unstable=report.switches,
        minimum_gap=report.minimum_gap,
        kinetic_energy=0.5 * float(world.inertial_masses @ speeds) if "inertia" in acting else 0.0,
        energies={name: energy.value(state.positions) for name, energy in acting.items()},
        mechanical_energy=mechanical_energy(world, report.potential, state).total,
    )


def _by_name(world: World, rows: Floats, role: str) -> dict[str, Floats]:
    """The rows (N, 3) of each cloth or body by its name, read-only."""
    things, slices = (world.cloths, world.cloth_slices) if role == "cloth" else (world.bodies, world.body_slices)
    parts = {thing.name: rows[part] for thing, part in zip(things, slices, strict=True)}  # type: ignore[attr-defined]
    for part in parts.values():
        part.flags.writeable = False
    return parts
