"""Deformation transfer from a source to a target mesh (Sumner & Popovic 2004, section 3.3).

min over x of sum over pairs (s, t) of w_st |S_s - T_t|^2, with S_s the source's deformation gradients, averaged over
the triangles that a target triangle follows, and T_t the target's. The normal matrix depends on the target and the
pairs only: it is factorised once and serves every pose.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, diags_array, eye_array
from scipy.spatial import cKDTree

from transfer.errors import TransferError
from transfer.gradients import centroids, deformation_gradients, factorise, inverse_frames, plane_operator
from transfer.triangle_surface import Floats, Ints, as_points, as_surface, vertex_components

REMEDY = "Pose with the mesh that the pairs were made for."


@dataclass(frozen=True)
class AveragedMotion:
    """Averaged source motion of each target triangle.

    gradients S (m, 3, 3); mean centroids of the followed source triangles at rest, start (m, 3), and deformed, end
    (m, 3) [m].
    """

    gradients: Floats
    start: Floats
    end: Floats

    def vertices(self, positions: Floats, triangles: Ints) -> Floats:
        """Images of vertices (n, 3): the mean over their triangles of b~ + S (x - b) [m]."""
        n, m = len(positions), len(triangles)
        fraction = 1.0 / np.maximum(np.bincount(triangles.ravel(), minlength=n), 1)
        entries = (fraction[triangles].ravel(), (triangles.ravel(), np.repeat(np.arange(m), 3)))
        mean = csr_array(entries, shape=(n, m))
        gradients = (mean @ self.gradients.reshape(m, 9)).reshape(n, 3, 3)
        origin = self.end - np.einsum("tab,tb->ta", self.gradients, self.start)
        return mean @ origin + np.einsum("nab,nb->na", gradients, positions)


@dataclass(frozen=True)
class SourceFrames:
    """Source at rest with inverse frames for many poses; made by `source_frames`.

    vertices: their number; triangles (k, 3): those that are followed; inverses (k, 3, 3) of their rest frames;
    averages (m, k); start (m, 3): mean rest centroid of the triangles that each row follows [m].
    """

    vertices: int
    triangles: Ints
    inverses: Floats
    averages: csr_array
    start: Floats

    @cached_property
    def one_to_one(self) -> bool:
        """True where each row follows only the triangle of the same index, as on bodies with one mesh."""
        same = self.averages.shape == (len(self.triangles),) * 2 and self.averages.nnz == len(self.triangles)
        return same and bool((self.averages.diagonal() == 1.0).all())

    @cached_property
    def middles(self) -> csr_array:
        """Operator from source vertices to the mean centroid of the triangles that each row follows, (m, vertices)."""
        k = len(self.triangles)
        entries = (np.full(3 * k, 1 / 3), (np.repeat(np.arange(k), 3), self.triangles.ravel()))
        return (self.averages @ csr_array(entries, shape=(k, self.vertices))).tocsr()

    def averaged(self, deformed: ArrayLike) -> AveragedMotion:
        """Averaged motion of the pose `deformed` (vertices, 3). TransferError for another number of vertices."""
        positions = as_points("deformed source", deformed)
        if len(positions) != self.vertices:
            raise TransferError(f"the source has {self.vertices} vertices, the deformed one {len(positions)}.", REMEDY)
        gradients = deformation_gradients(self.inverses, positions, self.triangles).reshape(-1, 9)
        mean = gradients if self.one_to_one else self.averages @ gradients
        return AveragedMotion(mean.reshape(-1, 3, 3), self.start, self.middles @ positions)


def source_frames(averages: csr_array, rest: ArrayLike, triangles: ArrayLike) -> SourceFrames:
    """Prepare a source at rest; averages (m, source triangles): weights of the triangles that each row follows.

    TransferError where a followed triangle does not exist or has no area.
    """
    positions, every = as_surface("source", rest, triangles)
    if averages.shape[1] > len(every):
        raise TransferError(
            f"the pairs name triangle {averages.shape[1] - 1} of the source, which has {len(every)}.", REMEDY
        )
    named = np.flatnonzero(np.bincount(averages.indices, minlength=averages.shape[1]))
    used, narrow = every[named], averages[:, named]
    inverses = inverse_frames(positions, used, "the source", named)
    return SourceFrames(len(positions), used, inverses, narrow, narrow @ centroids(positions, used))


WEAK = 1e-3
"""Weight of a triangle without a pair, which follows its nearest paired triangle."""


@dataclass(frozen=True)
class DeformationTransfer:
    """Factorized deformation transfer to one target mesh; made by `deformation_transfer`.

    Attributes
    ----------
    rest_positions : ndarray (n, 3)
        Target vertices at rest [m].
    triangles : ndarray (m, 3)
    averages : sparse (m, source triangles)
        Row t: weights, of sum 1, of the source triangles that t follows.
    components : ndarray (n,)
        Component of each vertex, -1 where no triangle uses it.
    free : ndarray
        Vertices that are solved for.
    anchor : float
        Weight of the anchors [1/m^2]; see `deformation_transfer`.
    right_hand_side : sparse (free, 3m)
    factor : object
        Factorization of the normal matrix, with `solve`.
    """

    rest_positions: Floats
    triangles: Ints
    averages: csr_array
    components: Ints
    free: Ints
    anchor: float
    right_hand_side: csr_array
    factor: Any

    @cached_property
    def parts(self) -> csr_array:
        """Operator of means over the triangles of each component, (components, m)."""
        owner = self.components[self.triangles[:, 0]]
        return csr_array((1.0 / np.bincount(owner)[owner], (owner, np.arange(len(owner)))))

    @cached_property
    def middles(self) -> csr_array:
        """Operator from vertices to the mean triangle centroid of each component, (components, n)."""
        m, n = len(self.triangles), len(self.rest_positions)
        corners = csr_array((np.full(3 * m, 1 / 3), (np.repeat(np.arange(m), 3), self.triangles.ravel())), shape=(m, n))
        return (self.parts @ corners).tocsr()

    @cached_property
    def rest_middles(self) -> Floats:
        """Mean triangle centroid of each component at rest, (components, 3) [m]."""
        return np.asarray(self.middles @ self.rest_positions)

    def pose(self, source_rest: ArrayLike, source_triangles: ArrayLike, source_deformed: ArrayLike) -> Floats:
        """Target positions for one pose of the source.

        A similarity of the source gives the same similarity of the target, translation included: a component without
        anchors keeps its offset from the triangles that it follows.

        Parameters
        ----------
        source_rest, source_deformed : array_like (k, 3)
            Source vertices at rest and in the pose [m].
        source_triangles : array_like (l, 3)
            Source mesh, whose triangles the pairs name.

        Returns
        -------
        ndarray (n, 3)
            Target vertices [m].

        Raises
        ------
        TransferError
            Invalid arrays, or a source triangle in use without area.
        """
        return self.follow(source_rest, source_triangles)(source_deformed)

    def follow(self, source_rest: ArrayLike, source_triangles: ArrayLike) -> Callable[[ArrayLike], Floats]:
        """`pose` for many poses of one source: a function from deformed source (k, 3) to target (n, 3) [m]."""
        source = source_frames(self.averages, source_rest, source_triangles)
        return lambda deformed: self.solve(source.averaged(deformed))

    def solve(self, averaged: AveragedMotion) -> Floats:
        """Positions (n, 3) [m] with gradients nearest to the averaged source gradients."""
        right = self.right_hand_side @ averaged.gradients.transpose(0, 2, 1).reshape(-1, 3)
        if self.anchor > 0:
            right += self.anchor * averaged.vertices(self.rest_positions, self.triangles)[self.free]
        positions = np.zeros_like(self.rest_positions)
        positions[self.free] = self.factor.solve(right)
        if self.anchor == 0:
            positions += self.component_shifts(positions, averaged)
        return self.with_loose_vertices(positions, averaged)

    def component_shifts(self, positions: Floats, averaged: AveragedMotion) -> Floats:
        """Translation (n, 3) of each vertex's component that keeps its offset from the triangles it follows.

        The offset of the centroids rotates with the component's mean gradient and scales with the gradients' size. The
        mean of b~ + S (p - b) over the triangles is not restored when the pose is undone (10 mm on a body whose
        arms are raised by 45 degrees).
        """
        parts, gradients = self.parts, averaged.gradients.reshape(-1, 9)
        offset = self.rest_middles - parts @ averaged.start
        size = parts @ np.sqrt(np.einsum("tk,tk->t", gradients, gradients) / 3.0)
        turn = nearest_rotations((parts @ gradients).reshape(-1, 3, 3))
        asked = parts @ averaged.end + size[:, None] * np.einsum("cab,cb->ca", turn, offset)
        shift = asked - self.middles @ positions
        return np.where(self.components[:, None] >= 0, shift[self.components], 0.0)

    def with_loose_vertices(self, positions: Floats, averaged: AveragedMotion) -> Floats:
        """Positions in which vertices of no triangle follow the nearest triangle."""
        loose = np.flatnonzero(self.components < 0)
        if len(loose):
            rest = centroids(self.rest_positions, self.triangles)
            nearest = nearest_rows(rest, self.rest_positions[loose])
            offset = np.einsum("lab,lb->la", averaged.gradients[nearest], self.rest_positions[loose] - rest[nearest])
            positions[loose] = centroids(positions, self.triangles)[nearest] + offset
        return positions


def deformation_transfer(
    rest_positions: ArrayLike,
    triangles: ArrayLike,
    pairs: ArrayLike,
    pair_weights: ArrayLike | None = None,
    anchor: float = 0.0,
) -> DeformationTransfer:
    """Factorize the deformation transfer to a target mesh.

    A target triangle without a pair follows, weakly, the source triangles of the nearest paired one.

    Parameters
    ----------
    rest_positions : array_like (n, 3)
        Target vertices at rest [m].
    triangles : array_like (m, 3)
        Target mesh.
    pairs : array_like (p, 2)
        (source triangle, target triangle), many to many.
    pair_weights : array_like (p,), optional
        Positive weights; None: 1.
    anchor : float
        With `anchor` > 0 [1/m^2] the energy gains anchor |x_i - a_i|^2, a_i being the mean of the positions to which
        the followed source triangles map vertex i. With 0, one vertex of each component is fixed while solving.

    Raises
    ------
    TransferError
        Invalid arrays, target triangles without area, or pairs that name no triangle.

    Examples
    --------
    A square follows a larger square that is stretched twofold in x:

    >>> import numpy as np
    >>> from transfer.deform import deformation_transfer
    >>> square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    >>> triangles = np.array([[0, 1, 2], [0, 2, 3]])
    >>> transfer = deformation_transfer(square, triangles, pairs=[[0, 0], [1, 1]])
    >>> moved = transfer.pose(3 * square, triangles, 3 * square * [2, 1, 1])
    >>> np.ptp(moved, axis=0).round(6).tolist()
    [2.0, 1.0, 0.0]
    """
    rest, triangles = as_surface("target", rest_positions, triangles)
    inverses = inverse_frames(rest, triangles, "the target")
    averages, weights = average_pairs(rest, triangles, pairs, pair_weights)
    components = vertex_components(triangles, len(rest))
    free = np.flatnonzero(components >= 0)
    if anchor == 0:
        free = np.delete(free, np.unique(components[free], return_index=True)[1])
    operator = plane_operator(inverses, triangles, len(rest))[:, free]
    right_hand_side = (operator.T @ diags_array(np.repeat(weights, 3))).tocsr()
    factor = factorise(right_hand_side @ operator + anchor * eye_array(len(free)))
    return DeformationTransfer(rest, triangles, averages, components, free, anchor, right_hand_side, factor)


def average_pairs(
    rest: Floats, triangles: Ints, pairs: ArrayLike, pair_weights: ArrayLike | None
) -> tuple[csr_array, Floats]:
    """Averages (m, source triangles) with rows of sum 1, and the weight (m,) of each row."""
    pairs = as_pairs(pairs, len(triangles))
    given = np.ones(len(pairs)) if pair_weights is None else np.asarray(pair_weights, dtype=np.float64)
    if given.shape != (len(pairs),) or not (given > 0).all():
        raise TransferError("pair_weights must hold one positive number a pair.", "Leave out pairs of weight 0.")
    sums = csr_array((given, (pairs[:, 1], pairs[:, 0])), shape=(len(triangles), pairs[:, 0].max() + 1))
    weights = np.asarray(np.bincount(pairs[:, 1], given, minlength=len(triangles)), dtype=np.float64)
    bare = np.flatnonzero(weights == 0)
    averages = (diags_array(1.0 / np.where(weights > 0, weights, 1.0)) @ sums).tocsr()
    if len(bare):
        paired = np.flatnonzero(weights > 0)
        middle = centroids(rest, triangles)
        lender = np.arange(len(triangles))
        lender[bare] = paired[nearest_rows(middle[paired], middle[bare])]
        averages = averages[lender]
        weights[bare] = WEAK
    return averages, weights


def as_pairs(pairs: ArrayLike, target_triangles: int) -> Ints:
    """`pairs` as int64 (p, 2), p > 0. TransferError where one names no triangle."""
    given = np.asarray(pairs)
    if given.ndim != 2 or given.shape[1] != 2 or given.dtype.kind not in "iu" or len(given) == 0:
        raise TransferError(
            f"the pairs have shape {given.shape} and type {given.dtype}.",
            "Give whole numbers (p, 2), p > 0: a source triangle and a target triangle a row.",
        )
    outside = np.flatnonzero((given < 0).any(axis=1) | (given[:, 1] >= target_triangles))
    if len(outside):
        raise TransferError(
            f"pair {outside[0]} = {given[outside[0]].tolist()} names no triangle; the target has {target_triangles}.",
            "Give pairs (source triangle, target triangle), counted from 0.",
        )
    return given.astype(np.int64)


def nearest_rows(points: Floats, queries: Floats) -> Ints:
    """Index (k,) of the nearest of `points` to each of `queries` (k, 3)."""
    return np.asarray(cKDTree(points).query(queries)[1], dtype=np.int64)


def nearest_rotations(matrices: Floats) -> Floats:
    """Nearest rotation (k, 3, 3) to each matrix, by SVD."""
    left, _, right = np.linalg.svd(matrices)
    left[:, :, 2] *= np.linalg.det(left @ right)[:, None]
    return left @ right
