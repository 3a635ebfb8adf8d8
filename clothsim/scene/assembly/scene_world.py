"""World and energies of a scene: only the effects that it names are built, and imported."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.inputs import raised
from clothsim.geometry.kinematics.deformation_gradient import thread_axes
from clothsim.keys.mesh_keys import ClothTable
from clothsim.mesh.cloth import Cloth
from clothsim.mesh.world import World, make_world, with_local_origin, with_material
from clothsim.physics.energies.base import Constraint, Energy, Off, PinsConstraint
from clothsim.physics.energies.key_values import Schedule, over_cloth, selected_vertices
from clothsim.physics.energies.protocols import ChangingMaterial, report_of
from clothsim.scene.assembly.checks import (
    refuse_absurd_numbers,
    refuse_large_error,
    refuse_start_inside,
    scene_warnings,
    size_warnings,
)
from clothsim.scene.assembly.holds import hold_notes, holds, missed_bodies, refuse_unsupported
from clothsim.scene.assembly.initial_positions import initial_positions, untangled
from clothsim.scene.assembly.meshes import (
    SHRINKAGES,
    body_of,
    cloth_of,
    cloth_shape,
    fabric_of,
    material_schedules,
    rigid_body_of,
    rod_of,
)
from clothsim.scene.cost import refuse_costly
from clothsim.scene.effects import CONTACTS, EFFECTS, Effect
from clothsim.scene.named_files import with_arrays
from clothsim.scene.scene import Scene


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
        Defaults that were chosen, and what holds the cloth.
    warnings : tuple of str
        What looks wrong, but is simulated as it is given.
    """

    world: World
    energies: dict[str, Energy]
    constraints: dict[str, Constraint]
    off: dict[str, str]
    notes: tuple[str, ...]
    warnings: tuple[str, ...] = ()


def build(scene: Scene, affordable: bool = False) -> Built:
    """Build the world of a scene, then each effect that it names, in the order of the table.

    Parameters
    ----------
    scene : Scene
    affordable : bool
        True: what a machine cannot be expected to run is refused before anything is built.

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
            f"Load one with clothsim.load_scene({scene if isinstance(scene, str) else 'scene.toml'!r}), "
            "or make it: clothsim.Scene(cloth=..., effects=...).",
        )
    if affordable:
        refuse_costly(scene)
    world, notes = _world(scene)
    built = build_effects(scene, world, notes)
    if not scene.run_settings.allow_inside:
        refuse_start_inside(built.world, built.energies)
    return built


def build_effects(
    scene: Scene, world: World, notes: Iterable[str] = (), before: Built | None = None, changed: Collection[str] = ()
) -> Built:
    """Build the effects of `scene` in a `world` whose pins are not yet clamped.

    before: what was built of the same world, of which every effect is taken over whose name is not `changed` and whose
    builder looks at no other effect; then `world` is that of `before`.
    """
    notes = list(notes)
    changes = [material_schedules(keys, where) for keys, where in zip(scene.cloths, _cloth_names(scene), strict=True)]
    energies: dict[str, Energy] = {}
    constraints: dict[str, Constraint] = {}
    off: dict[str, str] = {}
    for name, effect in EFFECTS.items():
        if name not in scene.effects:
            continue
        contacts = tuple(contact for contact in CONTACTS if contact in energies)
        if before is not None and name not in changed and not effect.sees_others:
            if name in before.energies:
                energies[name] = before.energies[name]
            elif name in before.constraints:
                constraints[name] = before.constraints[name]
            elif name in before.off:
                off[name] = before.off[name]
            continue
        supplied = {"contacts": contacts, "built": energies}
        where = f"effects.{name}"
        keys = with_arrays(where, scene.effects[name], scene.directory)
        with _errors_of(where, effect):
            made = effect.build(world, keys, supplied)
            if isinstance(made, Energy) and name in OF_MATERIAL and any(changes):
                made = _changing(where, world, scene.cloths, changes, keys, effect)
        if isinstance(made, Off):
            off[name] = made.reason
        elif isinstance(made, Energy):
            energies[name] = made
            notes.extend(f"{name}: {choice}." for choice in report_of(made).defaults_used())
        else:
            world, constraints[name] = _constrained(name, made)
            notes.extend(_held(world, constraints[name]))
    energies |= _rigid_energies(scene, world, energies)
    if world.rods and "stiffeners" not in energies:  # which has them too
        energies["rods"] = EFFECTS["stiffeners"].build(world, EFFECTS["stiffeners"].keys_class(), {})
    if not energies:
        raise InputError(
            "The scene has no effect that is on.", f"Write [effects.NAME], NAME one of {', '.join(EFFECTS)}."
        )
    settings = scene.run_settings
    refuse_absurd_numbers(world, scene)
    refuse_large_error(world, scene)
    held = holds(world, energies, constraints.values(), settings.duration)
    refuse_unsupported(held, world, energies)
    dt = min(scene.solver_settings.longest_step, 1 / settings.frames_per_second)
    endless = [each.name for each in held if each.falls] if settings.until == "rest" else []
    warnings = [
        *size_warnings(world, scene, energies),
        *scene_warnings(world, scene, energies, dt),
        *missed_bodies(held, world, energies),
        *(f"Nothing holds {name}: it falls, and a run until rest goes to its limit." for name in endless),
    ]
    return Built(world, energies, constraints, off, (*notes, *hold_notes(held)), tuple(warnings))


@contextmanager
def _errors_of(where: str, effect: Effect) -> Iterator[None]:
    """Within the block an error of a builder of a user's own, or a wrong type, is an InputError that names the effect.

    It is chained, so that `--debug` and Python show where it was raised.
    """
    try:
        yield
    except ClothsimError:
        raise
    except Exception as error:
        if callable(effect.builder):
            raise raised(where, effect.builder, error) from error
        if not isinstance(error, TypeError | ValueError):
            raise
        raise InputError(
            f"{where} has a value of the wrong type: {error}.", f"`clothsim keys {where}` lists the types."
        ) from error


OF_MATERIAL = ("membrane", "fibres", "strain_limit", "bending")
"""Effects that follow a material that changes over time."""


def _changing(
    where: str,
    world: World,
    cloths: Sequence[ClothTable],
    changes: Sequence[Mapping[str, Schedule]],
    keys: Any,
    effect: Effect,
) -> Energy:
    """The energy of an effect whose material changes.

    cloths, changes: the sections of the cloths and what changes in each.
    Masses stay as they are: cloth that shrinks becomes denser.
    """
    if getattr(keys, "elements", None) == "pairs" and any(key in each for each in changes for key in SHRINKAGES):
        raise InputError(f'{where}.elements = "pairs" does not take shrinkage.', 'Set it to "triangles".')
    threads = thread_axes(world, np.radians(over_cloth(f"{where}.angle_degrees", keys.angle_degrees, world)))
    axes = np.split(threads, np.cumsum([len(cloth.triangles) for cloth in world.cloths])[:-1])

    def changed(table: ClothTable, numbers: Mapping[str, float], cloth: Cloth, along: Floats) -> Cloth:
        fabric = fabric_of(table.with_keys(**numbers), cloth.name)[0]
        left = np.array([1.0 - numbers.get(key, 0.0) for key in SHRINKAGES])
        if (left == 1.0).all():
            return replace(cloth, fabric=fabric)
        shorter = np.einsum("mij,j,mkj->mik", along, left, along)
        coordinates = np.einsum("mij,mkj->mki", shorter, cloth.material_coordinates)
        return replace(cloth, fabric=fabric, material_coordinates=coordinates)

    def of(numbers: Sequence[Sequence[float]], at_start: bool = False) -> Energy:
        by_name = [dict(zip(each, values, strict=True)) for each, values in zip(changes, numbers, strict=True)]
        sheets = map(changed, cloths, by_name, world.cloths, axes)
        now = with_material(world, (*sheets, *world.cloths[len(cloths) :]))
        made = effect.build(now, keys, {"at_start": at_start})
        if not isinstance(made, Energy):  # no key frame is 0, but a function of time may be
            raise InputError(f"{where} has no stiffness at some time.", "Keep what changes over time above 0.")
        return made

    def numbers_at(time: float) -> tuple[tuple[float, ...], ...]:
        return tuple(tuple(each.at(time) for each in schedules.values()) for schedules in changes)

    first = of(numbers_at(0.0), at_start=True)  # with the checks of a start
    if all(each.is_constant for schedules in changes for each in schedules.values()):
        return first
    if any(world.per_triangle(f"hysteresis_along_{way}").any() for way in ("warp", "weft")):
        raise InputError("bending_hysteresis is not supported with a material that changes.", "Set it to 0.")
    return ChangingMaterial(first, numbers_at, of)


def _cloth_names(scene: Scene) -> list[str]:
    """The sections of the cloths, as messages name them."""
    return [f"cloth[{k}]" if len(scene.cloths) > 1 else "cloth" for k in range(len(scene.cloths))]


def _rigid_energies(scene: Scene, world: World, energies: Mapping[str, Energy]) -> dict[str, Energy]:
    """The rigidity of a world's rigid bodies, and their ties.

    InputError: the scene has no inertia, a policy of pinches that does not know rigid bodies, or a tie without a
    stiffness.
    """
    if not world.rigid:
        return {}
    if "inertia" not in energies:
        raise InputError("Rigid bodies need effects.inertia.", "Write [effects.inertia], or make the body a [[body]].")
    if scene.contact_settings.pinch != "stop":
        raise InputError('contact.pinch = "carry" does not work with rigid bodies.', "Leave the key out.")
    from clothsim.physics.energies import rigid_bodies, seams  # a scene without rigid bodies loads none of them

    tied = []
    for number, keys in enumerate(scene.rigid_bodies):
        body = f"rigid[{number}]" if len(scene.rigid_bodies) > 1 else "rigid"
        tie: Any
        for k, tie in enumerate(keys.tie):
            where = f"{body}.tie[{k}]"
            vertices = selected_vertices(f"{where}.select", world, tie.select)
            stiffness = seams.stitch_stiffness(where, world) if tie.stiffness is None else tie.stiffness
            tied.append(rigid_bodies.Tied(number, vertices, stiffness))
    made: dict[str, Energy] = {"rigidity": rigid_bodies.rigidity(world)}
    return made | ({"rigid_ties": rigid_bodies.rigid_ties(world, tied)} if tied else {})


def _constrained(name: str, made: Any) -> tuple[World, Constraint]:
    """The world and the constraint that a builder made. InputError where a builder of a user's own made neither."""
    if isinstance(made, tuple) and len(made) == 2 and isinstance(made[0], World) and isinstance(made[1], Constraint):
        return made
    raise InputError(
        f"The builder of effects.{name} returned a value of the type {type(made).__name__}.",
        "Return an object of a subclass of clothsim.physics.energies.base.Energy, or Off with a reason.",
    )


def _held(world: World, constraint: Constraint) -> list[str]:
    """A note on each group of pins: how many vertices it holds, and where."""
    notes = []
    for group in constraint.groups if isinstance(constraint, PinsConstraint) else ():
        rows = group.vertices[group.vertices < world.n_cloth]
        at = world.start()[rows] + world.origin
        low, high = (", ".join(f"{x:.3g}" for x in corner) for corner in (at.min(axis=0), at.max(axis=0)))
        vertices = "1 vertex" if len(rows) == 1 else f"{len(rows):,} vertices"
        notes.append(f"{group.name}: {vertices} held, from ({low}) to ({high}) m.")
    return notes


def world_of(scene: Scene) -> World:
    """The cloths and bodies of a scene, without its effects. InputError as of `build`."""
    return _world(scene)[0]


def _world(scene: Scene) -> tuple[World, list[str]]:
    notes: list[str] = []
    cloths, bodies = [], []
    names = _cloth_names(scene)
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
    for k, rod_keys in enumerate(scene.rods):
        rod, rod_notes = rod_of(rod_keys, "rod" if len(scene.rods) == 1 else f"rod[{k}]")
        cloths.append(rod)
        notes.extend(rod_notes)
    rigid = []
    for k, solid_keys in enumerate(scene.rigid_bodies):
        solid, body_notes = rigid_body_of(solid_keys, "rigid" if len(scene.rigid_bodies) == 1 else f"rigid[{k}]", scene)
        rigid.append(solid)
        notes.extend(body_notes)
    world = make_world(cloths, bodies, rigid)
    if scene.seed_settings.untangle:
        world, done = untangled(world)
        notes.append(done)
    return with_local_origin(world), notes
