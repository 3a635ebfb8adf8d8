"""The package's own Newton on a world and some energies, for tests that need an equilibrium or a step."""

import numpy as np

from clothsim.energies.base import Prescribed, Step
from clothsim.sim.simulator import steps
from clothsim.sim.state import first_state
from clothsim.sim.stepping import Integrator
from clothsim.solve.ledger import Ledger
from clothsim.solve.newton import Newton, NewtonSettings
from clothsim.solve.pattern import make_pattern
from clothsim.solve.potential import Potential
from clothsim.solve.system import System

NOTHING = Prescribed(np.zeros(0, np.int64), np.zeros((0, 3)))


def step_at(x, velocities=None, dt=1.0, load=1.0):
    zero = np.zeros_like(x)
    return Step(0.0, dt, x, zero if velocities is None else velocities, load, zero)


def held(x, vertices):
    """The vertices of x held where they are."""
    return Prescribed(np.asarray(vertices, np.int64), x[vertices])


def pattern_of(world, energies, x):
    return make_pattern(world.n_cloth, world.triangles, [energy.hessian(x) for energy in energies.values()])


def newton_of(world, energies, dt=1.0, velocities=None, positions=None, linear="superlu", **settings):
    """A Newton bound to one step from the world's start (or `positions`)."""
    x = world.start() if positions is None else positions
    system = System(pattern_of(world, energies, x), linear)
    potential = Potential(energies, Ledger()).begin(step_at(x, velocities, dt))
    system.begin(potential.couplings(x))
    return Newton(potential, system, NewtonSettings(**settings), dt)


def solve(world, energies, x, target=NOTHING, **keywords):
    """The result of `minimise` from x; with dt = 1 and no inertia: the equilibrium to `tolerance` metres."""
    return newton_of(world, energies, positions=x, **keywords).minimise(x, target)


def equilibrium(world, energies, x, target=NOTHING, tolerance=1e-12, **keywords):
    """The positions of the equilibrium; it must be found."""
    result = solve(world, energies, x, target, tolerance=tolerance, **keywords)
    assert result.outcome.converged, result.outcome.sentence
    return result.x


def integrator_of(world, energies, dt, constraints=None, ramp=0.0, linear="superlu", **settings):
    """The package's integrator for some energies of a world."""
    system = System(pattern_of(world, energies, world.start()), linear)
    potential = Potential(energies, Ledger())
    return Integrator(world, potential, constraints or {}, system, NewtonSettings(**settings), dt, ramp)


def run_of(integrator, duration, frames_per_second=None):
    """All step reports of a run; every step must be taken. One frame unless frames_per_second says otherwise."""
    start = first_state(integrator.world, integrator.dt)
    reports = list(steps(integrator, start, duration, frames_per_second or 1 / duration))
    assert all(report.converged for report in reports), reports[-1].failures
    return reports
