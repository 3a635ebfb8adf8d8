"""Stanford PLY, a file a frame: all surfaces as one mesh, with normals, colours, texture, stretch and their numbers.

Binary little endian. Vertices: x, y, z (double), normal, colour, number of the surface. Faces: corners, texture
coordinates of the corners where a surface has them (`texcoord`, 0 for those without), stretch (1 for bodies), number of
the surface and of the panel (-1 without one); the comments of the header give the names of the numbers.
"""

from pathlib import Path

import numpy as np

from clothsim.io.atomic import write_atomically
from clothsim.io.exchange.animation import Animation, PartFrame
from clothsim.io.exchange.obj_sequence import files

__all__ = ["files", "write"]

BODY_GREY = 0.75
"""sRGB of the vertices that have no colour."""
_TYPES = {"<f8": "double", "<f4": "float", "u1": "uchar", "<i4": "int"}


def write(animation: Animation, target: Path) -> None:
    """Write the files."""
    for k, path in enumerate(files(animation, target)):
        write_atomically(path, frame_bytes(animation, k))


def frame_bytes(animation: Animation, frame: int) -> bytes:
    """The file of a frame."""
    shapes = animation.at(frame)
    vertices, faces = _vertices(shapes), _faces(animation, shapes)
    header = ["ply", "format binary_little_endian 1.0"]
    header.append(
        f"comment clothsim, {animation.times[frame]:.9g} s, 1 unit = {animation.unit:.9g} m, {animation.up} up"
    )
    header += [f"comment surface {k} {part.name}" for k, part in enumerate(animation.parts)]
    header += [f"comment panel {k} {name}" for k, name in enumerate(_panels(animation))]
    header += [f"element vertex {len(vertices)}", *_properties(vertices.dtype)]
    header += [f"element face {len(faces)}", *_properties(faces.dtype), "end_header", ""]
    return "\n".join(header).encode() + vertices.tobytes() + faces.tobytes()


def _properties(kind: np.dtype) -> list[str]:
    """The lines of the properties; a field "n_NAME" of counts makes a list of the field behind it."""
    lines, lists = [], False
    for name, (field, *_) in (kind.fields or {}).items():
        base, size = field.subdtype or (field, ())
        word = _TYPES[base.str.replace("|", "")]
        if name.startswith("n_"):
            lists = True
        else:
            lines.append(f"property list uchar {word} {name}" if lists and size else f"property {word} {name}")
            lists = False
    return lines


def _vertices(shapes: tuple[PartFrame, ...]) -> np.ndarray:
    kind = [(name, "<f8") for name in ("x", "y", "z")] + [(name, "<f4") for name in ("nx", "ny", "nz")]
    kind += [(name, "u1") for name in ("red", "green", "blue")] + [("surface", "<i4")]
    rows = np.zeros(sum(len(shape.points) for shape in shapes), kind)
    start = 0
    for number, shape in enumerate(shapes):
        own = rows[start : start + len(shape.points)]
        colours = shape.colours if len(shape.colours) else np.full((len(own), 3), BODY_GREY)
        columns = np.column_stack([shape.points, shape.normals, np.rint(255 * colours)])
        for name, column in zip(rows.dtype.names or (), columns.T, strict=False):
            own[name] = column
        own["surface"] = number
        start += len(own)
    return rows


def _faces(animation: Animation, shapes: tuple[PartFrame, ...]) -> np.ndarray:
    textured = any(len(part.texture) for part in animation.parts)
    kind: list[tuple] = [("n_corners", "u1"), ("vertex_indices", "<i4", (3,))]
    kind += [("n_texcoord", "u1"), ("texcoord", "<f4", (6,))] if textured else []
    kind += [("stretch", "<f4"), ("surface", "<i4"), ("panel", "<i4")]
    rows = np.zeros(sum(len(part.triangles) for part in animation.parts), kind)
    rows["n_corners"], rows["stretch"], rows["panel"] = 3, 1.0, -1
    if textured:
        rows["n_texcoord"] = 6
    first, vertex, panel = 0, 0, 0
    for number, (part, shape) in enumerate(zip(animation.parts, shapes, strict=True)):
        own = rows[first : first + len(part.triangles)]
        own["vertex_indices"], own["surface"] = part.triangles + vertex, number
        if len(shape.stretch):
            own["stretch"] = shape.stretch
        if len(part.texture):
            own["texcoord"] = part.texture.reshape(-1, 6)
        for triangles in part.groups.values():
            own["panel"][triangles] = panel
            panel += 1
        first, vertex = first + len(own), vertex + len(shape.points)
    return rows


def _panels(animation: Animation) -> list[str]:
    """Names of the panels of all surfaces, by their numbers."""
    return [name for part in animation.parts for name in part.groups]
