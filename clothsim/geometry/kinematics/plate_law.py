"""Kirchhoff plate laws: bending energy per area of the curvature, isotropic or orthotropic.

With curvatures k = (k_11, sqrt(2) k_12, k_22), 1 along the warp, the energy is k'Ck/2 per area with

    C = [[D1, 0, D12], [0, T, 0], [D12, 0, D2]],  D12 = nu sqrt(D1 D2)

so that strips cut along warp and weft bend with D1 (1 - nu^2) and D2 (1 - nu^2). D1 = D2 = D with the twisting
stiffness T = (1 - nu) D is the isotropic plate, D/2 [(1 - nu) |S|^2 + nu tr(S)^2] (Timoshenko & Woinowsky-Krieger 1959,
Theory of plates and shells, section 85).
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.geometry.kinematics.warp_weft import thread_axes
from clothsim.mesh.world import World

ROOT2 = np.sqrt(2)


class PlateLaw(Protocol):
    """C of each triangle over its bending stiffness."""

    def roots(self) -> Floats:
        """The symmetric roots of C in the frames of the triangles, (m, 3, 3)."""

    def border_moments(self, triangles: Ints, directions: Floats) -> Floats:
        """The moments across edges of `directions (k,)` [rad] for each unit curvature in the edges' frames, (k, 3)."""


@dataclass(frozen=True)
class IsotropicPlates:
    """Plates of Poisson's ratios nu (m,)."""

    nu: Floats

    def roots(self) -> Floats:
        """The symmetric root of (1 - nu) |k|^2 + nu (k_xx + k_yy)^2, (m, 3, 3)."""
        trace = np.outer([1, 0, 1], [1, 0, 1]) / 2
        low, high = np.sqrt(1 - self.nu)[:, None, None], np.sqrt(1 + self.nu)[:, None, None]
        return low * np.eye(3) + (high - low) * trace

    def border_moments(self, triangles: Ints, directions: Floats) -> Floats:
        """nu k_tt + k_nn, (k, 3)."""
        nu = self.nu[triangles]
        return np.column_stack([nu, 0 * nu, 1 + 0 * nu])


@dataclass(frozen=True)
class OrthotropicPlates:
    """Plates of matrices C (m, 3, 3) in the frames of their triangles."""

    matrices: Floats

    def roots(self) -> Floats:
        """The symmetric roots, (m, 3, 3)."""
        values, vectors = np.linalg.eigh(self.matrices)
        return np.einsum("mik,mk,mjk->mij", vectors, np.sqrt(np.maximum(values, 0.0)), vectors)

    def border_moments(self, triangles: Ints, directions: Floats) -> Floats:
        """The last row of C in the edge's frame, (k, 3)."""
        turn = rotation_of_curvature(directions)
        return np.einsum("kj,kjl,kil->ki", turn[:, 2], self.matrices[triangles], turn)


def plate_law(world: World, angles: Floats) -> PlateLaw:
    """Law of a world's triangles: orthotropic where a fabric has bending stiffnesses of its own along warp or weft.

    Parameters
    ----------
    world : World
        Cloths with their fabrics, m triangles.
    angles : (m,) array
        Angle from the cloth's first axis to the warp [rad].

    Returns
    -------
    PlateLaw
        Over `Fabric.bending_stiffness`, in the frames of `World.rest_shapes`, mirrored ones reflected back along y.
    """
    nu = world.per_triangle("poisson_ratio")
    if not world.per_triangle("has_own_bending").any():
        return IsotropicPlates(nu)
    names = "bending_along_warp", "bending_along_weft", "twisting_stiffness", "bending_stiffness"
    warp, weft, twist, stiffness = (world.per_triangle(name) for name in names)
    by_threads = np.zeros((len(nu), 3, 3))
    by_threads[:, 0, 0], by_threads[:, 1, 1], by_threads[:, 2, 2] = warp, twist, weft
    by_threads[:, 0, 2] = by_threads[:, 2, 0] = nu * np.sqrt(warp * weft)
    by_threads /= np.where(stiffness > 0, stiffness, 1.0)[:, None, None]
    axis = thread_axes(world, angles)[:, :, 0]
    turn = rotation_of_curvature(np.arctan2(np.sign(np.linalg.det(world.rest_shapes)) * axis[:, 1], axis[:, 0]))
    return OrthotropicPlates(np.einsum("mki,mkl,mlj->mij", turn, by_threads, turn))


def rotation_of_curvature(angle: Floats) -> Floats:
    """Orthogonal matrices (..., 3, 3) that express curvatures in a frame rotated by `angle (...)` [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    rows = [
        [c * c, ROOT2 * c * s, s * s],
        [-ROOT2 * c * s, c * c - s * s, ROOT2 * c * s],
        [s * s, -ROOT2 * c * s, c * c],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
