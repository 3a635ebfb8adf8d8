"""Mesh files, read as triangles in metres: one mesh, or a sequence of one topology, the frames of an animation.

OBJ, OFF, legacy VTK and Gmsh files are read here and below, the others by meshio and trimesh, each imported when it is
needed. A reader gets the bytes or the path of one local file; what a file names (a texture, a script) is not opened.
"""

import contextlib
import io
import json
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from glob import iglob
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, as_points
from clothsim.base.errors import InputError
from clothsim.base.file_reading import bounded_decompression, read_regular_file
from clothsim.base.process_memory import in_own_process
from clothsim.files.meshes.polygons import MeshFile, MeshPart, Polygons, choose, cut_polygons
from clothsim.files.meshes.readers.gmsh import read_msh
from clothsim.files.meshes.readers.obj import read_obj
from clothsim.files.meshes.readers.vtk_legacy import read_vtk
from clothsim.mesh.weld import merge_coincident


def read_off(path: Path, text: str) -> Polygons:
    """The polygons of an OFF text: `OFF`, the counts, vertices and faces of any size. InputError names the fault."""
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
            raise InputError(f"{path} ends early: it declares {n_vertices} vertices and {n_faces} faces.")
        points = np.array([[float(word) for word in row[:3]] for row in rows], float).reshape(-1, 3)
        sizes = np.array([int(face[0]) for face in faces], np.int64)
        if (sizes < 0).any() or any(len(face) <= size for face, size in zip(faces, sizes, strict=True)):
            raise InputError(f"{path} has a face with fewer corners than it says.")
        corners = [int(word) for face, size in zip(faces, sizes, strict=True) for word in face[1 : 1 + size]]
        starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        return Polygons(points, np.array(corners, np.int64), starts)
    except (ValueError, IndexError, OverflowError) as error:
        raise InputError(f"{path} cannot be read as OFF ({error}).") from error


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
    return _convert_meshio(path, meshio.ply.read(str(path)))


def read_vtu(path: Path, content: bytes) -> Polygons:
    """A VTK XML unstructured grid."""
    import meshio.vtu

    with bounded_decompression(meshio.vtu._vtu, str(path), max(LEAST_UNPACKED, MOST_UNPACKED * len(content))):
        return _convert_meshio(path, meshio.vtu.read(str(path)))


def read_stl(path: Path, content: bytes) -> Polygons:
    """An STL file, which repeats the corners of every triangle: coincident ones are merged."""
    return _convert_trimesh(path, content, "stl")


def read_glb(path: Path, content: bytes) -> Polygons:
    """A binary glTF scene with the transform of each node; vertices that it splits for textures are merged."""
    start, size = 20, int.from_bytes(content[12:16], "little")
    accessors = json.loads(content[start : start + size])["accessors"]
    _refuse_promises(path, [int(accessor["count"]) for accessor in accessors], content)
    return _convert_trimesh(path, content, "glb")


LIBRARY_READERS: dict[str, Callable[[Path, bytes], Polygons]] = {
    ".ply": read_ply,
    ".vtu": read_vtu,
    ".stl": read_stl,
    ".glb": read_glb,
}


def _refuse_promises(path: Path, counts: list[int], content: bytes) -> None:
    """InputError where a header declares more elements than the file can hold: the libraries allocate them first."""
    if max(counts, default=0) > len(content) or sum(counts) > MOST_SHARED * len(content):
        raise InputError(
            f"{path} declares {max(counts):,} elements in {len(content):,} bytes.", "It is truncated or broken."
        )


def _convert_meshio(path: Path, mesh) -> Polygons:
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
    starts = np.concatenate([[0], np.cumsum(np.concatenate(sizes))]).astype(np.int64)
    return Polygons(points, np.concatenate(corners), starts, messages=tuple(messages))


def _convert_trimesh(path: Path, content: bytes, file_type: str) -> Polygons:
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


USD_ENDINGS = (".usd", ".usda", ".usdc")
TEXT_READERS = {".obj": read_obj, ".off": read_off}
BYTE_READERS = {".vtk": read_vtk, ".msh": read_msh}
ENDINGS = (*TEXT_READERS, *BYTE_READERS, *LIBRARY_READERS)


def read_mesh(
    path: str | Path,
    *,
    scale: float = 1.0,
    group: str | None = None,
    component: int | None = None,
    vertices: Sequence[int] | None = None,
    parts: Sequence[str] = (),
) -> MeshFile:
    r"""Read a mesh file or one part of it.

    A part keeps the order of its vertices and triangles and drops the vertices that it does not use; the whole file
    keeps them all.

    Parameters
    ----------
    path : str or Path
        An obj, ply, stl, off, vtk, vtu, msh or glb file; usd, usda or usdc with ``clothsim[usd]``.
    scale : float
        Metres per unit of the file.
    group : str, optional
        A group or object of an OBJ, a node of a glb, a mesh or subset of a USD file.
    component : int, optional
        A connected piece, numbered from 0 by decreasing number of vertices.
    vertices : (lo, hi), optional
        The vertices lo to hi - 1 of the file.
    parts : sequence of str
        Several groups, objects, nodes or subsets, as one mesh.

    Returns
    -------
    MeshFile
        Its triangles, in metres.

    Raises
    ------
    InputError
        The file cannot be read; the sentence has the path, and of an OBJ the line.

    Examples
    --------
    >>> from pathlib import Path
    >>> file = Path("quad.obj")
    >>> _ = file.write_text("v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nf 1 2 3 4\n")
    >>> mesh = read_mesh(file, scale=0.01)
    >>> mesh.triangles.tolist(), float(mesh.positions.max())
    ([[0, 1, 2], [0, 2, 3]], 0.1)
    >>> mesh.messages
    ('1 quads cut into triangles', 'scaled by 0.01')
    """
    file = Path(path)
    polygons = read_polygons(file)
    part = MeshPart(scale, group, component, vertices, parts)
    return choose(file, polygons, cut_polygons(polygons), part)


def read_polygons(file: Path) -> Polygons:
    """The polygons of a file, with finite vertices and corners in range. InputError as of `read_mesh`."""
    return checked(file, _read(file))


POINTS = ".xyz"
"""Ending of a text file with a point a line, x y z or x y z and its normal."""
NO_NORMALS = np.zeros((0, 3))


def read_cloud(path: Path, scale: float = 1.0) -> tuple[Floats, Floats]:
    """Return the points (k, 3) [m] and normals (k, 3) of a file, no normals where it has none.

    Parameters
    ----------
    path : Path
        A text file (.xyz) with a point a line, x y z or x y z and a normal; or the vertices of a mesh file.
    scale : float
        Metres per unit of the file.

    Raises
    ------
    InputError
        For a file that cannot be read, or has no points.
    """
    if path.suffix.lower() != POINTS:
        points = _read(path).positions
        if points.ndim != 2 or points.shape[1] != 3 or not len(points):
            raise InputError(f"{path} has no vertices.", "Export the points of the scan.")
        return scale * as_points(str(path), points), NO_NORMALS
    try:
        rows = np.loadtxt(path, ndmin=2)
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read ({error}).", "Give one point x y z per line.") from error
    if rows.shape[1] < 3 or not len(rows):
        raise InputError(f"{path} has no points.", "Give one point x y z per line.")
    points = scale * as_points(str(path), rows[:, :3])
    return points, as_points(str(path), rows[:, 3:]) if rows.shape[1] == 6 else NO_NORMALS


def _read(file: Path) -> Polygons:
    ending = file.suffix.lower()
    if ending not in (*ENDINGS, *USD_ENDINGS):
        known = ", ".join((*ENDINGS, *USD_ENDINGS))
        raise InputError(f"{file} has an unknown ending {ending!r}.", f"Export it as one of these: {known}.")
    content = read_regular_file(file, remedy="Correct the path of the mesh file.")
    if not content.strip():
        raise InputError(f"{file} is empty.", "Export it again, or name another file.")
    if ending in USD_ENDINGS:
        return _read_usd("read_usd", file)
    if ending in TEXT_READERS:
        if b"\0" in content:
            raise InputError(f"{file} is a binary file, not {ending[1:]} text.")
        return TEXT_READERS[ending](file, content.decode("utf-8", errors="replace"))
    if ending in BYTE_READERS:
        return BYTE_READERS[ending](file, content)
    try:  # all exceptions, exits and prints of a library become one sentence
        nowhere = io.StringIO()
        with warnings.catch_warnings(), contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
            warnings.simplefilter("ignore")
            return LIBRARY_READERS[ending](file, content)
    except (InputError, ImportError):
        raise
    except (Exception, SystemExit) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{file} cannot be read as {ending[1:]} ({reason[:100]}).") from error


USD_MEMORY, USD_SECONDS = 3 << 29, 600.0
"""Bounds on the process that reads a USD file: memory [bytes], and MOST_UNPACKED times its size; time [s]."""


def _read_usd(function: str, file: Path, *arguments: object) -> Any:
    """By a process of its own: on some changed bytes the library of USD ends the one that it is in."""
    memory = USD_MEMORY + MOST_UNPACKED * file.stat().st_size
    where = f"clothsim.files.meshes.readers.usd_reader:{function}"
    return in_own_process(where, file, *arguments, memory=memory, seconds=USD_SECONDS, what=str(file))


def checked(file: Path, polygons: Polygons) -> Polygons:
    """The polygons. InputError for a vertex that is not finite and for a face of vertices that are not there."""
    points, corners = polygons.positions, polygons.corners
    # Of a file that is not a mesh nothing is repeated: it may be anything.
    notes = "".join(f", {message}" for message in polygons.messages if len(points))
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"{file} has vertices of shape {points.shape}, not (n, 3).")
    if not len(corners):
        raise InputError(
            f"{file} contains no faces ({len(points)} vertices{notes}).", "Export a mesh with triangles or polygons."
        )
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise InputError(
            f"{file}: vertex {bad[0]} is {points[bad[0]].tolist()}, not finite ({len(bad)} such vertices)."
        )
    bad = np.flatnonzero((corners < 0) | (corners >= len(points)))
    if len(bad):
        face = np.searchsorted(polygons.starts, bad[0], side="right") - 1
        raise InputError(
            f"{file}: face {face} names vertex {corners[bad[0]]}, out of range 0..{len(points) - 1} "
            f"({len(bad)} such corners)."
        )
    small = np.flatnonzero(np.diff(polygons.starts) < 3)
    if len(small):
        raise InputError(f"{file}: face {small[0]} has fewer than three corners ({len(small)} such faces).")
    return polygons


MOST_FRAMES, MOST_BYTES = 20_000, 8 << 30
"""Largest number of frames, and largest memory of their positions [bytes]."""


def animation_files(directory: Path, pattern: str) -> list[Path]:
    """The files that match `pattern` ("kick/shell*.obj") in `directory`, in natural order: shell2 before shell10.

    InputError where there is none.
    """
    try:
        names = list(islice(iglob(pattern, root_dir=directory), MOST_FRAMES + 1))
    except (ValueError, re.error) as error:
        raise InputError(f"frames = {pattern!r} is not a pattern of file names ({error}).") from error
    if len(names) > MOST_FRAMES:
        raise InputError(
            f"frames = {pattern!r} matches more than {MOST_FRAMES:,} files.", "Name the frames more closely."
        )
    if not names:
        raise InputError(
            f"No file matches frames = {pattern!r}.", f"It starts from {directory}; * stands for any characters."
        )
    digits = re.compile(r"([0-9]+)")  # which are sorted by their number, everything else as text
    in_order = {
        name: [(int(word), "") if word.isdecimal() else (-1, word) for word in digits.split(name)] for name in names
    }
    return [directory / name for name in sorted(names, key=lambda name: (in_order[name], name))]


def read_frames(files: Sequence[Path], part: MeshPart, rate: float = 25.0) -> tuple[MeshFile, Floats]:
    """Read the frames of an animation.

    Parameters
    ----------
    files : sequence of Path
        Meshes of the same vertices and faces.
    part : MeshPart
        The part of each file, and its unit.
    rate : float
        Frames a second that are taken of one USD file, which has its own times.

    Returns
    -------
    mesh : MeshFile
        The first file; its quads are cut in all frames alike.
    positions : (k, n, 3) ndarray
        Vertices in each frame [m].

    Raises
    ------
    InputError
        A file has other vertices or faces than the first.
    """
    if len(files) == 1 and files[0].suffix.lower() in USD_ENDINGS:
        read = _read_usd("read_usd_frames", files[0], rate, MOST_FRAMES)
        states = [checked(files[0], each) for each in read]
        return _one_topology([files[0]] * len(states), iter(states), part)
    return _one_topology(files, (read_polygons(file) for file in files), part)


def _one_topology(files: Sequence[Path], states: Iterator[Polygons], part: MeshPart) -> tuple[MeshFile, Floats]:
    """The mesh and the frames of polygons that have the faces of the first; files: where each comes from."""
    first = next(states)
    cut = cut_polygons(first)
    mesh = choose(files[0], first, cut, part)
    size = len(files) * mesh.positions.nbytes
    if size > MOST_BYTES:
        raise InputError(
            f"{len(files):,} frames of {len(mesh.positions):,} vertices take {size / 1e9:.2g} GB.",
            "Name fewer frames, or a part of the mesh.",
        )
    frames = [mesh.positions]
    for file, polygons in zip(files[1:], states, strict=True):
        remedy = "All frames of a body need the same vertices and faces in the same order."
        counts = (
            ("vertices", len(polygons.positions), len(first.positions)),
            ("faces", len(polygons.starts), len(first.starts)),
        )
        for what, has, expected in counts:
            if has != expected:
                less = 1 if what == "faces" else 0
                raise InputError(f"{file} has {has - less} {what}, {files[0].name} has {expected - less}.", remedy)
        sizes = np.flatnonzero(np.diff(polygons.starts) != np.diff(first.starts))
        if len(sizes):
            raise InputError(f"{file}: face {sizes[0]} has another number of corners than in {files[0].name}.", remedy)
        differ = np.flatnonzero(polygons.corners != first.corners)
        if len(differ):
            face = int(np.searchsorted(first.starts, differ[0], side="right")) - 1
            rows = slice(first.starts[face], first.starts[face + 1])
            raise InputError(
                f"{file}: face {face} is {polygons.corners[rows].tolist()}, in {files[0].name} "
                f"{first.corners[rows].tolist()}.",
                remedy,
            )
        moved = replace(first, positions=polygons.positions)
        frames.append(choose(file, moved, cut, part).positions)
    return mesh, np.stack(frames)
