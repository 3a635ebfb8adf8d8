"""Point caches: positions of a mesh over time, with the mesh itself as an OBJ beside each.

A cache is of one mesh. The first cloth is in the file that was named, every other surface that moves in
stem_NAME, of the same ending; a body that stays where it is has its OBJ only. Vertices have the order of the OBJ.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.safe_files.atomic import replacing, write_atomically
from clothsim.files.exchange.animation import Animation, different, plain_word
from clothsim.files.exchange.obj_sequence import still_mesh


@dataclass(frozen=True)
class PartFiles:
    """The cache of a part, None where it does not move, and its mesh."""

    cache: Path | None
    mesh: Path


def part_files(animation: Animation, target: Path) -> list[PartFiles]:
    """The files of each part; the first is a cloth. Names that are alike as file names get a number."""
    names = different([part.name for part in animation.parts[1:]], plain_word)
    stems = [target.stem, *(f"{target.stem}_{name}" for name in names)]
    return [
        PartFiles(target.with_name(f"{stem}{target.suffix}") if part.moving else None, target.with_name(f"{stem}.obj"))
        for stem, part in zip(stems, animation.parts, strict=True)
    ]


def cache_files(animation: Animation, target: Path) -> list[Path]:
    """All files."""
    own = part_files(animation, target)
    return [path for each in own for path in (each.cache, each.mesh) if path is not None]


def write_caches(animation: Animation, target: Path, header: Callable[[BinaryIO, int], None], floats: str) -> None:
    """Write all files.

    Parameters
    ----------
    animation : Animation
    target : Path
    header : function of the file and the number of vertices
        Writes what comes before the points.
    floats : str
        NumPy type of a coordinate.
    """
    parts = part_files(animation, target)
    first = animation.at(0)
    for part, shape, own in zip(animation.parts, first, parts, strict=True):
        write_atomically(own.mesh, still_mesh(part, shape))
    for number, own in enumerate(parts):
        if own.cache is None:
            continue
        with replacing(own.cache) as beside, beside.open("wb") as file:
            header(file, len(first[number].points))
            for k in range(len(animation.times)):
                file.write(_bytes(animation.at(k)[number].points, floats))


def _bytes(points: Floats, floats: str) -> bytes:
    return np.asarray(points, floats).tobytes()
