"""Mesh files, read as triangles in metres."""

import contextlib
import io
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from clothsim.arrays import Floats, Ints, as_positive
from clothsim.errors import InputError
from clothsim.io.gmsh import read_msh
from clothsim.io.library_readers import LIBRARY_READERS
from clothsim.io.obj import read_obj
from clothsim.io.off import read_off
from clothsim.io.polygons import Polygons, cut_polygons
from clothsim.io.vtk_legacy import read_vtk
from clothsim.mesh.generators.argument_checks import as_count
from clothsim.mesh.topology import components, renumbered_groups

TEXT_READERS = {".obj": read_obj, ".off": read_off}
BYTE_READERS = {".vtk": read_vtk, ".msh": read_msh}
ENDINGS = (*TEXT_READERS, *BYTE_READERS, *LIBRARY_READERS)


@dataclass(frozen=True)
class MeshFile:
    """A triangle mesh from a file.

    Attributes
    ----------
    positions : (n, 3) ndarray
        Vertices [m].
    triangles : (m, 3) ndarray
        Vertex numbers.
    texture : (m, 3, 2) or (0, 3, 2) ndarray
        Texture coordinates of each corner, where the file has them.
    messages : tuple of str
        Faces that were cut or ignored, vertices that were merged, the scale.
    groups : dict of str to (k,) ndarray
        Triangles of each group or object that the file names.
    """

    positions: Floats
    triangles: Ints
    texture: Floats
    messages: tuple[str, ...]
    groups: Mapping[str, Ints] = field(default_factory=dict)


def read_mesh(
    path: str | Path,
    *,
    scale: float = 1.0,
    group: str | None = None,
    component: int | None = None,
    vertices: Sequence[int] | None = None,
) -> MeshFile:
    """Read a mesh file or one part of it.

    A part keeps the order of its vertices and triangles and drops the vertices that it does not use; the whole file
    keeps them all.

    Parameters
    ----------
    path : str or Path
        An obj, ply, stl, off, vtk, vtu, msh or glb file.
    scale : float
        Metres per unit of the file.
    group : str, optional
        A group or object of an OBJ, or a node of a glb.
    component : int, optional
        A connected piece, numbered from 0 by decreasing number of vertices.
    vertices : (lo, hi), optional
        The vertices lo to hi - 1 of the file.

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
    >>> _ = file.write_text("v 0 0 0\\nv 10 0 0\\nv 10 10 0\\nv 0 10 0\\nf 1 2 3 4\\n")
    >>> mesh = read_mesh(file, scale=0.01)
    >>> mesh.triangles.tolist(), float(mesh.positions.max())
    ([[0, 1, 2], [0, 2, 3]], 0.1)
    >>> mesh.messages
    ('1 quads cut into triangles', 'scaled by 0.01')
    """
    file = Path(path)
    polygons = read_polygons(file)
    part = Part(scale, group, component, vertices)
    return choose(file, polygons, cut_polygons(polygons), part)


@dataclass(frozen=True)
class Part:
    """A part of a file and its unit: the keywords of `read_mesh`."""

    scale: float = 1.0
    group: str | None = None
    component: int | None = None
    vertices: Sequence[int] | None = None


def read_polygons(file: Path) -> Polygons:
    """The polygons of a file, with finite vertices and corners in range. InputError as of `read_mesh`."""
    return _checked(file, _read(file))


def choose(file: Path, polygons: Polygons, cut: tuple[Ints, Ints, tuple[str, ...]], part: Part) -> MeshFile:
    """The `part` of `polygons` with the triangles `cut`, which `cut_polygons` made. InputError names `file`."""
    factor = as_positive("scale", part.scale)
    places, faces, messages = cut
    messages = (*polygons.messages, *messages)
    triangles = polygons.corners[places]
    texture = polygons.texture[places] if len(polygons.texture) else np.zeros((0, 3, 2))
    groups = {name: np.flatnonzero(np.isin(faces, own)) for name, own in polygons.groups.items()}
    whole = MeshFile(polygons.positions, triangles, texture, messages, groups)
    if sum(key is not None for key in (part.group, part.component, part.vertices)) > 1:
        raise InputError(f"{file}: give only one of group, component and vertices.")
    if part.group is not None:
        mesh = _of_group(file, whole, polygons, faces, part.group)
    elif part.component is not None:
        mesh = _of_component(file, whole, part.component)
    elif part.vertices is not None:
        mesh = _of_range(file, whole, part.vertices)
    else:
        mesh = _note_unused(whole)
    if factor == 1:
        return mesh
    return replace(mesh, positions=factor * mesh.positions, messages=(*mesh.messages, f"scaled by {factor:g}"))


def _read(file: Path) -> Polygons:
    ending = file.suffix.lower()
    if ending not in ENDINGS:
        raise InputError(f"{file} has an unknown ending {ending!r}.", f"Known are {', '.join(ENDINGS)}.")
    try:
        content = file.read_bytes()
    except (OSError, ValueError) as error:
        raise InputError(f"{file} cannot be opened ({getattr(error, 'strerror', None) or error}).") from error
    if not content.strip():
        raise InputError(f"{file} is empty.")
    if ending in TEXT_READERS:
        if b"\0" in content:
            raise InputError(f"{file} is a binary file, not {ending[1:]} text.")
        return TEXT_READERS[ending](file, content.decode("utf-8", errors="replace"))
    if ending in BYTE_READERS:
        return BYTE_READERS[ending](file, content)
    return _read_with_library(file, ending, content)


def _read_with_library(file: Path, ending: str, content: bytes) -> Polygons:
    """Read by a library; all its exceptions, exits and prints become one sentence of an InputError."""
    try:
        nowhere = io.StringIO()
        with warnings.catch_warnings(), contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
            warnings.simplefilter("ignore")
            return LIBRARY_READERS[ending](file, content)
    except (InputError, ImportError):
        raise
    except (Exception, SystemExit) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{file} cannot be read as {ending[1:]} ({reason[:100]}).") from error


def _checked(file: Path, polygons: Polygons) -> Polygons:
    """The polygons. InputError for a vertex that is not finite and for a face of vertices that are not there."""
    points, corners = polygons.positions, polygons.corners
    said = "".join(f", {message}" for message in polygons.messages)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"{file} has vertices of shape {points.shape}, not (n, 3).")
    if not len(corners):
        raise InputError(f"{file} holds no faces ({len(points)} vertices{said}).")
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


def _of_group(file: Path, whole: MeshFile, polygons: Polygons, faces: Ints, group: str) -> MeshFile:
    names = list(polygons.groups)
    if group not in polygons.groups:
        near = get_close_matches(str(group), names, n=5, cutoff=0.3) or names[:5]
        has = f"The nearest are {', '.join(map(repr, near))}." if names else "The file names no groups."
        raise InputError(f"{file} has no group {group!r}.", has)
    return _part(whole, np.isin(np.arange(len(faces)), whole.groups[group]), f"group {group!r}")


def _of_component(file: Path, whole: MeshFile, component: int) -> MeshFile:
    label = components(whole.triangles, len(whole.positions))
    pieces, first = np.unique(label[np.sort(np.unique(whole.triangles))], return_index=True)
    size = np.bincount(label)[pieces]
    order = np.lexsort((first, -size))
    number = as_count(f"{file}: component", component, least=0, most=len(pieces) - 1)
    keep = np.equal(label[whole.triangles[:, 0]], pieces[order[number]])
    return _part(whole, keep, f"component {number} of {len(pieces)} by decreasing number of vertices")


def _of_range(file: Path, whole: MeshFile, vertices: Sequence[int]) -> MeshFile:
    count = len(whole.positions)
    if isinstance(vertices, str) or not hasattr(vertices, "__len__") or len(vertices) != 2:
        raise InputError(f"{file}: vertices must be [lo, hi], not {vertices!r}.")
    low = as_count(f"{file}: vertices[0]", vertices[0], least=0, most=count - 1)
    high = as_count(f"{file}: vertices[1]", vertices[1], least=low + 1, most=count)
    inside = np.logical_and(whole.triangles >= low, whole.triangles < high)
    keep = np.all(inside, axis=1)
    cut = np.flatnonzero(inside.any(axis=1) & ~keep)
    if len(cut):
        raise InputError(
            f"{file}: vertices = [{low}, {high}] cuts through triangle {cut[0]} = {whole.triangles[cut[0]].tolist()} "
            f"({len(cut)} such triangles).",
            "Give the range of a whole part.",
        )
    if not keep.any():
        raise InputError(f"{file}: vertices = [{low}, {high}] hold no triangle.")
    return _part(whole, keep, f"vertices {low}..{high - 1}")


def _part(whole: MeshFile, keep: np.ndarray, what: str) -> MeshFile:
    used, triangles = np.unique(whole.triangles[keep], return_inverse=True)
    counts = f"{len(used)} of {len(whole.positions)} vertices, {keep.sum()} of {len(keep)} triangles"
    return MeshFile(
        whole.positions[used],
        triangles.reshape(-1, 3).astype(np.int64),
        whole.texture[keep] if len(whole.texture) else whole.texture,
        (*whole.messages, f"{what}: {counts}"),
        renumbered_groups(whole.groups, np.flatnonzero(keep)),
    )


def _note_unused(whole: MeshFile) -> MeshFile:
    unused = len(whole.positions) - len(np.unique(whole.triangles))
    if not unused:
        return whole
    return replace(whole, messages=(*whole.messages, f"{unused} vertices are in no triangle"))
