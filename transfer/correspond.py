"""Which triangles of two meshes of different topology mean the same (Sumner & Popovic 2004, section 4).

The source is laid over the target (`overlay`); then each triangle of either is paired with the closest of the other
that faces its way.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from transfer.adjacency import largest_component, vertex_components
from transfer.align import by_boxes, by_points, span_a_plane
from transfer.closest_surface_point import facing_surface
from transfer.deform import deformation_transfer
from transfer.errors import TransferError
from transfer.gradients import centroids, mean_edge
from transfer.landmarks import derive_markers
from transfer.overlay import lay_over
from transfer.triangle_surface import Floats, Ints, as_surface, triangle_normals

Mesh = tuple[Floats, Ints]


@dataclass(frozen=True)
class Correspondence:
    """positions (n, 3): the source's vertices laid over the target; pairs (p, 2): (source triangle, target triangle),
    many to many; markers (k, 2): the (source vertex, target vertex) used; derived: they were not given.
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
) -> Correspondence:
    """Lay the source over the target and pair their triangles.

    `markers` (k, 2): (source vertex, target vertex), met exactly; None: derived, for upright bodies that face the same
    way, met only in the first steps. Pieces of the source with a marker are fitted to the pieces of the target with
    one (the largest to the largest where they are derived); the others ride along. TransferError for bad arrays,
    triangles without area, markers in conflict, surfaces that nowhere face one another.
    """
    source = as_surface("source", source_positions, source_triangles)
    target = as_surface("target", target_positions, target_triangles)
    pieces = [vertex_components(triangles, len(positions)) for positions, triangles in (source, target)]
    if markers is None:
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
        laid = ride((start, source[1]), fitted, laid)
    return Correspondence(laid, triangle_pairs((laid, source[1]), target), used, markers is None)


def part(mesh: Mesh, pieces: Ints, chosen: ArrayLike) -> Ints:
    """The triangles of the pieces with a label in `chosen`."""
    return np.flatnonzero(np.isin(pieces[mesh[1][:, 0]], chosen))


def checked_markers(markers: ArrayLike, pieces: list[Ints]) -> Ints:
    """Markers (k, 2) without repetitions. TransferError for one that names no vertex of a triangle, and for two of one
    vertex: two places for it, or a triangle pulled to a point.
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
    """The source moved over the target by a similarity, and its mean edge then: the unit of length of the fit.

    Markers that were given and span a plane fix it, else the bounding boxes do. One unit for both meshes: were each
    scaled to its own mean edge, w_I would hold a fine mesh to the size of a coarse one.
    """
    from_points, to_points = source[0][markers[:, 0]], target[0][markers[:, 1]]
    planes = trusted and span_a_plane(from_points) and span_a_plane(to_points)
    similarity = by_points(from_points, to_points) if planes else by_boxes(source, target)
    start = similarity.apply(source[0])
    return start, mean_edge(start, source[1])


def ride(rest: Mesh, fitted: Ints, laid: Floats) -> Floats:
    """Pieces without a marker go with the nearest triangles of those that were fitted (eyes with the head)."""
    positions, triangles = rest
    pairs = np.column_stack([fitted, fitted])
    carried = deformation_transfer(positions, triangles, pairs).pose(positions, triangles, laid)
    carried[np.unique(triangles[fitted])] = laid[np.unique(triangles[fitted])]
    return carried


def triangle_pairs(laid: Mesh, target: Mesh) -> Ints:
    """Pairs (p, 2): for each triangle of either mesh the closest of the other that faces its way, each pair once."""
    found = []
    for mesh, other, order in ((laid, target, [0, 1]), (target, laid, [1, 0])):
        nearest, _ = facing_surface(*other).closest_valid(centroids(*mesh), triangle_normals(*mesh))
        valid = np.flatnonzero(nearest >= 0)
        found.append(np.column_stack([valid, nearest[valid]])[:, order])
    return np.unique(np.concatenate(found), axis=0)
