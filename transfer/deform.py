"""Deformation transfer: the target deforms as the source does (Sumner & Popovic 2004, section 3.3).

min over x of sum over pairs (s, t) of w_st |S_s - T_t|^2, with S_s the source's deformation gradients and T_t the
target's. The normal matrix depends on the target and the pairs only: it is factorised once and serves every pose.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array, diags_array

from transfer.adjacency import vertex_components
from transfer.errors import TransferError
from transfer.gradients import (
    centroids,
    deformation_gradients,
    factorise,
    inverse_frames,
    plane_operator,
)
from transfer.surface import Floats, Ints, as_surface

WEAK = 1e-3
"""Weight of a triangle without a pair: it follows what its nearest paired triangle does, where nothing else asks."""


@dataclass(frozen=True)
class DeformationTransfer:
    """A target mesh that can be posed; made by `deformation_transfer`.

    rest_positions (n, 3) and triangles (m, 3) of the target; averages (m, source triangles named): row t holds the
    weights, of sum 1, of the source triangles that t follows; weights (m,) of each row; components (n,) -1 where no
    triangle uses a vertex; the rest is the factorised normal matrix without the pinned vertices.
    """

    rest_positions: Floats
    triangles: Ints
    averages: csr_array
    components: Ints
    free: Ints
    right_hand_side: csr_array
    factor: Any

    def pose(self, source_rest: Floats, source_triangles: Ints, source_deformed: Floats) -> Floats:
        """Target positions (n, 3) for one pose of the source.

        `source_rest` and `source_deformed` (k, 3) share `source_triangles`, the mesh that the pairs name. The place of
        each component is that of its triangles, carried along by their source triangles: a similarity of the
        source gives the same similarity of the target. TransferError where a source triangle in use has no area.
        """
        carried = carry(self.averages, source_rest, source_triangles, source_deformed)
        positions = np.zeros_like(self.rest_positions)
        stacked = carried.gradients.transpose(0, 2, 1).reshape(-1, 3)
        positions[self.free] = self.factor.solve(self.right_hand_side @ stacked)
        self.place(positions, carried)
        return positions

    def place(self, positions: Floats, carried: "Carried") -> None:
        """Move each component to where its triangles are carried; a vertex of no triangle goes with the nearest."""
        rest = centroids(self.rest_positions, self.triangles)
        asked = carried.move(rest, np.arange(len(rest)))
        shift = asked - centroids(positions, self.triangles)
        owner = self.components[self.triangles[:, 0]]
        used = self.components >= 0
        count = np.bincount(owner)
        mean = np.column_stack([np.bincount(owner, shift[:, a]) / count for a in range(3)])
        positions[used] += mean[self.components[used]]
        loose = np.flatnonzero(~used)
        if len(loose):
            nearest = nearest_rows(rest, self.rest_positions[loose])
            offset = self.rest_positions[loose] - rest[nearest]
            moved = centroids(positions, self.triangles)[nearest]
            positions[loose] = moved + np.einsum("lab,lb->la", carried.gradients[nearest], offset)


@dataclass(frozen=True)
class Carried:
    """What the source does, averaged for each target triangle: its gradient S (m, 3, 3) and the centroids
    from (m, 3) and to (m, 3) of what it follows.
    """

    gradients: Floats
    start: Floats
    end: Floats

    def move(self, points: Floats, rows: Ints) -> Floats:
        """Where `points` (k, 3), each fixed to a row's source triangles, are taken: b~ + S (p - b)."""
        return self.end[rows] + np.einsum("kab,kb->ka", self.gradients[rows], points - self.start[rows])


def carry(averages: csr_array, source_rest: Floats, source_triangles: Ints, source_deformed: Floats) -> Carried:
    """The `Carried` of one pose. TransferError for a source that does not fit the pairs."""
    rest, triangles = as_surface("source", source_rest, source_triangles)
    deformed, _ = as_surface("deformed source", source_deformed, source_triangles)
    if len(deformed) != len(rest) or averages.shape[1] > len(triangles):
        raise TransferError(
            f"the source has {len(rest)} vertices at rest, {len(deformed)} deformed and {len(triangles)} triangles, "
            f"but the pairs name triangle {averages.shape[1] - 1}.",
            "Pose with the mesh that the pairs were made for.",
        )
    named = np.flatnonzero(np.bincount(averages.indices, minlength=averages.shape[1]))
    used = triangles[named]
    gradients = np.zeros((averages.shape[1], 9))
    start, end = np.zeros((2, averages.shape[1], 3))
    inverses = inverse_frames(rest, used, "the source", named)
    gradients[named] = deformation_gradients(inverses, deformed, used).reshape(-1, 9)
    start[named], end[named] = centroids(rest, used), centroids(deformed, used)
    return Carried((averages @ gradients).reshape(-1, 3, 3), averages @ start, averages @ end)


def deformation_transfer(
    rest_positions: Floats, triangles: Ints, pairs: Ints, pair_weights: Floats | None = None
) -> DeformationTransfer:
    """Factorise once for the target `rest_positions` (n, 3), `triangles` (m, 3).

    `pairs` (p, 2): (source triangle, target triangle), many to many; `pair_weights` (p,) > 0, else 1. A target
    triangle without a pair follows, weakly, what the nearest paired one follows. TransferError for zero-area triangles
    and for pairs that name no triangle.
    """
    rest, triangles = as_surface("target", rest_positions, triangles)
    inverses = inverse_frames(rest, triangles, "the target")
    averages, weights = average_pairs(rest, triangles, pairs, pair_weights)
    components = vertex_components(triangles, len(rest))
    operator = plane_operator(inverses, triangles, len(rest))
    used = np.flatnonzero(components >= 0)
    pins = used[np.unique(components[used], return_index=True)[1]]
    free = np.setdiff1d(used, pins)
    columns = operator[:, free]
    right_hand_side = (columns.T @ diags_array(np.repeat(weights, 3))).tocsr()
    factor = factorise(right_hand_side @ columns)
    return DeformationTransfer(rest, triangles, averages, components, free, right_hand_side, factor)


def average_pairs(rest: Floats, triangles: Ints, pairs: Ints, pair_weights: Floats | None) -> tuple[csr_array, Floats]:
    """Averages (m, source triangles) with rows of sum 1, and the weight (m,) of each row."""
    pairs = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
    given = np.ones(len(pairs)) if pair_weights is None else np.asarray(pair_weights, dtype=np.float64)
    outside = np.flatnonzero((pairs < 0).any(axis=1) | (pairs[:, 1] >= len(triangles)))
    if len(pairs) == 0 or len(outside):
        what = f"pair {outside[0]} is {pairs[outside[0]].tolist()}" if len(outside) else "there is no pair"
        raise TransferError(
            f"{what}; the target has {len(triangles)} triangles.", "Give pairs (source triangle, target triangle)."
        )
    if given.shape != (len(pairs),) or not (given > 0).all():
        raise TransferError("the weights of the pairs are not one positive number a pair.", "Leave out pairs of 0.")
    sums = csr_array((given, (pairs[:, 1], pairs[:, 0])), shape=(len(triangles), pairs[:, 0].max() + 1))
    weights = np.bincount(pairs[:, 1], given, minlength=len(triangles))
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


def nearest_rows(points: Floats, queries: Floats) -> Ints:
    """For each of `queries` (k, 3) the index (k,) of the nearest of `points`."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(points).query(queries)[1], dtype=np.int64)
