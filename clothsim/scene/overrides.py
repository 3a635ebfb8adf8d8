"""Overrides: one key of a scene changed from the command line."""

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from glob import glob
from pathlib import Path
from typing import Any

from clothsim.base.errors import InputError
from clothsim.keys.generator_keys import GENERATOR_KEYS
from clothsim.keys.keys import refuse_unknown
from clothsim.keys.mesh_keys import FilePart, check_body, check_cloth
from clothsim.keys.rigid_keys import check_rigid
from clothsim.keys.schema import keys_of
from clothsim.scene.scene import SECTIONS, Scene

FILES = ("mesh", "frames", "model", "clip", "file")
"""Keys that name files."""
SOURCES = ("mesh", "frames", "model")
"""Keys of which a cloth or body has one."""
MESHES = {"cloth": check_cloth, "body": check_body, "rigid": check_rigid}
_INSTEAD = {
    "error": "dt",
    "dt": "error",
    "tolerance": "newton_error_fraction",
    "newton_error_fraction": "tolerance",
}


def override(scene: Scene, assignment: str) -> Scene:
    """The scene with one key changed.

    Parameters
    ----------
    scene : Scene
        Scene to change; it stays as it is.
    assignment : str
        "solver.dt=0.01", "effects.damping.rate=3", "body.mesh=person.obj": the value is read as TOML, and as plain text
        where it is none. A file that exists under the current folder is meant there, and so are the files that match a
        pattern ("shell*.obj"). In a list of cloths or bodies the first is changed.

    Returns
    -------
    Scene
        solver.error replaces solver.dt, and vice versa; a new mesh replaces the keys of the old generator.

    Raises
    ------
    InputError
        For an assignment that names no key, or a file that is not there.

    Examples
    --------
    >>> import clothsim
    >>> scene = clothsim.Scene(cloth={"mesh": "rectangle", "size": [1, 1]})
    >>> override(scene, "solver.dt=0.02").solver
    {'dt': 0.02}
    >>> override(scene, "cloth.mesh=disk").cloth
    {'mesh': 'disk'}
    """
    path, equals, text = assignment.partition("=")
    section, *keys = path.strip().split(".")
    if not equals or not keys:
        raise InputError(f"--set {assignment!r} is no assignment.", "Write it as --set solver.dt=0.01.")
    refuse_unknown("The scene", [section], SECTIONS)
    value = _value(text.strip())
    if isinstance(value, str) and _is_here(value):
        value = str(Path(value).resolve())
    elif keys[-1] in FILES and isinstance(value, str):
        _refuse_missing(assignment, value, scene.directory)
    old = getattr(scene, section)
    if section in MESHES and not isinstance(old, Mapping):
        if not old:
            raise InputError(f"--set {assignment!r}: the scene has no {section}.", f"Add a [{section}] to the scene.")
        new: Any = [_with_mesh(section, _changed(path, old[0], keys, value), old[0]), *old[1:]]
    else:
        new = _changed(path, old, keys, value)
        new = _with_mesh(section, new, old) if section in MESHES else new
    if section == "solver" and keys[0] in _INSTEAD:
        new.pop(_INSTEAD[keys[0]], None)
    changed: dict[str, Any] = {section: new}
    return replace(scene, **changed)


def set_key(scene: Scene, path: str, value: Any) -> Scene:
    """`scene` with the key at "solver.dt" or "effects.body_contact.d_hat" set to a value of its type."""
    section, *keys = path.split(".")
    changed: dict[str, Any] = {section: _changed(path, getattr(scene, section), keys, value)}
    return replace(scene, **changed)


def _changed(path: str, table: Mapping[str, Any], keys: list[str], value: Any) -> dict[str, Any]:
    """A copy of nested tables with the value at `keys`."""
    first, *others = keys
    inner = table.get(first, {})
    if others and not isinstance(inner, Mapping):
        raise InputError(f"--set {path.strip()}: {first} is no table of keys, but {inner!r}.", f"Set {first} itself.")
    return {**table, first: _changed(path, inner, others, value) if others else value}


def _with_mesh(section: str, new: dict[str, Any], old: Mapping[str, Any]) -> dict[str, Any]:
    """The new table without what belongs to the old mesh alone: keys that the new one has not, or refuses."""
    source = old.get("mesh")
    merged = dict(new)
    if sum(name in new for name in SOURCES) > 1:  # the new one replaces the old
        merged = {name: value for name, value in new.items() if name not in SOURCES or name not in old}
    if all(merged.get(name) == old.get(name) for name in SOURCES):
        return merged
    generator = GENERATOR_KEYS.get(source) if isinstance(source, str) else None
    for key in keys_of(generator or FilePart):
        if key in old and key in merged and not _fits(section, merged, key):
            del merged[key]
    return merged


def _fits(section: str, table: Mapping[str, Any], key: str) -> bool:
    """True where a cloth or body of that mesh takes the key with its value."""
    source = {name: table[name] for name in SOURCES if name in table}
    try:
        MESHES[section](section, {**source, key: table[key]})
    except InputError:
        return False
    return True


def _refuse_missing(assignment: str, name: str, directory: Path) -> None:
    """InputError for the name of a file or pattern that is neither in the current folder nor in the scene's."""
    if "." not in Path(name).name or "\0" in name:
        return
    try:
        there = (directory / name).is_file() or any(glob(str(directory / name)))
    except (OSError, ValueError):
        there = False
    if not there:
        raise InputError(
            f"--set {assignment.strip()}: there is no file {name}, neither here nor in the folder of the scene.",
            "Correct the path, or give the whole one.",
        )


def _is_here(name: str) -> bool:
    """True where a file of that name, or one that matches it as a pattern, is under the current folder."""
    if "." not in name or "\0" in name:
        return False
    try:
        return Path(name).is_file() or ("*" in name and bool(glob(name)))
    except OSError:  # longer than a name may be
        return False


def _value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return text
