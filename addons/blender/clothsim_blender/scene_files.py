"""Files of a scene from arrays: the meshes as OBJ, and the scene as TOML."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

CLOTH_FILE, SCENE_FILE = "cloth.obj", "scene.toml"


@dataclass(frozen=True)
class Mesh:
    """An object in space: vertices (n, 3) [m] and faces, tuples of three or more vertex numbers."""

    name: str
    vertices: np.ndarray
    faces: Sequence[Sequence[int]]


@dataclass(frozen=True)
class Settings:
    """What the panel asks for.

    fabric: a named fabric; duration: simulated time [s]; frames_per_second: rate of the frames; friction: coefficient;
    self_contact: whether the cloth collides with itself; pins: pinned vertices.
    """

    fabric: str = "cotton"
    duration: float = 2.0
    frames_per_second: float = 24.0
    friction: float = 0.3
    self_contact: bool = True
    damping: float = 2.0
    pins: Sequence[int] = field(default_factory=tuple)


def obj_text(mesh: Mesh) -> str:
    """A mesh as Wavefront OBJ, its vertices in their order."""
    lines = [f"o {mesh.name}"]
    lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in np.asarray(mesh.vertices, float).tolist()]
    lines += ["f " + " ".join(str(vertex + 1) for vertex in face) for face in mesh.faces]
    return "\n".join(lines) + "\n"


def scene_text(cloth: str, bodies: Sequence[tuple[str, str, bool]], settings: Settings) -> str:
    """The scene as TOML; bodies: name, file or pattern of files, and whether it moves."""
    quoted = json.dumps
    lines = [
        "[cloth]",
        f"mesh = {quoted(CLOTH_FILE)}",
        f"name = {quoted(cloth)}",
        f"fabric = {quoted(settings.fabric)}",
    ]
    for name, file, moves in bodies:
        lines += ["", "[[body]]", f"name = {quoted(name)}"]
        lines += [f"frames = {quoted(file)}", f"frames_per_second = {settings.frames_per_second:g}"] if moves else []
        lines += [] if moves else [f"mesh = {quoted(file)}"]
    lines += ["", "[effects.inertia]", "[effects.membrane]", "[effects.bending]", "[effects.gravity]"]
    if settings.damping > 0:
        lines += ["[effects.damping]", f"rate = {settings.damping:g}"]
    if bodies:
        lines += ["[effects.body_contact]"]
    if settings.self_contact:
        lines += ["[effects.self_contact]"]
    if settings.friction > 0 and (bodies or settings.self_contact):
        lines += ["[effects.friction]", f"coefficient = {settings.friction:g}"]
    if len(settings.pins):
        lines += ["[effects.pins]", f"select = {[int(vertex) for vertex in settings.pins]}"]
    lines += ["", "[run]", f"duration = {settings.duration:g}", f"frames_per_second = {settings.frames_per_second:g}"]
    return "\n".join(lines) + "\n"


def write_scene(folder: Path, cloth: Mesh, bodies: Sequence[Sequence[Mesh]], settings: Settings) -> Path:
    """Write meshes and scene into a folder; bodies: the frames of each, one for a body at rest.

    Returns the scene's file.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / CLOTH_FILE).write_text(obj_text(cloth), encoding="utf-8")
    named = []
    for number, frames in enumerate(bodies):
        moves = len(frames) > 1
        for old in folder.glob(f"body{number}*.obj"):
            old.unlink()
        for k, frame in enumerate(frames):
            name = f"body{number}_{k:05d}.obj" if moves else f"body{number}.obj"
            (folder / name).write_text(obj_text(frame), encoding="utf-8")
        named.append((frames[0].name, f"body{number}_*.obj" if moves else f"body{number}.obj", moves))
    scene = folder / SCENE_FILE
    scene.write_text(scene_text(cloth.name, named, settings), encoding="utf-8")
    return scene
