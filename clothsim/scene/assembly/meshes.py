"""Meshes of a scene's tables: generated, read or in memory; checked, sewn, scaled and placed."""

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, as_number, as_positive, as_vector
from clothsim.base.errors import InputError
from clothsim.base.inputs import table
from clothsim.keys.fabric import BENDINGS, Fabric
from clothsim.keys.fabrics import fabric_named, fabrics_of
from clothsim.keys.mesh_arrays import MeshArrays
from clothsim.keys.mesh_keys import check_body, check_cloth
from clothsim.mesh.body import Body, make_body
from clothsim.mesh.cloth import Cloth, make_cloth
from clothsim.mesh.degenerate import flat_triangles
from clothsim.mesh.generators.table import GENERATORS
from clothsim.mesh.motion import frame_motion, rigid_motion
from clothsim.scene import cloth_arrays
from clothsim.scene.assembly.placement import PART, Shape, examined, existing_file, name_of, placed
from clothsim.scene.assembly.welding import sewn
from clothsim.scene.assembly.winding import wound_alike
from clothsim.scene.scene import Scene

# Animated bodies: the frames of a sequence of files or of an array.


def body_of_files(keys: Mapping[str, Any], where: str, directory: Path) -> tuple[Body, tuple[str, ...]]:
    """The body of a table whose `frames` name a sequence of files, and notes for the user."""
    from clothsim.files.meshes.mesh_part import Part
    from clothsim.files.meshes.mesh_sequence import frame_files, read_frames

    pattern = keys["frames"]
    if not isinstance(pattern, str) or not pattern or not pattern.isprintable():
        raise InputError(f"{where}.frames must name files, not {pattern!r}.", 'Write it as frames = "kick/shell*.obj".')
    files = frame_files(directory, pattern)
    rate = as_positive(f"{where}.frames_per_second", keys.get("frames_per_second", 25.0))
    mesh, frames = read_frames(files, Part(**{key: keys[key] for key in PART if key in keys}), rate)
    shape = Shape(mesh.positions, mesh.triangles, mesh.texture, mesh.messages)
    names = [str(file) for file in files] if len(files) == len(frames) else [f"{files[0]}"] * len(frames)
    return _animated(keys, where, shape, frames, names)


def body_of_frames(keys: Mapping[str, Any], where: str, shape: Shape) -> tuple[Body, tuple[str, ...]]:
    """The body of a table whose mesh in memory has frames, and notes for the user; shape: the mesh, scaled."""
    arrays: MeshArrays = keys["mesh"]
    if arrays.frames is None:
        raise ValueError("the mesh has no frames")
    frames = as_positive(f"{where}.scale", keys.get("scale", 1.0)) * arrays.frames
    return _animated(keys, where, shape, frames, [f"{where}.frames[{k}]" for k in range(len(frames))])


def _animated(
    keys: Mapping[str, Any], where: str, shape: Shape, frames: Floats, names: Sequence[str]
) -> tuple[Body, tuple[str, ...]]:
    """The body that moves through `frames (k, n, 3)` [m], each of a name for messages."""
    rate = as_positive(f"{where}.frames_per_second", keys.get("frames_per_second", 25.0))
    for name, frame in zip(names, frames, strict=True):
        flat = flat_triangles(frame, shape.triangles)
        if len(flat):
            raise InputError(f"{name}: triangle {flat[0]} has no area ({len(flat)} such triangles).", "Repair it.")
    frames = placed(keys, where, frames)
    motion = frame_motion(frames, rate)
    if motion.still:
        note = f"{len(frames)} frame{'' if len(frames) == 1 else 's, all alike'}: a body at rest"
    else:
        note = f"{len(frames)} frames, {rate:g} a second: it moves for {motion.duration:g} s, then rests"
    label = name_of(keys, where)
    notes = examined(label, Shape(shape.positions, shape.triangles, shape.texture, (*shape.notes, note)), "body")
    return make_body(label, frames[0], shape.triangles, motion), notes


THREADS = ("warp_stiffness", "weft_stiffness", "shear_stiffness", "thread_poisson_ratio")
EXTENSIONS = ("warp_extension", "weft_extension")
ISOTROPIC = ("density", "thickness", "youngs_modulus", "poisson_ratio", "bending_stiffness")
FABRIC = (*ISOTROPIC, *THREADS, *BENDINGS, *EXTENSIONS)


def cloth_shape(keys: Mapping[str, Any], where: str, directory: Path) -> Shape:
    """The mesh of a [cloth] table as generated, in memory or in its file: neither checked, sewn nor placed."""
    mesh = keys["mesh"]
    if isinstance(mesh, str) and mesh not in GENERATORS and Path(mesh).suffix.lower() == ".json":
        from clothsim.scene.assembly.pattern_file import shape_of_pattern

        return shape_of_pattern(existing_file(f"{where}.mesh", directory, mesh), keys, where)
    return mesh_shape(keys, where, directory)


def cloth_of(
    shape: Shape, keys: Mapping[str, Any], where: str, start: Floats | None = None
) -> tuple[Cloth, tuple[str, ...]]:
    """The cloth of a [cloth] table.

    Parameters
    ----------
    shape : Shape
        The table's `cloth_shape`.
    keys : dict
        The table.
    where : str
        Dotted name of the table, for messages.
    start : (n, 3) ndarray [m], optional
        Initial positions of the vertices of the shape, in place of those of the table.

    Returns
    -------
    cloth : Cloth
    notes : tuple of str
        Notes for the user.

    Notes
    -----
    Panels are sewn where their borders meet: in the mesh; with rest = "vt" and a start, in the start, for such files
    hold the panels apart. A file with sewn = true is one mesh already, in which seams of three layers are no fault.
    """
    label = name_of(keys, where)
    fabric, fabric_note = fabric_of(keys, where)
    own = fabrics_of(f"{where}.fabric_of", shape.groups, keys.get("fabric_of") or {})
    rest = keys.get("rest", "file")
    if not isinstance(rest, str) or rest not in ("file", "vt"):
        raise InputError(f"{where}.rest is {rest!r}.", 'Known: "file", "vt".')
    if rest == "vt" and not len(shape.texture):
        raise InputError(f'{where}.rest is "vt", but the mesh has no texture coordinates.', 'Use rest = "file".')
    in_plane = rest == "vt" or shape.flat
    if start is None and shape.start is not None:
        start = placed(keys, where, shape.start)
    gap = as_positive(f"{where}.weld", keys.get("weld", 0.0), zero=True)
    shape = wound_alike(shape)
    if gap:
        shape, start = sewn(label, shape, start, gap, at_start=in_plane)
        shape = wound_alike(shape)  # panels wound the other way than their neighbours
    layers = _flag(f"{where}.sewn", keys.get("sewn", False))
    warnings = examined(label, shape, "sewn cloth" if gap or layers else "cloth")
    cloth = make_cloth(
        label,
        shape.positions,
        shape.triangles,
        fabric,
        positions=placed(keys, where, shape.positions) if start is None else start,
        material_coordinates=shape.texture if in_plane else None,
        velocity=as_vector(f"{where}.velocity", keys.get("velocity", (0, 0, 0))),
        groups=shape.groups,
        texture=shape.texture,
        fabrics={panel: own[panel] for panel in shape.groups if panel in own},
        lines=shape.lines,
    )
    of_panels = tuple(f"{label}: fabric {own[panel].name} of {panel}." for panel in cloth.fabrics)
    return cloth, (*warnings, fabric_note, *of_panels)


def body_mesh(given: Scene | cloth_arrays.Body) -> tuple[Body, tuple[str, ...]]:
    """The first body of a scene, or a body of arrays, as it is placed, and notes for the user."""
    if isinstance(given, Scene):
        return body_of(given.bodies[0], "body", given.directory)
    return body_of(check_body("body", given.as_table()), "body", Path())


def cloth_mesh(given: cloth_arrays.Cloth, weld: float) -> tuple[Cloth, tuple[str, ...]]:
    """A cloth of arrays as it is placed, and notes for the user; weld: in place of its own, if not 0 [m]."""
    table = check_cloth("cloth", given.as_table() | ({"weld": weld} if weld else {}))
    return cloth_of(cloth_shape(table, "cloth", Path()), table, "cloth")


def body_of(keys: Mapping[str, Any], where: str, directory: Path) -> tuple[Body, tuple[str, ...]]:
    """The body of a [[body]] table, and notes for the user."""
    if "model" in keys:
        from clothsim.scene.assembly.model_body import body_of_model

        return body_of_model(keys, where, directory)
    if "frames" in keys:
        return body_of_files(keys, where, directory)
    shape = mesh_shape(keys, where, directory)
    if isinstance(keys["mesh"], MeshArrays) and keys["mesh"].frames is not None:
        return body_of_frames(keys, where, shape)
    notes = examined(name_of(keys, where), shape, "body")
    positions = placed(keys, where, shape.positions)
    motion = dict(table(f"{where}.motion", keys.get("motion", {})))
    motion.setdefault("centre", as_vector(f"{where}.position", keys.get("position", (0, 0, 0))))
    return make_body(name_of(keys, where), positions, shape.triangles, rigid_motion(**motion)), notes


def _flag(name: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise InputError(f"{name} is {value!r}.", "Give true or false.")
    return value


def mesh_shape(keys: Mapping[str, Any], where: str, directory: Path) -> Shape:
    """The mesh that the key `mesh` names or holds."""
    mesh = keys["mesh"]
    if isinstance(mesh, MeshArrays):
        return _from_arrays(mesh, keys, where)
    if mesh in GENERATORS:
        return _generated(mesh, keys, where)
    return _from_file(existing_file(f"{where}.mesh", directory, mesh), keys)


def _generated(name: str, keys: Mapping[str, Any], where: str) -> Shape:
    generator = GENERATORS[name]
    own = list(inspect.signature(generator).parameters)
    try:
        positions, triangles = generator(**{key: keys[key] for key in own if key in keys})
    except InputError as error:
        raise InputError(f"{where} ({name}): {error.sentence}", error.remedy) from error
    scale = as_positive(f"{where}.scale", keys.get("scale", 1.0))
    return Shape(scale * positions, triangles, np.zeros((0, 3, 2)), ())


def _from_file(path: Path, keys: Mapping[str, Any]) -> Shape:
    from clothsim.files.meshes.mesh_file import read_mesh

    mesh = read_mesh(path, **{key: keys[key] for key in PART if key in keys})
    return Shape(mesh.positions, mesh.triangles, mesh.texture, mesh.messages, mesh.groups)


def _from_arrays(mesh: MeshArrays, keys: Mapping[str, Any], where: str) -> Shape:
    """A mesh in memory; its arrays are copied, for kernels are compiled for writable ones."""
    scale = as_positive(f"{where}.scale", keys.get("scale", 1.0))
    vertices, triangles = scale * mesh.vertices, mesh.triangles.copy()
    none = np.zeros((0, 3, 2))
    if mesh.rest is None:
        return Shape(vertices, triangles, none, (), mesh.groups)
    if mesh.is_flat:
        return Shape(vertices, triangles, scale * mesh.rest, (), mesh.groups, flat=True)
    return Shape(scale * mesh.rest, triangles, none, (), mesh.groups, start=vertices)


def fabric_of(keys: Mapping[str, Any], where: str) -> tuple[Fabric, str]:
    """The named fabric with the keys that override it.

    A Young's modulus replaces the stiffnesses of the threads, a bending stiffness those along warp, weft and bias.
    """
    name = keys.get("fabric", "cotton")
    named = fabric_named(f"{where}.fabric", name)
    own = {key: as_number(f"{where}.{key}", keys[key]) for key in FABRIC if key in keys}
    ruled = dict.fromkeys((*THREADS, *EXTENSIONS)) if "youngs_modulus" in own else {}
    ruled |= dict.fromkeys(BENDINGS) if "bending_stiffness" in own else {}
    try:
        fabric = replace(named, **(ruled | own))  # type: ignore[arg-type]
    except InputError as error:
        raise InputError(f"{where}.{error.sentence}", error.remedy) from error
    changed = f" with its own {', '.join(own)}" if own else ""
    return fabric, f"{name_of(keys, where)}: fabric {name}{changed}."
