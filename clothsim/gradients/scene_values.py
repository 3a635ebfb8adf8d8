"""Numbers of a scene by their path: "cloth.youngs_modulus", "effects.gravity.acceleration", "body.ball.radius".

The value of a key that the scene leaves to its fabric or to a default is the value that the run has.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, as_finite
from clothsim.base.errors import InputError
from clothsim.keys.fabric import BENDINGS, THREADS, Fabric
from clothsim.mesh.world import World
from clothsim.scene import paths
from clothsim.scene.assembly.meshes import FABRIC
from clothsim.scene.effects import EFFECTS
from clothsim.scene.scene import Scene

RULED = {"youngs_modulus": THREADS, "bending_stiffness": BENDINGS}
"""Stiffnesses of a fabric that a key of the isotropic sheet replaces."""


def value_at(scene: Scene, world: World, path: str) -> Floats:
    """Return the number or numbers at a path, a 0- or 1-dimensional array.

    Raises
    ------
    InputError
        For a path that names no number of the scene.
    """
    value: Any = paths.get(scene, path)
    if value is None and is_of_fabric(path):
        _, number, keys = paths.located(scene, path)
        value = _read_fabric(world.cloths[int(number or 0)].fabric, path, str(keys[0]))
    if value is None:
        raise InputError(f"{path} is no number of the scene.", "`clothsim keys SECTION` lists the keys of a section.")
    if isinstance(value, str | bool | Mapping) or callable(value):
        raise InputError(f"{path} is {value!r}, no number that a gradient can vary.", "Give it as a number.")
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


def _read_fabric(fabric: Fabric, path: str, key: str) -> float | None:
    """The value of a fabric's key. InputError where other keys act in its place."""
    own = [name for name in RULED.get(key, ()) if getattr(fabric, name) is not None]
    if own:
        raise InputError(
            f"{path} does not act: the fabric {fabric.name!r} has {', '.join(own)} instead.",
            f"Take cloth.{own[0]}, or give {key} in the scene.",
        )
    value = getattr(fabric, key, None)
    return None if value is None else float(value)
