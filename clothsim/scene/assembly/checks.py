"""Checks of a scene at its start: keys without effect, other units, unusual starts; warnings before a run."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.geometry.held_inside import HeldInside, held_inside, is_inside
from clothsim.keys.generator_keys import GENERATOR_KEYS, Slab
from clothsim.keys.key_table import KeyTable
from clothsim.keys.plausible import doubts, refuse_absurd
from clothsim.mesh.body import FrameMotion
from clothsim.mesh.topology import components
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Step
from clothsim.physics.energies.protocols import ContactGap, is_idle
from clothsim.scene.scene import Scene

LARGEST, SMALLEST = 10.0, 0.01
"""Longest extents of a mesh [m] beyond which its unit is doubted."""
LYING, FLAT = 0.5, 0.1
"""Extent along gravity, as fraction of the longest, below which a body lies, and below which it is a floor."""

FAST_SPIN = 5.0
"""Degrees in a step from which on a rigid body loses more than 1 % of its spin in a second of steps of .01 s."""

UNSTRETCHED = {"inertia", "bending", "gravity", "pins", "damping", "body_contact", "self_contact", "friction"}
"""Effects among which cloth that hangs from its pins stretches without end."""
INSIDE = 0.9
"""Gap at the start, as fraction of d_hat, below which contact is looked at."""
GRAVITY = 9.81
"""With this acceleration [m/s2] a fall through d_hat gives the speed up to which a push is harmless."""


def scene_warnings(world: World, scene: Scene, energies: dict[str, Energy], dt: float) -> tuple[str, ...]:
    """The warnings of a world.

    world: cloths and bodies at the start; scene: its keys; energies: the effects that are on; dt: longest step [s].
    """
    ignored, skipped = [], []
    moving = [cloth.name for cloth in world.cloths if cloth.velocity.any()]
    if moving and "inertia" not in energies:
        ignored.append(f"{moving[0]}: velocity does nothing without effects.inertia.")
    if len(world.ghosts) and "bending" not in energies:
        ignored.append("pins: clamp does nothing without effects.bending.")
    if {"gravity", "pins"} <= set(scene.effects) <= UNSTRETCHED and len(world.triangles):
        ignored.append("Nothing resists stretch: the scene has no effects.membrane.")
    for body in world.bodies:
        motion = body.motion
        if isinstance(motion, FrameMotion) and not motion.still and dt * motion.frames_per_second > 1 + 1e-9:
            frame = 1 / motion.frames_per_second
            skipped.append(f"{body.name}: a step of {dt:g} s skips frames of {frame:g} s: it moves in straight lines.")
    thrown = []  # by a gap at the start well inside d_hat, where the energy is that of a fall through d_hat
    for name, energy in energies.items():
        if not isinstance(energy, ContactGap):
            continue
        gap, d_hat = energy.minimum_gap(world.start()), energy.d_hat
        speed = _pushed_to(world, energies, energy, dt) if gap < INSIDE * d_hat else 0.0
        if speed > np.sqrt(2 * GRAVITY * d_hat):
            thrown.append(
                f"{name}: the gap at the start is {gap:.2g} m, inside d_hat of {d_hat:g} m: contact pushes at once, "
                f"what it touches to {speed:.2g} m/s if nothing resists."
            )
    return (
        *ignored,
        *_frictionless(scene, energies),
        *skipped,
        *_fast_spins(world, dt),
        *held_sentences(held_inside(world, world.start()), "starts", "body_contact" in energies),
        *_nested_bodies(world, energies),
        *_wide_activation(world, energies),
        *thrown,
    )


def size_warnings(world: World, scene: Scene, energies: Mapping[str, Energy]) -> tuple[str, ...]:
    """Meshes whose unit or vertical axis looks wrong, each with the key that corrects it.

    world: cloths and bodies at the start; scene: their tables. Of generated bodies a slab is taken for a floor, and
    none has a vertical axis of its own; energies: the effects that are on.
    """
    tables = [*scene.cloths, *scene.rods, *scene.bodies, *scene.rigid_bodies]
    meshes = [(cloth.name, cloth.positions) for cloth in world.cloths]
    meshes += [(body.name, body.positions) for body in world.bodies]
    # a question on each number that looks like one in another unit
    sentences = [sentence for where, keys in _sections(world, scene) for sentence in doubts(where, keys)]
    size = float(np.ptp(world.start(), axis=0).max())
    if (scene.solver_settings.error or 0.0) > 0.1 * size:
        error = f"{scene.solver_settings.error:g} m"
        sentences.append(f"solver.error is {error}, in a scene of {size:.3g} m: a millimetre is 1e-3 (--error 1mm).")
    for (name, positions), keys in zip(meshes, tables, strict=True):
        if not isinstance(keys, Slab):
            sentences += size_doubts(name, positions)
    gravity = getattr(energies.get("gravity"), "acceleration", None)
    for body, keys in zip(world.prescribed_bodies, scene.bodies, strict=True):
        if gravity is not None and not isinstance(keys, tuple(GENERATOR_KEYS.values())):
            sentences += _lying(body.name, np.ptp(body.positions, axis=0), gravity, keys.up or "z")
    return tuple(sentences)


def _sections(world: World, scene: Scene) -> list[tuple[str, KeyTable]]:
    """The sections of a scene with their names."""
    tables = [*scene.cloths, *scene.rods, *scene.bodies, *scene.rigid_bodies]
    sections: list[tuple[str, KeyTable]] = list(zip(world.names, tables, strict=True))
    sections += [(f"effects.{name}", keys) for name, keys in scene.effects.items()]
    return [*sections, ("solver", scene.solver), ("run", scene.run), ("seed", scene.seed)]


def size_doubts(name: str, positions: Floats) -> list[str]:
    """A sentence where a mesh (n, 3) [m] is longer than LARGEST or shorter than SMALLEST."""
    longest = float(np.ptp(positions, axis=0).max())
    if SMALLEST <= longest <= LARGEST or not np.isfinite(longest):
        return []
    factor = next((factor for factor in (1e-2, 1e-3, 10.0, 100.0, 1e3) if 0.1 <= factor * longest <= 3), None)
    hint = "if its unit is not the metre, set scale, the metres per unit"
    hint += f" (scale = {factor:g} makes it {factor * longest:.3g} m)" if factor else ""
    return [f"{name} is {longest:.3g} m long; {hint}."]


def _lying(name: str, extent: Floats, gravity: Floats, up: str) -> list[str]:
    """A body that is at least twice as long across gravity as along it; a flatter one is a floor or a table."""
    axis, longest = int(np.argmax(np.abs(gravity))), int(np.argmax(extent))
    if not FLAT * extent[longest] < extent[axis] < LYING * extent[longest]:
        return []
    mend = 'up = "y" turns a file with y up' if up == "z" and axis == 2 else "rotation_degrees turns it"
    return [
        f"{name} lies across gravity: it is {extent[axis]:.3g} m along it, and {extent[longest]:.3g} m along "
        f"{'xyz'[longest]}; {mend}."
    ]


def _fast_spins(world: World, dt: float) -> list[str]:
    """Rigid bodies that turn by more than FAST_SPIN degrees in a step of `dt` [s]."""
    sentences = []
    for body in world.rigid:
        rate = body.velocities.T @ body.gradients
        turned = float(np.degrees(np.linalg.norm(rate - rate.T) / np.sqrt(8))) * dt
        if turned > FAST_SPIN:
            sentences.append(
                f"{body.name} turns by {turned:.3g} degrees in a step of {dt:g} s, and will lose spin: "
                f"take solver.dt = {0.6 * FAST_SPIN / turned * dt:.1g}."
            )
    return sentences


def _frictionless(scene: Scene, energies: Mapping[str, Energy]) -> list[str]:
    """Friction in a scene without contact."""
    if "friction" not in scene.effects or any(isinstance(energy, ContactGap) for energy in energies.values()):
        return []
    return ["friction does nothing without contact: add [effects.body_contact] or [effects.self_contact]."]


def refuse_start_inside(world: World, energies: Mapping[str, Energy]) -> None:
    """Raise an InputError where all of a cloth starts inside a body: contact would keep it there."""
    if "body_contact" not in energies:
        return
    for each in held_inside(world, world.start()):
        if each.pieces == each.of:
            raise InputError(
                f"{each.cloth} starts inside {each.body}, {each.where}: contact would keep it in.",
                f"Check the scale, up and position of both; `clothsim fit` frees a garment; where {each.body} is "
                "meant to hold it, give run.allow_inside = true, or --force.",
            )


def refuse_absurd_numbers(world: World, scene: Scene) -> None:
    """Raise an InputError for a number that no material has, in any unit."""
    for where, keys in _sections(world, scene):
        refuse_absurd(where, keys)


def refuse_large_error(world: World, scene: Scene) -> None:
    """Raise an InputError where the error that is asked for is that of the whole scene: it has another unit."""
    size, error = float(np.ptp(world.start(), axis=0).max()), scene.solver_settings.error
    if error >= size:
        raise InputError(
            f"solver.error is {error:g} m, and the whole scene is {size:.3g} m long.",
            f"Give it in metres, solver.error = {1e-3 * error:g}, or with its unit: `--error {error:g}mm`.",
        )


def held_sentences(found: Sequence[HeldInside], verb: str, contact: bool) -> list[str]:
    """A sentence on each cloth that is inside a body, where it `verb` ("is", "starts"), with or without contact."""
    why = "contact keeps it in" if contact else "without [effects.body_contact] it passes through the surface"
    rods = "rods do not touch rigid bodies, so it passes through the surface"
    return [f"{each.cloth} {verb} inside {each.body}, {each.where}: {why if each.touch else rods}." for each in found]


def _nested_bodies(world: World, energies: dict[str, Energy]) -> list[str]:
    """Bodies inside another one at the start, one of the two rigid: contact of their surfaces keeps them there."""
    if not world.rigid or "body_contact" not in energies:
        return []
    start, sentences = world.start(), []
    rigid = {body.name for body in world.rigid}
    bodies = list(zip(world.bodies, (start[rows] for rows in world.body_slices), strict=True))
    for inner, points in bodies:
        firsts = np.unique(components(inner.triangles, len(points)), return_index=True)[1]
        for outer, surface in bodies:
            if inner is outer or not {inner.name, outer.name} & rigid:
                continue
            if any(is_inside(points[row], surface, outer.triangles) for row in firsts):
                sentences.append(f"{inner.name} starts inside {outer.name}: contact of their surfaces keeps it in.")
    return sentences


def _wide_activation(world: World, energies: dict[str, Energy]) -> list[str]:
    """Activation distances above the median edge length of the cloth."""
    if not world.cloths:
        return []
    starts = world.start()[world.edges]
    edge = float(np.median(np.linalg.norm(starts[:, 0] - starts[:, 1], axis=1)))
    wide = {name: energy.d_hat for name, energy in energies.items() if isinstance(energy, ContactGap)}
    return [
        f"{name}: d_hat of {d_hat:g} m is more than the median edge of {edge:.2g} m: vertices close at rest "
        "repel each other."
        for name, d_hat in wide.items()
        if d_hat > edge
    ]


def _pushed_to(world: World, energies: Mapping[str, Energy], contact: Energy, dt: float) -> float:
    """Speed that the energy of a contact at the start gives to what it touches, cloth or a rigid body [m/s]."""
    start = world.start()
    step = Step(0.0, dt, start, world.start_velocities(), 1.0, np.zeros_like(start))
    bound = {name: energy.begin(step) for name, energy in energies.items() if not energy.depends_on_other_energies}
    gradient = sum((each.gradient(start) for each in bound.values() if not is_idle(each)), np.zeros_like(start))
    pushing = contact.begin(replace(step, gradient=gradient, bound=bound))
    touched = pushing.gradient(start)[: world.n_cloth].any(axis=1)
    rigid = [float(body.masses.sum()) for body in world.rigid]
    mass = float(world.masses[touched].sum()) or min(rigid, default=0.0)
    return float(np.sqrt(2 * pushing.value(start) / mass)) if mass else 0.0
