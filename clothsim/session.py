"""A scene made ready to step: pattern, solver and integrator."""

import os
import sys
from dataclasses import dataclass

import numpy as np

from clothsim.errors import InputError
from clothsim.mesh.motion import RigidMotion
from clothsim.mesh.world import World
from clothsim.scene.build import Built
from clothsim.scene.scene import Scene
from clothsim.sim.formula import BACKWARD_EULER
from clothsim.sim.stepping import Integrator
from clothsim.solve.ledger import Account, Ledger
from clothsim.solve.linear import slowness
from clothsim.solve.memory import keep_freed_memory
from clothsim.solve.newton import NewtonSettings
from clothsim.solve.pattern import make_pattern
from clothsim.solve.potential import Potential
from clothsim.solve.system import System

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
    settings, run = scene.solver_settings(), scene.run_settings()
    _set_threads(settings.threads)
    keep_freed_memory()
    ledger = Ledger(effects={name: Account() for name in built.energies})
    potential = Potential(built.energies, ledger)
    start = built.world.start()
    hessians = [energy.hessian(start) for energy in built.energies.values()]
    pattern = make_pattern(built.world.n_cloth, built.world.triangles, hessians)
    system = System(pattern, settings.linear, settings.threads)
    newton = NewtonSettings(settings.tolerance, settings.max_iterations)
    ramp = 0.0 if "inertia" in built.energies else run.duration
    frame = 1 / run.frames_per_second
    dt = min(settings.dt, run.duration, frame)
    if "body_contact" in built.energies:
        _refuse_leaps(built.world, dt)
    formula = settings.integrator if "inertia" in built.energies else BACKWARD_EULER
    integrator = Integrator(built.world, potential, built.constraints, system, newton, dt, ramp, formula=formula)
    shorter = f"Steps are {dt:g} s, not {settings.dt:g} s: each frame ends a step." if frame < settings.dt else ""
    slow = slowness(system.solver) if settings.linear == "auto" else ""
    unheard = "" if formula == settings.integrator else f"{settings.integrator} does nothing without effects.inertia."
    notes = (*built.notes, *filter(None, [shorter, slow, unheard]))
    return Session(scene, built, integrator, notes)


def _refuse_leaps(world: World, dt: float) -> None:
    """InputError for a body that turns so far in a step that its vertices' straight ways are no arcs any more."""
    for body in world.bodies:
        if not isinstance(body.motion, RigidMotion):
            continue  # frames are straight between their times already
        turn = float(np.degrees(np.linalg.norm(body.motion.angular_velocity)) * dt)
        if turn > LARGEST_TURN:
            raise InputError(
                f"{body.name} turns {turn:.4g} degrees in a step, and contact follows it on straight ways.",
                f"Take solver.dt below {dt * LARGEST_TURN / turn:.2g} s.",
            )


def _set_threads(threads: int) -> None:
    """Threads of ipctk, where a scene has loaded it; the linear solver is told when it is made."""
    if "ipctk" in sys.modules:
        sys.modules["ipctk"].set_num_threads(threads or os.cpu_count() or 1)
