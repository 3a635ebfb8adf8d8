"""A scene made ready to step: pattern, solver and integrator."""

import os
import sys
from dataclasses import dataclass, replace

import numpy as np

from clothsim.build.scene_world import Built
from clothsim.errors import InputError
from clothsim.mesh.motion import RigidMotion
from clothsim.mesh.world import World
from clothsim.scene.scene import Scene
from clothsim.sim.integrators import BACKWARD_EULER
from clothsim.sim.step_size import ErrorControl
from clothsim.sim.stepping import Integrator
from clothsim.solve.linear_solvers import slowness
from clothsim.solve.linear_system import System
from clothsim.solve.newton import NewtonSettings
from clothsim.solve.potential import Potential
from clothsim.solve.process_memory import keep_freed_memory
from clothsim.solve.sparsity import make_pattern
from clothsim.solve.timers import EffectCounters, Timers

FINER = 0.1
"""Newton's tolerance as share of the error asked for over the duration."""

LARGEST_TURN = 45.0
"""How far a body may turn in a step [degrees]: the straight way of a vertex then is 8 % of the radius off its arc."""


@dataclass(frozen=True)
class Session:
    """A scene made ready to step; notes: what was chosen for the user and what the meshes had."""

    scene: Scene
    built: Built
    integrator: Integrator
    notes: tuple[str, ...]


def prepare(scene: Scene, built: Built) -> Session:
    """Pattern, solver and integrator of a built scene."""
    settings, run = scene.solver_settings, scene.run_settings
    _set_threads(settings.threads)
    keep_freed_memory()
    timers = Timers(effects={name: EffectCounters() for name in built.energies})
    potential = Potential(built.energies, timers)
    start = built.world.start()
    hessians = [energy.hessian(start) for energy in built.energies.values()]
    pattern = make_pattern(built.world.n_cloth, built.world.triangles, hessians)
    system = System(pattern, settings.linear, settings.threads)
    tolerance, finer = _tolerance(scene)
    newton = NewtonSettings(tolerance, settings.max_iterations)
    ramp = 0.0 if "inertia" in built.energies else run.duration
    frame = 1 / run.frames_per_second
    dt = min(settings.longest_step, run.duration, frame)
    if "body_contact" in built.energies:
        if settings.error:
            dt = min([dt, *(0.999 * LARGEST_TURN / turn for turn in _turns(built.world).values() if turn)])
        _refuse_leaps(built.world, dt)
    if settings.error:
        _refuse_error(built)
    control = ErrorControl(settings.error, run.duration, dt) if settings.error else None
    formula = settings.integrator if "inertia" in built.energies else BACKWARD_EULER
    integrator = Integrator(built.world, potential, built.constraints, system, newton, dt, ramp, formula=formula)
    integrator = replace(integrator, control=control)
    cut = not settings.error and frame < settings.dt
    shorter = f"Steps are {dt:g} s, not {settings.dt:g} s: each frame ends a step." if cut else ""
    solver = system.solver  # one that is not installed is told here, not in the first step
    slow = slowness(solver) if settings.linear == "auto" else ""
    unheard = "" if formula == settings.integrator else f"{settings.integrator} does nothing without effects.inertia."
    notes = (*built.notes, *filter(None, [shorter, slow, unheard, finer]))
    return Session(scene, built, integrator, notes)


def _refuse_error(built: Built) -> None:
    """InputError where no error of time can be asked for."""
    if "inertia" not in built.energies:
        why = "solver.error needs effects.inertia: a quasi-static run has no error of time."
    elif "seams" in built.energies:
        why = "solver.error does not go with effects.seams: its steps would follow the ringing of the stitches."
    else:
        return
    raise InputError(why, "Give solver.dt.")


def _refuse_leaps(world: World, dt: float) -> None:
    """InputError for a body that turns so far in a step that its vertices' straight ways are no arcs any more."""
    for name, speed in _turns(world).items():
        turn = speed * dt
        if turn > LARGEST_TURN:
            raise InputError(
                f"{name} turns {turn:.4g} degrees in a step, and contact follows it on straight ways.",
                f"Take solver.dt below {dt * LARGEST_TURN / turn:.2g} s.",
            )


def _turns(world: World) -> dict[str, float]:
    """How fast each rigid body turns [degrees/s]; animated ones are straight between their frames already."""
    rigid = ((body.name, body.motion) for body in world.bodies if isinstance(body.motion, RigidMotion))
    return {name: float(np.degrees(np.linalg.norm(motion.angular_velocity))) for name, motion in rigid}


def _tolerance(scene: Scene) -> tuple[float, str]:
    """Newton's tolerance [m/s], and what to say of it: finer than the default where an error that asks for it is given.

    What Newton leaves in the velocities is no error of the formula, but looks like one.
    """
    settings = scene.solver_settings
    finer = FINER * settings.error / scene.run_settings.duration
    if not settings.error or "tolerance" in scene.solver or finer >= settings.tolerance:
        return settings.tolerance, ""
    return finer, f"tolerance = {finer:.2g} m/s, for the error asked for."


def _set_threads(threads: int) -> None:
    """Threads of ipctk, where a scene has loaded it; the linear solver is told when it is made."""
    ipctk = sys.modules.get("ipctk")
    if ipctk is not None:
        ipctk.set_num_threads(threads or os.cpu_count() or 1)
