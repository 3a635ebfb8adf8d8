"""Numbers of a scene by their path: "cloth.youngs_modulus", "effects.gravity.acceleration", "body.ball.radius".

A path is a section, the name of an object where there are several, and keys; [k] takes an entry of a list. The value of
a key that the scene leaves to its fabric or to a default is the value that the run has.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, as_finite
from clothsim.base.errors import InputError
from clothsim.keys.fabric import BENDINGS, THREADS, Fabric
from clothsim.mesh.world import World
from clothsim.scene.assembly.meshes import FABRIC
from clothsim.scene.effects import EFFECTS
from clothsim.scene.scene import Scene

SECTIONS = ("cloth", "body", "effects")
RULED = {"youngs_modulus": THREADS, "bending_stiffness": BENDINGS}
"""Stiffnesses of a fabric that a key of the isotropic sheet replaces."""


def value_at(scene: Scene, world: World, path: str) -> Floats:
    """Return the number or numbers at a path, a 0- or 1-dimensional array.

    Raises
    ------
    InputError
        For a path that names no number of the scene.
    """
    section, keys, number = _located(scene, path)
    table = getattr(scene, f"{'bodies' if section == 'body' else 'cloths'}")[number] if number >= 0 else scene.effects
    value: Any = table
    for k, key in enumerate(keys):
        found = _inside(value, key)
        if found is None and section == "cloth" and len(keys) == 1 and key in FABRIC:
            found = _of_fabric(world.cloths[number].fabric, path, str(key))
        if found is None and section == "effects" and k == 1:
            found = EFFECTS[str(keys[0])].keys().get(str(key))
        if found is None:
            raise InputError(f"{path} is no number of the scene.", f"`clothsim keys {section}` lists its keys.")
        value = found
    if isinstance(value, str | bool | Mapping) or callable(value):
        raise InputError(f"{path} is {value!r}, no number that a gradient can vary.", "Give it as a number.")
    return as_finite(path, value)


def with_value(scene: Scene, path: str, value: Floats) -> Scene:
    """Return the scene with another number or numbers at a path."""
    section, keys, number = _located(scene, path)
    given: Any = float(value) if np.ndim(value) == 0 else [float(each) for each in value]
    if number < 0:
        return _remade(scene, section, _replaced(scene.effects, keys, given))
    tables = list(scene.bodies if section == "body" else scene.cloths)
    tables[number] = _replaced(tables[number], keys, given)
    return _remade(scene, section, tables)


def affected_effects(path: str, names: Sequence[str]) -> tuple[str, ...]:
    """Return the effects whose energies may change with the number at a path, in the order of `names`."""
    section, *keys = path.split(".")
    contacts = ("body_contact", "self_contact")
    if section == "effects":
        own = keys[0]
        return tuple(name for name in names if name == own or EFFECTS[name].sees_others)
    if section == "cloth" and keys[-1] in FABRIC:
        return tuple(name for name in names if name not in (*contacts, "friction"))
    return tuple(names)


def _located(scene: Scene, path: str) -> tuple[str, list[str | int], int]:
    """Section, keys and the number of the object, -1 for an effect."""
    section, *words = path.split(".")
    if section not in SECTIONS or not words:
        raise InputError(
            f"{path!r} is no path of a number in the scene.",
            "Write one as cloth.density or effects.friction.coefficient.",
        )
    number = -1
    if section != "effects":
        tables = scene.bodies if section == "body" else scene.cloths
        names = [str(keys.get("name", section)) for keys in tables]
        if len(words) > 1 and words[0] in names:
            number, words = names.index(words[0]), words[1:]
        elif len(tables) == 1:
            number = 0
        else:
            raise InputError(f"{path} names none of several.", f"Write {section}.NAME.KEY with {', '.join(names)}.")
    elif words[0] not in scene.effects:
        raise InputError(f"The scene has no effect {words[0]!r}.", f"It has {', '.join(scene.effects)}.")
    keys: list[str | int] = []
    for word in words:
        name, *indices = re.split(r"[\[\]]+", word.rstrip("]"))
        keys += [name, *(int(index) if index.isdigit() else index for index in indices)]
    return section, keys, number


def _inside(value: Any, key: str | int) -> Any:
    if isinstance(value, Mapping):
        return value.get(key)
    if isinstance(key, int) and isinstance(value, list | tuple | np.ndarray) and key < len(value):
        return value[key]
    return None


def _replaced(table: Any, keys: Sequence[str | int], value: Any) -> Any:
    """A copy of nested tables and lists with the value at `keys`."""
    first, *others = keys
    inner = _inside(table, first)
    new = _replaced({} if inner is None else inner, others, value) if others else value
    if isinstance(table, Mapping):
        return {**table, first: new}
    return [new if k == first else each for k, each in enumerate(table)]


def _remade(scene: Scene, section: str, value: Any) -> Scene:
    changed: dict[str, Any] = {section: value}
    return replace(scene, **changed)


def _of_fabric(fabric: Fabric, path: str, key: str) -> float | None:
    """The value of a fabric's key. InputError where other keys act in its place."""
    own = [name for name in RULED.get(key, ()) if getattr(fabric, name) is not None]
    if own:
        raise InputError(
            f"{path} does not act: the fabric {fabric.name!r} has {', '.join(own)} instead.",
            f"Take cloth.{own[0]}, or give {key} in the scene.",
        )
    value = getattr(fabric, key, None)
    return None if value is None else float(value)
