"""Correspondence of two meshes of different topology (Sumner & Popovic 2004, section 4).

The source is aligned with the target by a similarity and deformed onto it by a non-rigid registration (section 4.1),

min over x, v4 of w_S sum over neighbours |T_i - T_j|^2 + w_I sum |T_i - I|^2 + w_C sum |x_i - c_i|^2,

markers being eliminated unknowns and c_i the closest point of the target with a compatible normal; w_C has the unit of
1 / length^2 and is meant for a mean edge of 1. Then each triangle of either is paired with the closest of the other
with a compatible normal.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import igl
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, diags_array, eye_array, kron
from scipy.spatial import cKDTree

from transfer.body_parts import BodyParts, body_parts, derive_markers
from transfer.deform import deformation_transfer
from transfer.errors import TransferError
from transfer.gradients import centroids, factorise, gradient_operator, inverse_frames, mean_edge
from transfer.part_warp import warped_onto
from transfer.triangle_surface import (
    Floats,
    Ints,
    adjacent_triangles,
    as_surface,
    largest_component,
    triangle_normals,
    vertex_components,
    vertex_normals,
)


@dataclass(frozen=True)
class Similarity:
    """Similarity x -> scale * rotation @ x + shift; rotation (3, 3), shift (3,)."""

    scale: float
    rotation: Floats
    shift: Floats

    def apply(self, points: Floats) -> Floats:
        """Transform points (k, 3)."""
        return self.scale * points @ self.rotation.T + self.shift


def by_points(source: Floats, target: Floats) -> Similarity:
    """Least-squares similarity from source to target points, (k, 3) (Umeyama 1991); not all collinear."""
    from_mean, to_mean = source.mean(axis=0), target.mean(axis=0)
    a, b = source - from_mean, target - to_mean
    left, singular, right = np.linalg.svd(b.T @ a)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    rotation = (left * signs) @ right
    scale = float((singular * signs).sum() / (a**2).sum())
    return Similarity(scale, rotation, to_mean - scale * rotation @ from_mean)


def by_boxes(source: tuple[Floats, Ints], target: tuple[Floats, Ints]) -> Similarity:
    """Similarity without rotation that matches the centres and the longest sides of the bounding boxes."""
    used = [positions[np.unique(triangles)] for positions, triangles in (source, target)]
    low, high = np.array([(p.min(axis=0), p.max(axis=0)) for p in used]).transpose(1, 0, 2)
    side = (high - low).max(axis=1)
    scale = float(side[1] / side[0])
    middle = (low + high) / 2.0
    return Similarity(scale, np.eye(3), middle[1] - scale * middle[0])


def span_a_plane(points: Floats) -> bool:
    """True where points (k, 3) are at least three and not collinear, so that they determine a rotation."""
    if len(points) < 3:
        return False
    singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(singular[1] > 1e-3 * singular[0])


CANDIDATES = 32
"""Nearest triangles searched where the closest point has an incompatible normal."""


@dataclass(frozen=True)
class FacingSurface:
    """Triangle mesh with search trees; made by `facing_surface`."""

    positions: Floats
    triangles: Ints
    normals: Floats
    middles: Floats
    boxes: Any
    tree: Any

    def closest_valid(self, points: Floats, normals: Floats) -> tuple[Ints, Floats]:
        """Closest valid triangles (k,), -1 for none, and positions (k, 3), of `points` (k, 3) with `normals` (k, 3).

        A point of the surface is valid where its triangle's normal makes less than 90 degrees with the given one.
        The closest point is taken where it is valid, else the nearest valid centroid of the CANDIDATES nearest
        triangles: on the far side of a fold the true point is within a triangle of it.
        """
        _, nearest, closest = self.boxes.squared_distance(self.positions, self.triangles, np.ascontiguousarray(points))
        triangles = np.asarray(nearest, dtype=np.int64).reshape(-1)
        positions = np.array(closest, dtype=np.float64).reshape(-1, 3)
        facing = np.einsum("ka,ka->k", self.normals[triangles], normals) > 0
        astray = np.flatnonzero(~facing)
        if len(astray):
            count = min(CANDIDATES, len(self.triangles))
            _, near = self.tree.query(points[astray], k=np.arange(1, count + 1))
            valid = np.einsum("kca,ka->kc", self.normals[near], normals[astray]) > 0
            first = near[np.arange(len(astray)), valid.argmax(axis=1)]
            triangles[astray] = np.where(valid.any(axis=1), first, -1)
            positions[astray] = self.middles[first]
        return triangles, positions


def facing_surface(positions: Floats, triangles: Ints) -> FacingSurface:
    """Build the search trees of a mesh, positions (n, 3) and triangles (m, 3)."""
    boxes = igl.AABB()
    positions, triangles = np.ascontiguousarray(positions), np.ascontiguousarray(triangles)
    boxes.init(positions, triangles)
    middles = centroids(positions, triangles)
    normals = triangle_normals(positions, triangles)
    return FacingSurface(positions, triangles, normals, middles, boxes, cKDTree(middles))


SMOOTHNESS, IDENTITY = 1.0, 1e-3
"""w_S and w_I."""
CLOSENESS = (1.0, 17.0, 292.0, 5000.0)
"""w_C of the four steps of phase 2: geometric from 1 to 5000."""
GENTLE = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
"""w_C of softer steps before them, for few or rough markers: w_S spreads an attraction over (w_S / w_C)^(1/4) edges,
so the first moves whole limbs, where 1 already moves single vertices."""
LET_GO = 1e-3
"""w_C from which rough markers are released: the limbs coincide by then, and a marker would only distort them."""


def lay_over(
    positions: Floats,
    triangles: Ints,
    target: FacingSurface,
    fixed: Ints,
    targets: Floats,
    rough: bool = False,
    progress: Callable[[str], None] | None = None,
    weights: tuple[float, ...] = (),
) -> Floats:
    """Register the mesh `positions` (n, 3), `triangles` (m, 3), mean edge length 1, to `target`; returns (n, 3).

    Vertices `fixed` (k,) go to `targets` (k, 3), at least one in each connected piece. `rough`: these are few and not
    exact; the GENTLE steps come first, and from LET_GO on they are free. Vertices of no triangle stay. weights: w_C of
    each step, in place of those.
    TransferError where no vertex has a compatible point of the target.
    """
    n = len(positions)
    operator = gradient_operator(inverse_frames(positions, triangles, "the source"), triangles, n)
    smooth = difference_operator(adjacent_triangles(triangles), len(triangles)) @ operator
    normal = SMOOTHNESS * (smooth.T @ smooth) + IDENTITY * (operator.T @ operator)
    right = IDENTITY * (operator.T @ np.tile(np.eye(3), (len(triangles), 1)))
    unknowns = np.concatenate([np.unique(triangles), n + np.arange(len(triangles))])
    laid = np.concatenate([positions, np.zeros((len(triangles), 3))])  # vertices, then fourth vertices
    weights = weights or (0.0, *(GENTLE if rough else ()), *CLOSENESS)
    laid[fixed] = targets
    for step, weight in enumerate(weights):
        held = fixed[:0] if rough and weight >= LET_GO else fixed
        moving = np.setdiff1d(unknowns, held)
        attraction_weights, closest = attraction(laid[:n], triangles, target, weight)
        system = normal[moving]
        matrix = system[:, moving] + diags_array(attraction_weights[moving])
        known = right[moving] + attraction_weights[moving, None] * closest[moving] - system[:, held] @ laid[held]
        laid[moving] = factorise(matrix).solve(known)
        if progress is not None:
            progress(f"registering the source to the target: {step + 1} of {len(weights)}")
    return laid[:n]


def attraction(laid: Floats, triangles: Ints, target: FacingSurface, weight: float) -> tuple[Floats, Floats]:
    """Weights (n + m,) and closest points (n + m, 3) of vertices and fourth vertices; weight 0 for none valid."""
    attraction_weights, closest = np.zeros(len(laid) + len(triangles)), np.zeros((len(laid) + len(triangles), 3))
    if weight:
        used = np.unique(triangles)
        nearest, closest[used] = target.closest_valid(laid[used], vertex_normals(laid, triangles)[used])
        attraction_weights[used] = weight * (nearest >= 0)
        if not attraction_weights.any():
            raise TransferError(
                "no point of the target has a normal compatible with the source.",
                "Reverse the orientation of one of them, or check the markers.",
            )
    return attraction_weights, closest


def difference_operator(pairs: Ints, count: int) -> csr_array:
    """Difference operator K (3p, 3m) of stacked 3x3 blocks over pairs; sqrt 2 as each pair counts in both orders."""
    rows = np.repeat(np.arange(len(pairs)), 2)
    values = np.sqrt(2.0) * np.tile([1.0, -1.0], len(pairs))
    return csr_array(kron(csr_array((values, (rows, pairs.ravel())), shape=(len(pairs), count)), eye_array(3)))


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
