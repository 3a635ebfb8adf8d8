"""The files that a scene names: meshes, the frames of animated bodies, numbers over the cloth, and the seed."""

import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from clothsim.base.errors import InputError
from clothsim.mesh.generators.table import GENERATORS
from clothsim.scene.assembly.array_files import named_arrays
from clothsim.scene.scene import Scene, scene_from_text

FOLDER = "meshes"
"""The folder of an archive that holds them."""


def relocated(scene: Scene) -> tuple[str, dict[str, Path]]:
    """The scene as text with its files in FOLDER, and the present path of each file by its new name.

    InputError where the scene names a file that does not exist.
    """
    data = json.loads(scene.to_text())
    files: dict[str, Path] = {}
    for owner, table, key in _named(data):
        if key == "frames":
            files.update(_frames(scene.directory, table[key], f"{FOLDER}/{owner}"))
            table[key] = f"{FOLDER}/{owner}/*"
        else:
            source = scene.directory / table[key]
            table[key] = f"{FOLDER}/{owner}/{_plain(source.name)}"
            files[table[key]] = source
    for source in files.values():
        if not source.is_file():
            raise InputError(f"The scene's file {source} is not there.", "Put it back where the scene names it.")
    return json.dumps({**data, "directory": "."}), files


def named_files(scene: Scene) -> list[str]:
    """The files that a scene names, as it names them; of an animation the pattern."""
    return [str(table[key]) for _, table, key in _named(json.loads(scene.to_text(names_of_functions=True)))]


def refuse_outside(text: str, files: Iterable[str] = ()) -> None:
    """InputError for a text that is no scene, or that names a file outside of its own folder, or for such `files`."""
    try:
        scene_from_text(text)
        data = json.loads(text)
        named = [str(table[key]) for _, table, key in _named(data)]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"The scene in the archive is broken ({error}).") from error
    if data.get("directory") != ".":
        raise InputError("The scene in the archive does not start at its own folder.")
    for name in (*named, *files):
        paths = PurePosixPath(name), PureWindowsPath(name)
        if any(path.is_absolute() or path.drive or ".." in path.parts for path in paths):
            raise InputError(f"The scene in the archive names {name}, which is outside of it.")


def _named(data: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], str]]:
    """Each key of a scene that names files: a name for its owner, its table, the key."""
    for section in ("cloth", "body"):
        tables = data[section]
        for k, table in enumerate([tables] if isinstance(tables, dict) else tables):
            if isinstance(table.get("mesh"), str) and table["mesh"] not in GENERATORS:  # one in memory is in the text
                yield f"{section}{k}", table, "mesh"
            if "model" in table and table["model"] != "mannequin":
                yield f"{section}{k}", table, "model"
            if "model" in table:
                yield from _named_clip(f"{section}{k}_motion", table)
            if "frames" in table:
                yield f"{section}{k}", table, "frames"
    for name, keys in data["effects"].items():
        yield from named_arrays(f"effect_{name}", keys)
    if data["seed"].get("file"):
        yield "seed", data["seed"], "file"


def _named_clip(owner: str, table: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], str]]:
    """The file of the motion of a body model."""
    from clothsim.files.characters.gait import CLIPS

    motion = table.get("motion")
    keyed = (motion, "clip") if isinstance(motion, dict) else (table, "motion")
    if motion and keyed[0][keyed[1]] not in (*CLIPS, "own"):
        yield owner, *keyed


def _frames(directory: Path, pattern: str, folder: str) -> dict[str, Path]:
    """The files of an animation by new names, numbered in their order."""
    from clothsim.files.meshes.mesh_file import frame_files

    files = frame_files(directory, pattern)
    return {f"{folder}/{k:06d}_{_plain(file.name)}": file for k, file in enumerate(files)}


def _plain(name: str) -> str:
    """A file name that is valid on every system."""
    return re.sub(r"[^\w.\-]", "_", name)
