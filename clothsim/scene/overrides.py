"""Changing one key of a scene from the command line."""

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from glob import glob
from pathlib import Path
from typing import Any

from clothsim.errors import InputError
from clothsim.scene.keys import refuse_unknown
from clothsim.scene.scene import SECTIONS, Scene

_INSTEAD = {"error": "dt", "dt": "error"}


def override(scene: Scene, assignment: str) -> Scene:
    """The scene with one key changed: "solver.dt=0.01", "effects.damping.rate=3", "body.mesh=person.obj".

    The value is read as TOML, and as plain text where it is none. A file that exists under the current folder is meant
    there, and so are the files that match a pattern ("shell*.obj"). In a list of cloths or bodies the first is changed.
    solver.error takes the place of solver.dt, and the other way round.
    InputError for an assignment that names no key.
    """
    path, equals, text = assignment.partition("=")
    section, *keys = path.strip().split(".")
    if not equals or not keys:
        raise InputError(f"--set {assignment!r} is no assignment.", "Write it as --set solver.dt=0.01.")
    refuse_unknown("The scene", [section], SECTIONS)
    value = _value(text.strip())
    if isinstance(value, str) and _is_here(value):
        value = str(Path(value).resolve())
    old = getattr(scene, section)
    if section in ("cloth", "body") and not isinstance(old, Mapping):
        if not old:
            raise InputError(f"--set {assignment!r}: the scene has no {section}.")
        new: Any = [_changed(old[0], keys, value), *old[1:]]
    else:
        new = _changed(old, keys, value)
    if section == "solver" and keys[0] in _INSTEAD:
        new.pop(_INSTEAD[keys[0]], None)
    changed: dict[str, Any] = {section: new}
    return replace(scene, **changed)


def _changed(table: Mapping[str, Any], keys: list[str], value: Any) -> dict[str, Any]:
    """A copy of nested tables with the value at `keys`."""
    first, *others = keys
    inner = table.get(first, {})
    if others and not isinstance(inner, Mapping):
        raise InputError(f"--set: {first} is no table of keys.")
    return {**table, first: _changed(inner, others, value) if others else value}


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
