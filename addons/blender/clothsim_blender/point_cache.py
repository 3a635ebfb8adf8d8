"""Point caches (.pc2): frames of vertices in single precision, as Blender's modifier Mesh Cache reads them."""

import struct
from pathlib import Path

import numpy as np

HEADER = struct.Struct("<12siiffi")
SIGNATURE = b"POINTCACHE2\0"


def read_cache(path: Path) -> np.ndarray:
    """Frames (k, n, 3). ValueError for another file."""
    data = path.read_bytes()
    if len(data) < HEADER.size:
        raise ValueError(f"{path.name} is not a point cache.")
    signature, version, points, _, _, frames = HEADER.unpack_from(data)
    if signature != SIGNATURE or version != 1 or len(data) != HEADER.size + 12 * points * frames:
        raise ValueError(f"{path.name} is not a point cache.")
    return np.frombuffer(data, "<f4", offset=HEADER.size).reshape(frames, points, 3)


def write_cache(path: Path, frames: np.ndarray) -> None:
    """Write frames (k, n, 3)."""
    count, points = frames.shape[:2]
    header = HEADER.pack(SIGNATURE, 1, points, 0.0, 1.0, count)
    path.write_bytes(header + np.ascontiguousarray(frames, "<f4").tobytes())


def moved(frames: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Frames under a homogeneous matrix (4, 4): from space into the coordinates of an object."""
    return frames @ matrix[:3, :3].T.astype(float) + matrix[:3, 3]
