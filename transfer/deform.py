"""Deformation transfer: the target deforms as the source does (Sumner & Popovic 2004, section 3.3).

min over x of sum over pairs (s, t) of w_st |S_s - T_t|^2, with S_s the source's deformation gradients and T_t the
target's. The normal matrix depends on the target and the pairs only: it is factorised once and serves every pose.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, diags_array, eye_array

from transfer.adjacency import vertex_components
from transfer.errors import TransferError
from transfer.follow import Carried, followed_source
from transfer.gradients import (
    centroids,
    factorise,
    inverse_frames,
    plane_operator,
)
from transfer.triangle_surface import Floats, Ints, as_surface

WEAK = 1e-3
"""Weight of a triangle without a pair: it follows what its nearest paired triangle does, where nothing else asks."""


@dataclass(frozen=True)
class DeformationTransfer:
    """A target mesh that can be posed; made by `deformation_transfer`.

    rest_positions (n, 3) and triangles (m, 3) of the target; averages (m, source triangles named): row t holds the
    weights, of sum 1, of the source triangles that t follows; components (n,) of the vertices, -1 where no triangle is;
    free: the vertices that are solved for; anchor: see there; right_hand_side (free, 3m); factor: of the normal matrix.
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
        """The mean over the triangles of each component, (components, m)."""
        owner = self.components[self.triangles[:, 0]]
        return csr_array((1.0 / np.bincount(owner)[owner], (owner, np.arange(len(owner)))))

    @cached_property
    def middles(self) -> csr_array:
        """The mean over the triangles' centroids of each component, (components, n)."""
        m, n = len(self.triangles), len(self.rest_positions)
        corners = csr_array((np.full(3 * m, 1 / 3), (np.repeat(np.arange(m), 3), self.triangles.ravel())), shape=(m, n))
        return (self.parts @ corners).tocsr()

    @cached_property
    def rest_middles(self) -> Floats:
        """Of each component at rest, (components, 3)."""
        return np.asarray(self.middles @ self.rest_positions)

    def pose(self, source_rest: ArrayLike, source_triangles: ArrayLike, source_deformed: ArrayLike) -> Floats:
        """Target positions (n, 3) for one pose of the source.

        `source_rest` and `source_deformed` (k, 3) share `source_triangles`, the mesh that the pairs name. A similarity
        of the source gives the same similarity of the target, its place included: a component without anchors keeps
        its offset from what it follows. TransferError where a source triangle in use has no area.
        """
        return self.follow(source_rest, source_triangles)(source_deformed)

    def follow(self, source_rest: ArrayLike, source_triangles: ArrayLike) -> Callable[[ArrayLike], Floats]:
        """`pose` for many poses of one source: a function from the deformed source (k, 3) to the target (n, 3)."""
        source = followed_source(self.averages, source_rest, source_triangles)
        return lambda deformed: self.solve(source.carried(deformed))

    def solve(self, carried: Carried) -> Floats:
        """Positions (n, 3) whose gradients are nearest to the carried ones."""
        right = self.right_hand_side @ carried.gradients.transpose(0, 2, 1).reshape(-1, 3)
        if self.anchor > 0:
            right += self.anchor * carried.vertices(self.rest_positions, self.triangles)[self.free]
        positions = np.zeros_like(self.rest_positions)
        positions[self.free] = self.factor.solve(right)
        if self.anchor == 0:
            positions += self.component_shifts(positions, carried)
        return self.with_loose_vertices(positions, carried)

    def component_shifts(self, positions: Floats, carried: Carried) -> Floats:
        """How far (n, 3) each vertex's component has to move to keep its offset from what it follows.

        The offset of their centroids turns with the component's mean gradient and scales with the gradients' size. The
        mean of b~ + S (p - b) over the triangles would not come back when the pose is undone (10 mm on a body whose
        arms are raised by 45 degrees).
        """
        parts, gradients = self.parts, carried.gradients.reshape(-1, 9)
        offset = self.rest_middles - parts @ carried.start
        size = parts @ np.sqrt(np.einsum("tk,tk->t", gradients, gradients) / 3.0)
        turn = nearest_rotations((parts @ gradients).reshape(-1, 3, 3))
        asked = parts @ carried.end + size[:, None] * np.einsum("cab,cb->ca", turn, offset)
        shift = asked - self.middles @ positions
        return np.where(self.components[:, None] >= 0, shift[self.components], 0.0)

    def with_loose_vertices(self, positions: Floats, carried: Carried) -> Floats:
        """A vertex of no triangle goes with the nearest one."""
        loose = np.flatnonzero(self.components < 0)
        if len(loose):
            rest = centroids(self.rest_positions, self.triangles)
            nearest = nearest_rows(rest, self.rest_positions[loose])
            offset = np.einsum("lab,lb->la", carried.gradients[nearest], self.rest_positions[loose] - rest[nearest])
            positions[loose] = centroids(positions, self.triangles)[nearest] + offset
        return positions


def deformation_transfer(
    rest_positions: ArrayLike,
    triangles: ArrayLike,
    pairs: ArrayLike,
    pair_weights: ArrayLike | None = None,
    anchor: float = 0.0,
) -> DeformationTransfer:
    """Factorise once for the target `rest_positions` (n, 3), `triangles` (m, 3).

    `pairs` (p, 2): (source triangle, target triangle), many to many; `pair_weights` (p,) > 0, else 1. A target
    triangle without a pair follows, weakly, what the nearest paired one follows. One vertex of each component is pinned
    while solving; with `anchor` > 0 [1 / length^2] nothing is, and anchor |x_i - a_i|^2 is added, a_i being where the
    vertex is carried by what its triangles follow. TransferError for zero-area triangles and pairs that do not exist.
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
        raise TransferError("the weights of the pairs are not one positive number a pair.", "Leave out pairs of 0.")
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
    """For each of `queries` (k, 3) the index (k,) of the nearest of `points`."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(points).query(queries)[1], dtype=np.int64)


def nearest_rotations(matrices: Floats) -> Floats:
    """The rotation (k, 3, 3) nearest to each matrix."""
    left, _, right = np.linalg.svd(matrices)
    left[:, :, 2] *= np.linalg.det(left @ right)[:, None]
    return left @ right
