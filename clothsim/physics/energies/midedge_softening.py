"""Nonlinear mid-edge bending: stiffness that changes with the curvature, and hysteresis.

With the curvature k of a triangle, 1 along the warp, and the matrix B of `plate_law`'s form whose entries give each
direction its slope, n = (k'Bk)^(1/2), the energy per area is that of the plate and a cubic term,

    w = k'Ck/2 + sign(s) c(n),   c = n^3/3 up to n_c, beyond it with the constant second derivative 2 n_c.

A cylinder along warp, weft or bias has n^3 = |s| k^3: its moment is w' = D k + s k^2 (a secant: of measured cloth 99 %
have s < 0, Feng et al. 2022, "Learning-based bending stiffness parameter estimation by a drape tester", ACM TOG). As
0 <= c'' and c'/n <= 2 n_c, w is C2, and convex with at least a part f of the plate's tangent in every direction where
2 n_c B <= (1 - f) C, which gives n_c. The direction that loses most reaches f; the others stop with it.

The Gauss-Newton Hessian of a softening sheet is below that of the plate, so Newton's springs bound it too.

With friction the moment has a hysteresis. Beside the plate each triangle has an elastic-perfectly-plastic element
(Prandtl 1928), as the friction of yarns gives the loops of a KES bending test. With the curvature k, 1 along the warp,
F = diag(h1^2, h1 h2, h2^2) of half the widths 2HB along warp and weft, h the larger, and the slip p, the energy per
area is

    min_p [h |v - p|^2/(2 k_y) + h |p - p_n|] = h f(|v - p_n|),   v = F^(1/2) k/h,
    f(n) = n^2/(2 k_y) up to k_y, n - k_y/2 beyond

with the slip of a step eliminated (Ortiz & Stainier 1999): convex, and C1. A cylinder along the warp then has
the moment D k +- HB once its curvature has turned back by 2 k_y. The next step begins with the return mapping at
the positions where this one was accepted. A run begins with a sheet that was bent from its rest shape.

The value has what the step dissipates in it, so that no growth of the total energy is hidden.
"""

from dataclasses import dataclass, fields, replace
from typing import ClassVar, Self

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.geometry.kinematics.curvature import matrices_of_threads, plate_law, threads_in_triangles
from clothsim.mesh.cloth import Hinges
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Step
from clothsim.physics.energies.midedge_bending import MidedgeBending, midedge_bending
from clothsim.physics.energies.protocols import History

LEAST_TANGENT = 0.2
"""f, the least part of the bending stiffness that softening leaves; stiffening adds 1 - f at most."""


@dataclass(frozen=True)
class SofteningBending(MidedgeBending):
    """E = |G (theta - theta0)|^2/2 + sum a c(|L e|), e = G (theta - theta0) of each element: a point of a triangle.

    Parameters
    ----------
    amounts : (m,) array
        a = sign(s) A [m2], A the area of an element.
    maps : (m, 3, 3) array
        L, from the strains of an element [sqrt(J)] to B^(1/2) k.
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
        return plate + self._added(self._strains(x)) if np.isfinite(plate) else plate

    def _added(self, strains: Floats) -> float:
        """What is added to the energy of the plate at strains (m, 3) [J]."""
        n = np.linalg.norm(np.einsum("mik,mk->mi", self.maps, strains), axis=1)
        beyond = np.maximum(n - self.caps, 0.0)
        least = n - beyond
        return float(self.amounts @ (least**3 / 3 + least**2 * beyond + least * beyond**2))

    def _added_stress(self, strains: Floats) -> Floats:
        """Its derivative, (m, 3) [sqrt(J)]."""
        mapped = np.einsum("mik,mk->mi", self.maps, strains)
        return np.einsum("m,mki,mk->mi", self.amounts * self._derivatives(mapped)[0], self.maps, mapped)

    def _tangent(self, strains: Floats) -> Floats:
        """The second derivative of the whole, (m, 3, 3) [1]."""
        mapped = np.einsum("mik,mk->mi", self.maps, strains)
        added = radial_tangent(mapped, *self._derivatives(mapped))
        return np.eye(3) + np.einsum("m,mki,mkl,mlj->mij", self.amounts, self.maps, added, self.maps, optimize=True)

    def _moments(self, x: Floats) -> Floats:
        forces = np.einsum("mqj,mq->mj", self.weights, self._added_stress(self._strains(x)))
        added = np.bincount(self.stencils.ravel(), weights=forces.ravel(), minlength=len(self.vertices))
        return super()._moments(x) + added

    def _tangents(self, x: Floats) -> Floats:
        """C'G with C C' the second derivative over the strains."""
        return np.einsum("mkq,mkj->mqj", np.linalg.cholesky(self._tangent(self._strains(x))), self.weights)

    def _strains(self, x: Floats) -> Floats:
        """e = G (theta - theta0), (m, 3) [sqrt(J)]; a hinge without an angle counts as flat."""
        change = self._change(x)
        bent = np.where(np.isinf(change), 0.0, change)
        return np.einsum("mkj,mj->mk", self.weights, bent[self.stencils])

    def _derivatives(self, mapped: Floats) -> tuple[Floats, Floats]:
        """c'/n and c'' of n = |L e|, (m,) each."""
        n = np.asarray(np.linalg.norm(mapped, axis=1), np.float64)
        least = np.minimum(n, self.caps)
        beyond = n > self.caps
        slope = np.where(beyond, least**2 + 2 * least * (n - least), 0.0)
        return np.divide(slope, n, out=n.copy(), where=beyond), 2 * least


def radial_tangent(vectors: Floats, along: Floats, curved: Floats) -> Floats:
    """Second derivatives (m, 3, 3) of f(|v|) by v (m, 3), with f'/|v| and f'' (m,) each."""
    n = np.linalg.norm(vectors, axis=1)[:, None]
    unit = np.divide(vectors, n, out=np.zeros_like(vectors), where=n > 0)
    return along[:, None, None] * np.eye(3) + np.einsum("m,mi,mj->mij", curved - along, unit, unit)


def softening_bending(hinges: Hinges, world: World, angles: Floats, short_waves: float = 0.0) -> SofteningBending:
    """The bending energy of hinges, of fabrics with a slope; the rest as in `midedge_bending`."""
    plate = midedge_bending(hinges, world, angles, short_waves).by_point()
    triangles, areas, nu = plate.triangles, plate.areas(world), world.per_triangle("poisson_ratio")
    slopes = {way: world.per_triangle(f"slope_along_{way}") for way in ("warp", "weft", "bias")}
    warp, weft, bias = (np.abs(slopes[way]) ** (2 / 3) for way in ("warp", "weft", "bias"))
    twist = np.maximum(2 * bias - (warp + weft) / 2 - nu * np.sqrt(warp * weft), 0.0)
    turn = threads_in_triangles(world, angles)
    norms = np.einsum("mki,mkl,mlj->mij", turn, matrices_of_threads(warp, twist, weft, nu), turn)[triangles]
    maps = maps_of_curvature(world, plate, angles, norms)
    largest = areas * np.linalg.norm(maps, ord=2, axis=(1, 2)) ** 2
    caps = np.divide((1 - LEAST_TANGENT) / 2, largest, out=np.zeros_like(largest), where=largest > 0)
    signs = np.sign(sum(slopes.values()))[triangles]
    base = {field.name: getattr(plate, field.name) for field in fields(MidedgeBending) if field.init}
    if (signs > 0).any():
        base["bounds"] = (2 - LEAST_TANGENT) * plate.bounds
    return SofteningBending(**base, amounts=signs * areas, maps=maps, caps=caps)


def maps_of_curvature(world: World, plate: MidedgeBending, angles: Floats, norms: Floats) -> Floats:
    """B^(1/2) k of the strains of the elements of a plate, (m, 3, 3), with `norms` B (m, 3, 3) in their frames."""
    values, vectors = np.linalg.eigh(norms)
    roots = np.einsum("mik,mk,mjk->mij", vectors, np.sqrt(np.maximum(values, 0.0)), vectors)
    strains = plate_law(world, angles).roots()[plate.triangles] * np.sqrt(plate.stiffnesses)[:, None, None]
    return np.asarray(roots @ np.linalg.pinv(strains), np.float64)


NAME = "bending"


@dataclass(frozen=True)
class HystereticBending(SofteningBending, History):
    """The energy of `SofteningBending` and sum b f(|M e - p_n|).

    Parameters
    ----------
    limits : (m,) array
        b = A h [J m].
    turns : (m, 3, 3) array
        M, from the strains of a triangle [sqrt(J)] to v [1/m].
    ranges : (m,) array
        k_y [1/m].
    slips : (m, 3) array
        p_n of this step [1/m].
    """

    limits: Floats
    turns: Floats
    ranges: Floats
    slips: Floats

    per_triangle: ClassVar[tuple[str, ...]] = (*SofteningBending.per_triangle, "limits", "turns", "ranges", "slips")

    @property
    def carry_over(self) -> Floats:
        """p_n, (3 m,) [1/m]."""
        return self.slips.ravel()

    def begin(self, step: Step) -> Self:
        """A copy with the slips after the return mapping at the start of the step."""
        memory = step.memory.get(NAME, np.zeros(self.slips.size))
        before = replace(self, slips=np.asarray(memory, np.float64).reshape(self.slips.shape))
        elastic = before._elastic(self._strains(step.positions))
        n = np.linalg.norm(elastic, axis=1)
        beyond = np.maximum(n - self.ranges, 0.0)
        moved = np.divide(beyond, n, out=np.zeros_like(n), where=n > 0)[:, None] * elastic
        return replace(self, slips=before.slips + moved)

    def _elastic(self, strains: Floats) -> Floats:
        """M e - p_n, (m, 3) [1/m]."""
        return np.asarray(np.einsum("mik,mk->mi", self.turns, strains) - self.slips, np.float64)

    def _added(self, strains: Floats) -> float:
        n = np.linalg.norm(self._elastic(strains), axis=1)
        least = np.minimum(n, self.ranges)
        return super()._added(strains) + float(self.limits @ (least**2 / (2 * self.ranges) + n - least))

    def _added_stress(self, strains: Floats) -> Floats:
        elastic = self._elastic(strains)
        along, _ = self._friction(elastic)
        return super()._added_stress(strains) + np.einsum("m,mki,mk->mi", self.limits * along, self.turns, elastic)

    def _tangent(self, strains: Floats) -> Floats:
        elastic = self._elastic(strains)
        added = radial_tangent(elastic, *self._friction(elastic))
        turned = np.einsum("m,mki,mkl,mlj->mij", self.limits, self.turns, added, self.turns, optimize=True)
        return super()._tangent(strains) + turned

    def _friction(self, elastic: Floats) -> tuple[Floats, Floats]:
        """f'/n and f'', (m,) each."""
        n = np.linalg.norm(elastic, axis=1)
        return 1.0 / np.maximum(n, self.ranges), np.where(n <= self.ranges, 1.0 / self.ranges, 0.0)


def hysteretic_bending(hinges: Hinges, world: World, angles: Floats, short_waves: float = 0.0) -> HystereticBending:
    """The bending energy of hinges, of fabrics with hysteresis; the rest as in `midedge_bending`."""
    plate = softening_bending(hinges, world, angles, short_waves)
    chosen = plate.triangles
    warp, weft = (world.per_triangle(f"hysteresis_along_{way}") / 2 for way in ("warp", "weft"))
    largest = np.maximum(warp, weft)
    scale = np.where(largest > 0, largest, 1.0)
    warp, weft = warp / scale, weft / scale
    turn = threads_in_triangles(world, angles)
    by_threads = matrices_of_threads(warp**2, warp * weft, weft**2, np.zeros(len(warp)))
    norms = np.einsum("mki,mkl,mlj->mij", turn, by_threads, turn)[chosen]
    turns = maps_of_curvature(world, plate, angles, norms)
    limits = plate.areas(world) * largest[chosen]
    ranges = world.per_triangle("hysteresis_curvature")[chosen]
    stiffest = np.sqrt(limits / ranges)[:, None, None] * (turns @ plate.weights)
    sums = np.abs(np.einsum("mqj,mql->mjl", stiffest, stiffest)).sum(axis=2)
    bounds = plate.bounds + np.bincount(plate.stencils.ravel(), sums.ravel(), minlength=len(plate.bounds))
    base = {field.name: getattr(plate, field.name) for field in fields(SofteningBending) if field.init}
    slips = np.zeros((len(chosen), 3))
    return HystereticBending(**(base | {"bounds": bounds}), limits=limits, turns=turns, ranges=ranges, slips=slips)
