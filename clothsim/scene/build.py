"""From a scene to its world and the energies that it names; nothing that it does not name is built, nor imported."""

from dataclasses import dataclass, replace

import numpy as np

from clothsim.energies.base import Constraint, Energy, Off
from clothsim.errors import InputError
from clothsim.mesh.cloth import Cloth
from clothsim.mesh.world import World, make_world
from clothsim.scene.effects import EFFECTS
from clothsim.scene.meshes import body_of, cloth_of
from clothsim.scene.scene import Scene


@dataclass(frozen=True)
class Built:
    """A scene made ready: world, energies by name, constraints by name, {named effect that is off: reason}, notes."""

    world: World
    energies: dict[str, Energy]
    constraints: dict[str, Constraint]
    off: dict[str, str]
    notes: tuple[str, ...]


def build(scene: Scene) -> Built:
    """Build the world, then each named effect in the order of the table. InputError, one sentence, for bad input."""
    world, notes = _world(scene)
    energies: dict[str, Energy] = {}
    constraints: dict[str, Constraint] = {}
    off: dict[str, str] = {}
    for name, effect in EFFECTS.items():
        if name not in scene.effects:
            continue
        try:
            made = effect.load()(world, **scene.effects[name])
        except TypeError as error:
            raise InputError(f"effects.{name} has a value of the wrong type: {error}.") from error
        if isinstance(made, Off):
            off[name] = made.reason
        elif isinstance(made, Energy):
            energies[name] = made
            notes.extend(f"{name}: {choice}." for choice in made.choices())
        else:
            world, constraints[name] = made
    if not energies:
        raise InputError("The scene has no effect that is on.", f"Name some: {', '.join(EFFECTS)}.")
    return Built(world, energies, constraints, off, (*notes, *_without_effect(world, energies)))


def _without_effect(world: World, energies: dict[str, Energy]) -> list[str]:
    """What the scene says that no effect of it listens to."""
    unheard = []
    moving = [cloth.name for cloth in world.cloths if cloth.velocity.any()]
    if moving and "inertia" not in energies:
        unheard.append(f"{moving[0]}: velocity does nothing without effects.inertia.")
    if len(world.ghosts) and "bending" not in energies:
        unheard.append("pins: clamp does nothing without effects.bending.")
    return unheard


def _world(scene: Scene) -> tuple[World, list[str]]:
    notes: list[str] = []
    cloths, bodies = [], []
    for k, keys in enumerate(scene.cloths):
        cloth, said = cloth_of(keys, "cloth" if len(scene.cloths) == 1 else f"cloth[{k}]", scene.directory)
        cloths.append(cloth)
        notes.extend(said)
    for k, keys in enumerate(scene.bodies):
        body, said = body_of(keys, "body" if len(scene.bodies) == 1 else f"body[{k}]", scene.directory)
        bodies.append(body)
        notes.extend(said)
    return make_world(_seeded(scene, cloths), bodies), notes


def _seeded(scene: Scene, cloths: list[Cloth]) -> list[Cloth]:
    """The cloths at the vertices of the seed file, where the scene has one."""
    seed = scene.seed_settings()
    if seed.from_ == "rest":
        return cloths
    from clothsim.io.meshes import read_mesh

    positions = read_mesh(scene.directory / seed.file).positions
    expected = sum(len(cloth.positions) for cloth in cloths)
    if len(positions) != expected:
        raise InputError(f"seed.file {seed.file} has {len(positions)} vertices, the cloths have {expected}.")
    parts = np.split(positions, np.cumsum([len(cloth.positions) for cloth in cloths])[:-1])
    return [replace(cloth, positions=part) for cloth, part in zip(cloths, parts, strict=True)]
