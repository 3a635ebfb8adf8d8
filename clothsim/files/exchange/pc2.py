"""Point cache 2 (.pc2): little-endian, header "POINTCACHE2", points of all frames in single precision.

Header of 32 bytes: 12 characters, version 1, number of points, first frame 0, frames per sample 1, number of samples.
Source: the documentation of 3ds Max, "PC2 file format".
"""

import struct
from pathlib import Path
from typing import BinaryIO

from clothsim.files.exchange.animation import Animation
from clothsim.files.exchange.point_cache import cache_files, write_caches


def files(animation: Animation, target: Path) -> list[Path]:
    """The caches and the meshes."""
    return cache_files(animation, target)


def write(animation: Animation, target: Path) -> None:
    """Write the files."""
    frames = len(animation.times)

    def header(file: BinaryIO, points: int) -> None:
        file.write(struct.pack("<12siiffi", b"POINTCACHE2\0", 1, points, 0.0, 1.0, frames))

    write_caches(animation, target, header, "<f4")
