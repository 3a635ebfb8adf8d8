"""Smallest motion of a sheet that meets displacement targets: one global step of projective dynamics.

    min over d:  1/2 sum_t A_t |grad d - (P_t - F_t)|^2 + alpha/2 |d|^2 + kappa/2 sum_c |sum_j w_cj d_j - s_c|^2

P_t is F_t with its principal stretches clipped to limits (Bouaziz et al. 2014): the sheet resists strain beyond those
alone, its displacement is smooth, and decays away from the targets.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from clothsim.base.arrays import Floats, Ints
from clothsim.geometry.kinematics.deformation_gradient import deformation_gradients

LIMITS, WIDEST = (0.6, 1.3), (0.3, 2.0)
"""Principal stretches that are not resisted, and how far those of the start widen them."""
KAPPA = 30.0
"""Weight of the targets over the mean diagonal of the Laplacian."""
SLACK = 1e-6
"""Stretches that far beyond their limits are not resisted: round-off."""
RINGS = 3
"""Vertices farther than that many times `spread` from a target, or from a strained triangle, stay."""
LEAST_SPREAD = 3.0
"""Least `spread`."""


@dataclass(frozen=True)
class DisplacementTargets:
    """Displacements s (c, 3) [m] that sums of w x, over rows (c, j) with weights (c, j), are to make.

    spread: edges over which the displacement decays.
    """

    rows: Ints
    weights: Floats
    shifts: Floats
    spread: float = LEAST_SPREAD


NO_TARGETS = DisplacementTargets(np.zeros((0, 1), np.int64), np.zeros((0, 1)), np.zeros((0, 3)))


class Sheet:
    """Rest shape of the sheet: its Laplacian and gradients.

    x (n, 3) [m]: start; material (m, 3, 2) [m]: corners of each triangle at rest; fixed (n,) bool: vertices that do not
    move; limits: principal stretches that are not resisted; None: LIMITS, widened to those of the start.
    """

    def __init__(
        self, x: Floats, triangles: Ints, material: Floats, fixed: np.ndarray, limits: tuple[float, float] | None = None
    ) -> None:
        self.triangles, self.fixed, n = triangles, fixed, len(fixed)
        shapes = np.stack([material[:, 1] - material[:, 0], material[:, 2] - material[:, 0]], axis=2)
        self.inverses = np.linalg.inv(shapes)
        self.areas = 0.5 * np.abs(np.linalg.det(shapes))
        self.gradients = np.concatenate([-self.inverses.sum(axis=1, keepdims=True), self.inverses], axis=1)
        blocks = self.areas[:, None, None] * (self.gradients @ self.gradients.transpose(0, 2, 1))
        i, j = np.repeat(triangles, 3, axis=1), np.tile(triangles, 3)
        self.laplacian = csr_array((blocks.ravel(), (i.ravel(), j.ravel())), shape=(n, n))
        self.adjacency = csr_array((np.ones(i.size), (i.ravel(), j.ravel())), shape=(n, n))
        self.unit = float(self.laplacian.diagonal().mean())
        least, most = self.stretches(x)
        self.lower: Floats = np.clip(least, WIDEST[0], LIMITS[0])
        self.upper: Floats = np.clip(most, LIMITS[1], WIDEST[1])
        if limits is not None:
            self.lower, self.upper = (np.full(len(triangles), limit) for limit in limits)

    def stretches(self, x: Floats) -> tuple[Floats, Floats]:
        """Return the principal stretches of each triangle, (m,) and (m,): the smaller, the larger."""
        F = deformation_gradients(x, self.triangles, self.inverses)
        C = F.transpose(0, 2, 1) @ F
        middle, half = 0.5 * (C[:, 0, 0] + C[:, 1, 1]), np.hypot(0.5 * (C[:, 0, 0] - C[:, 1, 1]), C[:, 0, 1])
        return np.sqrt(np.maximum(middle - half, 0.0)), np.sqrt(middle + half)

    def strain_forces(self, x: Floats) -> tuple[Floats, Ints]:
        """Return the forces (n, 3) that draw triangles back into their limits, and those triangles."""
        least, most = self.stretches(x)
        strained = np.flatnonzero((least < self.lower - SLACK) | (most > self.upper + SLACK))
        F = deformation_gradients(x, self.triangles[strained], self.inverses[strained])
        U, stretch, V = np.linalg.svd(F, full_matrices=False)
        bounded = np.clip(stretch, self.lower[strained, None], self.upper[strained, None])
        change = U @ ((bounded - stretch)[:, :, None] * V)
        parts = self.areas[strained, None, None] * (change @ self.gradients[strained].transpose(0, 2, 1))
        forces = np.zeros_like(x)
        np.add.at(forces, self.triangles[strained], parts.transpose(0, 2, 1))
        return forces, strained

    def displacement(self, x: Floats, targets: DisplacementTargets) -> Floats:
        """Return d (n, 3) [m]."""
        forces, strained = self.strain_forces(x)
        n, c = len(x), len(targets.rows)
        here = np.zeros(n, bool)
        here[targets.rows[targets.weights != 0]] = True
        here[self.triangles[strained]] = True
        near = here.astype(np.float64)
        for _ in range(int(RINGS * targets.spread)):
            near = (self.adjacency @ near > 0).astype(np.float64)
        free = np.flatnonzero((near > 0) & ~self.fixed)
        if not len(free):
            return np.zeros_like(x)
        cells = (np.repeat(np.arange(c), targets.rows.shape[1]), targets.rows.ravel())
        W = csr_array((targets.weights.ravel(), cells), shape=(c, n))[:, free]
        kappa = KAPPA * self.unit
        matrix = (
            self.laplacian[free][:, free]
            + diags_array(np.full(len(free), self.unit / targets.spread**2))
            + kappa * W.T @ W
        )
        load = forces[free] + kappa * (W.T @ targets.shifts)
        options = {"SymmetricMode": True}
        solver = splu(csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        moved = np.zeros_like(x)
        moved[free] = solver.solve(load)
        return moved
