"""World and energies of a scene: only the effects that it names are built, and imported."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.keys.mesh_keys import RigidTable
from clothsim.mesh.local_origin import with_local_origin
from clothsim.mesh.rigid_body import RigidBody
from clothsim.mesh.world import World, make_world
from clothsim.physics.energies.base import Constraint, Energy, Off, Step
from clothsim.physics.energies.protocols import Anchored, report_of
from clothsim.scene.assembly.array_files import with_arrays
from clothsim.scene.assembly.initial_positions import initial_positions
from clothsim.scene.assembly.meshes import body_of, cloth_of, cloth_shape
from clothsim.scene.assembly.untangle import untangled
from clothsim.scene.assembly.warnings import scene_warnings, size_warnings
from clothsim.scene.effects import CONTACTS, EFFECTS
from clothsim.scene.scene import Scene

# Existence of a quasi-static equilibrium: a load on a cloth without any support has none.

ROUND_OFF = 1e-9
"""Fraction of the forces on a piece below which their sum counts as zero: internal forces cancel to the last digits."""


def refuse_unsupported(world: World, energies: Mapping[str, Energy], constraints: Iterable[Constraint]) -> None:
    """Refuse a piece of cloth under a load without pin, spring, contact with a body, inertia or damping.

    Parameters
    ----------
    world : World
        Cloths and bodies at the start.
    energies : dict of str to Energy
        The effects that are on.
    constraints : iterable of Constraint
        The prescribed positions.

    Raises
    ------
    InputError
        With the name of the piece and its load.

    Notes
    -----
    The internal forces of a piece cancel, so that the sum of its forces is the load. With self_contact all pieces count
    as one, as one may lie on another.
    """
    # Friction resists only where there is contact, whose forces are known last.
    resisted = any(_resists(world, energy) for energy in energies.values() if not energy.begins_last)
    if resisted or "body_contact" in energies:
        return
    pieces = np.zeros(world.n_cloth, np.int64) if "self_contact" in energies else _pieces(world)
    held = np.zeros(world.n_vertices, bool)
    for constraint in constraints:
        held[constraint.at(0.0).vertices] = True
    for energy in energies.values():
        if isinstance(energy, Anchored):
            held[energy.anchored_rows] = True
    forces = _forces(world, energies)
    for piece in np.setdiff1d(pieces, pieces[held[: world.n_cloth]]):
        of_piece = np.flatnonzero(pieces == piece)
        load = float(np.linalg.norm(forces[of_piece].sum(axis=0)))
        if load > ROUND_OFF * np.linalg.norm(forces[of_piece], axis=1).sum():
            label = int(world.labels[of_piece[0]])
            own = of_piece[0] - world.cloth_slices[label].start
            part = f"the piece of {world.names[label]} with vertex {own}" if own else world.names[label]
            raise InputError(
                f"Nothing supports {part} against its load of {load:.3g} N: no pin of its own, no body_contact, no "
                "inertia.",
                "Pin some of its vertices, put a body under it (with effects.body_contact), or add effects.inertia.",
            )


def _resists(world: World, energy: Energy) -> bool:
    """True for an incremental energy with a force against a translation: damping of the strain rate has none."""
    if not energy.incremental:
        return False
    start = world.start()
    none = np.zeros_like(start)
    bound = energy.begin(Step(0.0, 1.0, start, none, 1.0, none))
    change = bound.gradient(start + 1.0) - bound.gradient(start)
    return bool(np.abs(change.sum(axis=0)).max() > ROUND_OFF * np.abs(change).sum())


def _pieces(world: World) -> Ints:
    """The number of the connected piece of each cloth vertex, (n_cloth,)."""
    ones = np.ones(len(world.edges))
    graph = coo_array((ones, tuple(world.edges.T)), shape=(world.n_cloth, world.n_cloth))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def _forces(world: World, energies: Mapping[str, Energy]) -> Floats:
    """Minus the gradient of the energies at the start under full load, (n_cloth, 3) [N]; without those of contact."""
    start = world.start()
    none = np.zeros_like(start)
    step = Step(0.0, 1.0, start, none, 1.0, none)
    forces = none.copy()
    for energy in energies.values():
        if not energy.begins_last:
            forces -= energy.begin(step).gradient(start)
    return forces[: world.n_cloth]


@dataclass(frozen=True)
class Built:
    """World, energies and constraints of a scene.

    Parameters
    ----------
    world : World
        Cloths and bodies at the start.
    energies : dict of str to Energy
        The effects that are on, in the order of the table.
    constraints : dict of str to Constraint
        The effects that prescribe positions.
    off : dict of str to str
        The reason why a named effect is off.
    notes : tuple of str
        Defaults that were chosen, and warnings.
    """

    world: World
    energies: dict[str, Energy]
    constraints: dict[str, Constraint]
    off: dict[str, str]
    notes: tuple[str, ...]


def build(scene: Scene) -> Built:
    """Build the world of a scene, then each effect that it names, in the order of the table.

    Parameters
    ----------
    scene : Scene
        The scene.

    Returns
    -------
    Built

    Raises
    ------
    InputError
        For bad input, in one sentence.

    Examples
    --------
    >>> import clothsim
    >>> scene = clothsim.Scene(cloth={"mesh": "rectangle", "cells": [2, 2]}, effects=[clothsim.Inertia()])
    >>> build(scene).world.n_cloth
    9
    """
    if not isinstance(scene, Scene):
        raise InputError(
            f"A clothsim.Scene is needed, not a value of the type {type(scene).__name__}.",
            'Load one with clothsim.load_scene("scene.toml"), or make it: clothsim.Scene(cloth=..., effects=...).',
        )
    world, notes = _world(scene)
    return build_effects(scene, world, notes)


def build_effects(
    scene: Scene, world: World, notes: Iterable[str] = (), before: Built | None = None, changed: Collection[str] = ()
) -> Built:
    """Build the effects of `scene` in a `world` whose pins are not yet clamped.

    before: what was built of the same world, of which every effect is taken over whose name is not `changed` and whose
    builder looks at no other effect; then `world` is that of `before`.
    """
    notes = list(notes)
    energies: dict[str, Energy] = {}
    constraints: dict[str, Constraint] = {}
    off: dict[str, str] = {}
    for name, effect in EFFECTS.items():
        if name not in scene.effects:
            continue
        contacts = tuple(contact for contact in CONTACTS if contact in energies)
        if before is not None and name not in changed and not effect.sees_others:
            _take_over(name, before, energies, constraints, off)
            continue
        supplied = {"contacts": contacts, "built": energies}
        where = f"effects.{name}"
        keys = with_arrays(where, scene.effects[name], scene.directory)
        try:
            made = effect.build(world, keys, supplied)
        except (TypeError, ValueError) as error:
            raise InputError(
                f"{where} has a value of the wrong type: {error}.", f"`clothsim keys {where}` lists the types."
            ) from error
        if isinstance(made, Off):
            off[name] = made.reason
        elif isinstance(made, Energy):
            energies[name] = made
            notes.extend(f"{name}: {choice}." for choice in report_of(made).defaults_used())
        else:
            world, constraints[name] = _constrained(name, made)
    for name, energy in _rigid_energies(scene, world, energies).items():
        energies[name] = energy
    if not energies:
        raise InputError(
            "The scene has no effect that is on.", f"Write [effects.NAME], NAME one of {', '.join(EFFECTS)}."
        )
    refuse_unsupported(world, energies, constraints.values())
    dt = min(scene.solver_settings.longest_step, 1 / scene.run_settings.frames_per_second)
    return Built(
        world,
        energies,
        constraints,
        off,
        (*notes, *size_warnings(world, scene, energies), *scene_warnings(world, energies, dt)),
    )


def _rigid_energies(scene: Scene, world: World, energies: dict[str, Energy]) -> dict[str, Energy]:
    """What comes with rigid bodies; a scene without them does not import it."""
    if not world.rigid:
        return {}
    from clothsim.scene.assembly.rigid_bodies import rigid_energies

    return rigid_energies(scene, world, energies)


def _constrained(name: str, made: Any) -> tuple[World, Constraint]:
    """The world and the constraint that a builder made. InputError where a builder of a user's own made neither."""
    if isinstance(made, tuple) and len(made) == 2 and isinstance(made[0], World) and isinstance(made[1], Constraint):
        return made
    raise InputError(
        f"The builder of effects.{name} returned a value of the type {type(made).__name__}.",
        "Return an object of a subclass of clothsim.physics.energies.base.Energy, or Off with a reason.",
    )


def _take_over(
    name: str, before: Built, energies: dict[str, Energy], constraints: dict[str, Constraint], off: dict[str, str]
) -> None:
    """Put the effect `name` of what was built before where it belongs."""
    if name in before.energies:
        energies[name] = before.energies[name]
    elif name in before.constraints:
        constraints[name] = before.constraints[name]
    elif name in before.off:
        off[name] = before.off[name]


def _rigid_body(keys: RigidTable, where: str, scene: Scene) -> tuple[RigidBody, tuple[str, ...]]:
    from clothsim.scene.assembly.rigid_bodies import rigid_body_of

    return rigid_body_of(keys, where, scene)


def world_of(scene: Scene) -> World:
    """The cloths and bodies of a scene, without its effects. InputError as of `build`."""
    return _world(scene)[0]


def _world(scene: Scene) -> tuple[World, list[str]]:
    notes: list[str] = []
    cloths, bodies = [], []
    names = [f"cloth[{k}]" if len(scene.cloths) > 1 else "cloth" for k in range(len(scene.cloths))]
    shapes = [cloth_shape(keys, where, scene.directory) for keys, where in zip(scene.cloths, names, strict=True)]
    starts = initial_positions(scene, [len(shape.positions) for shape in shapes])
    for shape, keys, where, start in zip(shapes, scene.cloths, names, starts, strict=True):
        cloth, cloth_notes = cloth_of(shape, keys, where, start)
        cloths.append(cloth)
        notes.extend(cloth_notes)
    for k, given in enumerate(scene.bodies):
        body, body_notes = body_of(given, "body" if len(scene.bodies) == 1 else f"body[{k}]", scene.directory)
        bodies.append(body)
        notes.extend(body_notes)
    rigid = []
    for k, solid_keys in enumerate(scene.rigid_bodies):
        solid, body_notes = _rigid_body(solid_keys, "rigid" if len(scene.rigid_bodies) == 1 else f"rigid[{k}]", scene)
        rigid.append(solid)
        notes.extend(body_notes)
    world = make_world(cloths, bodies, rigid)
    if scene.seed_settings.untangle:
        world, done = untangled(world)
        notes.append(done)
    return with_local_origin(world), notes
