"""Stanford PLY, a file a frame: all surfaces as one mesh, with normals, colours, texture and stretch of the vertices.

Binary little endian. Faces have corners only, which every reader takes. Vertices are split where texture coordinates
differ: of each surface first its vertices in their order, then the copies. `surface` is the number of the surface,
whose name is in a comment of the header; `stretch` the mean at the vertex, 1 for bodies.
"""

from pathlib import Path

import numpy as np

from clothsim.base.file_writing import write_atomically
from clothsim.files.exchange.animation import Animation, Part, PartFrame, split_vertices, vertex_means
from clothsim.files.exchange.obj_sequence import files

__all__ = ["files", "write"]

BODY_GREY = 0.75
"""sRGB of the vertices that have no colour."""
_TYPES = {"<f8": "double", "<f4": "float", "|u1": "uchar", "<i4": "int"}
_VERTEX = np.dtype(
    [
        *((name, "<f8") for name in ("x", "y", "z")),
        *((name, "<f4") for name in ("nx", "ny", "nz", "s", "t", "stretch")),
        *((name, "u1") for name in ("red", "green", "blue")),
        ("surface", "<i4"),
    ]
)
_FACE = np.dtype([("count", "u1"), ("vertex_indices", "<i4", (3,))])


def write(animation: Animation, target: Path) -> None:
    """Write the files."""
    for k, path in enumerate(files(animation, target)):
        write_atomically(path, frame_bytes(animation, k))


def frame_bytes(animation: Animation, frame: int) -> bytes:
    """The file of a frame."""
    vertices, faces, count = [], [], 0
    for number, (part, shape) in enumerate(zip(animation.parts, animation.at(frame), strict=True)):
        rows, triangles = _part(part, shape)
        rows["surface"] = number
        corners = np.zeros(len(triangles), _FACE)
        corners["count"], corners["vertex_indices"] = 3, triangles + count
        vertices.append(rows)
        faces.append(corners)
        count += len(rows)
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment clothsim, {animation.times[frame]:.9g} s, 1 unit = {animation.unit:.9g} m, {animation.up} up",
        *(f"comment surface {number} {part.name}" for number, part in enumerate(animation.parts)),
        f"element vertex {count}",
        *(f"property {_TYPES[_VERTEX[name].str]} {name}" for name in _VERTEX.names or ()),
        f"element face {sum(map(len, faces))}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    return "\n".join(header).encode() + b"".join(each.tobytes() for each in (*vertices, *faces))


def _part(part: Part, shape: PartFrame) -> tuple[np.ndarray, np.ndarray]:
    """The vertices of a surface, and its triangles by their rows."""
    split, triangles, texture = split_vertices(part, len(shape.points))
    rows = np.zeros(len(split), _VERTEX)
    colours = shape.colours[split] if len(shape.colours) else np.full((len(split), 3), BODY_GREY)
    stretch = vertex_means(shape.stretch, part.triangles, len(shape.points))[split] if len(shape.stretch) else 1.0
    for name, column in zip("xyz", shape.points[split].T, strict=True):
        rows[name] = column
    for name, column in zip(("nx", "ny", "nz"), shape.normals[split].T, strict=True):
        rows[name] = column
    for name, column in zip(("red", "green", "blue"), np.rint(255 * colours).T, strict=True):
        rows[name] = column
    rows["stretch"] = stretch
    if len(texture):
        rows["s"], rows["t"] = texture.T
    return rows, triangles
