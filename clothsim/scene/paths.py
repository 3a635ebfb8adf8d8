"""Keys of a scene by path: "solver.dt", "effects.gravity.acceleration", "cloth.shirt.size", "cloth[1].size".

A path is a section, the name or the number of an entry where the section has several, and keys; [k] takes an entry of a
list, as in "effects.springs.spring[0].stiffness" or "cloth.position[2]". `override` sets one from the command line.
"""

import dataclasses
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from glob import glob
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.errors import InputError
from clothsim.base.inputs import shown
from clothsim.keys.generator_keys import GENERATOR_KEYS
from clothsim.keys.key_table import KeyTable
from clothsim.keys.mesh_keys import FilePart, check_body, check_cloth, check_rigid, check_rod
from clothsim.keys.schema import keys_of
from clothsim.keys.section_hints import paths_of, section_remedy
from clothsim.keys.value_checks import refuse_unknown_key
from clothsim.scene.effects import EFFECTS
from clothsim.scene.scene import SECTIONS, Scene

SOURCES = ("mesh", "frames", "model")
"""Keys of which a cloth or body has one."""
LISTS = {"cloth": "cloths", "body": "bodies", "rigid": "rigid_bodies", "rod": "rods"}
"""Sections that may have several entries, and the attribute of a scene that has them all."""
_CHECKS: dict[str, Any] = {"cloth": check_cloth, "body": check_body, "rigid": check_rigid, "rod": check_rod}
_INSTEAD = {
    "error": "dt",
    "dt": "error",
    "tolerance": "newton_error_fraction",
    "newton_error_fraction": "tolerance",
}
_PART = re.compile(r"\[([^\[\]]+)\]|(?:^|\.)([^.\[\]]+)")
_EXAMPLES = "Write one as solver.dt, effects.gravity.acceleration, cloth.density, cloth.NAME.density or cloth[1].size."


def get(scene: Scene, path: str) -> Any:
    """The value of a key, as the scene gives it, else its default.

    Parameters
    ----------
    scene : Scene
    path : str
        "solver.dt", "effects.gravity.acceleration[2]", "cloth.shirt.size" or "cloth[1].size".

    Returns
    -------
    Any
        Of an entry, as "cloth[1]" or "effects.gravity", its section. None where the default depends on the
        scene, as that of a key of the fabric.

    Raises
    ------
    InputError
        For a path that names no key, with those that there are, and for an effect that the scene has not.

    Examples
    --------
    >>> import clothsim
    >>> scene = clothsim.Scene(cloth={"mesh": "rectangle", "size": [1, 2]}, effects=[clothsim.Gravity()])
    >>> get(scene, "cloth.size[1]"), get(scene, "solver.dt"), get(scene, "effects.gravity.acceleration")
    (2, 0.01, (0.0, 0.0, -9.81))
    """
    section, entry, keys = located(scene, path)
    value, where = _entry(scene, section, entry), f"effects.{entry}" if section == "effects" else section
    if value is None:
        raise InputError(f"The scene has no effect {entry!r}.", f"It has {', '.join(scene.effects) or 'none'}.")
    for key in keys:
        if isinstance(key, int):
            entries = value if isinstance(value, list | tuple | np.ndarray) else ()
            if key >= len(entries):
                raise InputError(f"{path}: {where} has no [{key}].", f"It is {shown(value)}.")
            value = entries[key]
        else:
            if not isinstance(value, Mapping):
                raise InputError(
                    f"{path}: {where} is not a table of keys, but {shown(value)}.", _remedy(where, value, "Name")
                )
            known = keys_of(type(value)) if isinstance(value, KeyTable) else None
            refuse_unknown_key(where, [key], known or value)
            value = getattr(value, known[key].field) if known else value[key]
        where = f"{where}[{key}]" if isinstance(key, int) else f"{where}.{key}"
    return value


def replace(scene: Scene, path: str, value: Any) -> Scene:
    """The scene with the key at a path set to a value.

    Parameters
    ----------
    scene : Scene
        Scene to change; it stays as it is.
    path : str
        As of `get`; an effect that the scene has not is added.
    value : Any
        Value of the key's type.

    Returns
    -------
    Scene
        solver.error replaces solver.dt, and tolerance newton_error_fraction, and vice versa; a new mesh replaces the
        keys of the old generator that do not fit it.

    Raises
    ------
    InputError
        For a path that names no key, with those that there are, and for a value of another type or out of range.

    Examples
    --------
    >>> import clothsim
    >>> scene = clothsim.Scene(cloth={"mesh": "rectangle", "size": [1, 1]})
    >>> replace(scene, "solver.dt", 0.02).solver
    Solver(dt=0.02)
    >>> replace(scene, "cloth.mesh", "disk").cloth
    ClothTable(mesh='disk')
    """
    return replaced(scene, [(path, value)])


def replaced(scene: Scene, changes: Iterable[tuple[str, Any]]) -> Scene:
    """The scene with several keys set as of `replace`, checked together: those that need one another, as seed.from."""
    tables: dict[tuple[str, str | int | None], Any] = {}
    for path, value in changes:
        section, entry, keys = located(scene, path)
        old = _entry(scene, section, entry)
        table = tables.get((section, entry), {} if old is None else old)
        if len(keys) > 1 and isinstance(table, Mapping) and keys[0] not in table:
            usual = _default(old, str(keys[0]))
            table = table if usual is None else {**table, keys[0]: usual}
        table = _changed(path, f"effects.{entry}" if section == "effects" else section, table, keys, value)
        if section in LISTS and keys:
            table = _drop_keys_of_old_mesh(section, table, old)
        if section == "solver":
            table.pop(_INSTEAD.get(str(keys[0])), None)
        tables[section, entry] = table
    changed: dict[str, Any] = {}
    for (section, entry), table in tables.items():
        if section == "effects":
            changed[section] = {**changed.get(section, scene.effects), entry: table}
        elif section in LISTS and isinstance(getattr(scene, section), tuple):
            entries = changed.get(section, getattr(scene, LISTS[section]))
            changed[section] = [table if k == entry else each for k, each in enumerate(entries)]
        else:
            changed[section] = table
    return dataclasses.replace(scene, **changed)


def parts_of(path: str) -> list[str | int]:
    """Names and numbers of a path: ["cloth", 1, "size", 0] of "cloth[1].size[0]". InputError for none."""
    text, parts, end = path.strip(), [], 0
    text = "" if text.startswith(".") else text
    for match in _PART.finditer(text):
        if match.start() != end:
            break
        inner, end = match[1], match.end()
        parts.append(match[2] if inner is None else int(inner) if inner.isdecimal() else inner)
    if end != len(text) or not parts:
        raise InputError(f"{shown(path)} is not a path of a key.", _EXAMPLES)
    return parts


def located(scene: Scene, path: str) -> tuple[str, str | int | None, list[str | int]]:
    """Where a path leads: its section, the name of the effect or the number of the entry, and the keys in it.

    InputError for another section, for a section alone, and for an entry that is not there or not named among several.
    """
    section, *keys = parts_of(path)
    if section not in SECTIONS:
        raise InputError(f"The scene has no key {section!r}.", section_remedy(str(section), SECTIONS))
    if not keys:
        raise InputError(f"{path!r} names a section, and no key of it.", _EXAMPLES)
    if section == "effects":
        refuse_unknown_key("effects", [str(keys[0])], EFFECTS)
        return "effects", keys[0], keys[1:]
    if section not in LISTS:
        return str(section), None, keys
    tables = getattr(scene, LISTS[str(section)])
    if not tables:
        raise InputError(f"{path}: the scene has no {section}.", f"Add a [{section}] to the scene.")
    return str(section), *select_entry(path, entry_names(str(section), tables), keys)


def entry_names(section: str, entries: Sequence[Any]) -> list[str]:
    """The names of the entries of a section; of one without a name "cloth", or "cloth[1]" where there are several."""
    several = len(entries) > 1
    return [keys.name or (f"{section}[{k}]" if several else section) for k, keys in enumerate(entries)]


def select_entry(path: str, names: Sequence[str], keys: list[str | int]) -> tuple[int, list[str | int]]:
    """The number of the entry that the first of the keys names or counts, else the only one, and the other keys."""
    first, several = keys[0], len(names) > 1
    if isinstance(first, int):
        if first >= len(names):
            there = "is one" if len(names) == 1 else f"are {len(names)}"
            raise InputError(f"{path}: there {there}.", f"They count from 0: {', '.join(names)}.")
        return first, keys[1:]
    if first in names and (several or len(keys) > 1):
        if names.count(first) > 1:
            raise InputError(f"{path}: {names.count(first)} have this name.", "Give the number, as in cloth[1].")
        return names.index(first), keys[1:]
    if several:
        section = parts_of(path)[0]
        raise InputError(
            f"{path} names none of {len(names)}.", f"Write {section}.NAME.KEY or {section}[0].KEY: {', '.join(names)}."
        )
    return 0, keys


def _entry(scene: Scene, section: str, entry: str | int | None) -> Any:
    """The section of an entry; None of an effect that the scene has not."""
    if section == "effects":
        return scene.effects.get(str(entry))
    return getattr(scene, section) if entry is None else getattr(scene, LISTS[section])[entry]


def _changed(path: str, where: str, old: Any, keys: Sequence[str | int], value: Any) -> Any:
    """A copy of nested tables and lists with the value at `keys`."""
    if not keys:
        return value
    first, *others = keys
    if isinstance(first, int):
        entries = list(old) if isinstance(old, list | tuple | np.ndarray) else []
        if first >= len(entries):
            raise InputError(f"{path}: {where} has no [{first}].", f"It is {shown(old)}.")
        entries[first] = _changed(path, f"{where}[{first}]", entries[first], others, value)
        return entries
    if not isinstance(old, Mapping):
        raise InputError(f"{path}: {where} is not a table of keys, but {shown(old)}.", _remedy(where, old, "Set"))
    inner = old.get(first, _default(old, first))
    return {**old, first: _changed(path, f"{where}.{first}", {} if inner is None else inner, others, value)}


def _remedy(where: str, value: Any, verb: str) -> str:
    """What to do with a key of something that is not a table: one of a list of tables has a number."""
    if isinstance(value, list | tuple) and any(isinstance(each, Mapping) for each in value):
        return f"It is a list of tables: {verb.lower()} a key of one, {where}[0]."
    return f"{verb} {where} itself."


def _default(section: Mapping[str, Any], key: str) -> Any:
    """The default of a key of a section; None of another table."""
    known = keys_of(type(section)) if isinstance(section, KeyTable) else {}
    return getattr(section, known[key].field) if key in known else None


def _drop_keys_of_old_mesh(section: str, new: dict[str, Any], old: Mapping[str, Any]) -> dict[str, Any]:
    """The new table without what belongs to the old mesh alone: keys of it that the new one has not, or refuses."""
    source = old.get("mesh")
    merged = dict(new)
    if sum(name in new for name in SOURCES) > 1:  # the new one replaces the old
        merged = {name: value for name, value in new.items() if name not in SOURCES or name not in old}
    if all(merged.get(name) == old.get(name) for name in SOURCES):
        return merged
    generator = GENERATOR_KEYS.get(source) if isinstance(source, str) else None
    for key in keys_of(generator or FilePart):
        if key in merged and merged[key] == old.get(key):
            try:
                _CHECKS[section](section, {name: merged[name] for name in (*SOURCES, key) if name in merged})
            except InputError:
                del merged[key]
    return merged


MOST_PATHS = 3
"""Paths that a remedy lists."""
FILES = ("mesh", "frames", "model", "clip", "file")
"""Keys that name files."""


def override(scene: Scene, *assignments: str) -> Scene:
    """The scene with some keys changed, which are checked together.

    Parameters
    ----------
    scene : Scene
        Scene to change; it stays as it is.
    *assignments : str
        "solver.dt=0.01", "effects.damping.rate=3", "body.mesh=person.obj": the value is read as TOML, and as plain text
        where it is none; the path is one of `paths.replace`. A file that exists under the current folder is meant
        there, and so are the files that match a pattern ("shell*.obj").

    Returns
    -------
    Scene
        As of `paths.replace`.

    Raises
    ------
    InputError
        For an assignment that names no key, or none of several cloths or bodies, and for a file that is not there.

    Examples
    --------
    >>> import clothsim
    >>> scene = clothsim.Scene(cloth={"mesh": "rectangle", "size": [1, 1]})
    >>> override(scene, "solver.dt=0.02").solver
    Solver(dt=0.02)
    >>> override(scene, "cloth.mesh=disk").cloth
    ClothTable(mesh='disk')
    """
    return replaced(scene, [_assigned(scene, assignment) for assignment in assignments])


def _assigned(scene: Scene, assignment: str) -> tuple[str, Any]:
    """Path and value of an assignment."""
    path, equals, text = assignment.partition("=")
    if not equals or len(parts := parts_of(path)) < 2:
        paths = paths_of(path.strip())[:MOST_PATHS] if equals else []
        written = " or ".join(f"--set {each}={text}" for each in paths) or "--set solver.dt=0.01"
        raise InputError(f"--set {assignment!r} is not an assignment.", f"Write it as {written}.")
    try:
        value = tomllib.loads(f"value = {text.strip()}")["value"]
    except (ValueError, RecursionError):
        value = text.strip()
    if isinstance(value, str) and "." in value and _is_file(Path(), value, "*" in value):
        return path, str(Path(value).resolve())
    named = parts[-1] in FILES and isinstance(value, str) and "." in Path(value).name and "\0" not in value
    if named and not _is_file(scene.directory, value, True):
        raise InputError(
            f"--set {assignment.strip()}: there is no file {value}, neither here nor in the folder of the scene.",
            "Correct the path, or give the whole one.",
        )
    return path, value


def _is_file(folder: Path, name: str, pattern: bool) -> bool:
    """True where a file of that name, or one that matches it as a pattern, is under the folder."""
    try:
        return (folder / name).is_file() or (pattern and bool(glob(str(folder / name))))
    except (OSError, ValueError):  # longer than a name may be, or with a null
        return False
