"""Numbers of a scene by their path, and derivatives by them: what each of them builds, and differences of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from clothsim.base.arrays import Floats, as_finite
from clothsim.base.errors import InputError
from clothsim.gradients.backward_pass import LIMIT, Adjoints
from clothsim.gradients.differentiable_session import RecordedStep, held_energies
from clothsim.keys.fabric import BENDINGS, THREADS
from clothsim.mesh.world import World
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.energies.base import Constraint, Energy, Past
from clothsim.physics.energies.protocols import HistorySensitivity, is_idle
from clothsim.scene import paths
from clothsim.scene.assembly.meshes import FABRIC
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.effects import EFFECTS
from clothsim.scene.scene import Scene
from clothsim.solve.newton.potential import Potential
from clothsim.solve.pinch.pinch import masked, pinch_gap
from clothsim.solve.stepping.integrators import prescribed
from clothsim.solve.stepping.stepping import Integrator
from clothsim.solve.timers import Timers

if TYPE_CHECKING:
    from clothsim.gradients.run import Trace

# Paths as "cloth.youngs_modulus", "effects.gravity.acceleration", "body.ball.radius".
#
# The value of a key that the scene leaves to its fabric or to a default is the value that the run has.


RULED = {"youngs_modulus": THREADS, "bending_stiffness": BENDINGS}
"""Stiffnesses of a fabric that a key of the isotropic sheet replaces."""
HELD = ("solver", "run", "seed")
"""Sections whose numbers are of the steps, not of what moves."""


def value_at(scene: Scene, world: World, path: str) -> Floats:
    """Return the number or numbers at a path, a 0- or 1-dimensional array; of key frames (k, 2).

    Raises
    ------
    InputError
        For a path that names no number of the scene, or one of the steps, which are held.
    """
    if paths.parts_of(path)[0] in HELD:
        raise InputError(f"{path} has no gradient: the steps of a run are fixed.", f"Compare runs: sweep {path}.")
    value: Any = paths.get(scene, path)
    if value is None and is_of_fabric(path):
        _, number, keys = paths.located(scene, path)
        fabric = world.cloths[int(number or 0)].fabric
        key = str(keys[0])
        own = [name for name in RULED.get(key, ()) if getattr(fabric, name) is not None]
        if own:
            raise InputError(
                f"{path} does not act: the fabric {fabric.name!r} has {', '.join(own)} instead.",
                f"Use cloth.{own[0]}, or give {key} in the scene.",
            )
        value = getattr(fabric, key, None)
    if value is None:
        raise InputError(
            f"{path} is not a number of the scene.", "`clothsim keys SECTION` lists the keys of a section."
        )
    if isinstance(value, str | bool | Mapping) or callable(value):
        raise InputError(
            f"{path} is {value!r}, not a number that a gradient can vary.",
            "Name a number, such as cloth.youngs_modulus.",
        )
    return as_finite(path, value)


def with_value(scene: Scene, path: str, value: Floats) -> Scene:
    """Return the scene with another number or numbers at a path."""
    return paths.replace(scene, path, np.asarray(value, np.float64).tolist())


def is_of_fabric(path: str) -> bool:
    """True for a path to a key of a cloth's fabric."""
    section, *keys = paths.parts_of(path)
    return section == "cloth" and keys[-1:] != [] and keys[-1] in FABRIC


def affected_effects(path: str, names: Sequence[str]) -> tuple[str, ...]:
    """Return the effects whose energies may change with the number at a path, in the order of `names`."""
    section, *keys = paths.parts_of(path)
    contacts = ("body_contact", "self_contact")
    if section == "effects":
        own = keys[0]
        return tuple(name for name in names if name == own or EFFECTS[name].sees_others)
    if is_of_fabric(path):
        return tuple(name for name in names if name not in (*contacts, "friction"))
    return tuple(names)


# Derivative by a number that the world and the energies are built from, by differences of the force.
#
# The default of every parameter: dL/dp = -a . dG/dp, with G of energies built with p beside p, at the positions of the
# run. It takes no solve: two or four forces a step. What p moves at the start, and the prescribed positions that it
# moves, come with their own adjoints.


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
                raise InputError("The gradient with respect to a parameter at which an effect is off is one-sided.")
            total += weight / self.step * self._power(variant, integrator, steps, adjoints)
        return total

    def _power(
        self, variant: Variant, integrator: Integrator, steps: Sequence[RecordedStep], adjoints: Adjoints
    ) -> float:
        """Start, prescribed positions and histories by their adjoints, less a.G, of one variant."""
        world = integrator.world
        moved = world.origin - variant.world.origin
        start, velocities = variant.world.start() - moved - world.start(), variant.world.start_velocities()
        total = float(np.vdot(adjoints.start, start) + np.vdot(adjoints.velocities, velocities))
        energies, of_both = variant.energies, (variant.energies, integrator.potential.energies)
        if not any(energies[name].depends_on_other_energies for name in self.affected):  # the others are not asked for
            energies = {name: energies[name] for name in self.affected}
        gaps = [pinch_gap(cast("Barrier", each["body_contact"])) for each in of_both if "body_contact" in each]
        for k, record in enumerate(steps):
            held, own = (_prescribed(each, record.end.time) for each in (variant, integrator))
            by = held - moved - own
            total += float(np.vdot(np.where(by, adjoints.prescribed[k], 0.0), by))
            if not self.affected:
                continue
            potential = Potential(energies, Timers())
            if record.carried is not None:
                potential = Potential(masked(energies, record.carried.exclusion), Timers())
                by_gap = record.carried.widening * float(adjoints.memory_adjoints[k][LIMIT])
                total += by_gap * (gaps[0] - gaps[1])
            step = record.step(integrator)
            if moved.any():  # the origin
                past = Past(step.past.positions + moved, step.past.velocities, step.past.dt)
                step = replace(step, positions=step.positions + moved, multistep_past=past)
            bound, x = potential.begin(step).energies, record.solution + moved
            a = np.zeros_like(x)
            a[: world.n_cloth] = adjoints.forces[k]
            for name in self.affected:
                energy = bound[name]
                if not is_idle(energy):
                    total -= float(np.vdot(a, energy.gradient(x)))
                if isinstance(energy, HistorySensitivity) and name in adjoints.memory_adjoints[k]:
                    total += float(np.vdot(adjoints.memory_adjoints[k][name], energy.carry_over))
        return total


def _prescribed(source: Variant | Integrator, time: float) -> Floats:
    """All rows of x at the start, the prescribed ones at their positions at `time` [s]; (N, 3) [m]."""
    rows = source.world.start()
    target = prescribed(source.world, source.constraints.values(), time)
    rows[target.vertices] = target.positions
    return rows


RELATIVE_STEP, OF_FABRIC = 1e-5, 3e-5
"""Change of a number as a fraction of itself, or of the largest of a vector; that of a fabric, in which the energy is
linear or nearly so."""
LEAST_STEP = 1e-6
"""Change of a number that is 0."""


def full_path(name: str) -> str:
    """Return the path of a number; a key of a fabric is meant of the cloth."""
    return f"cloth.{name}" if name in FABRIC or name == "fabric" else name


def scene_derivative(run: "Trace", adjoints: Adjoints, path: str) -> Floats:
    """Return dL by the number or numbers at a path of the scene, () or (k,), or by the key frames there, (k, 2).

    Raises
    ------
    InputError
        For a path that names no number.
    ClothsimError
        For one that moves a body whose adjoint is not known.
    """
    session = run.session
    scene, integrator = session.scene, session.integrator
    value = value_at(scene, session.built.world, path)
    affected = affected_effects(path, tuple(session.built.energies))
    relative, stencil = (OF_FABRIC, SECOND_ORDER) if is_of_fabric(path) else (RELATIVE_STEP, FOURTH_ORDER)
    largest = np.abs(value).max(axis=0) if value.ndim == 2 else np.abs(value).max(initial=0.0)  # of times, of values
    sizes = np.broadcast_to(np.where(largest > 0, relative * largest, LEAST_STEP), value.shape)
    out = np.zeros(value.shape)
    for index in np.ndindex(value.shape):

        def built(change: float, index: tuple[int, ...] = index) -> Variant:
            changed = value.copy()
            changed[index] += change
            made = build(with_value(scene, path, changed))
            return Variant(made.world, held_energies(made.energies, run.stiffness), made.constraints)

        varied = Variation(built, float(sizes[index]), stencil, affected)
        out[index] = varied.derivative(integrator, run.steps, adjoints)
    return adjoints.known(out)
