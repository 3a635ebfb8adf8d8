"""Mesh formats read by meshio and trimesh, each imported when it is needed.

Each reader gets the bytes or the path of one local file; nothing that a file names (a texture, a script) is opened.
"""

import io
import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Ints
from clothsim.base.errors import InputError
from clothsim.base.safe_files.decompression import bounded_decompression
from clothsim.files.meshes.polygons import Polygons
from clothsim.mesh.weld import merge_coincident

MOST_SHARED = 64
"""Largest number of elements per byte of a file, on average: accessors of a glb may overlap."""
LEAST_UNPACKED, MOST_UNPACKED = 1 << 26, 64
"""Bound on the bytes that a compressed file may unpack to: the first, or so many for each of its own."""
SURFACES = ("triangle", "quad", "polygon")
"""The cell types of meshio that are straight faces."""


def read_ply(path: Path, content: bytes) -> Polygons:
    """A PLY file, text or binary."""
    import meshio.ply

    header, end, _ = content.partition(b"end_header")
    if not end:  # meshio would search for it without end
        raise InputError(f"{path} has no complete PLY header.")
    _refuse_promises(
        path, [int(count) for count in re.findall(rb"^\s*element\s+\S+\s+(\d{1,40})", header, re.M)], content
    )
    return _of_meshio(path, meshio.ply.read(str(path)))


def read_vtu(path: Path, content: bytes) -> Polygons:
    """A VTK XML unstructured grid."""
    import meshio.vtu

    with bounded_decompression(meshio.vtu._vtu, str(path), max(LEAST_UNPACKED, MOST_UNPACKED * len(content))):
        return _of_meshio(path, meshio.vtu.read(str(path)))


def read_stl(path: Path, content: bytes) -> Polygons:
    """An STL file, which repeats the corners of every triangle: coincident ones are merged."""
    return _of_trimesh(path, content, "stl")


def read_glb(path: Path, content: bytes) -> Polygons:
    """A binary glTF scene with the transform of each node; vertices that it splits for textures are merged."""
    start, size = 20, int.from_bytes(content[12:16], "little")
    accessors = json.loads(content[start : start + size])["accessors"]
    _refuse_promises(path, [int(accessor["count"]) for accessor in accessors], content)
    return _of_trimesh(path, content, "glb")


LIBRARY_READERS: dict[str, Callable[[Path, bytes], Polygons]] = {
    ".ply": read_ply,
    ".vtu": read_vtu,
    ".stl": read_stl,
    ".glb": read_glb,
}


def _refuse_promises(path: Path, counts: list[int], content: bytes) -> None:
    """InputError where a header declares more elements than the file can hold: the libraries allocate them first."""
    if max(counts, default=0) > len(content) or sum(counts) > MOST_SHARED * len(content):
        raise InputError(f"{path} promises {max(counts):,} elements in {len(content):,} bytes.", "It is cut or broken.")


def _of_meshio(path: Path, mesh) -> Polygons:
    points = np.asarray(mesh.points, float)
    messages = []
    if points.ndim == 2 and points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
        messages.append("two coordinates a vertex: z = 0")
    corners, sizes = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for block in mesh.cells:
        if block.type in SURFACES:
            corners += [np.asarray(face, np.int64).ravel() for face in block.data]
            sizes.append(np.array([len(face) for face in block.data], np.int64))
        else:
            messages.append(f"{len(block.data)} {block.type} cells ignored")
    return _polygons(points, np.concatenate(corners), np.concatenate(sizes), tuple(messages))


def _polygons(points: np.ndarray, corners: Ints, sizes: Ints, messages: tuple[str, ...]) -> Polygons:
    starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    return Polygons(points, corners, starts, messages=messages)


def _of_trimesh(path: Path, content: bytes, file_type: str) -> Polygons:
    import trimesh

    scene = trimesh.load_scene(io.BytesIO(content), file_type=file_type, process=False)
    points, triangles, texture, groups, count, faces = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], [], {}, 0, 0
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        part = scene.geometry[name]
        if not isinstance(part, trimesh.Trimesh):
            continue
        points.append(np.asarray(part.vertices, float) @ transform[:3, :3].T + transform[:3, 3])
        triangles.append(np.asarray(part.faces, np.int64) + count)
        coordinates = getattr(part.visual, "uv", None)
        texture.append(None if coordinates is None else np.asarray(coordinates, float)[part.faces].reshape(-1, 2))
        groups[str(node)] = faces + np.arange(len(part.faces))
        count, faces = count + len(part.vertices), faces + len(part.faces)
    merged, number = merge_coincident(np.concatenate(points))
    corners = number[np.concatenate(triangles)].ravel()
    known = [coordinates for coordinates in texture if coordinates is not None]
    return Polygons(
        merged,
        corners,
        3 * np.arange(faces + 1),
        np.concatenate(known) if known and len(known) == len(texture) else np.zeros((0, 2)),
        groups,
        (f"{count - len(merged)} vertices at the place of another merged",) if len(merged) < count else (),
    )
