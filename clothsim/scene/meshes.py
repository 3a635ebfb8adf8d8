"""The meshes that a scene's tables name: generated or read, examined, welded, scaled and placed."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.arrays import Floats, Ints, as_number, as_positive, as_vector
from clothsim.errors import InputError
from clothsim.mesh.body import Body, make_body, rigid_motion, rotation_matrix
from clothsim.mesh.check import Role, examine, refuse
from clothsim.mesh.cloth import Cloth, make_cloth
from clothsim.mesh.fabric import Fabric
from clothsim.mesh.generate import GENERATORS
from clothsim.mesh.weld import weld
from clothsim.scene.fabrics import FABRICS
from clothsim.scene.keys import refuse_unknown, table

PLACE = ("name", "mesh", "position", "rotation_degrees")
PART = ("scale", "group", "component", "vertices")
FABRIC = ("density", "thickness", "youngs_modulus", "poisson_ratio", "bending_stiffness")
CLOTH = ("velocity", "fabric", "weld", "rest", *FABRIC)
MOTION = ("velocity", "rotate_degrees_per_second", "centre")


@dataclass(frozen=True)
class Shape:
    """A mesh as a table names it, before it is placed; texture (m, 3, 2) or (0, 3, 2); notes for the user."""

    positions: Floats
    triangles: Ints
    texture: Floats
    notes: tuple[str, ...]


def cloth_of(keys: Mapping[str, Any], where: str, directory: Path) -> tuple[Cloth, tuple[str, ...]]:
    """The cloth of a [cloth] table, and what the user should know of it."""
    shape = _shape(keys, where, directory, (*PLACE, *CLOTH), "cloth")
    fabric, note = _fabric(keys, where)
    rest = keys.get("rest", "file")
    if rest not in ("file", "vt"):
        raise InputError(f"{where}.rest is {rest!r}.", 'Known: "file", "vt".')
    if rest == "vt" and not len(shape.texture):
        raise InputError(f'{where}.rest is "vt", but the mesh has no texture coordinates.', 'Use rest = "file".')
    cloth = make_cloth(
        _name(keys, where),
        shape.positions,
        shape.triangles,
        fabric,
        positions=_placed(keys, where, shape.positions),
        material_coordinates=shape.texture if rest == "vt" else None,
        velocity=as_vector(f"{where}.velocity", keys.get("velocity", (0, 0, 0))),
    )
    return cloth, (*shape.notes, note)


def body_of(keys: Mapping[str, Any], where: str, directory: Path) -> tuple[Body, tuple[str, ...]]:
    """The body of a [[body]] table, and what the user should know of it."""
    if "frames" in keys:
        raise InputError(f"{where}.frames: animated bodies are not built yet.", "Give one mesh.")
    shape = _shape(keys, where, directory, (*PLACE, "motion"), "body")
    positions = _placed(keys, where, shape.positions)
    motion = dict(table(f"{where}.motion", keys.get("motion", {})))
    refuse_unknown(f"{where}.motion", motion, MOTION)
    motion.setdefault("centre", as_vector(f"{where}.position", keys.get("position", (0, 0, 0))))
    body = make_body(_name(keys, where), positions, shape.triangles, rigid_motion(**motion))
    return body, shape.notes


def _shape(keys: Mapping[str, Any], where: str, directory: Path, common: tuple[str, ...], role: Role) -> Shape:
    """The mesh that `keys` name, examined."""
    mesh = keys.get("mesh")
    if not isinstance(mesh, str) or not mesh:
        raise InputError(f"{where} has no mesh.", f"Give one of {', '.join(GENERATORS)}, or a file.")
    label = _name(keys, where)
    if mesh in GENERATORS:
        shape = _generated(GENERATORS[mesh], mesh, keys, where, common)
    elif "." not in Path(mesh).name:
        refuse_unknown(f"{where}.mesh", [mesh], GENERATORS)
        raise InputError(f"{where}.mesh is {mesh!r}.")
    else:
        shape = _from_file(directory / mesh, keys, where, common)
    gap = as_positive(f"{where}.weld", keys.get("weld", 0.0), zero=True)
    if gap:
        positions, triangles, _ = weld(shape.positions, shape.triangles, gap)
        merged = len(shape.positions) - len(positions)
        note = f"{label}: {merged} border vertices were welded."
        shape = Shape(positions, triangles, shape.texture, (*shape.notes, note))
    report = examine(label, shape.positions, shape.triangles, role)
    refuse(report)
    warnings = tuple(finding.sentence for finding in report.warnings)
    return replace(shape, notes=tuple(f"{label}: {note}" for note in (*shape.notes, *warnings)))


def _name(keys: Mapping[str, Any], where: str) -> str:
    name = keys.get("name", where)
    if not isinstance(name, str) or not name or not name.isprintable():
        raise InputError(f"{where}.name must be a text that can be printed, not {name!r}.")
    return name


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
    from clothsim.io.meshes import read_mesh

    refuse_unknown(f"{where} (a file)", keys, (*common, *PART))
    mesh = read_mesh(path, **{key: keys[key] for key in PART if key in keys})
    return Shape(mesh.positions, mesh.triangles, mesh.texture, mesh.messages)


def _placed(keys: Mapping[str, Any], where: str, positions: Floats) -> Floats:
    """Turned about x, then y, then z by rotation_degrees, then moved by position."""
    angles = np.radians(as_vector(f"{where}.rotation_degrees", keys.get("rotation_degrees", (0, 0, 0))))
    turn = np.eye(3)
    for axis in range(3):
        turn = rotation_matrix(angles[axis] * np.eye(3)[axis]) @ turn
    return positions @ turn.T + as_vector(f"{where}.position", keys.get("position", (0, 0, 0)))


def _fabric(keys: Mapping[str, Any], where: str) -> tuple[Fabric, str]:
    """The named fabric with the keys that override it."""
    name = keys.get("fabric", "cotton")
    if not isinstance(name, str) or name not in FABRICS:
        raise InputError(f"{where}.fabric is {name!r}.", f"Known: {', '.join(FABRICS)}.")
    own = {key: as_number(f"{where}.{key}", keys[key]) for key in FABRIC if key in keys}
    fabric = replace(FABRICS[name], **own)  # type: ignore[arg-type]
    changed = f" with its own {', '.join(own)}" if own else ""
    return fabric, f"{_name(keys, where)}: fabric {name}{changed}."
