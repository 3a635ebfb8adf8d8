"""Animated bodies: the frames of a sequence of files or of an array."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from clothsim.base.arrays import Floats, as_positive
from clothsim.base.errors import InputError
from clothsim.keys.mesh_arrays import MeshArrays
from clothsim.mesh.body import Body, make_body
from clothsim.mesh.degenerate import flat_triangles
from clothsim.mesh.motion import frame_motion
from clothsim.scene.assembly.placement import PART, Shape, examined, name_of, placed


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
