"""Sequences: Wavefront OBJ and Stanford PLY, a file a frame, and point caches, a file a surface.

OBJ: positions to the last bit, texture, normals; an object a surface, a group a panel.

PLY: all surfaces as one mesh, with normals, colours, texture and stretch of the vertices; binary little endian. Faces
have corners only, which every reader takes. Vertices are split where texture coordinates differ: of each surface first
its vertices in their order, then the copies. `surface` is the number of the surface, whose name is in a comment of the
header; `stretch` the mean at the vertex, 1 for bodies.

PC2 (.pc2), little-endian: a header of 32 bytes, 12 characters "POINTCACHE2", version 1, number of points, first frame
0, frames per sample 1, number of samples; then the points of all frames in single precision. Source: the documentation
of 3ds Max, "PC2 file format". MDD (.mdd), big-endian: number of frames, number of points, the time of each frame [s],
then the points. Source: NewTek's LightWave SDK, "MDD". A cache is of one mesh, which is an OBJ beside it. The first
cloth is in the file that was named, every other surface that moves in stem_NAME, of the same ending; a body that stays
where it is has its OBJ only. Vertices have the order of the OBJ.
"""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from clothsim.base.file_writing import replacing, write_atomically
from clothsim.files.exchange.animation import (
    AnimatedPart,
    Animation,
    PartFrame,
    different,
    flat_texture,
    group_runs,
    one_word,
    plain_word,
    split_vertices,
    vertex_means,
)

CACHES = (".pc2", ".mdd")


def files(animation: Animation, target: Path) -> list[Path]:
    """The files that `write` makes."""
    return (cache_files if target.suffix.lower() in CACHES else frame_files)(animation, target)


def write(animation: Animation, target: Path) -> None:
    """Write the files."""
    {".obj": write_obj_frames, ".ply": write_ply_frames}.get(target.suffix.lower(), write_caches)(animation, target)


def frame_files(animation: Animation, target: Path) -> list[Path]:
    """A file for each frame: target_0000.obj, target_0001.obj, ...; of one frame the target itself."""
    if animation.alone:
        return [target]
    count = len(animation.times)
    digits = max(4, len(str(count - 1)))
    return [target.with_name(f"{target.stem}_{k:0{digits}d}{target.suffix}") for k in range(count)]


def write_obj_frames(animation: Animation, target: Path) -> None:
    """Write the files."""
    for k, path in enumerate(frame_files(animation, target)):
        write_atomically(path, frame_text(animation, k).encode())


def frame_text(animation: Animation, frame: int) -> str:
    """The text of a frame, with unit and axis in a comment."""
    lines = [f"# clothsim, {animation.times[frame]:.9g} s, 1 unit = {animation.unit:.9g} m, {animation.up} up"]
    counts = [0, 0]
    if any(len(part.texture) for part in animation.parts):
        lines.append("vt 0.0 0.0")  # of the parts without texture: some readers drop all where some corners have none
        counts[1] = 1
    names = different([part.name for part in animation.parts], one_word)
    for name, part, shape in zip(names, animation.parts, animation.at(frame), strict=True):
        lines += _part_lines(name, part, shape, counts)
    return "\n".join(lines) + "\n"


def _part_lines(name: str, part: AnimatedPart, shape: PartFrame, counts: list[int]) -> list[str]:
    """The lines of a surface; counts: vertices and texture coordinates before it, which grow."""
    lines = [f"o {name}"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in shape.points.tolist()]
    lines += [f"vn {x:.7g} {y:.7g} {z:.7g}" for x, y, z in shape.normals.tolist()]
    vertex, sizes = part.corners(part.triangles + counts[0] + 1)
    if len(part.texture):
        rows, corners = flat_texture(part)
        lines += [f"vt {u!r} {v!r}" for u, v in rows.tolist()]
        texture = part.corners(corners + counts[1] + 1)[0].tolist()
        words = [f"{i}/{t}/{i}" for i, t in zip(vertex.tolist(), texture, strict=True)]
        counts[1] += len(rows)
    else:
        none = "1" if counts[1] else ""
        words = [f"{i}/{none}/{i}" for i in vertex.tolist()]
    ends = np.concatenate([[0], np.cumsum(sizes)]).tolist()
    for names, first, stop in group_runs(part):
        lines.append(f"g {' '.join(map(one_word, names)) if names else name}")
        faces = range(*np.searchsorted(part.first_triangles, [first, stop]).tolist())
        lines += [f"f {' '.join(words[ends[k] : ends[k + 1]])}" for k in faces]
    counts[0] += len(shape.points)
    return lines


def still_mesh(part: AnimatedPart, shape: PartFrame) -> bytes:
    """An OBJ of one surface."""
    return ("\n".join(_part_lines(one_word(part.name), part, shape, [0, 0])) + "\n").encode()


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


def write_ply_frames(animation: Animation, target: Path) -> None:
    """Write the files."""
    for k, path in enumerate(frame_files(animation, target)):
        write_atomically(path, ply_bytes(animation, k))


def ply_bytes(animation: Animation, frame: int) -> bytes:
    """The file of a frame."""
    vertices, faces, count = [], [], 0
    for number, (part, shape) in enumerate(zip(animation.parts, animation.at(frame), strict=True)):
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
        rows["surface"] = number
        vertices.append(rows)
        # for each face a byte with the number of its corners, then these
        corners, sizes = part.corners(triangles + count)
        starts = np.cumsum(sizes) - sizes
        packed = np.zeros(4 * len(corners) + len(sizes), np.uint8)
        counted = 4 * starts + np.arange(len(sizes))
        packed[counted] = sizes
        rest = np.ones(len(packed), bool)
        rest[counted] = False
        packed[rest] = corners.astype("<i4").view(np.uint8)
        faces.append(packed.tobytes())
        count += len(rows)
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment clothsim, {animation.times[frame]:.9g} s, 1 unit = {animation.unit:.9g} m, {animation.up} up",
        *(f"comment surface {number} {part.name}" for number, part in enumerate(animation.parts)),
        f"element vertex {count}",
        *(f"property {_TYPES[_VERTEX[name].str]} {name}" for name in _VERTEX.names or ()),
        f"element face {sum(len(part.first_triangles) for part in animation.parts)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    return "\n".join(header).encode() + b"".join([*(each.tobytes() for each in vertices), *faces])


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
    """The caches and the meshes."""
    own = part_files(animation, target)
    return [path for each in own for path in (each.cache, each.mesh) if path is not None]


def write_caches(animation: Animation, target: Path) -> None:
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
