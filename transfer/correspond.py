"""Triangle correspondence of two meshes of different topology (Sumner & Popovic 2004, section 4).

The source is deformed onto the target (`overlay`); then each triangle of either is paired with the closest of the other
with a compatible normal.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from transfer.align import by_boxes, by_points, span_a_plane
from transfer.body_parts import BodyParts, body_parts
from transfer.deform import deformation_transfer
from transfer.errors import TransferError
from transfer.gradients import centroids, mean_edge
from transfer.landmarks import derive_markers
from transfer.overlay import facing_surface, lay_over
from transfer.part_warp import warped_onto
from transfer.triangle_surface import Floats, Ints, as_surface, largest_component, triangle_normals, vertex_components

Mesh = tuple[Floats, Ints]

FROM_NEAR = (1e-2, 1e-1, 1.0, 17.0, 292.0)
"""w_C of the steps of a registration that begins near the target."""


@dataclass(frozen=True)
class Correspondence:
    """Correspondence of a source and a target mesh.

    Attributes
    ----------
    positions : ndarray (n, 3)
        Source vertices in the shape of the target [m].
    pairs : ndarray (p, 2)
        (source triangle, target triangle), many to many.
    markers : ndarray (k, 2)
        (source vertex, target vertex) that were used.
    derived : bool
        True where the markers were derived from the shapes.
    """

    positions: Floats
    pairs: Ints
    markers: Ints
    derived: bool


def correspond(
    source_positions: ArrayLike,
    source_triangles: ArrayLike,
    target_positions: ArrayLike,
    target_triangles: ArrayLike,
    markers: ArrayLike | None = None,
    progress: Callable[[str], None] | None = None,
    parts: tuple[BodyParts, BodyParts] | None = None,
) -> Correspondence:
    """Deform the source onto the target and pair their triangles.

    Components of the source with a marker are fitted to the components of the target with one (the largest to the
    largest where markers are derived); the other components follow the nearest fitted triangles.

    Parameters
    ----------
    source_positions, target_positions : array_like (n, 3), (k, 3)
        Vertices [m].
    source_triangles, target_triangles : array_like (m, 3), (l, 3)
        Vertex indices.
    markers : array_like (k, 2), optional
        (source vertex, target vertex), met exactly. None: none are needed for standing bodies, in any orientation
        about a vertical axis y or z and with any pose of the arms (see `body_parts`); for other surfaces they are
        derived, in the same axes, and met in the first steps only.
    progress : callable, optional
        Called with a line of text after each step.
    parts : (BodyParts, BodyParts), optional
        Of both bodies, where they are known; None: they are found where both are standing bodies.

    Raises
    ------
    TransferError
        Invalid arrays, triangles without area, conflicting markers, or surfaces without compatible normals.

    Examples
    --------
    A tetrahedron onto one twice as large:

    >>> import numpy as np
    >>> from transfer.correspond import correspond
    >>> x = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> result = correspond(x, triangles, 2 * x, triangles, markers=[[0, 0], [1, 1], [2, 2], [3, 3]])
    >>> bool(np.allclose(result.positions, 2 * x)), len(result.pairs)
    (True, 4)
    """
    source = as_surface("source", source_positions, source_triangles)
    target = as_surface("target", target_positions, target_triangles)
    pieces = [vertex_components(triangles, len(positions)) for positions, triangles in (source, target)]
    if markers is None:
        by_parts = registered_by_parts(source, target, progress, parts)
        if len(by_parts):
            return Correspondence(by_parts, triangle_pairs((by_parts, source[1]), target), np.zeros((0, 2), int), True)
        whole = [
            part(mesh, of, [largest_component(mesh[1], of)]) for mesh, of in zip((source, target), pieces, strict=True)
        ]
        used = derive_markers((source[0], source[1][whole[0]]), (target[0], target[1][whole[1]]))
    else:
        used = checked_markers(markers, pieces)
    fitted, aim = (
        part(mesh, of, of[used[:, side]]) for side, (mesh, of) in enumerate(zip((source, target), pieces, strict=True))
    )
    start, unit = aligned((source[0], source[1][fitted]), (target[0], target[1][aim]), used, markers is not None)
    onto = facing_surface(target[0] / unit, target[1][aim])
    laid = unit * lay_over(
        start / unit, source[1][fitted], onto, used[:, 0], target[0][used[:, 1]] / unit, markers is None, progress
    )
    if markers is not None:
        laid[used[:, 0]] = target[0][used[:, 1]]
    if len(fitted) < len(source[1]):
        laid = follow_fitted((start, source[1]), fitted, laid)
    return Correspondence(laid, triangle_pairs((laid, source[1]), target), used, markers is None)


def registered_by_parts(
    source: Mesh,
    target: Mesh,
    progress: Callable[[str], None] | None,
    parts: tuple[BodyParts, BodyParts] | None = None,
) -> Floats:
    """Source vertices (n, 3) in the shape of the target where both are standing bodies; else none, (0, 3).

    The pose, the proportions and the orientation are those of the target before the first closest point is asked for:
    what is left is a fraction of a limb's radius, and needs no markers.
    """
    try:
        own, other = parts or (body_parts(*source), body_parts(*target))
    except TransferError:
        return np.zeros((0, 3))
    near = warped_onto(own, other, source[0])
    labels = [vertex_components(triangles, len(positions)) for positions, triangles in (source, target)]
    fitted, aim = (
        part(mesh, of, [largest_component(mesh[1], of)]) for mesh, of in zip((source, target), labels, strict=True)
    )
    unit = mean_edge(near, source[1][fitted])
    onto = facing_surface(target[0] / unit, target[1][aim])
    none = np.zeros(0, np.int64), np.zeros((0, 3))
    laid = unit * lay_over(near / unit, source[1][fitted], onto, *none, progress=progress, weights=FROM_NEAR)
    return laid if len(fitted) == len(source[1]) else follow_fitted((near, source[1]), fitted, laid)


def part(mesh: Mesh, pieces: Ints, chosen: ArrayLike) -> Ints:
    """Indices of the triangles in components with a label in `chosen`."""
    return np.flatnonzero(np.isin(pieces[mesh[1][:, 0]], chosen))


def checked_markers(markers: ArrayLike, pieces: list[Ints]) -> Ints:
    """Markers (k, 2) without repetitions.

    TransferError for one that names no vertex of a triangle, and for two of one vertex, which would be contradictory or
    collapse a triangle.
    """
    given = np.asarray(markers)
    if given.ndim != 2 or given.shape[1] != 2 or given.dtype.kind not in "iu" or len(given) == 0:
        raise TransferError(
            f"the markers have shape {given.shape} and type {given.dtype}.",
            "Give whole numbers (k, 2), k > 0: a vertex of the source and of the target a row; or None to derive them.",
        )
    used = np.unique(given.astype(np.int64), axis=0)
    for side, name in enumerate(("source", "target")):
        count = len(pieces[side])
        for row in used:
            vertex = row[side]
            if not 0 <= vertex < count or pieces[side][vertex] < 0:
                raise TransferError(
                    f"marker {row.tolist()} names vertex {vertex} of the {name}, which has {count} vertices"
                    f"{' and no triangle there' if 0 <= vertex < count else ''}.",
                    "Name vertices that triangles use.",
                )
        vertices, times = np.unique(used[:, side], return_counts=True)
        if (times > 1).any():
            twice = used[used[:, side] == vertices[times.argmax()]]
            raise TransferError(
                f"markers {twice.tolist()} name vertex {vertices[times.argmax()]} of the {name} twice.",
                "Leave one marker on a vertex.",
            )
    return used


def aligned(source: Mesh, target: Mesh, markers: Ints, trusted: bool) -> tuple[Floats, float]:
    """Source aligned with the target by a similarity, and its mean edge length, the unit of the fit.

    Given markers that span a plane determine it, else the bounding boxes do. One unit for both meshes: were each
    scaled to its own mean edge, w_I would keep a fine mesh at the size of a coarse one.
    """
    from_points, to_points = source[0][markers[:, 0]], target[0][markers[:, 1]]
    planes = trusted and span_a_plane(from_points) and span_a_plane(to_points)
    similarity = by_points(from_points, to_points) if planes else by_boxes(source, target)
    start = similarity.apply(source[0])
    return start, mean_edge(start, source[1])


def follow_fitted(rest: Mesh, fitted: Ints, laid: Floats) -> Floats:
    """Components without a marker follow the nearest fitted triangles (eyes the head)."""
    positions, triangles = rest
    pairs = np.column_stack([fitted, fitted])
    warped = deformation_transfer(positions, triangles, pairs).pose(positions, triangles, laid)
    warped[np.unique(triangles[fitted])] = laid[np.unique(triangles[fitted])]
    return warped


def triangle_pairs(laid: Mesh, target: Mesh) -> Ints:
    """Pairs (p, 2): for each triangle of either mesh the closest with a compatible normal, without repetitions."""
    pairs = []
    for mesh, other, order in ((laid, target, [0, 1]), (target, laid, [1, 0])):
        nearest, _ = facing_surface(*other).closest_valid(centroids(*mesh), triangle_normals(*mesh))
        valid = np.flatnonzero(nearest >= 0)
        pairs.append(np.column_stack([valid, nearest[valid]])[:, order])
    return np.unique(np.concatenate(pairs), axis=0)
