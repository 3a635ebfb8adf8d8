"""Polygon meshes, their triangulation, and parts of them: a group, a connected piece, a range of vertices."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_count, as_positive
from clothsim.base.errors import InputError
from clothsim.mesh.topology import components, renumbered_groups

MOST_FANS = 32
"""Corners tried as the origin of the fan of a large polygon."""


@dataclass(frozen=True)
class Polygons:
    """Faces of any number of corners.

    positions: (n, 3) in the file's unit; corners: (c,) the vertices of all faces one after the other; starts: (f + 1,)
    face i has corners[starts[i]:starts[i + 1]]; texture: (c, 2) coordinates of each corner, or (0, 2) where absent;
    groups: the faces of each named group; messages: of the reader.
    """

    positions: Floats
    corners: Ints
    starts: Ints
    texture: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    groups: dict[str, Ints] = field(default_factory=dict)
    messages: tuple[str, ...] = ()


def cut_polygons(polygons: Polygons) -> tuple[Ints, Ints, tuple[str, ...]]:
    """Cut every face into triangles, in the order of the faces.

    Returns
    -------
    corners : (m, 3) ndarray
        The triangles, as indices into `polygons.corners`.
    faces : (m,) ndarray
        The face of each triangle.
    messages : tuple of str
        Counts of the faces that were cut.

    Notes
    -----
    A face of more than three corners becomes a fan from the corner that inverts fewest triangles and then has the
    shortest diagonals: of a quad the shorter diagonal, unless it lies outside. The triangulation depends on the shape:
    for files of one topology (frames, a start) use that of the first.
    """
    sizes = np.diff(polygons.starts)
    corner_rows, faces, messages = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)], []
    for size in np.unique(sizes[sizes >= 3]):
        rows = np.flatnonzero(sizes == size)
        corner = polygons.starts[rows, None] + np.arange(size)
        with np.errstate(over="ignore", invalid="ignore"):  # at 1e154 any fan will do
            points = polygons.positions[polygons.corners[corner]]
            # the fan of each polygon, and where even that overlaps
            count = len(points)
            fans = np.zeros((count, size - 2, 3), np.int64)
            least_turned, shortest = np.full(count, size), np.full(count, np.inf)
            for origin in range(1 if size == 3 else 2 if size == 4 else min(size, MOST_FANS)):
                ring = (origin + np.arange(size)) % size
                fan = np.column_stack([np.full(size - 2, ring[0]), ring[1:-1], ring[2:]])
                spokes = points[:, ring[1:]] - points[:, ring[:1]]
                normals = np.cross(spokes[:, :-1], spokes[:, 1:])
                turned = (np.einsum("kij,kj->ki", normals, normals.sum(axis=1)) < 0).sum(axis=1)
                length = np.linalg.norm(spokes[:, 1:-1], axis=2).sum(axis=1)
                better = (turned < least_turned) | ((turned == least_turned) & (length < shortest * (1 - 1e-6)))
                fans[better], least_turned[better], shortest[better] = fan, turned[better], length[better]
            overlapping = least_turned > 0
        corner_rows.append(np.take_along_axis(corner, fans.reshape(len(rows), -1), axis=1).reshape(-1, 3))
        faces.append(np.repeat(rows, size - 2))
        if size > 3:
            name = "quads" if size == 4 else f"faces of {size} corners"
            messages.append(f"{len(rows)} {name} cut into triangles")
        if overlapping.any():
            messages.append(f"{overlapping.sum()} of them fold or bend inward, first face {rows[overlapping][0]}")
    order = np.argsort(np.concatenate(faces), kind="stable")
    return np.concatenate(corner_rows)[order], np.concatenate(faces)[order], tuple(messages)


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
    used : (n,) ndarray
        Vertex of the file of each vertex of a part; (0,) for the whole file, whose vertices are all there.
    """

    positions: Floats
    triangles: Ints
    texture: Floats
    messages: tuple[str, ...]
    groups: Mapping[str, Ints] = field(default_factory=dict)
    used: Ints = field(default_factory=lambda: np.zeros(0, np.int64))


@dataclass(frozen=True)
class MeshPart:
    """A part of a file and its unit: the keywords of `read_mesh`."""

    scale: float = 1.0
    group: str | None = None
    component: int | None = None
    vertices: Sequence[int] | None = None
    parts: Sequence[str] = ()


def choose(file: Path, polygons: Polygons, cut: tuple[Ints, Ints, tuple[str, ...]], part: MeshPart) -> MeshFile:
    """The `part` of `polygons` with the triangles `cut`, which `cut_polygons` made. InputError names `file`."""
    factor = as_positive("scale", part.scale)
    corner_rows, faces, messages = cut
    messages = (*polygons.messages, *messages)
    triangles = polygons.corners[corner_rows]
    texture = polygons.texture[corner_rows] if len(polygons.texture) else np.zeros((0, 3, 2))
    groups = {name: np.flatnonzero(np.isin(faces, own)) for name, own in polygons.groups.items()}
    whole = MeshFile(polygons.positions, triangles, texture, messages, groups)
    if sum(key is not None for key in (part.group, part.component, part.vertices, part.parts or None)) > 1:
        raise InputError(f"{file}: give only one of group, parts, component and vertices.")
    if part.group is not None:
        mesh = _take_groups(file, whole, [part.group])
    elif part.parts:
        mesh = _take_groups(file, whole, part.parts)
    elif part.component is not None:
        label = components(whole.triangles, len(whole.positions))
        pieces, first = np.unique(label[np.sort(np.unique(whole.triangles))], return_index=True)
        size = np.bincount(label)[pieces]
        order = np.lexsort((first, -size))
        number = as_count(f"{file}: component", part.component, least=0, most=len(pieces) - 1)
        keep = np.equal(label[whole.triangles[:, 0]], pieces[order[number]])
        mesh = _part(whole, keep, f"component {number} of {len(pieces)} by decreasing number of vertices")
    elif part.vertices is not None:
        mesh = _take_range(file, whole, part.vertices)
    else:
        unused = len(whole.positions) - len(np.unique(whole.triangles))
        notes = (f"{unused} vertices are in no triangle",) if unused else ()
        mesh = replace(whole, messages=(*whole.messages, *notes))
    if factor == 1:
        return mesh
    return replace(mesh, positions=factor * mesh.positions, messages=(*mesh.messages, f"scaled by {factor:g}"))


def _take_groups(file: Path, whole: MeshFile, wanted: Sequence[str]) -> MeshFile:
    names = list(whole.groups)
    for group in wanted:
        if group not in whole.groups:
            near = get_close_matches(str(group), names, n=5, cutoff=0.3) or names[:5]
            has = f"The nearest are {', '.join(map(repr, near))}." if names else "The file names no groups."
            raise InputError(f"{file} has no group {group!r}.", has)
    keep = np.zeros(len(whole.triangles), bool)
    for group in wanted:
        keep[whole.groups[group]] = True
    return _part(whole, keep, f"{'group' if len(wanted) == 1 else 'groups'} {', '.join(map(repr, wanted))}")


def _take_range(file: Path, whole: MeshFile, vertices: Sequence[int]) -> MeshFile:
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
        used,
    )
