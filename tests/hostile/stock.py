"""Small good inputs that the cases spoil: scenes, meshes in every format, a pattern, a run, a farm."""

import io
import os
import struct
import subprocess
import sys
import tempfile
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import trimesh

ROOT = Path(__file__).parents[2]

SHEET = """\
[cloth]
mesh = "rectangle"
cells = [4, 4]
position = [0.0, 0.0, 0.31]
[[body]]
name = "ball"
mesh = "sphere"
radius = 0.3
subdivisions = 1
[effects.inertia]
[effects.membrane]
[effects.gravity]
[effects.body_contact]
[solver]
linear = "superlu"
threads = 1
[run]
duration = 0.04
"""
FREE = """\
[cloth]
mesh = "rectangle"
cells = [4, 4]
[effects.inertia]
[effects.gravity]
[solver]
linear = "superlu"
threads = 1
[run]
duration = 0.08
"""
LONG = SHEET.replace("duration = 0.04", "duration = 60.0\nframes_per_second = 50")
RECIPE = '[farm]\nscene = "sheet.toml"\ncount = 2\nuntil = "time"\n[vary]\n"cloth.density" = { uniform = [0.1, 0.3] }\n'


def changed(old: str, new: str, text: str = SHEET) -> str:
    """A scene with one change."""
    assert old in text, old
    return text.replace(old, new)


def with_mesh(name: str) -> str:
    """The sheet with its mesh of a file."""
    return changed('"rectangle"\ncells = [4, 4]', f'"{name}"')


def with_body(lines: str) -> str:
    """The sheet with another body."""
    return changed('name = "ball"\nmesh = "sphere"\nradius = 0.3\nsubdivisions = 1', lines)


FORMS: dict[str, dict[str, Any] | None] = {
    "ply": {},
    "ply, text": {"binary": False},
    "vtk": {},
    "vtk, text": {"binary": False},
    "vtu": {},
    "vtu, text": {"binary": False},
    "msh": {"file_format": "gmsh"},
    "msh, text": {"file_format": "gmsh22", "binary": False},
    "stl": None,
    "obj": None,
    "off": None,
    "glb": None,
}
"""How a mesh is written: keywords of meshio, None for trimesh."""


def ending(form: str) -> str:
    """Ending of the files of a form."""
    return f".{form.split(',', maxsplit=1)[0]}"


@cache
def meshes() -> dict[str, bytes]:
    """A ball of 12 vertices in every form."""
    ball, written = trimesh.creation.icosphere(0, 0.5), {}
    with tempfile.TemporaryDirectory() as folder:
        for form, keywords in FORMS.items():
            path = Path(folder) / f"ball{ending(form)}"
            if keywords is None:
                ball.export(path)
            else:
                meshio.write(path, meshio.Mesh(ball.vertices, [("triangle", ball.faces)]), **keywords)
            written[form] = path.read_bytes()
        path = Path(folder) / "ball.usdc"
        if _usd(path, ball):
            written["usdc"] = path.read_bytes()
            written["usda"] = path.with_suffix(".usda").read_bytes()
    return written


def _usd(path: Path, ball: trimesh.Trimesh) -> bool:
    try:
        from pxr import Usd, UsdGeom
    except ImportError:
        return False
    for target in (path, path.with_suffix(".usda")):
        stage = Usd.Stage.CreateNew(str(target))
        mesh = UsdGeom.Mesh.Define(stage, "/ball")
        mesh.GetPointsAttr().Set([tuple(map(float, point)) for point in ball.vertices])
        mesh.GetFaceVertexCountsAttr().Set([3] * len(ball.faces))
        mesh.GetFaceVertexIndicesAttr().Set(ball.faces.ravel().tolist())
        stage.SetStartTimeCode(0)
        stage.SetEndTimeCode(1)
        stage.GetRootLayer().Save()
    return True


def glb(document: str, binary: bytes = b"") -> bytes:
    """A .glb file of a JSON text."""
    text = document.encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<2I", len(text), 0x4E4F534A) + text
    if binary:
        chunks += struct.pack("<2I", len(binary), 0x004E4942) + binary
    return struct.pack("<4s2I", b"glTF", 2, 12 + len(chunks)) + chunks


def npz(compressed: bool = False, **arrays: Any) -> bytes:
    """A NumPy archive."""
    content = io.BytesIO()
    (np.savez_compressed if compressed else np.savez)(content, **arrays)
    return content.getvalue()


def npy(array: Any) -> bytes:
    """A NumPy file."""
    content = io.BytesIO()
    np.save(content, array, allow_pickle=True)
    return content.getvalue()


def archive(**entries: bytes) -> bytes:
    """A zip archive; __ in a name is a slash."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as packed:
        for name, data in entries.items():
            packed.writestr(name.replace("__", "/"), data)
    return content.getvalue()


def with_members(content: bytes, **changes: bytes | None) -> bytes:
    """A zip archive with members of another content, or without them (None)."""
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(made, "w") as new:
        for name in old.namelist():
            change = changes.get(name.replace(".npy", "").replace(".", "_"), old.read(name))
            if change is not None:
                new.writestr(name, change)
    return made.getvalue()


def _made(texts: dict[str, str], *lines: str) -> dict[str, bytes]:
    """What commands leave of some files, by name; None of a directory is left out."""
    with tempfile.TemporaryDirectory() as folder:
        for name, text in texts.items():
            (Path(folder) / name).write_text(text)
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "CLOTHSIM_RENDERER": "ray"}
        for line in lines:
            command = [sys.executable, "-m", "clothsim", *line.split()]
            subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True)
        found = {str(path.relative_to(folder)): path for path in Path(folder).rglob("*") if path.is_file()}
        return {name: path.read_bytes() for name, path in found.items()}


@cache
def run() -> dict[str, bytes]:
    """A completed run of the sheet in run/, its scene, and its archive run.zip."""
    return _made({"sheet.toml": SHEET}, "run sheet.toml -o run --no-picture", "bundle run")


@cache
def farm() -> dict[str, bytes]:
    """A farm of two drapes, done, in farm/, with its recipe and scene."""
    texts = {"sheet.toml": SHEET, "recipe.toml": RECIPE}
    return _made(texts, "farm plan recipe.toml -o farm", "farm work farm")


def pattern(**changes: Any) -> dict[str, Any]:
    """Two squares that are sewn together on one side, as a specification; keys of "pattern" are changed."""
    square = {
        "vertices": [[0, 0], [0, 40], [40, 40], [40, 0]],
        "edges": [{"endpoints": [k, (k + 1) % 4]} for k in range(4)],
        "translation": [0, 0, 20],
        "rotation": [0, 0, 0],
    }
    back = {**square, "translation": [0, 0, -20]}
    sides = [{"panel": "front", "edge": 0}, {"panel": "back", "edge": 0}]
    return {
        "pattern": {"panels": {"front": square, "back": back}, "stitches": [sides], **changes},
        "properties": {"units_in_meter": 100, "curvature_coords": "relative"},
    }
