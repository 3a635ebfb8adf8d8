"""Derivative by a number that the world and the energies are built from, by differences of the force.

The default of every parameter: dL/dp = -a . dG/dp, with G of energies built with p beside p, at the positions of the
run. It takes no solve: two or four forces a step. What p moves at the start, and the prescribed positions that it
moves, come with their own adjoints.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.gradients.backward_pass import Adjoints
from clothsim.gradients.recorded_step import RecordedStep
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Constraint, Energy, Past, Step
from clothsim.physics.energies.protocols import is_idle
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.integrators import prescribed
from clothsim.solve.stepping.stepping import Integrator
from clothsim.solve.timers import Timers

SECOND_ORDER = ((1.0, 0.5), (-1.0, -0.5))
FOURTH_ORDER = ((2.0, -1.0 / 12.0), (1.0, 2.0 / 3.0), (-1.0, -2.0 / 3.0), (-2.0, 1.0 / 12.0))
"""Offsets and weights of central differences."""


@dataclass(frozen=True)
class Variant:
    """World, energies and constraints that a value of a parameter gives."""

    world: World
    energies: Mapping[str, Energy]
    constraints: Mapping[str, Constraint]


@dataclass(frozen=True)
class Variation:
    """A parameter, and what is built with values beside its own.

    Parameters
    ----------
    build : callable
        From the change of the parameter to what it gives.
    step : float
        Change of the parameter that differences take.
    stencil : tuple
        Offsets, in `step`, and weights of the difference.
    affected : tuple of str
        Effects whose energies may change.
    """

    build: Callable[[float], Variant]
    step: float
    stencil: tuple[tuple[float, float], ...]
    affected: tuple[str, ...]

    def derivative(self, integrator: Integrator, steps: Sequence[RecordedStep], adjoints: Adjoints) -> float:
        """Return dL/dp over recorded steps with their adjoints."""
        total = 0.0
        for offset, weight in self.stencil:
            variant = self.build(offset * self.step)
            if variant.energies.keys() != integrator.potential.energies.keys():
                raise InputError("The gradient by a parameter at which an effect is switched off is one-sided.")
            total += weight / self.step * self._power(variant, integrator, steps, adjoints)
        return total

    def _power(
        self, variant: Variant, integrator: Integrator, steps: Sequence[RecordedStep], adjoints: Adjoints
    ) -> float:
        """Start and prescribed positions by their adjoints, less a.G, of one variant."""
        world = integrator.world
        moved = world.origin - variant.world.origin
        start, velocities = variant.world.start() - moved - world.start(), variant.world.start_velocities()
        total = float(np.vdot(adjoints.start, start) + np.vdot(adjoints.velocities, velocities))
        energies = variant.energies
        if not any(energies[name].begins_last for name in self.affected):  # the others are not asked for
            energies = {name: energies[name] for name in self.affected}
        potential = Potential(energies, Timers())
        for k, record in enumerate(steps):
            held, own = (_prescribed(each, record.end.time) for each in (variant, integrator))
            total += float(np.vdot(adjoints.prescribed[k], held - moved - own))
            if not self.affected:
                continue
            step = _shift_origin(record.step(integrator), moved)
            bound, x = potential.begin(step).energies, record.solution + moved
            a = np.zeros_like(x)
            a[: world.n_cloth] = adjoints.forces[k]
            for name in self.affected:
                if not is_idle(bound[name]):
                    total -= float(np.vdot(a, bound[name].gradient(x)))
        return total


def _prescribed(source: Variant | Integrator, time: float) -> Floats:
    """All rows of x at the start, the prescribed ones at their positions at `time` [s]; (N, 3) [m]."""
    rows = source.world.start()
    target = prescribed(source.world, source.constraints.values(), time)
    rows[target.vertices] = target.positions
    return rows


def _shift_origin(step: Step, by: Floats) -> Step:
    """The step in the coordinates of another origin."""
    if not by.any():
        return step
    past = step.past
    return replace(step, positions=step.positions + by, weighed=Past(past.positions + by, past.velocities, past.dt))
