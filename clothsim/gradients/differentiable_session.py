"""Session whose run can be differentiated, and the record of its steps.

Contact stiffness is held, solves are polished; what has no derivative is refused by name.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.interruption import interruption
from clothsim.gradients.exact_system import MOST_STEPS, Polish
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.energies.base import Energy, Step
from clothsim.physics.energies.protocols import AdaptiveStiffness, History, Lagged
from clothsim.run.session import Session
from clothsim.solve.newton.potential import Potential
from clothsim.solve.pinch.flypaper import MEMORY, FlypaperedPositions, HeldChoices, flypapered_in, with_bodies
from clothsim.solve.pinch.pinch import pinch_gap, remembering, with_flypapered
from clothsim.solve.stepping.integrators import BACKWARD_EULER, Formula, formula_of, prescribed
from clothsim.solve.stepping.state import State, first_state
from clothsim.solve.stepping.stepping import Integrator, StepReport, advance, step_of, unrefined
from clothsim.solve.stepping.time_loop import steps
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
    carried : FlypaperedPositions or None
        Vertices that a body carried through a pinch in the step; None where there were none.
    """

    start: State
    end: State
    dt: float
    solution: Floats
    restarted: bool
    pairs: Mapping[str, Ints]
    carried: FlypaperedPositions | None = None

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

    def of_step(self, integrator: Integrator) -> Integrator:
        """Return the integrator of the run as it was in the step: with what was carried, and without its contact."""
        return integrator if self.carried is None else with_flypapered(integrator, self.carried)


def recorded(start: State, report: StepReport) -> RecordedStep:
    """Return the record of a step from `start`."""
    x, contacts = report.result.x, report.potential.energies.items()
    pairs = {name: each.candidates.active(x).keys for name, each in contacts if isinstance(each, Barrier)}
    held = report.constraints.get(MEMORY)
    carried = held if isinstance(held, FlypaperedPositions) else None
    return RecordedStep(start, report.state, report.dt, x, report.restarted, pairs, carried)


def untimed(potential: Potential) -> Potential:
    """Return a potential with timers of its own: what the backward pass does is not part of the run's account."""
    return replace(potential, timers=Timers())


def bound_to(integrator: Integrator, record: RecordedStep) -> tuple[Step, Potential]:
    """Return the step of a record and the potential bound to it; integrator: that of the step."""
    step = record.step(integrator)
    return step, untimed(integrator.potential).begin(step)


def free_rows(integrator: Integrator, record: RecordedStep) -> np.ndarray:
    """Return the mask (N,) of the rows that the step solved for; integrator: that of the step."""
    free = np.zeros(integrator.world.n_vertices, bool)
    free[: integrator.world.n_cloth] = True
    free[record.fixed_rows(integrator)] = False
    return free


def differentiable_session(session: Session, polish: int = MOST_STEPS) -> Session:
    """Return a session whose steps have a derivative.

    Parameters
    ----------
    session : Session
        Of the scene.
    polish : int
        Newton steps with the exact Hessian after each converged solve; 0: none, and the gradient is then as wrong as
        `Gradient.newton_error` says.

    Returns
    -------
    Session
        Contact has the largest stiffness that a pilot run of the same scene took, if it was adaptive; a note says so.

    Raises
    ------
    InputError
        For an effect or setting that cannot be differentiated.
    ClothsimError
        Where the pilot run fails.
    """
    refuse_undifferentiable(session)
    adaptive = [name for name, energy in session.built.energies.items() if getattr(energy, "adaptive", False)]
    stiffness = pilot_stiffness(session, adaptive) if adaptive else {}
    held = with_stiffness(session, stiffness)
    refine = Polish(held.integrator.system, polish) if polish else unrefined
    notes = tuple(
        f"{name}: stiffness held at {kappa:.4g} Pa, for the gradient. Hold it in runs that are compared with this: "
        f"effects.{name}.stiffness = {kappa:.12g}."
        for name, kappa in stiffness.items()
    )
    return replace(held, integrator=replace(held.integrator, refine=refine), notes=(*held.notes, *notes))


def refuse_undifferentiable(session: Session) -> None:
    """InputError for what cannot be differentiated, by its name in the scene."""
    energies, scene = session.built.energies, session.scene
    if isinstance(energies.get("bending"), History):
        raise InputError(
            "cloth.bending_hysteresis has no gradient: its slips remember every step before.", "Set it to 0."
        )
    friction = energies.get("friction")
    if isinstance(friction, Lagged) and friction.lag_iterations > 1:
        raise InputError("effects.friction.iterations has a gradient for 1 only.", "Set it to 1.")
    if scene.solver_settings.error:
        raise InputError(
            "solver.error chooses dt, cells and d_hat by several runs, and what is varied needs one choice.",
            "Run the scene once, and give what its summary names as chosen.",
        )
    if session.built.world.rigid:
        raise InputError("Rigid bodies have no gradient.", "Make them bodies with a motion: [[body]].")


def pilot_stiffness(session: Session, names: Sequence[str]) -> dict[str, float]:
    """Return the largest stiffness [Pa] of adaptive contacts in a run of the scene; ClothsimError where it fails.

    That of a first step in which a contact did not act counts only without others: no load of the scene chose it.
    """
    largest, unused = dict[str, float](), dict[str, float]()
    run, state = session.scene.run_settings, first_state(session.built.world, session.integrator.dt)
    for report in steps(session.integrator, state, run.duration, run.frames_per_second, run.until, run.budget):
        if report.failure is not None:
            raise ClothsimError(f"The pilot run failed: {report.failure.sentence}", report.failure.remedy)
        for name in names:
            contact = cast("Any", report.potential.energies[name])
            idle = report.state.step == 1 and not np.isfinite(contact.minimum_gap(report.state.positions))
            found = unused if idle else largest
            found[name] = max(found.get(name, 0.0), float(contact.stiffness))
    return unused | largest


def stiffness_of(energies: Mapping[str, Energy]) -> dict[str, float]:
    """Return the stiffness of each contact [Pa], by effect."""
    contacts = {name: cast("Any", each) for name, each in energies.items() if isinstance(each, AdaptiveStiffness)}
    return {name: float(each.stiffness) for name, each in contacts.items()}


def with_stiffness(session: Session, stiffness: Mapping[str, float]) -> Session:
    """Return a session whose adaptive contacts have given stiffnesses [Pa], by effect."""
    energies = held_energies(session.built.energies, stiffness)
    potential = Potential(energies, session.integrator.potential.timers)
    integrator = replace(session.integrator, potential=potential)
    return replace(session, built=replace(session.built, energies=energies), integrator=integrator)


def held_energies(energies: Mapping[str, Energy], stiffness: Mapping[str, float]) -> dict[str, Energy]:
    """Return energies with the stiffnesses of contacts [Pa] in place of adaptive ones."""
    return {
        name: replace(cast("Any", energy), adaptive=False, stiffness=stiffness[name])
        if name in stiffness and isinstance(energy, AdaptiveStiffness)
        else energy
        for name, energy in energies.items()
    }


def forward(session: Session, state: State) -> Iterator[RecordedStep]:
    """Take the steps of a session one by one from its first state, without output; ClothsimError where one fails."""
    run = session.scene.run_settings
    with interruption() as flag:
        for report in steps(session.integrator, state, run.duration, run.frames_per_second, run.until, run.budget):
            flag.check()
            if report.failure is not None:
                raise ClothsimError(report.failure.sentence, report.failure.remedy)
            yield recorded(state, report)
            state = report.state


def replayed(integrator: Integrator, state: State, like: Sequence[RecordedStep]) -> list[RecordedStep]:
    """Repeat recorded steps, with their lengths, from another state or with other energies.

    Raises
    ------
    ClothsimError
        Where a step fails, or takes another formula than the recorded one.
    """
    taken: list[RecordedStep] = []
    for record in like:
        own, held = integrator, record.carried
        if held is not None:
            body = cast("Barrier", integrator.potential.energies["body_contact"])
            ahead, end = (with_bodies(integrator.world, state.positions, at) for at in (held.ahead, record.end.time))
            known, limit = flypapered_in(state.memory), held.widening * pinch_gap(body)
            choices = HeldChoices.of(record.start, held)
            held = replace(
                held,
                world=integrator.world,
                limit=limit,
                flypapered=choices.placed(state.positions, ahead, end, known, limit),
            )
            own = with_flypapered(integrator, held)
        report = advance(own, replace(state, dt=1.01 * record.dt), record.end.time, retries=False)
        if report.failure is not None or report.restarted != record.restarted:
            raise ClothsimError(f"Step {len(taken) + 1} cannot be repeated with its length of {record.dt:g} s.")
        if held is not None:
            report = remembering(report, held, held.widening)
        taken.append(recorded(state, report))
        state = report.state
    return taken
