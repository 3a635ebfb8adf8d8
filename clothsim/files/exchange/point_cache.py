"""Point caches: positions of a mesh over time, with the mesh itself as an OBJ beside each.

PC2 (.pc2), little-endian: a header of 32 bytes, 12 characters "POINTCACHE2", version 1, number of points, first frame
0, frames per sample 1, number of samples; then the points of all frames in single precision. Source: the documentation
of 3ds Max, "PC2 file format". MDD (.mdd), big-endian: number of frames, number of points, the time of each frame [s],
then the points. Source: NewTek's LightWave SDK, "MDD".

A cache is of one mesh. The first cloth is in the file that was named, every other surface that moves in
stem_NAME, of the same ending; a body that stays where it is has its OBJ only. Vertices have the order of the OBJ.
"""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from clothsim.base.file_writing import replacing, write_atomically
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


def files(animation: Animation, target: Path) -> list[Path]:
    """The caches and the meshes."""
    own = part_files(animation, target)
    return [path for each in own for path in (each.cache, each.mesh) if path is not None]


def write(animation: Animation, target: Path) -> None:
    """Write the files."""
    parts, times = part_files(animation, target), np.asarray(animation.times, ">f4")
    first = animation.at(0)
    for part, shape, own in zip(animation.parts, first, parts, strict=True):
        write_atomically(own.mesh, still_mesh(part, shape))
    for number, own in enumerate(parts):
        if own.cache is None:
            continue
        points = len(first[number].points)
        if target.suffix.lower() == ".mdd":
            header, floats = struct.pack(">ii", len(times), points) + times.tobytes(), ">f4"
        else:
            header, floats = struct.pack("<12siiffi", b"POINTCACHE2\0", 1, points, 0.0, 1.0, len(times)), "<f4"
        with replacing(own.cache) as beside, beside.open("wb") as file:
            file.write(header)
            for k in range(len(times)):
                file.write(np.asarray(animation.at(k)[number].points, floats).tobytes())
