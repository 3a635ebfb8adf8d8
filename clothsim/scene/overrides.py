"""Overrides: one key of a scene changed from the command line."""

import tomllib
from glob import glob
from pathlib import Path
from typing import Any

from clothsim.base.errors import InputError
from clothsim.scene.paths import parts_of, replace
from clothsim.scene.scene import Scene

FILES = ("mesh", "frames", "model", "clip", "file")
"""Keys that name files."""


def override(scene: Scene, assignment: str) -> Scene:
    """The scene with one key changed.

    Parameters
    ----------
    scene : Scene
        Scene to change; it stays as it is.
    assignment : str
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
    path, equals, text = assignment.partition("=")
    if not equals or len(parts := parts_of(path)) < 2:
        raise InputError(f"--set {assignment!r} is no assignment.", "Write it as --set solver.dt=0.01.")
    value = _value(text.strip())
    if isinstance(value, str) and _is_here(value):
        value = str(Path(value).resolve())
    elif parts[-1] in FILES and isinstance(value, str):
        _refuse_missing(assignment, value, scene.directory)
    return replace(scene, path, value)


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
