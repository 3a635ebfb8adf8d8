"""MDD point cache (.mdd): big-endian, times of the frames, points of all frames in single precision.

Number of frames, number of points, the time of each frame [s], then the points. Source: NewTek's LightWave SDK, "MDD".
"""

import struct
from pathlib import Path
from typing import BinaryIO

import numpy as np

from clothsim.files.exchange.animation import Animation
from clothsim.files.exchange.point_cache import cache_files, write_caches


def files(animation: Animation, target: Path) -> list[Path]:
    """The caches and the meshes."""
    return cache_files(animation, target)


def write(animation: Animation, target: Path) -> None:
    """Write the files."""

    def header(file: BinaryIO, points: int) -> None:
        file.write(struct.pack(">ii", len(animation.times), points))
        file.write(np.asarray(animation.times, ">f4").tobytes())

    write_caches(animation, target, header, ">f4")
