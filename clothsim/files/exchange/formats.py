"""Table of the formats that runs are exported to."""

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast

from clothsim.base.errors import InputError
from clothsim.files.exchange.animation import Animation


class Writer(Protocol):
    """A module of a format."""

    def files(self, animation: Animation, target: Path) -> list[Path]:
        """The files that `write` makes."""

    def write(self, animation: Animation, target: Path) -> None:
        """Write the files."""


@dataclass(frozen=True)
class Format:
    """A file format.

    Attributes
    ----------
    module : str
        Module beside this one with `files` and `write`.
    meaning : str
        Name of the format and who reads it.
    up : str
        The only up axis of the format; "" where it takes any.
    metres : bool
        True where the format's unit is the metre.
    relative : bool
        True where points may be relative to an origin that the file gives in double precision.
    polygons : bool
        True where faces may have more than three corners.
    timed : bool
        True where frames have times; else they are played evenly.
    """

    module: str
    meaning: str
    up: str = ""
    metres: bool = False
    relative: bool = False
    polygons: bool = True
    timed: bool = True

    @property
    def writer(self) -> Writer:
        """The module, imported."""
        return cast("Writer", importlib.import_module(f"clothsim.files.exchange.{self.module}"))


FORMATS: dict[str, Format] = {
    ".obj": Format("sequences", "Wavefront OBJ, a file a frame", timed=False),
    ".ply": Format("sequences", "Stanford PLY, a file a frame, with stretch and colours", timed=False),
    ".pc2": Format("sequences", "point cache 2 of Blender, 3ds Max and Houdini, with the mesh as OBJ", timed=False),
    ".mdd": Format("sequences", "point cache MDD of Blender, Houdini and LightWave, with the mesh as OBJ"),
    ".glb": Format("glb", "binary glTF 2.0 with morph targets", up="y", metres=True, relative=True, polygons=False),
    ".usdc": Format("usd", "binary USD with time samples", relative=True),
    ".usda": Format("usd", "USD as text with time samples", relative=True),
    ".usd": Format("usd", "USD with time samples", relative=True),
    ".vtkhdf": Format("vtkhdf", "VTKHDF of ParaView and pyvista", polygons=False),
}
"""Formats by the ending of a file."""


def format_of(target: Path) -> Format:
    """The format of a file by its ending. InputError for another ending."""
    if target.suffix.lower() not in FORMATS:
        raise InputError(f"{target.name} has an ending of no known format.", f"Known are {', '.join(FORMATS)}.")
    return FORMATS[target.suffix.lower()]
