"""Time loop: the steps of a run from frame to frame, their rest, and the unstable equilibria that they leave."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.geometry.kinematics.deformation_gradient import deformation_gradients
from clothsim.geometry.kinematics.stretch import principal_stretches
from clothsim.physics.energies.base import Energy, Step
from clothsim.physics.energies.protocols import ChangingMaterial
from clothsim.solve.newton.convergence import CONVERGED_PART
from clothsim.solve.newton.stability import Mode, StaticModel, descent_from_saddle, lowest_mode
from clothsim.solve.stepping.failure import budget_failure
from clothsim.solve.stepping.integrators import prescribed
from clothsim.solve.stepping.state import Previous, Rest, State, Switch
from clothsim.solve.stepping.stepping import Integrator, StepReport, advance


def steps(
    integrator: Integrator,
    state: State,
    duration: float,
    frames_per_second: float,
    until: str = "time",
    budget: float | None = None,
) -> Iterator[StepReport]:
    """Generate the steps from `state` to `duration` [s]; each frame falls on the end of a step.

    Parameters
    ----------
    integrator : Integrator
        Takes the steps.
    state : State
        Start.
    duration : float
        End [s].
    frames_per_second : float
        Frame rate [1/s].
    until : {"time", "rest"}
        "rest": the first frame at rest is the last one, if it comes before the end.
    budget : float, optional
        CPU time of all steps [s].

    Yields
    ------
    StepReport
        The last one may be of a step that failed; where the budget is spent, it is a second one of the last step.
    """
    ends = np.inf if budget is None else process_time() + budget
    while not finished(state, duration, frames_per_second, until):
        report = next_step(integrator, state, duration, frames_per_second)
        yield report
        if not report.converged:
            return
        state = report.state
        if budget is not None and process_time() > ends and not finished(state, duration, frames_per_second, until):
            yield replace(report, failure=budget_failure(state, duration, report.dt))
            return


def next_step(integrator: Integrator, state: State, duration: float, frames_per_second: float) -> StepReport:
    """One step from `state` towards the next frame; after `duration` [s] frames follow at the same rate."""
    until = (state.frame + 1) / frames_per_second
    if state.frame < frame_count(duration, frames_per_second):
        until = min(until, duration)
    if integrator.flypapers:
        from clothsim.solve.pinch.pinch import advance_flypapering  # no other run imports it

        report, integrator = advance_flypapering(integrator, state, until)
    else:
        report = advance(integrator, state, until)
    if report.converged and report.state.time == until:
        report = replace(report, frame_done=True, state=replace(report.state, frame=state.frame + 1))
    return with_rest_state(integrator, state, report, duration)


def finished(state: State, duration: float, frames_per_second: float, until: str = "time") -> bool:
    """True where `state` is the end of a run; parameters as of `steps`."""
    return state.frame >= frame_count(duration, frames_per_second) or (until == "rest" and state.at_rest)


def frame_count(duration: float, frames_per_second: float) -> int:
    """Number of frames after the start in a run of `duration` [s]."""
    return max(1, int(np.ceil(duration * frames_per_second - 1e-9)))


# State of rest: slow for several steps, near an equilibrium, and with nothing left that will change.
#
# Speeds alone mislead: where a cloth turns back all of them vanish together, and one that creeps is slow for long. The
# distance from equilibrium tells both from rest; it takes a factorisation, so it is looked at only where the cloth is
# slow. A slow cloth is looked at where a frame ends, on which a run may end.


SLOW_STEPS = 10
"""Consecutive steps without a vertex faster than `Integrator.rest_speed` before the distance is looked at."""
REST_TIME = 1.0
"""The distance from equilibrium at rest is at most `Integrator.rest_speed` times this [s]."""
LATER_TIMES = 32
"""Later times at which loads and prescribed positions are compared with those of now."""
GOLDEN = 0.5 * (5**0.5 - 1)
"""Spacing of the later times as a fraction of their range, modulo 1: no period of a rotation or a gust fits it."""
ROUNDING = 1e-9
"""Relative change of a load or a position below which it is none."""


def with_rest_state(integrator: Integrator, before: State, report: StepReport, until: float) -> StepReport:
    """Return the report of a step with the `rest` of its state, which is displaced where it was found unstable.

    Parameters
    ----------
    integrator : Integrator
        Took the step.
    before : State
        Start of the step.
    report : StepReport
        The step.
    until : float
        End of the loads that matter [s].
    """
    if not report.converged:
        return report
    static = "inertia" not in integrator.potential.energies
    with integrator.potential.timers.phase("stability"):
        report = stabilised(integrator, before, report) if static else out_of_plane(integrator, report)
    slow = report.state.slow_steps + 1 if report.fastest < integrator.rest_speed else 0
    rest = report.state.rest if slow else Rest.MOVING
    kept = static and bool(report.switches) and not report.switches[-1].left
    if kept:
        rest = Rest.UNSTABLE
    elif report.frame_done and rest is not Rest.REACHED and (static or slow >= SLOW_STEPS):
        with integrator.potential.timers.phase("stability"):
            report, rest = _looked_at(integrator, report, until, static)
        slow = slow if rest is Rest.REACHED else 0
    return replace(report, state=replace(report.state, slow_steps=slow, rest=rest))


def _looked_at(integrator: Integrator, report: StepReport, until: float, static: bool) -> tuple[StepReport, Rest]:
    """The report of a step whose end is slow, displaced where that is unstable, and its state of rest."""
    changes = _changes(integrator, report, until)
    if static and changes:
        return report, Rest.CHANGING
    model = static_model(integrator, report)
    distance = float(np.linalg.norm(model.displacement(), axis=1).max(initial=0.0))
    near = distance < REST_TIME * integrator.rest_speed
    side = unstable_side(integrator, model) if near else None
    if side is not None and not static:
        report = displaced(report, side)
    if side is not None:  # left or kept: no rest either way
        return report, Rest.UNSTABLE
    if changes:
        return report, Rest.CHANGING
    return report, Rest.REACHED if near else Rest.DISTANT


def _changes(integrator: Integrator, report: StepReport, until: float) -> bool:
    """True where a load, a prescribed position or a material changes between the state and `until` [s]."""
    state, held = report.state, integrator.constraints.values()
    if integrator.load(state.time) < 1.0:
        return True
    span = max(until - state.time, REST_TIME)
    later = [span, *(span * (k * GOLDEN % 1.0) for k in range(1, LATER_TIMES))]
    still = all([*(body.motion.still for body in integrator.world.bodies), *(one.still for one in held)])
    if not still:
        now = prescribed(integrator.world, held, state.time).positions
        if any(_differ(prescribed(integrator.world, held, state.time + t).positions, now) for t in later):
            return True
    # those bound to a step may depend on time, but for those bound last (contact)
    energies = report.potential.energies.values()
    timed = [e for e in energies if type(e).begin is not Energy.begin and not e.depends_on_other_energies]
    if any(_varies(integrator, state, energy, later) for energy in timed):
        return True
    in_run = [t for t in later if t <= until - state.time]  # a material over time may be none after the run
    materials = [one for one in integrator.potential.energies.values() if isinstance(one, ChangingMaterial)]
    return any(_varies(integrator, state, energy, in_run) for energy in materials)


def _varies(integrator: Integrator, state: State, energy: Energy, later: list[float]) -> bool:
    """True where the force of an energy on the cloth without velocities varies over time."""

    def force(t: float) -> Floats:
        return energy.begin(step_from_rest(integrator, state, t)).gradient(state.positions)

    now = force(0.0)
    return any(_differ(force(t), now) for t in later)


def _differ(a: Floats, b: Floats) -> bool:
    return bool(np.abs(a - b).max(initial=0.0) > ROUNDING * np.abs(b).max(initial=0.0))


# Branch switching at unstable equilibria: a displacement along the lowest mode of the exact static Hessian.
#
# A state that no force leaves may be a saddle of the energy: a flat strip that is compressed has no force out of its
# plane. It is left along its lowest mode (Wriggers & Simo 1990, Int. J. Numer. Methods Eng. 30), downhill, or where
# both sides are equal to the one that the seed chooses. Looked for
#
# * after each quasi-static step, which is then repeated from the displaced positions;
# * where a cloth is slow;
# * where a cloth moves, but exactly in a plane, and is compressed there: nothing out of the plane is left to grow.
#
# Any other moving cloth leaves such states by itself. Where a force has no potential (a pressure on a free border) the
# Hessian does not tell what is stable, and none is left.


STEPS_BETWEEN_LOOKS = 20
"""Steps from one look at a cloth in a plane to the next; the first is after the first step."""
MOST_SWITCHES = 4
"""Switches in one quasi-static step: each ends in a state of lower energy, of which there may be many."""
STATIC_AMPLITUDE = 1e-3
"""First displacement of a quasi-static switch over the size of the cloth; extended as long as the energy falls."""
LONGEST_EXTENSION = 256.0
LARGEST_AMPLITUDE = 0.01
"""Bound on the displacement of a slow cloth over its size."""
FLAT = 1e-9
"""Distance from a plane over the size, below which a cloth is in it: some ulps, after rotations of the scene too."""
COMPRESSED = 1 - 1e-9
"""Principal stretch below which a triangle is compressed."""


@dataclass(frozen=True)
class ModeDisplacement:
    """A displacement dx (N, 3) [m] along a mode; 0 where the state is left unchanged."""

    mode: Mode
    dx: Floats

    def record(self) -> Switch:
        """Return the entry of the report."""
        vertex = int(np.linalg.norm(self.mode.shape, axis=1).argmax())
        return Switch(self.mode.growth_rate, vertex, (*map(float, self.dx[vertex]),))


def static_model(integrator: Integrator, report: StepReport, only: np.ndarray | None = None) -> StaticModel:
    """Return the static model at the end of a step; only (n_cloth,) bool: all other vertices are fixed.

    Rigid bodies are held where they are: one that may roll has no stiffness, and is not an instability of the cloth.
    """
    world, state = integrator.world, report.state
    fixed = np.ones(world.n_unknowns, bool)
    fixed[: world.n_cloth] = False if only is None else ~only
    rows = prescribed(world, integrator.constraints.values(), state.time).vertices
    fixed[rows[rows < world.n_cloth]] = True
    rest = step_from_rest(integrator, state, 0.0)
    return StaticModel(report.potential, integrator.system, world.inertial_masses, fixed, rest)


def step_from_rest(integrator: Integrator, state: State, later: float) -> Step:
    """Return a step from the positions of `state` without velocities, with the loads of `later` [s] from then."""
    end, h = state.time + later, state.dt
    zero = np.zeros_like(state.positions)
    return Step(end - h, h, state.positions, zero, integrator.load(end), zero, memory=state.memory)


def stabilised(integrator: Integrator, before: State, report: StepReport) -> StepReport:
    """Return the report of a quasi-static step, repeated along unstable modes until its end is stable.

    A repetition that fails is not taken: the equilibrium is then kept, and recorded as such. So is one that is still
    unstable after MOST_SWITCHES of them.
    """
    for count in range(MOST_SWITCHES + 1):
        model = static_model(integrator, report)
        size = _extent(report.state.positions[: integrator.world.n_cloth])
        side = unstable_side(integrator, model, STATIC_AMPLITUDE * size, LONGEST_EXTENSION)
        if side is None:
            break
        leaves = side.dx.any() and count < MOST_SWITCHES
        again = _repeated(integrator, before, report, side.dx) if leaves else None
        if again is None:
            kept = replace(side, dx=np.zeros_like(side.dx))
            return replace(report, switches=(*report.switches, kept.record()))
        done = report.result.iterations + again.result.iterations
        report = replace(
            again,
            state=replace(again.state, frame=report.state.frame),
            result=replace(again.result, iterations=done),
            frame_done=report.frame_done,
            switches=(*report.switches, side.record()),
        )
    return report


def _repeated(integrator: Integrator, before: State, report: StepReport, dx: Floats) -> StepReport | None:
    """The report of a step repeated from its end displaced by dx; None where it fails: a shorter one is of no use.

    Beside a saddle steps are short, and one below a tolerance in m/s is no sign of a minimum: with a tolerance a solve
    by the motion since the displacement goes before (`StaticStop`).
    """
    own, start, iterations = integrator.settings, report.state.positions + dx, 0
    by_motion = replace(own, error_fraction=CONVERGED_PART)
    for settings in (own,) if own.error_fraction else (by_motion, own):
        solver = replace(integrator, settings=settings)
        again = advance(solver, replace(before, positions=start), report.state.time, retries=False)
        if not again.converged or again.state.time != report.state.time:
            return None
        start, iterations = again.state.positions, iterations + again.result.iterations
    return replace(again, result=replace(again.result, iterations=iterations))


def out_of_plane(integrator: Integrator, report: StepReport) -> StepReport:
    """Return the report of a step, displaced out of the plane where a cloth in a plane is unstable.

    The displacement is what the slowest speed that counts would do in the step: invisible, and enough to grow.
    """
    if report.state.at_rest or report.state.step % STEPS_BETWEEN_LOOKS != 1:
        return report
    world, x = integrator.world, report.state.positions
    normals = np.zeros((world.n_unknowns, 3))  # at the vertices of each cloth that lies in a plane and is compressed
    for rows in world.cloth_slices:
        normal = _normal(x[rows])
        if normal is not None:
            own = np.flatnonzero((world.triangles[:, 0] >= rows.start) & (world.triangles[:, 0] < rows.stop))
            F = deformation_gradients(x[: world.n_cloth], world.triangles[own], world.rest_shape_inverses[own])
            if principal_stretches(F)[:, 1].min(initial=np.inf) < COMPRESSED:
                normals[rows] = normal
    flat = np.asarray(normals.any(axis=1))
    if not flat.any():
        return report
    model = static_model(integrator, report, flat[: world.n_cloth])
    side = unstable_side(integrator, model, integrator.rest_speed * report.dt, along=normals)
    return report if side is None else displaced(report, side)


def unstable_side(
    integrator: Integrator,
    model: StaticModel,
    amplitude: float | None = None,
    longest: float = 1.0,
    along: Floats | None = None,
) -> ModeDisplacement | None:
    """Return the displacement that leaves an unstable state; None where it is stable, or has no way down.

    Parameters
    ----------
    integrator : Integrator
        Its seed chooses the side, and `leaves_unstable` whether the state is left.
    model : StaticModel
        The state.
    amplitude, longest, along
        As of `descent_from_saddle` and `lowest_mode`; without an amplitude one that grows as fast as `rest_speed`.
    """
    if not model.is_conservative or model.is_stable:
        return None
    mode = lowest_mode(model, integrator.perturbation_seed, along)
    if mode is None:
        return None
    if amplitude is None:
        most = LARGEST_AMPLITUDE * _extent(model.rest.positions[: len(model.masses)])
        amplitude = min(most, integrator.rest_speed / mode.growth_rate)
    dx = descent_from_saddle(model, mode, amplitude, longest)
    if dx is None:
        return None
    return ModeDisplacement(mode, dx if integrator.leaves_unstable else np.zeros_like(dx))


def displaced(report: StepReport, side: ModeDisplacement) -> StepReport:
    """Return the report with its state displaced; the state before it too, so that no velocity is added."""
    state = report.state
    before = state.previous
    if before is not None:
        before = Previous(before.positions + side.dx, before.velocities, before.dt)
    moved = replace(state, positions=state.positions + side.dx, previous=before)
    return replace(report, state=moved, switches=(*report.switches, side.record()))


def _normal(points: Floats) -> Floats | None:
    """Unit normal of the plane that the points (n, 3) lie in; None where they do not, or lie on a line."""
    arms = points - points[0]
    lengths = np.linalg.norm(arms, axis=1)
    first = arms[lengths.argmax()]
    across = np.cross(first, arms)
    heights = np.linalg.norm(across, axis=1)
    if not heights.max() > FLAT * lengths.max() ** 2:
        return None
    normal = across[heights.argmax()] / heights.max()
    return normal if np.abs(arms @ normal).max() <= FLAT * lengths.max() else None


def _extent(points: Floats) -> float:
    return float(np.ptp(points, axis=0).max())
