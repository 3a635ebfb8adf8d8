"""The meshes that a scene's tables name: generated or read, examined, sewn, scaled and placed."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.arrays import Floats, Ints, as_number, as_positive, as_vector
from clothsim.build.animated_body import animated_body
from clothsim.build.placement import PART, Shape, examined, name_of, placed
from clothsim.build.welding import sewn
from clothsim.errors import InputError
from clothsim.mesh.body import Body, make_body
from clothsim.mesh.cloth import Cloth, make_cloth
from clothsim.mesh.fabric import Fabric
from clothsim.mesh.generators.sheets import GENERATORS
from clothsim.mesh.motion import rigid_motion
from clothsim.scene.fabrics import fabric_named
from clothsim.scene.keys import refuse_unknown, table

PLACE = ("name", "mesh", "position", "rotation_degrees")
THREADS = ("warp_stiffness", "weft_stiffness", "shear_stiffness", "thread_poisson_ratio")
FABRIC = ("density", "thickness", "youngs_modulus", "poisson_ratio", "bending_stiffness", *THREADS)
CLOTH = ("velocity", "fabric", "weld", "sewn", "rest", *FABRIC)
MOTION = ("velocity", "rotate_degrees_per_second", "centre")


def cloth_shape(keys: Mapping[str, Any], where: str, directory: Path) -> Shape:
    """The mesh of a [cloth] table as it is in its file or generated: neither examined, sewn nor placed."""
    return _shape(keys, where, directory, (*PLACE, *CLOTH))


def cloth_of(
    shape: Shape, keys: Mapping[str, Any], where: str, start: Floats | None = None
) -> tuple[Cloth, tuple[str, ...]]:
    """The cloth of a [cloth] table with its `cloth_shape`, and what the user should know of it.

    start: (n, 3) where the vertices of the shape start [m], if not where the table places them. Panels are sewn where
    they touch: in the file (sewn = true: they are one mesh already, in which seams of three layers are no fault);
    with rest = "vt" and a start, in the start, for such files hold the panels apart.
    """
    label = name_of(keys, where)
    fabric, fabric_note = fabric_of(keys, where)
    rest = keys.get("rest", "file")
    if not isinstance(rest, str) or rest not in ("file", "vt"):
        raise InputError(f"{where}.rest is {rest!r}.", 'Known: "file", "vt".')
    if rest == "vt" and not len(shape.texture):
        raise InputError(f'{where}.rest is "vt", but the mesh has no texture coordinates.', 'Use rest = "file".')
    gap = as_positive(f"{where}.weld", keys.get("weld", 0.0), zero=True)
    if gap:
        shape, start = sewn(label, shape, start, gap, at_start=rest == "vt")
    layers = _flag(f"{where}.sewn", keys.get("sewn", False))
    warnings = examined(label, shape, "sewn cloth" if gap or layers else "cloth")
    cloth = make_cloth(
        label,
        shape.positions,
        shape.triangles,
        fabric,
        positions=placed(keys, where, shape.positions) if start is None else start,
        material_coordinates=shape.texture if rest == "vt" else None,
        velocity=as_vector(f"{where}.velocity", keys.get("velocity", (0, 0, 0))),
        groups=shape.groups,
    )
    return cloth, (*warnings, fabric_note)


def body_of(keys: Mapping[str, Any], where: str, directory: Path) -> tuple[Body, tuple[str, ...]]:
    """The body of a [[body]] table, and what the user should know of it."""
    if "frames" in keys:
        return animated_body(keys, where, directory)
    shape = _shape(keys, where, directory, (*PLACE, "motion"))
    notes = examined(name_of(keys, where), shape, "body")
    positions = placed(keys, where, shape.positions)
    motion = dict(table(f"{where}.motion", keys.get("motion", {})))
    refuse_unknown(f"{where}.motion", motion, MOTION)
    motion.setdefault("centre", as_vector(f"{where}.position", keys.get("position", (0, 0, 0))))
    return make_body(name_of(keys, where), positions, shape.triangles, rigid_motion(**motion)), notes


def _flag(name: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise InputError(f"{name} is {value!r}.", "Give true or false.")
    return value


def _shape(keys: Mapping[str, Any], where: str, directory: Path, common: tuple[str, ...]) -> Shape:
    """The mesh that `keys` name."""
    mesh = keys.get("mesh")
    if not isinstance(mesh, str) or not mesh or not mesh.isprintable():
        raise InputError(f"{where} has no mesh.", f"Give one of {', '.join(GENERATORS)}, or a file.")
    if mesh in GENERATORS:
        return _generated(GENERATORS[mesh], mesh, keys, where, common)
    if "." not in Path(mesh).name:
        refuse_unknown(f"{where}.mesh", [mesh], GENERATORS)
        raise InputError(f"{where}.mesh is {mesh!r}.")
    return _from_file(directory / mesh, keys, where, common)


def _generated(
    generator: Callable[..., tuple[Floats, Ints]],
    name: str,
    keys: Mapping[str, Any],
    where: str,
    common: tuple[str, ...],
) -> Shape:
    own = list(inspect.signature(generator).parameters)
    refuse_unknown(f"{where} ({name})", keys, (*common, *own, "scale"))
    positions, triangles = generator(**{key: keys[key] for key in own if key in keys})
    scale = as_positive(f"{where}.scale", keys.get("scale", 1.0))
    return Shape(scale * positions, triangles, np.zeros((0, 3, 2)), ())


def _from_file(path: Path, keys: Mapping[str, Any], where: str, common: tuple[str, ...]) -> Shape:
    from clothsim.io.mesh_file import read_mesh

    refuse_unknown(f"{where} (a file)", keys, (*common, *PART))
    mesh = read_mesh(path, **{key: keys[key] for key in PART if key in keys})
    return Shape(mesh.positions, mesh.triangles, mesh.texture, mesh.messages, mesh.groups)


def fabric_of(keys: Mapping[str, Any], where: str) -> tuple[Fabric, str]:
    """The named fabric with the keys that override it; a Young's modulus takes the place of what its threads have."""
    name = keys.get("fabric", "cotton")
    named = fabric_named(f"{where}.fabric", name)
    own = {key: as_number(f"{where}.{key}", keys[key]) for key in FABRIC if key in keys}
    ruled = dict.fromkeys(THREADS) if "youngs_modulus" in own else {}
    fabric = replace(named, **(ruled | own))  # type: ignore[arg-type]
    changed = f" with its own {', '.join(own)}" if own else ""
    return fabric, f"{name_of(keys, where)}: fabric {name}{changed}."
