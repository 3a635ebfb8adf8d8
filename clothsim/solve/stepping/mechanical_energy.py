"""Mechanical energy of a state, and its growth in a step of a two-step formula.

Backward Euler dissipates energy. BDF2 has no such law: after an impact its velocity, from three positions, holds a part
of the one before the impact, and the next steps may turn it into height (a sheet at 100 m/s on a plate: a third more
energy than it had). A step of BDF2 that ends with more energy than it began with is repeated with backward Euler, as
multi-step formulas are restarted at a discontinuity (Hairer, Norsett & Wanner, Solving ODEs I, III.5).

What bodies, pins and wind do as work is no gain. Without it the criterion would depend on the frame of reference: cloth
on a plate that slides away under it is sped up by friction, which in the frame of the plate slows it down.
"""

from dataclasses import dataclass

import numpy as np

from clothsim.mesh.world import World
from clothsim.physics.energies.base import Prescribed
from clothsim.physics.energies.protocols import RecoverableEnergy, is_driven
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.state import State

ALLOWED = 0.01
"""Growth of a step as a fraction of the kinetic energy that is left to the truncation error of BDF2."""
ALLOWED_WITH_WORK = 0.1
"""The same in a step in which bodies, pins or wind do work, beyond that work, which the forces at its end give to first
order; nothing is asked of such a step without contact."""
ROUND_OFF = 1e-9
"""Growth relative to the largest part of the energy that is round-off."""
LEAST_SPEED = 1e-6
"""Speed of the whole cloth whose kinetic energy is the least scale [m/s]: at rest there is round-off alone."""


@dataclass(frozen=True)
class MechanicalEnergy:
    """Energies of a state, measured with the potential of one step.

    Parameters
    ----------
    total : float
        Kinetic energy and Psi [J].
    incremental : float
        Incremental potential E(x) [J].
    kinetic : float
        Kinetic energy [J].
    scale : float
        Largest absolute part of the total [J], at least the kinetic energy at `LEAST_SPEED`.
    """

    total: float
    incremental: float
    kinetic: float
    scale: float


def mechanical_energy(world: World, potential: Potential, state: State) -> MechanicalEnergy:
    """Return the energies of `state` with the data of a bound potential, which has evaluated most ends of steps before.

    An energy that is not defined there makes `incremental` inf, and those after it in the sum do not count.
    """
    energies, values = potential.acting.values(), potential.values(state.positions)
    stored = [value for energy, value in zip(energies, values, strict=False) if not energy.incremental]
    dynamic = len(stored) < len(values)
    stored += [energy.recoverable(state.positions) for energy in energies if isinstance(energy, RecoverableEnergy)]
    speeds = (state.velocities[: world.n_unknowns] ** 2).sum(axis=1)
    kinetic = 0.5 * float(world.inertial_masses @ speeds) if dynamic else 0.0
    least = 0.5 * float(world.inertial_masses.sum()) * LEAST_SPEED**2
    scale = max(least, *(abs(part) for part in (kinetic, *stored)))
    return MechanicalEnergy(kinetic + sum(stored), sum(values), kinetic, scale)


def gains_energy(world: World, potential: Potential, before: State, after: State, target: Prescribed) -> bool:
    """True where a step of a two-step formula adds energy that no force has done as work.

    Parameters
    ----------
    world : World
        Meshes.
    potential : Potential
        Potential bound to the step.
    before, after : State
        Its start and end.
    target : Prescribed
        Vertices of bodies and pins with their positions at its end.
    """
    prescribed = not np.array_equal(before.positions[target.vertices], target.positions)
    works = prescribed or any(is_driven(energy) for energy in potential.energies.values())
    if works and not np.isfinite(min(potential.minimum_gap(state.positions) for state in (before, after))):
        return False
    start, end = (mechanical_energy(world, potential, state) for state in (before, after))
    allowed = (ALLOWED_WITH_WORK if works else ALLOWED) * max(start.kinetic, end.kinetic)
    excess = end.total - start.total - allowed - ROUND_OFF * max(start.scale, end.scale)
    return excess > 0.0 and not (works and excess <= external_work(potential, before, after, target))


def external_work(potential: Potential, before: State, after: State, target: Prescribed) -> float:
    """Work of bodies, pins and wind on the cloth in a step, by the forces at its end [J].

    Reactions of the prescribed vertices times their displacements, and the forces of wind times those of the cloth.

    Parameters
    ----------
    potential : Potential
        Potential bound to the step.
    before, after : State
        Its start and end.
    target : Prescribed
        Vertices of bodies and pins.
    """
    displacements, rows = after.positions - before.positions, target.vertices
    work = float((potential.gradient(after.positions)[rows] * displacements[rows]).sum())
    for energy in potential.acting.values():
        if is_driven(energy):
            work -= float((energy.gradient(after.positions) * displacements).sum())
    return work
