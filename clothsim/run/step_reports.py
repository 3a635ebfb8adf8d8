"""What users see of a step: the state at its end, the progress of the run, a line of the record."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError, InputError
from clothsim.mesh.world import World
from clothsim.run.certificate import Certificate
from clothsim.run.fields import CONTACTS, FRICTION, acting_forces
from clothsim.run.session import Session
from clothsim.solve.stepping.failure import Failure
from clothsim.solve.stepping.mechanical_energy import mechanical_energy
from clothsim.solve.stepping.state import State, Switch
from clothsim.solve.stepping.stepping import StepReport

if TYPE_CHECKING:
    from clothsim.scene.assembly.scene_world import Built
    from clothsim.solve.stepping.stepping import StepReport


class SimulationError(ClothsimError):
    """A step that failed.

    Attributes
    ----------
    failure : Failure
        Cause, name and position of the element, and remedy, as in the summary of a failed run.
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
        Number of completed steps and frames.
    positions, velocities : dict of str to (n, 3) array
        Vertices of each cloth by its name [m], [m/s].
    bodies : dict of str to (n, 3) array
        Vertices of each body by its name [m].
    newton_iterations : int
        Newton iterations of the step.
    minimum_gap : float
        Smallest contact distance below d_hat [m]; inf if nothing is that close.
    kinetic_energy : float
        Kinetic energy of all cloths [J]; 0 if the scene has no inertia.
    at_rest : bool
        True if the cloth was at rest at the end of the last frame and has been slow since then.
    unstable : tuple of Switch
        Unstable equilibria in which the step ended, with the growth rate, the vertex and the displacement by which the
        step left each.
    energies : dict of str to float
        Value of each energy of the step [J]; that of "inertia", "damping", "air" and "friction" belongs to the step
        and is not a stored energy. Empty at the start.
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
        positions=_group_by_name(world, state.positions + world.origin, "cloth"),
        velocities=_group_by_name(world, state.velocities, "cloth"),
        bodies=_group_by_name(world, state.positions + world.origin, "body"),
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
        energies=dict(zip(acting, report.potential.values(state.positions), strict=False)),
        mechanical_energy=mechanical_energy(world, report.potential, state).total,
    )


def _group_by_name(world: World, rows: Floats, role: str) -> dict[str, Floats]:
    """The rows (N, 3) of each cloth or body by its name, read-only."""
    things, slices = (world.cloths, world.cloth_slices) if role == "cloth" else (world.bodies, world.body_slices)
    parts = {thing.name: rows[part] for thing, part in zip(things, slices, strict=True)}  # type: ignore[attr-defined]
    for part in parts.values():
        part.flags.writeable = False
    return parts


@dataclass(frozen=True)
class Progress:
    """Progress after a step.

    Attributes
    ----------
    time, duration : float
        Simulated time and its end [s].
    step, newton_iterations : int
        Number of the step, and its iterations.
    minimum_gap : float
        Smallest distance in contact [m], inf if nothing is closer than d_hat.
    fastest : float
        Largest speed of a cloth vertex [m/s].
    verdict : {"moving", "slow", "stalled", "unstable"}
        Slow: no vertex is faster than ten times the tolerance; stalled: dt is below an eighth; unstable: the step
        ended in an unstable equilibrium.
    seconds : float
        Wall time since the start [s].
    stage : str
        Of a command of several runs the stage and round that the run is: "close, round 2 of at most 7".
    until_rest : bool
        True if the run may end before its duration.
    """

    time: float
    duration: float
    step: int
    newton_iterations: int
    minimum_gap: float
    fastest: float
    verdict: str
    seconds: float
    stage: str = ""
    until_rest: bool = False


def progress_of(report: StepReport, session: Session, seconds: float) -> Progress:
    """The progress after a step; seconds: wall-clock time since the run began [s]."""
    run, integrator = session.scene.run_settings, session.integrator
    verdict = "moving"
    if integrator.control is None and report.dt < integrator.dt / 8:
        verdict = "stalled"
    elif report.fastest < 10 * integrator.settings.tolerance:
        verdict = "slow"
    if report.switches:
        verdict = "unstable"
    return Progress(
        report.state.time,
        run.duration,
        report.state.step,
        report.result.iterations,
        report.minimum_gap,
        report.fastest,
        verdict,
        seconds,
        until_rest=run.until == "rest",
    )


def record_entry(report: StepReport, certificate: Certificate) -> dict[str, Any]:
    """A line of the record."""
    return {
        "step": report.state.step,
        "time": report.state.time,
        "dt": report.dt,
        "newton_iterations": report.result.iterations,
        "regional_iterations": report.result.elimination_iterations,
        "speed": report.result.speed,
        "residual": report.result.residual,
        "relative_residual": report.result.relative_residual,
        "energy": certificate.energy,
        "stiffness_energy": certificate.stiffness.last,
        **({} if certificate.material is None else {"material_energy": certificate.material.last}),
        "minimum_gap": report.minimum_gap,
        "fastest": report.fastest,
        "failures": list(report.failures),
        "error": None if report.error is None else report.error.rms,
        "largest_error": None if report.error is None else report.error.largest,
        "rejected": report.rejected,
        "restarted": report.restarted,
        "unstable": [asdict(switch) for switch in report.switches],
        **({} if certificate.flypapered is None else {"carried": certificate.flypapered.now}),
    }


# Forces of a step: of contact and friction on each body, and of each group of pins on the cloth.


@dataclass(frozen=True)
class Forces:
    """Forces at the ends of the steps of a run.

    Attributes
    ----------
    times : (k,) ndarray
        [s].
    bodies : mapping of str to (k, 3) ndarray
        Force of contact and friction on each body [N].
    pins : mapping of str to (k, 3) ndarray
        Force of each group of pins ("pins", "pins.group[1]") on the cloth [N].
    """

    times: Floats
    bodies: Mapping[str, Floats]
    pins: Mapping[str, Floats]


def step_forces(built: "Built", report: "StepReport") -> dict[str, dict[str, list[float]]]:
    """Sums of the forces at the end of a step [N], by the name of the body and of the group of pins.

    The reaction of a pin is the gradient of the incremental potential there: a free vertex has none, as forces balance.
    Ghost vertices of a clamp belong to its group.
    """
    world, x, energies = built.world, report.state.positions, report.potential.energies
    contact = acting_forces(energies, (*CONTACTS, FRICTION), x)
    bodies = {
        body.name: contact[rows].sum(axis=0).tolist()
        for body, rows in zip(world.bodies, world.body_slices, strict=True)
    }
    if not built.constraints:
        return {"bodies": bodies, "pins": {}}
    gradient, pins = report.potential.gradient(x), dict[str, Floats]()
    for constraint in built.constraints.values():
        for row in constraint.at(report.state.time).vertices.tolist():
            name = constraint.holder(row)
            pins[name] = pins.get(name, np.zeros(3)) + gradient[row]
    return {"bodies": bodies, "pins": {name: force.tolist() for name, force in pins.items()}}


def forces_of(record: Sequence[Mapping[str, Any]], where: str) -> Forces:
    """The forces in the record of a run. InputError if it holds none."""
    entries = [entry for entry in record if "forces" in entry]
    if not entries:
        raise InputError(f"{where} has no forces.", "Ask for them before the run: [run] forces = true.")
    times = np.array([entry["time"] for entry in entries])

    def columns(kind: str) -> dict[str, Floats]:
        names = entries[0]["forces"][kind]
        return {name: np.array([entry["forces"][kind][name] for entry in entries]) for name in names}

    return Forces(times, columns("bodies"), columns("pins"))
