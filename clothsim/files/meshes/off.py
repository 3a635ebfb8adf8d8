"""Object File Format, as text: `OFF`, the counts, then vertices and faces of any size; colours are ignored."""

from pathlib import Path

import numpy as np

from clothsim.base.errors import InputError
from clothsim.files.meshes.polygons import Polygons


def read_off(path: Path, text: str) -> Polygons:
    """The polygons of `text`. InputError names `path` and the fault."""
    lines = [line.split("#", 1)[0].split() for line in text.splitlines()]
    lines = [words for words in lines if words]
    if not lines or lines[0][0].upper() != "OFF":
        raise InputError(f"{path} does not start with OFF.", "Only plain OFF text can be read.")
    lines[0] = lines[0][1:]
    lines = lines if lines[0] else lines[1:]
    try:
        n_vertices, n_faces = int(lines[0][0]), int(lines[0][1])
        rows, faces = lines[1 : 1 + n_vertices], lines[1 + n_vertices : 1 + n_vertices + n_faces]
        if min(n_vertices, n_faces) < 0 or len(rows) < n_vertices or len(faces) < n_faces:
            raise InputError(f"{path} ends early: it promises {n_vertices} vertices and {n_faces} faces.")
        points = np.array([[float(word) for word in row[:3]] for row in rows], float).reshape(-1, 3)
        sizes = np.array([int(face[0]) for face in faces], np.int64)
        if (sizes < 0).any() or any(len(face) <= size for face, size in zip(faces, sizes, strict=True)):
            raise InputError(f"{path} has a face with fewer corners than it says.")
        corners = [int(word) for face, size in zip(faces, sizes, strict=True) for word in face[1 : 1 + size]]
        starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        return Polygons(points, np.array(corners, np.int64), starts)
    except (ValueError, IndexError, OverflowError) as error:
        raise InputError(f"{path} cannot be read as OFF ({error}).") from error
