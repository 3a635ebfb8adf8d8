"""Meshes of a scene's tables: generated, read or in memory; checked, sewn, scaled and placed."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from clothsim.base.arrays import Floats, as_points
from clothsim.base.errors import InputError
from clothsim.files.meshes.mesh_file import animation_files, read_frames, read_mesh
from clothsim.files.meshes.polygons import MeshPart
from clothsim.keys.effect_tables import Motion
from clothsim.keys.fabric import BENDINGS, CURLS, HYSTERESES, SLOPES, Fabric
from clothsim.keys.fabric_table import fabric_named, fabrics_of
from clothsim.keys.generator_keys import GENERATOR_KEYS
from clothsim.keys.mesh_arrays import MeshArrays
from clothsim.keys.mesh_keys import (
    BodyTable,
    ClothTable,
    FramesTable,
    ModelTable,
    PatternFile,
    RigidTable,
    RodTable,
    check_body,
    check_cloth,
)
from clothsim.keys.schema import keys_of
from clothsim.mesh.body import Body, frame_motion, make_body, rigid_motion
from clothsim.mesh.cloth import Cloth, make_cloth
from clothsim.mesh.generators.table import GENERATORS
from clothsim.mesh.rigid_body import Joint, RigidBody, rigid_body
from clothsim.mesh.rod import Rod, make_rod
from clothsim.mesh.topology import flat_triangles
from clothsim.physics.energies.key_values import Schedule, schedule
from clothsim.scene import cloth_arrays
from clothsim.scene.assembly.shapes import PART, Shape, checked_notes, existing_file, name_of, placed, sewn, wound_alike
from clothsim.scene.scene import Scene

# Animated bodies: the frames of a sequence of files or of an array.


def body_of_files(keys: Any, where: str, directory: Path) -> tuple[Body, tuple[str, ...]]:
    """The body of a table whose `frames` name a sequence of files, and notes for the user."""
    if not keys.frames:
        raise InputError(f"{where}.frames must name files, not ''.", 'Write it as frames = "kick/shell*.obj".')
    files = animation_files(directory, keys.frames)
    part = MeshPart(**{key: getattr(keys, key) for key in PART})
    mesh, frames = read_frames(files, part, keys.frames_per_second)
    shape = Shape(mesh.positions, mesh.triangles, mesh.texture, mesh.messages)
    names = [str(file) for file in files] if len(files) == len(frames) else [f"{files[0]}"] * len(frames)
    return _animated(keys, where, shape, frames, names)


def body_of_frames(keys: Any, where: str, shape: Shape) -> tuple[Body, tuple[str, ...]]:
    """The body of a table whose mesh in memory has frames, and notes for the user; shape: the mesh, scaled."""
    frames = keys.scale * keys.mesh.frames
    return _animated(keys, where, shape, frames, [f"{where}.frames[{k}]" for k in range(len(frames))])


def _animated(
    keys: Any, where: str, shape: Shape, frames: Floats, names: Sequence[str]
) -> tuple[Body, tuple[str, ...]]:
    """The body that moves through `frames (k, n, 3)` [m], each of a name for messages."""
    rate = keys.frames_per_second
    for name, frame in zip(names, frames, strict=True):
        flat = flat_triangles(frame, shape.triangles)
        if len(flat):
            raise InputError(f"{name}: triangle {flat[0]} has no area ({len(flat)} such triangles).", "Repair it.")
    frames = placed(keys, frames)
    motion = frame_motion(frames, rate)
    if motion.still:
        note = f"{len(frames)} frame{'' if len(frames) == 1 else 's, all alike'}: a body at rest"
    else:
        note = f"{len(frames)} frames, {rate:g} a second: it moves for {motion.duration:g} s, then rests"
    label = name_of(keys, where)
    notes = checked_notes(label, Shape(shape.positions, shape.triangles, shape.texture, (*shape.notes, note)), "body")
    return make_body(label, frames[0], shape.triangles, motion), notes


MOST_EDGES = 100_000
"""Edges of a rod."""
THREADS = ("warp_stiffness", "weft_stiffness", "shear_stiffness", "thread_poisson_ratio")
EXTENSIONS = ("warp_extension", "weft_extension")
ISOTROPIC = ("density", "thickness", "youngs_modulus", "poisson_ratio", "bending_stiffness")
FABRIC = (
    *ISOTROPIC, *THREADS, *BENDINGS, *SLOPES, *CURLS, *HYSTERESES, "hysteresis_curvature", *EXTENSIONS,
)  # fmt: skip

SHRINKAGES = ("shrinkage_warp", "shrinkage_weft")
OVER_TIME = (
    "youngs_modulus", "bending_stiffness", *BENDINGS, "warp_stiffness", "weft_stiffness", "shear_stiffness", *CURLS,
    *SHRINKAGES,
)  # fmt: skip
"""Keys of a cloth that may change over time."""


def material_schedules(keys: ClothTable, where: str) -> dict[str, Schedule]:
    """The keys of a cloth that change over time, and any shrinkage.

    Raises
    ------
    InputError
        For a bad key frame, a stiffness of 0 or below, or a shrinkage of 1 or more.
    """
    found = {}
    for name in OVER_TIME:
        value = getattr(keys, name)
        if value is None or (isinstance(value, float | int) and (name not in SHRINKAGES or value == 0)):
            continue
        each = schedule(f"{where}.{name}", value)
        known = each.values if each.function is None else np.array([each.at(0.0)])
        if name in SHRINKAGES and (known >= 1).any():
            raise InputError(f"{where}.{name} reaches {known.max():g}.", "Keep it below 1: 0.1 is a tenth.")
        if name not in (*SHRINKAGES, *CURLS) and (known <= 0).any():
            fault = f"has a key frame of {known.min():g}" if each.function is None else f"is {known.min():g} at 0 s"
            raise InputError(f"{where}.{name} {fault}.", "Keep it above 0.")
        found[name] = each
    return found


def cloth_shape(keys: ClothTable, where: str, directory: Path) -> Shape:
    """The mesh of a [cloth] as generated, in memory or in its file: neither checked, sewn nor placed."""
    if isinstance(keys, PatternFile):
        from clothsim.scene.assembly.pattern_file import shape_of_pattern

        return shape_of_pattern(existing_file(f"{where}.mesh", directory, keys.mesh), keys)
    return mesh_shape(keys, where, directory)


def cloth_of(shape: Shape, keys: ClothTable, where: str, start: Floats | None = None) -> tuple[Cloth, tuple[str, ...]]:
    """The cloth of a [cloth].

    Parameters
    ----------
    shape : Shape
        Its `cloth_shape`.
    keys : ClothTable
        Its section.
    where : str
        Dotted name of the section, for messages.
    start : (n, 3) ndarray [m], optional
        Initial positions of the vertices of the shape, in place of those of the section.

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
    own = fabrics_of(f"{where}.fabric_of", shape.groups, keys.fabric_of or {})
    if keys.rest not in ("file", "vt"):
        raise InputError(f"{where}.rest is {keys.rest!r}.", 'Known: "file", "vt".')
    if keys.rest == "vt" and not len(shape.texture):
        raise InputError(f'{where}.rest is "vt", but the mesh has no texture coordinates.', 'Use rest = "file".')
    in_plane = keys.rest == "vt" or shape.flat
    if start is None and shape.start is not None:
        start = placed(keys, shape.start)
    shape = wound_alike(shape)
    if keys.weld:
        shape, start = sewn(label, shape, start, keys.weld, at_start=in_plane)
        shape = wound_alike(shape)  # panels wound the other way than their neighbours
    warnings = checked_notes(label, shape, "sewn cloth" if keys.weld or keys.sewn else "cloth")
    cloth = make_cloth(
        label,
        shape.positions,
        shape.triangles,
        fabric,
        positions=placed(keys, shape.positions) if start is None else start,
        material_coordinates=shape.texture if in_plane else None,
        velocity=np.array(keys.velocity, np.float64),
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
    return body_of(check_body("body", given), "body", Path())


def cloth_mesh(given: cloth_arrays.Cloth, weld: float) -> tuple[Cloth, tuple[str, ...]]:
    """A cloth of arrays as it is placed, and notes for the user; weld: in place of its own, if not 0 [m]."""
    keys = check_cloth("cloth", {**given, "weld": weld} if weld else given)
    return cloth_of(cloth_shape(keys, "cloth", Path()), keys, "cloth")


def body_of(keys: BodyTable | FramesTable | ModelTable, where: str, directory: Path) -> tuple[Body, tuple[str, ...]]:
    """The body of a [[body]], and notes for the user."""
    if isinstance(keys, ModelTable):
        from clothsim.scene.assembly.model_body import body_of_model

        return body_of_model(keys, where, directory)
    if isinstance(keys, FramesTable):
        return body_of_files(keys, where, directory)
    shape = mesh_shape(keys, where, directory)
    if isinstance(keys.mesh, MeshArrays) and keys.mesh.frames is not None:
        return body_of_frames(keys, where, shape)
    notes = checked_notes(name_of(keys, where), shape, "body")
    positions = placed(keys, shape.positions)
    motion: Any = keys.motion or Motion()
    centre: Any = keys.position if motion.centre is None else motion.centre
    moving = rigid_motion(motion.velocity, motion.rotate_degrees_per_second, centre)
    return make_body(name_of(keys, where), positions, shape.triangles, moving), notes


def mesh_shape(keys: ClothTable | BodyTable | RigidTable, where: str, directory: Path) -> Shape:
    """The mesh that the key `mesh` names or holds."""
    if isinstance(keys.mesh, MeshArrays):
        # copies, for kernels are compiled for writable arrays
        vertices, triangles = keys.scale * keys.mesh.vertices, keys.mesh.triangles.copy()
        none = np.zeros((0, 3, 2))
        if keys.mesh.rest is None:
            return Shape(vertices, triangles, none, (), keys.mesh.groups)
        if keys.mesh.is_flat:
            return Shape(vertices, triangles, keys.scale * keys.mesh.rest, (), keys.mesh.groups, flat=True)
        return Shape(keys.scale * keys.mesh.rest, triangles, none, (), keys.mesh.groups, start=vertices)
    if keys.mesh in GENERATORS:
        try:
            positions, triangles = GENERATORS[keys.mesh](
                **{key: getattr(keys, key) for key in keys_of(GENERATOR_KEYS[keys.mesh])}
            )
        except InputError as error:
            raise InputError(f"{where} ({keys.mesh}): {error.sentence}", error.remedy) from error
        return Shape(keys.scale * positions, triangles, np.zeros((0, 3, 2)), ())
    mesh = read_mesh(existing_file(f"{where}.mesh", directory, keys.mesh), **{key: getattr(keys, key) for key in PART})
    return Shape(mesh.positions, mesh.triangles, mesh.texture, mesh.messages, mesh.groups)


def fabric_of(keys: ClothTable, where: str) -> tuple[Fabric, str]:
    """The named fabric with the keys that override it, those over time as they are at the start.

    A Young's modulus replaces the stiffnesses of the threads, a bending stiffness those along warp, weft and bias with
    their slopes, a slope or hysteresis its values by direction.
    """
    named = fabric_named(f"{where}.fabric", keys.fabric)
    at_start = {name: each.at(0.0) for name, each in material_schedules(keys, where).items()}
    keys = keys.with_keys(**at_start) if at_start else keys
    own = {key: getattr(keys, key) for key in FABRIC if key in keys}
    ruled: dict[str, float | None] = dict.fromkeys((*THREADS, *EXTENSIONS)) if "youngs_modulus" in own else {}
    ruled |= dict.fromkeys(BENDINGS) | {"bending_slope": 0.0} if "bending_stiffness" in own else {}
    ruled |= dict.fromkeys(SLOPES[1:]) if "bending_stiffness" in own or "bending_slope" in own else {}
    ruled |= dict.fromkeys(HYSTERESES[1:]) if "bending_hysteresis" in own else {}
    try:
        fabric = replace(named, **(ruled | own))
    except InputError as error:
        raise InputError(f"{where}.{error.sentence}", error.remedy) from error
    changed = f" with its own {', '.join(own)}" if own else ""
    return fabric, f"{name_of(keys, where)}: fabric {keys.fabric}{changed}."


def rigid_body_of(keys: RigidTable, where: str, scene: Scene) -> tuple[RigidBody, tuple[str, ...]]:
    """The rigid body of a [[rigid]] table, and notes for the user. InputError for a mesh that is not a solid."""
    shape = mesh_shape(keys, where, scene.directory)
    label = name_of(keys, where)
    notes = checked_notes(label, shape, "body")
    joint, given = None, cast("Any", keys.joint)
    if given is not None:
        axis = given.axis
        if axis is not None and not np.any(axis):
            raise InputError(f"{where}.joint.axis is zero.", "Give a direction, or leave it out for a ball joint.")
        joint = Joint(np.array(given.point, np.float64), np.array((0, 0, 0) if axis is None else axis, np.float64))
    body = rigid_body(
        label,
        placed(keys, shape.positions),
        shape.triangles,
        keys.density,
        np.array(keys.velocity, np.float64),
        np.radians(np.array(keys.spin_degrees_per_second, np.float64)),
        keys.stiffness,
        joint,
    )
    return body, (*notes, f"{label}: rigid, {body.mass:.4g} kg.")


def rod_of(keys: RodTable, where: str) -> tuple[Rod, tuple[str, ...]]:
    """The rod of a [[rod]] table, and notes for the user. InputError for points that are not a line."""
    label = name_of(keys, where)
    points = placed(keys, keys.scale * as_points(f"{where}.points", keys.points))
    if keys.edge is not None and len(points) > 1:
        # points along the polyline at equal arc lengths of about `edge` [m]
        line = np.concatenate([points, points[:1]]) if keys.loop else points
        with np.errstate(over="ignore"):  # refused below
            run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        if not run[-1] / keys.edge <= MOST_EDGES:
            raise InputError(
                f"{where}.edge = {keys.edge:g} cuts it into {run[-1] / keys.edge:,.4g} edges.",
                f"Give at most {MOST_EDGES:,}.",
            )
        count = max(round(run[-1] / keys.edge), 1)
        even = np.linspace(0.0, run[-1], count + 1)
        cut = np.column_stack([np.interp(even, run, column) for column in line.T])
        points = cut[:-1] if keys.loop else cut
    section = keys.radius, keys.density, keys.youngs_modulus
    rod = make_rod(label, points, *section, is_loop=keys.loop, velocity=np.array(keys.velocity, np.float64))
    stiffness = f"EA = {rod.stretch_stiffness:.3g} N, EI = {rod.bending_stiffness:.3g} N m2"
    return rod, (f"{label}: a rod of {rod.lengths.sum():.4g} m, {len(rod.lengths)} edges, {stiffness}.",)
