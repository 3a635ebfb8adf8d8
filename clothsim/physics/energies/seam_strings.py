"""Strings that draw the borders of seams together, and hinges across the closed ones.

Each stitch is a string (`links`) whose length falls from the gap at `start` to 0 at `end`,

    E = sum k/2 max(|r| - L, 0)^2,   L(t + dt) = |r(t)| (1 - u(t + dt)) / (1 - u(t)),   u = (t - start) / (end - start),

so that all gaps close linearly without impulses; the force of a seam that is held open is largest at its end. From then
on L = 0 and a stitch is a spring of stiffness k, no exact weld: under the force f it gapes by f/k.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.cloth import stiffness_in_series
from clothsim.mesh.world import World
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.physics.energies.hinge_bending import HingeBending
from clothsim.physics.energies.links import Links
from clothsim.physics.energies.protocols import Coupling, Driven, Report
from clothsim.physics.energies.step import Step


@dataclass(frozen=True)
class StitchedSeam:
    """One seam: its name in the scene, start and end of closing [s], numbers of stitches and hinges."""

    name: str
    start: float
    end: float
    stitches: int
    hinges: int

    def open_fraction(self, time: float) -> float:
        """Fraction 1 - u of the initial gap at `time` [s], from 1 to 0."""
        return float(1 - np.clip((time - self.start) / (self.end - self.start), 0.0, 1.0))


@dataclass(frozen=True)
class SeamsEnergy(Links, Coupling, Driven, Report):
    """Strings of all seams, and hinges across the closed ones.

    Parameters
    ----------
    seams : tuple of StitchedSeam
        The seams, in the order of their stitches.
    stiffness : (m,) array
        k of the stitches [N/m].
    gap : float
        Final length of the strings [m].
    across : HingeBending
        Hinges across all seams.
    bending : HingeBending
        Those of the seams that are closed in this step.
    """

    seams: tuple[StitchedSeam, ...]
    stiffness: Floats
    gap: float
    across: HingeBending
    bending: HingeBending

    @property
    def drives(self) -> bool:
        """True: closing a seam does external work."""
        return True

    @property
    def idle(self) -> bool:
        """True where no stitch acts and no closed seam bends."""
        return super().idle and not self._bends

    def begin(self, step: Step) -> Self:
        """A copy with the lengths of the strings at the end of the step."""
        now, then = step.time, step.time + step.dt
        counts = [seam.stitches for seam in self.seams]
        fractions = [(seam.open_fraction(now), seam.open_fraction(then)) for seam in self.seams]
        active = np.repeat([after < 1 for _, after in fractions], counts)
        ratios = np.repeat([after / before if before else 0.0 for before, after in fractions], counts)
        gaps = np.linalg.norm(self.lines(step.positions), axis=1)
        closed = np.repeat([after == 0 for _, after in fractions], [seam.hinges for seam in self.seams])
        return replace(
            self,
            lengths=self.gap + ratios * np.maximum(gaps - self.gap, 0.0),
            stiffnesses=np.where(active, self.stiffness, 0.0),
            bending=those(self.across, np.flatnonzero(closed)),
        )

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        stitched = super().value(x)
        return stitched + self.bending.value(x) if self._bends else stitched

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        stitched = super().gradient(x)
        return stitched + self.bending.gradient(x) if self._bends else stitched

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (m, 9, 9) of the stitches [N/m]; with hinges 12 x 12, stitches with a fourth vertex of weight 0."""
        stitched = super().hessian(x, project)
        if not self._bends:
            return stitched
        bent = self.bending.hessian(x, project)
        blocks = np.zeros((len(stitched.elements), 12, 12))
        blocks[:, :9, :9] = stitched.blocks
        rows = np.concatenate([_four(stitched.elements), bent.elements])
        return ElementHessian(rows, np.concatenate([blocks, bent.blocks]))

    def couplings(self, x: Floats, dx: Floats) -> Ints:
        """The rows (m, 4) of the active stitches and of the hinges across closed seams."""
        return np.concatenate([_four(self.rows[self.stiffnesses > 0]), self.bending.vertices])

    @property
    def _bends(self) -> bool:
        return len(self.bending.stiffnesses) > 0

    def defaults_used(self) -> tuple[str, ...]:
        """Number and stiffness of the stitches, their final gap, and the hinges."""
        bent = sum(seam.hinges for seam in self.seams)
        gap = f", to a gap of {self.gap:g} m for self_contact" if self.gap else ""
        over = f"{bent} hinges across them" if bent else "no hinges across them: they fold freely"
        return (f"{len(self.rows)} stitches of {self.stiffness.max():.3g} N/m at most{gap}; {over}",)

    def final_notes(self, x: Floats) -> tuple[str, ...]:
        """The largest gap of each seam at x."""
        gaps = np.split(np.linalg.norm(self.lines(x), axis=1), np.cumsum([seam.stitches for seam in self.seams])[:-1])
        return tuple(
            f"{seam.name} gapes by {1e3 * gap.max():.3g} mm at most" for seam, gap in zip(self.seams, gaps, strict=True)
        )


def bending_across(world: World, hinges: Ints, triangles: Ints) -> HingeBending:
    """The energy of hinges (h, 4) across closed seams between triangles (h, 2), weighted as all hinges."""
    rest = np.concatenate([cloth.rest_positions for cloth in world.cloths])
    edges = rest[hinges[:, 1]] - rest[hinges[:, 0]]
    areas = world.rest_areas[triangles]
    stiffness = stiffness_in_series(world.per_triangle("bending_stiffness")[triangles], areas)
    weights = stiffness * np.einsum("ij,ij->i", edges, edges) / areas.sum(axis=1)
    return HingeBending(hinges, np.zeros(len(hinges)), weights)


def those(hinges: HingeBending, chosen: Ints) -> HingeBending:
    """The `chosen (k,)` of the hinges."""
    return HingeBending(hinges.vertices[chosen], hinges.rest_angles[chosen], hinges.stiffnesses[chosen])


def _four(rows: Ints) -> Ints:
    """Rows (m, 3) with the last column twice."""
    return np.column_stack([rows, rows[:, -1]])
