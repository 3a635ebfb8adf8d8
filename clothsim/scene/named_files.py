"""Files that a scene names: meshes, frames of animated bodies, arrays over the cloth, the seed."""

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_numbers
from clothsim.keys.key_table import KeyTable
from clothsim.scene.named_keys import named_keys, names_array
from clothsim.scene.paths import FILES
from clothsim.scene.scene import Scene, scene_from_text


def with_arrays(where: str, value: Any, directory: Path) -> Any:
    """A value with the arrays of the .npy files that its tables name; the value itself where they name none.

    where: dotted name of the value, for messages; value: a section, a table, or one of its values; directory: folder at
    which relative file names start. InputError where a file is missing or has no numeric data.
    """
    if isinstance(value, Mapping):
        read = {key: with_arrays(f"{where}.{key}", inner, directory) for key, inner in value.items()}
        if all(read[key] is inner for key, inner in value.items()):
            return value
        return type(value).parsed(where, read) if isinstance(value, KeyTable) else read
    if not names_array(value):
        return value
    path = directory / value
    if not path.name.isprintable():
        raise InputError(f"{where} is {path.name!r}, which names no file.", "Name a .npy file.")
    try:
        return read_numbers(path)
    except InputError as error:
        remedy = error.remedy or f"Its path starts at {path.parent}/: correct {where}."
        raise InputError(f"{where}: {error.sentence}", remedy) from error


def by_content(value: Any, folder: Path, key: str = "") -> Any:
    """Tables whose names of files are replaced by hashes of their content."""
    if isinstance(value, dict):
        return {name: by_content(inner, folder, name) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [by_content(inner, folder, key) for inner in value]
    if isinstance(value, str) and key in FILES and "." in value and (folder / value).is_file():
        file = folder / value
        return _file_hash(file, file.stat().st_mtime_ns)
    return value


@cache
def _file_hash(file: Path, changed: int) -> str:
    """sha256 of a file; changed: time of its last change, so that a process reads it once."""
    return f"sha256:{hashlib.sha256(file.read_bytes()).hexdigest()}"


FOLDER = "meshes"
"""The folder of an archive that holds them."""


def relocated(scene: Scene) -> tuple[str, dict[str, Path]]:
    """The scene as text with its files in FOLDER, and the present path of each file by its new name.

    InputError where the scene names a file that does not exist.
    """
    data = json.loads(scene.to_text())
    files: dict[str, Path] = {}
    for owner, table, key in named_keys(data):
        if key == "frames":
            from clothsim.files.meshes.mesh_file import animation_files

            frames = enumerate(animation_files(scene.directory, table[key]))
            files.update({f"{FOLDER}/{owner}/{k:06d}_{_plain(file.name)}": file for k, file in frames})
            table[key] = f"{FOLDER}/{owner}/*"
        else:
            source = scene.directory / table[key]
            table[key] = f"{FOLDER}/{owner}/{_plain(source.name)}"
            files[table[key]] = source
    for source in files.values():
        if not source.is_file():
            raise InputError(f"The scene's file {source} is not there.", "Put it back where the scene names it.")
    return json.dumps({**data, "directory": "."}), files


def refuse_outside(text: str, files: Iterable[str] = ()) -> None:
    """InputError for text that is not a scene, or that names a file outside of its own folder, or for such `files`."""
    try:
        scene_from_text(text)
        data = json.loads(text)
        named = [str(table[key]) for _, table, key in named_keys(data)]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"The scene in the archive is broken ({error}).") from error
    if data.get("directory") != ".":
        raise InputError("The scene in the archive does not start at its own folder.")
    for name in (*named, *files):
        paths = PurePosixPath(name), PureWindowsPath(name)
        if any(path.is_absolute() or path.drive or ".." in path.parts for path in paths):
            raise InputError(f"The scene in the archive names {name}, which is outside of it.")


def _plain(name: str) -> str:
    """A file name that is valid on every system."""
    return re.sub(r"[^\w.\-]", "_", name)
