"""Newton and integrator on a world with given energies: an equilibrium, a step, a run."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy import sparse

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import ClothsimError
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Constraint, Energy, Off, Prescribed, Step
from clothsim.physics.energies.hessians import ByElement, SumHessian
from clothsim.solve.linear.linear_system import System
from clothsim.solve.linear.sparsity import SparsityPattern, make_pattern
from clothsim.solve.newton.newton import Newton, NewtonResult, NewtonSettings
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.state import first_state
from clothsim.solve.stepping.stepping import Integrator, StepReport
from clothsim.solve.stepping.time_loop import steps
from clothsim.solve.timers import Timers
from tests.support.effect_builders import pins

NOTHING = Prescribed(np.zeros(0, np.int64), np.zeros((0, 3)))
"""No vertex held."""


def step_at(x: Floats, velocities: Floats | None = None, dt: float = 1.0, load: float = 1.0) -> Step:
    """A step from the positions x, at rest unless velocities are given."""
    zero = np.zeros_like(x)
    return Step(0.0, dt, x, zero if velocities is None else velocities, load, zero)


def those_on(**effects: Energy | Off) -> dict[str, Energy]:
    """The effects that are on, by name."""
    return {name: effect for name, effect in effects.items() if isinstance(effect, Energy)}


def second_derivatives(energy: Energy | Off, x: Floats) -> sparse.csr_array:
    """The exact ones of an energy with an element Hessian, (3 N, 3 N)."""
    hessian = energy.hessian(x, project=False) if isinstance(energy, Energy) else None
    if not isinstance(hessian, ByElement | SumHessian):
        raise ClothsimError(f"{type(energy).__name__} has no element Hessian.")
    return hessian.to_sparse(len(x))


def held(x: Floats, vertices: Any) -> Prescribed:
    """The vertices of x held where they are."""
    rows: Ints = np.asarray(vertices, np.int64)
    return Prescribed(rows, x[rows])


def pattern_of(world: World, energies: Mapping[str, Energy], x: Floats) -> SparsityPattern:
    """The pattern of the Newton matrix of some energies."""
    return make_pattern(world.n_cloth, world.triangles, [energy.hessian(x) for energy in energies.values()])


def newton_of(
    world: World,
    energies: dict[str, Energy],
    dt: float = 1.0,
    velocities: Floats | None = None,
    positions: Floats | None = None,
    linear: str = "superlu",
    **settings: Any,
) -> Newton:
    """A Newton bound to one step from the world's start (or `positions`)."""
    x = world.start() if positions is None else positions
    system = System(pattern_of(world, energies, x), linear)
    potential = Potential(energies, Timers()).begin(step_at(x, velocities, dt))
    system.begin(potential.couplings(x, np.zeros_like(x)))
    return Newton(potential, system, NewtonSettings(**settings), dt)


def solve(
    world: World, energies: dict[str, Energy], x: Floats, target: Prescribed = NOTHING, **keywords: Any
) -> NewtonResult:
    """The result of `minimise` from x; with dt = 1 and no inertia: the equilibrium to `tolerance` metres."""
    return newton_of(world, energies, positions=x, **keywords).minimise(x, target)


def equilibrium(
    world: World,
    energies: dict[str, Energy],
    x: Floats,
    target: Prescribed = NOTHING,
    tolerance: float = 1e-12,
    **keywords: Any,
) -> Floats:
    """The positions of the equilibrium (N, 3); ClothsimError where Newton does not find it."""
    result = solve(world, energies, x, target, tolerance=tolerance, **keywords)
    if not result.outcome.converged:
        raise ClothsimError(f"No equilibrium was found: {result.outcome.sentence}")
    return result.x


def pinned(world: World, **keys: Any) -> tuple[World, Constraint]:
    """The world with vertices held, and what holds them; the keys are those of the effect `pins`."""
    found = pins(world, **keys)
    if isinstance(found, Off):
        raise ClothsimError(f"Nothing is pinned: {found.reason}.")
    return found


def integrator_of(
    world: World,
    energies: dict[str, Energy],
    dt: float,
    constraints: Mapping[str, Constraint] | None = None,
    ramp: float = 0.0,
    linear: str = "superlu",
    **settings: Any,
) -> Integrator:
    """The package's integrator for some energies of a world."""
    system = System(pattern_of(world, energies, world.start()), linear)
    potential = Potential(energies, Timers())
    return Integrator(world, potential, constraints or {}, system, NewtonSettings(**settings), dt, ramp)


def run_of(integrator: Integrator, duration: float, frames_per_second: float | None = None) -> list[StepReport]:
    """All step reports of a run, one frame unless frames_per_second says otherwise; ClothsimError at a failed step."""
    start = first_state(integrator.world, integrator.dt)
    reports = list(steps(integrator, start, duration, frames_per_second or 1 / duration))
    if not all(report.converged for report in reports):
        raise ClothsimError(f"A step failed: {reports[-1].failures}")
    return reports
