"""Losses on the command line: a name, and its value behind "="."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import clothsim
from clothsim import gradients, patterns
from clothsim.base.errors import InputError
from clothsim.cli.arguments import as_length

if TYPE_CHECKING:
    from clothsim import Loss, Scene
    from clothsim.engine import World
    from clothsim.patterns import PatternMesh

LOSSES = {
    "height": "mean height of the cloth [m]",
    "hem": "mean height of the side of its border that hangs lowest [m]",
    "silhouette": "area of its shadow on the ground [m2]",
    "girth=HEIGHT": "length of its cut with the plane z = HEIGHT [m]",
    "target=FILE": "mean squared distance to a drape: a mesh, points (.xyz) or a run [m2]",
}
"""Losses by the form in which they are given."""

_VALUES: dict[str, Callable[[str], float | Path] | None] = {
    "height": None,
    "hem": None,
    "silhouette": None,
    "girth": float,
    "target": Path,
}
"""What stands behind the "=" of each."""


def loss_of(text: str, world: "World", option: str = "--loss") -> "Loss":
    """Return the loss that a text such as "girth=0.8" names. InputError, with the option's name, for another text."""
    name, _, value = (part.strip() for part in text.partition("="))
    if name not in _VALUES or bool(value) != (_VALUES[name] is not None):
        raise InputError(f"{option} {text!r} is no loss.", f"Give {', '.join(LOSSES)}.")
    kind = _VALUES[name]
    try:
        return gradients.named_loss(name, world, None if kind is None else kind(value))
    except ValueError as error:
        raise InputError(f"{option} {text}: {value!r} is no height.", "Write it as girth=0.8, in metres.") from error


def words(option: str, text: str, example: str = "youngs_modulus,bending_stiffness") -> list[str]:
    """Return the names of a list such as "youngs_modulus,bending_stiffness". InputError where there is none."""
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise InputError(f"{option} names nothing.", f"Give some, such as {option} {example}.")
    return names


def meshed(file: Path, size: str) -> "PatternMesh":
    """Return the mesh of a pattern file with a size such as "2cm", as a dressed garment has it."""
    return patterns.mesh_pattern(patterns.read_specification(file), as_length("--size", size))


def scene_or_run(path: Path) -> "Scene":
    """Return the scene of a file, of an installed name, or of the run in a directory."""
    return clothsim.open_run(path).scene if path.is_dir() else clothsim.load_scene(path)
