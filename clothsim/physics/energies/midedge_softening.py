"""Mid-edge bending that softens, or stiffens, as it bends.

With the curvature k of a triangle, 1 along the warp, and the matrix B of `plate_law`'s form whose entries give each
direction its slope, n = (k'Bk)^(1/2), the energy per area is that of the plate and a cubic term,

    w = k'Ck/2 + sign(s) c(n),   c = n^3/3 up to n_c, beyond it with the constant second derivative 2 n_c.

A cylinder along warp, weft or bias has n^3 = |s| k^3: its moment is w' = D k + s k^2 (a secant: of measured cloth 99 %
have s < 0, Feng et al. 2022, "Learning-based bending stiffness parameter estimation by a drape tester", ACM TOG). As
0 <= c'' and c'/n <= 2 n_c, w is C2, and convex with at least a part f of the plate's tangent in every direction where
2 n_c B <= (1 - f) C, which gives n_c. The direction that loses most reaches f; the others stop with it.

The Gauss-Newton Hessian of a softening sheet is below that of the plate, so Newton's springs bound it too.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.geometry.kinematics.curvature import matrices_of_threads, plate_law, threads_in_triangles
from clothsim.mesh.cloth import Hinges
from clothsim.mesh.world import World
from clothsim.physics.energies.midedge_bending import MidedgeBending, midedge_bending

LEAST_TANGENT = 0.2
"""f, the least part of the bending stiffness that softening leaves; stiffening adds 1 - f at most."""


@dataclass(frozen=True)
class SofteningBending(MidedgeBending):
    """E = |G (theta - theta0)|^2/2 + sum a c(|L e|), e = G (theta - theta0) of each triangle.

    Parameters
    ----------
    amounts : (m,) array
        a = sign(s) A [m2].
    maps : (m, 3, 3) array
        L, from the strains of a triangle [sqrt(J)] to B^(1/2) k.
    caps : (m,) array
        n_c.
    """

    amounts: Floats
    maps: Floats
    caps: Floats

    per_triangle: ClassVar[tuple[str, ...]] = (*MidedgeBending.per_triangle, "amounts", "maps", "caps")

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        plate = super().value(x)
        if not np.isfinite(plate):
            return plate
        n = np.linalg.norm(self._mapped(x), axis=1)
        beyond = np.maximum(n - self.caps, 0.0)
        least = n - beyond
        return plate + float(self.amounts @ (least**3 / 3 + least**2 * beyond + least * beyond**2))

    def _moments(self, x: Floats) -> Floats:
        mapped = self._mapped(x)
        along, _ = self._derivatives(mapped)
        stresses = np.einsum("m,mki,mk->mi", self.amounts * along, self.maps, mapped)
        forces = np.einsum("mqj,mq->mj", self.weights, stresses)
        added = np.bincount(self.stencils.ravel(), weights=forces.ravel(), minlength=len(self.vertices))
        return super()._moments(x) + added

    def _tangents(self, x: Floats) -> Floats:
        """C'G with C C' the second derivative of w over the strains."""
        mapped = self._mapped(x)
        along, curved = self._derivatives(mapped)
        n = np.linalg.norm(mapped, axis=1)[:, None]
        unit = np.divide(mapped, n, out=np.zeros_like(mapped), where=n > 0)
        inner = along[:, None, None] * np.eye(3) + np.einsum("m,mi,mj->mij", curved - along, unit, unit)
        tangent = np.eye(3) + np.einsum("m,mki,mkl,mlj->mij", self.amounts, self.maps, inner, self.maps, optimize=True)
        return np.einsum("mkq,mkj->mqj", np.linalg.cholesky(tangent), self.weights)

    def _mapped(self, x: Floats) -> Floats:
        """L e, (m, 3)."""
        change = self._change(x)
        bent = np.where(np.isinf(change), 0.0, change)
        return np.einsum("mik,mkj,mj->mi", self.maps, self.weights, bent[self.stencils], optimize=True)

    def _derivatives(self, mapped: Floats) -> tuple[Floats, Floats]:
        """c'/n and c'' of n = |L e|, (m,) each."""
        n = np.asarray(np.linalg.norm(mapped, axis=1), np.float64)
        least = np.minimum(n, self.caps)
        beyond = n > self.caps
        slope = np.where(beyond, least**2 + 2 * least * (n - least), 0.0)
        return np.divide(slope, n, out=n.copy(), where=beyond), 2 * least


INHERITED = ("vertices", "rest_angles", "bounds", "stencils", *MidedgeBending.per_triangle)
"""Fields of the plate."""


def softening_bending(hinges: Hinges, world: World, angles: Floats) -> SofteningBending:
    """The bending energy of hinges, of fabrics with a slope; angles (m,) of the warp [rad]."""
    plate = midedge_bending(hinges, world, angles)
    triangles = plate.triangles
    areas, nu = world.rest_areas, world.per_triangle("poisson_ratio")
    slopes = {way: world.per_triangle(f"slope_along_{way}") for way in ("warp", "weft", "bias")}
    warp, weft, bias = (np.abs(slopes[way]) ** (2 / 3) for way in ("warp", "weft", "bias"))
    twist = np.maximum(2 * bias - (warp + weft) / 2 - nu * np.sqrt(warp * weft), 0.0)
    turn = threads_in_triangles(world, angles)
    norms = np.einsum("mki,mkl,mlj->mij", turn, matrices_of_threads(warp, twist, weft, nu), turn)[triangles]
    values, vectors = np.linalg.eigh(norms)
    roots = np.einsum("mik,mk,mjk->mij", vectors, np.sqrt(np.maximum(values, 0.0)), vectors)
    strains = plate_law(world, angles).roots()[triangles] * np.sqrt(plate.stiffnesses)[:, None, None]
    maps = roots @ np.linalg.pinv(strains)
    largest = areas[triangles] * np.linalg.norm(maps, ord=2, axis=(1, 2)) ** 2
    caps = np.divide((1 - LEAST_TANGENT) / 2, largest, out=np.zeros_like(largest), where=largest > 0)
    signs = np.sign(sum(slopes.values()))[triangles]
    base = {name: getattr(plate, name) for name in INHERITED}
    if (signs > 0).any():
        base["bounds"] = (2 - LEAST_TANGENT) * plate.bounds
    return SofteningBending(**base, amounts=signs * areas[triangles], maps=maps, caps=caps)
