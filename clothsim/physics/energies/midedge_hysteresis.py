"""Mid-edge bending with friction: hysteresis of the moment.

Beside the plate each triangle has an elastic-perfectly-plastic element (Prandtl 1928), as the friction of yarns gives
the loops of a KES bending test. With the curvature k, 1 along the warp, F = diag(h1^2, h1 h2, h2^2) of half the widths
2HB along warp and weft, h the larger, and the slip p, the energy per area is

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
from clothsim.geometry.kinematics.curvature import matrices_of_threads, threads_in_triangles
from clothsim.mesh.cloth import Hinges
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Step
from clothsim.physics.energies.midedge_softening import (
    SofteningBending,
    maps_of_curvature,
    radial_tangent,
    softening_bending,
)
from clothsim.physics.energies.protocols import History

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
