"""An animated body: a [[body]] table whose `frames` name a sequence of files."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from clothsim.arrays import as_positive
from clothsim.build.placement import PART, Shape, examined, name_of, placed
from clothsim.errors import InputError
from clothsim.mesh.body import Body, make_body
from clothsim.mesh.degenerate import flat_triangles
from clothsim.mesh.motion import frame_motion
from clothsim.scene.keys import refuse_unknown

KEYS = ("name", "frames", "frames_per_second", "position", "rotation_degrees", *PART)


def animated_body(keys: Mapping[str, Any], where: str, directory: Path) -> tuple[Body, tuple[str, ...]]:
    """The body of a table with `frames`, and what the user should know of it."""
    from clothsim.io.mesh_file import Part
    from clothsim.io.mesh_sequence import frame_files, read_frames

    for other in ("mesh", "motion"):
        if other in keys:
            raise InputError(f"{where} has frames and {other}.", f"Give {other} or frames, not both.")
    refuse_unknown(f"{where} (frames)", keys, KEYS)
    pattern, label = keys["frames"], name_of(keys, where)
    if not isinstance(pattern, str) or not pattern or not pattern.isprintable():
        raise InputError(f"{where}.frames must name files, not {pattern!r}.", 'Write it as frames = "kick/shell*.obj".')
    rate = as_positive(f"{where}.frames_per_second", keys.get("frames_per_second", 25.0))
    files = frame_files(directory, pattern)
    mesh, frames = read_frames(files, Part(**{key: keys[key] for key in PART if key in keys}))
    for file, frame in zip(files, frames, strict=True):
        flat = flat_triangles(frame, mesh.triangles)
        if len(flat):
            raise InputError(f"{file}: triangle {flat[0]} has no area ({len(flat)} such triangles).", "Repair it.")
    frames = placed(keys, where, frames)
    motion = frame_motion(frames, rate)
    if motion.still:
        said = f"{len(frames)} frame{'' if len(frames) == 1 else 's, all alike'}: a body that stands still"
    else:
        said = f"{len(frames)} frames, {rate:g} a second: it moves for {motion.duration:g} s, then stands still"
    notes = examined(label, Shape(mesh.positions, mesh.triangles, mesh.texture, (*mesh.messages, said)), "body")
    return make_body(label, frames[0], mesh.triangles, motion), notes
