"""Session: a scene prepared for stepping, with pattern, linear solver, integrator and bounds on motion in a step."""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.process_memory import keep_freed_memory
from clothsim.keys.settings import CONVERGED, Solver
from clothsim.mesh.body import LaterMotion, RigidMotion
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Constraint
from clothsim.physics.energies.hessians import ByElement
from clothsim.scene.assembly.scene_world import Built, build
from clothsim.scene.scene import Scene
from clothsim.solve.linear.dependent_rows import DependentRows
from clothsim.solve.linear.linear_solvers import slowness
from clothsim.solve.linear.linear_system import System
from clothsim.solve.linear.pardiso_factor import load_library
from clothsim.solve.linear.sparsity import SparsityPattern, make_pattern
from clothsim.solve.newton.convergence import LEAST_SPEED
from clothsim.solve.newton.newton import NewtonSettings
from clothsim.solve.newton.potential import Potential
from clothsim.solve.problem import gravity_of, least_contact_time, rigid_rows
from clothsim.solve.stepping.integrators import BACKWARD_EULER
from clothsim.solve.stepping.local_error import ErrorControl
from clothsim.solve.stepping.state import first_state
from clothsim.solve.stepping.stepping import Integrator
from clothsim.solve.stepping.time_loop import steps
from clothsim.solve.timers import EffectCounters, Timers

LARGEST_TURN = 45.0
"""Largest rotation in a step [degrees]: a straight path then leaves the arc by 8 % of the radius."""

LARGEST_FLIGHT = 100.0
"""Largest displacement in a step, in sizes of the scene: every pair of triangles is then a candidate for contact."""


def rotation_speeds(built: Built) -> dict[str, float]:
    """Speed of rotation of each rigid body that contact follows, and of each group of pins [degrees/s].

    Animated bodies move on straight paths.
    """
    bodies = built.world.bodies if "body_contact" in built.energies else ()
    motions = {body.name: body.motion for body in bodies}
    motions = {name: each.motion if isinstance(each, LaterMotion) else each for name, each in motions.items()}
    rigid = {name: each.angular_velocity for name, each in motions.items() if isinstance(each, RigidMotion)}
    pinned = {
        name: speed
        for constraint in built.constraints.values()
        for name, speed in constraint.angular_velocities().items()
    }
    return {name: float(np.degrees(np.linalg.norm(speed))) for name, speed in {**rigid, **pinned}.items()}


def check_rotation_per_step(built: Built, dt: float) -> None:
    """InputError for a body or a group of pins that turns so far in a step that its straight path is far from its arc.

    At a full turn a step it would not move at all.
    """
    for name, speed in rotation_speeds(built).items():
        turn = speed * dt
        if not turn <= LARGEST_TURN:
            raise InputError(
                f"{name} turns {turn:.4g} degrees in a step, and contact follows it on straight paths.",
                f"Use solver.dt below {dt * LARGEST_TURN / turn:.2g} s.",
            )


def check_displacement_per_step(world: World, constraints: Collection[Constraint], dt: float, contact: bool) -> None:
    """InputError for what moves by many sizes of the scene in a step of `dt` [s].

    Pins drag the cloth along a straight path. With contact, bodies and cloth sweep over everything on theirs.
    """
    start = world.start()
    size = float(np.linalg.norm(np.ptp(start, axis=0)))
    with np.errstate(over="ignore", invalid="ignore"):
        moved = [_farthest(start, constraint, dt) for constraint in constraints]
        if contact:
            bodies = zip(world.bodies, world.body_slices, strict=True)
            moved += [(body.name, _longest(body.at(dt) - start[rows])) for body, rows in bodies]
            moved += [(cloth.name, dt * _longest(np.atleast_2d(cloth.velocity))) for cloth in world.cloths]
    for name, distance in moved:
        if not distance <= LARGEST_FLIGHT * size:
            sizes, pairs = distance / size, len(world.triangles) * (len(world.triangles) + len(world.body_triangles))
            raise InputError(
                f"{name} moves {distance:.2g} m in a step of {dt:g} s, {sizes:.2g} times the size of the scene"
                + (f": all {pairs:,} pairs of triangles are candidates for contact." if contact else "."),
                f"Use solver.dt below {dt * LARGEST_FLIGHT * size / distance:.2g} s, or a smaller velocity; "
                "--force lifts this bound.",
            )


def _farthest(start: Floats, constraint: Constraint, dt: float) -> tuple[str, float]:
    """Name of the group with the largest prescribed displacement in `dt` [s], and that [m]."""
    target = constraint.at(dt)
    distances = np.linalg.norm(target.positions - start[target.vertices], axis=1)
    farthest = int(np.argmax(distances))
    return constraint.holder(int(target.vertices[farthest])), float(distances[farthest])


def _longest(vectors: Floats) -> float:
    return float(np.linalg.norm(vectors, axis=1).max())


SHORTEST_STEP = 1e-12
"""Shortest dt that a scene may have [s]: masses over dt squared are far from overflow, and cloth moves by less than an
atom in it."""

FINER = 0.1
"""Newton's tolerance as a fraction of the requested error over the duration."""
LEAST_FALL = 0.01
"""Speed below which a Newton step ends a solve whatever the time error, over newton_error_fraction and the speed
(g cell)^1/2 that a fall by half a cell gives: .001 m/s at cells of 11 mm and the default fraction."""

PRICE = "repeatable: the same bits at every number of threads; a factorisation takes 1.05 to 1.2 of its time."


@dataclass(frozen=True)
class Session:
    """Scene prepared for stepping; notes: warnings of its start, defaults used, and remarks on the meshes."""

    scene: Scene
    built: Built
    integrator: Integrator
    notes: tuple[str, ...]


def prepare(scene: Scene, built: Built) -> Session:
    """Prepare a built scene for stepping. InputError for settings that conflict."""
    settings = scene.solver_settings
    reproducible = _make_reproducible() if settings.repeatable else ""
    keep_freed_memory()
    timers = Timers(effects={name: EffectCounters() for name in built.energies})
    system = _system(_pattern(built), settings, rigid_rows(built.world))
    newton, finer = _newton_settings(scene, built)
    integrator = _integrator(scene, built, Potential(built.energies, timers, built.world.n_unknowns), system, newton)
    solver = system.solver  # one that is not installed is reported here, not in the first step
    slow = slowness(solver) if settings.linear == "auto" else ""
    dt = integrator.dt
    cut = not settings.error and 1 / scene.run_settings.frames_per_second < settings.dt
    shorter = f"Steps are {dt:g} s, not {settings.dt:g} s: each frame ends a step." if cut else ""
    ignored = "integrator" in scene.solver and integrator.formula != settings.integrator
    without = f"{settings.integrator} does nothing without effects.inertia." if ignored else ""
    remarks = [shorter, without, slow, finer, reproducible, _endless(scene, built)]
    notes = (*built.warnings, *built.notes, *filter(None, remarks))
    return Session(scene, built, integrator, notes)


def rebuilt(session: Session, scene: Scene, built: Built) -> Session:
    """Prepare `scene` from its `built` world; where the pattern is unchanged the linear solver is taken over.

    The solver and run settings of both scenes are the same.
    """
    before, settings = session.integrator, scene.solver_settings
    timers = before.potential.timers
    for name in built.energies:
        timers.effects.setdefault(name, EffectCounters())
    system = before.system
    if not _same_couplings(session.built, built):
        pattern = _pattern(built)
        if not pattern.same_as(system.base):
            system = _system(pattern, settings, rigid_rows(built.world))
    integrator = _integrator(
        scene, built, Potential(built.energies, timers, built.world.n_unknowns), system, before.settings
    )
    return Session(scene, built, integrator, session.notes)


def _system(pattern: SparsityPattern, settings: Solver, dependent: DependentRows) -> System:
    """The Newton matrix and its solver, by the scene's settings."""
    return System(pattern, settings.linear, settings.threads, dependent=dependent, repeatable=settings.repeatable)


def _pattern(built: Built) -> SparsityPattern:
    """The blocks that the mesh and the energies couple at the start."""
    start = built.world.start()
    hessians = [energy.hessian(start) for energy in built.energies.values()]
    return make_pattern(built.world.n_unknowns, built.world.triangles, hessians)


def _same_couplings(before: Built, built: Built) -> bool:
    """True where every rebuilt energy couples the same rows of x in its Hessian."""
    if before.energies.keys() != built.energies.keys():
        return False
    start = built.world.start()
    for name, energy in built.energies.items():
        if energy is not before.energies[name]:
            new, old = (each.hessian(start) for each in (energy, before.energies[name]))
            if not (isinstance(new, ByElement) and isinstance(old, ByElement)):
                return False
            if not np.array_equal(new.elements, old.elements):
                return False
    return True


def _integrator(scene: Scene, built: Built, potential: Potential, system: System, newton: NewtonSettings) -> Integrator:
    settings, run = scene.solver_settings, scene.run_settings
    dynamic = "inertia" in built.energies
    dt = min(settings.longest_step, run.duration, 1 / run.frames_per_second)
    if settings.error:
        dt = min([dt, *(0.999 * LARGEST_TURN / turn for turn in rotation_speeds(built).values() if turn)])
    if dt < SHORTEST_STEP:
        raise InputError(
            f"Steps of {dt:.2g} s, the least of solver.dt, run.duration and a frame, are below {SHORTEST_STEP:g} s.",
            "Set a longer one.",
        )
    check_rotation_per_step(built, dt)
    if settings.error:
        _refuse_error(built)
    least = least_contact_time(built.world, built.energies)
    control = ErrorControl(settings.error, run.duration, dt, least) if settings.error else None
    formula = settings.integrator if dynamic else BACKWARD_EULER
    ramp = 0.0 if dynamic else run.duration
    integrator = Integrator(built.world, potential, built.constraints, system, newton, dt, ramp, formula=formula)
    leaves = settings.unstable_equilibrium == "leave"
    return replace(
        integrator,
        control=control,
        rest_speed=run.rest_speed,
        leaves_unstable=leaves,
        perturbation_seed=settings.perturbation_seed,
        flypapers=_flypapers(scene, built),
        contact_time=least,
    )


def _flypapers(scene: Scene, built: Built) -> bool:
    """True where the scene asks that cloth in a pinch is flypapered. InputError where contact cannot do it."""
    if scene.contact_settings.pinch == "stop":
        return False
    if "body_contact" not in built.energies:
        raise InputError('contact.pinch = "carry" needs effects.body_contact.', "Add it, or leave the key out.")
    return True


def _endless(scene: Scene, built: Built) -> str:
    """A note on what never stops in a run until rest; empty where there is nothing."""
    if scene.run_settings.until == "time":
        return ""
    motions = {body.name: body.motion for body in built.world.bodies}
    moving = [name for name, motion in motions.items() if isinstance(motion, RigidMotion) and not motion.still]
    moving += ["a pin"] if any(not constraint.still for constraint in built.constraints.values()) else []
    return f"{' and '.join(moving)} never stops, so the run goes to its limit." if moving else ""


def _refuse_error(built: Built) -> None:
    """InputError where no error of time can be asked for."""
    if "inertia" not in built.energies:
        why = "solver.error needs effects.inertia: a quasi-static run has no error of time."
    elif "seams" in built.energies:
        why = "solver.error cannot be used with effects.seams: its steps would resolve the vibration of the stitches."
    else:
        return
    raise InputError(why, "Give solver.dt.")


def _newton_settings(scene: Scene, built: Built) -> tuple[NewtonSettings, str]:
    """Settings of Newton's method and a note on them: finer than the default where a requested error needs it.

    The residual of Newton's method in the velocities would be taken for an error of the integrator.
    """
    settings = scene.solver_settings
    if not settings.balanced:
        return NewtonSettings(settings.tolerance, settings.max_iterations), ""
    fraction, note = settings.stop_fraction, ""
    dynamic = "inertia" in built.energies
    converge = settings.converge or bool(settings.error) or not dynamic
    if converge:
        fraction = fraction if dynamic or settings.newton_error_fraction else CONVERGED
        least = LEAST_SPEED * fraction
    else:
        least = LEAST_FALL * fraction * float(np.sqrt(gravity_of(built.energies) * built.world.cell))
    finer = FINER * settings.error / scene.run_settings.duration
    if settings.error and finer < least:
        least, note = finer, f"tolerance = {finer:.2g} m/s, for the error asked for."
    return NewtonSettings(least, settings.max_iterations, error_fraction=fraction, converge=converge), note


def _make_reproducible() -> str:
    """Fix the order of PARDISO's sums, whatever the number of threads; a note on the price.

    The other solvers have one thread. InputError where the process has used PARDISO otherwise.
    """
    try:
        library = load_library()
    except (ImportError, OSError):
        return ""
    if not library.make_reproducible():
        raise InputError(
            "solver.repeatable = true comes too late: this process has used PARDISO without it.",
            "Run the scene in a process of its own, or set the variable MKL_CBWR=AUTO.",
        )
    return PRICE if library.threaded else ""


def last_positions(scene: Scene) -> tuple[World, Floats, str, bool]:
    """Step a scene to its end without writing or checking anything.

    Returns
    -------
    world : World
    positions : (n, 3) float64
        Cloth vertices after the last step that was taken [m].
    reason : str
        Why it came to no end; empty where it did.
    touched : bool
        True where contact acted at the end of a step.
    """
    session = prepare(scene, build(scene))
    world, run = session.built.world, scene.run_settings
    state, reason, touched = first_state(world, session.integrator.dt), "", False
    for report in steps(session.integrator, state, run.duration, run.frames_per_second, run.until, run.budget):
        if report.failure is not None:
            reason = report.failure.reason
            break
        state, touched = report.state, touched or report.minimum_gap < np.inf
    return world, state.positions[: world.n_cloth] + world.origin, reason, touched
