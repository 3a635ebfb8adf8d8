"""Barrier energy on principal stretches and thread stretches of triangles (`strain_limit` has the formula)."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.physics.energies import fibre_kernels
from clothsim.physics.energies import strain_limit_kernels as kernels
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.elementwise import Elementwise
from clothsim.physics.energies.hessians import ElementHessian, LanesHessian
from clothsim.physics.energies.protocols import BarrierGap, Report

SLACK = 0.9
"""Largest fraction of the distance to its limit that a stretch may cover in a Newton step that would pass the limit."""
CHORDS = 8
"""Secant iterations of the step limit."""
TIGHT = 0.9
"""Value of y from which a stretch is reported as the reason of a failed step."""


@dataclass(frozen=True)
class StrainLimitEnergy(Elementwise, Energy, BarrierGap, Report):
    """E = sum over triangles and stretches of A psi; +inf where a stretch is at its limit or beyond.

    Parameters
    ----------
    triangles : (m, 3) int array
        Rows of x.
    inverses : (m, 2, 2) array
        Dm^-1 [a b] [1/m].
    areas : (m,) array
        A at rest [m2].
    begins, limits : (m, 4) arrays
        s_hat and S of the stretches s1, s2, la, lb; inf where there is no limit.
    stiffness : (m,) array
        k [N/m].
    """

    triangles: Ints
    inverses: Floats
    areas: Floats
    begins: Floats
    limits: Floats
    stiffness: Floats

    per_element = ("triangles", "inverses", "areas", "begins", "limits", "stiffness")

    def value(self, x: Floats) -> float:
        """Energy of the barrier [J]; +inf where a stretch is at its limit or beyond."""
        stretches = kernels.stretches(x, self.triangles, self.inverses)
        near = np.flatnonzero((stretches > self.begins).any(axis=1))
        y, ranges = self._range(stretches[near], near)
        if not (y < 1).all():
            return np.inf
        weights = (self.areas * self.stiffness)[near, None]
        return float(np.sum(-weights * ranges**2 * y**2 * np.log1p(-y)))

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        near, stretches, slopes, _ = self._near(x)
        if not len(near):
            return np.zeros_like(x)
        triangles, inverses = self.triangles[near], self.inverses[near]
        principal = kernels.principal_gradient(x, triangles, inverses, np.ascontiguousarray(slopes[:, :2]))
        threads, along = _of_threads(stretches), _of_threads(slopes)
        return principal + fibre_kernels.gradient(x, triangles, inverses, threads, along)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (k, 9, 9) [N/m] of the triangles past s_hat; exact and positive semi-definite."""
        near, stretches, slopes, curvatures = self._near(x)
        triangles, inverses = self.triangles[near], self.inverses[near]
        if not len(near):
            return ElementHessian(triangles, np.zeros((0, 9, 9)))
        middle = np.repeat(stretches[:, :2].mean(axis=1), 4).reshape(-1, 4)
        between = self._curvature(middle, near)[:, 0]
        pairs = np.ascontiguousarray(slopes[:, :2]), np.ascontiguousarray(curvatures[:, :2])
        blocks = LanesHessian(
            triangles, lambda lanes, first: kernels.fill(lanes, first, x, triangles, inverses, *pairs, between)
        ).blocks
        threads, along, none = _of_threads(stretches), _of_threads(slopes), np.zeros(len(near))
        curved = np.column_stack([curvatures[:, 2], none, curvatures[:, 3], none])
        blocks += fibre_kernels.hessian(x, triangles, inverses, threads, along, curved, False)
        return ElementHessian(triangles, blocks)

    def step_limit(self, x: Floats, dx: Floats, most: float = 1.0) -> float:
        """The fraction of dx, at most `most`, with which a stretch covers at most SLACK of the distance to its limit.

        A stretch is convex along dx, hence below its secant: where the secant from x to x + dx meets the goal, the
        stretch is still below it. The next secant starts there.
        """
        passing = np.flatnonzero(self._loads(x + dx, self.triangles).max(axis=1, initial=0.0) >= 1)
        if not len(passing):
            return most
        corners = self.triangles[passing].ravel()
        own = np.arange(len(corners)).reshape(-1, 3)
        start, displacement = x[corners], dx[corners]
        load = self._loads(start, own, passing)
        end = self._loads(start + displacement, own, passing)
        goal = load + SLACK * (1 - load)
        fractions = np.zeros(len(passing))
        for _ in range(CHORDS):
            steps = np.where(end > goal, (goal - load) / np.where(end > goal, end - load, 1.0), 1.0).min(axis=1)
            fractions += (1 - fractions) * np.clip(steps, 0.0, 1.0)
            load = np.minimum(self._loads(start + np.repeat(fractions, 3)[:, None] * displacement, own, passing), goal)
        return min(most, float(fractions.min()))

    def gap_change(self, x: Floats, dx: Floats, within: float = np.inf) -> float:
        """The largest relative change of the distance of a stretch to its limit, over the triangles past s_hat.

        Triangles whose distance is `within` times that of s_hat or more do not count.
        """
        stretches = kernels.stretches(x, self.triangles, self.inverses)
        y, _ = self._range(stretches, np.arange(len(stretches)))
        near = ((stretches > self.begins) & (1 - y < within)).any(axis=1)
        if not near.any():
            return 0.0
        load = self._loads(x, self.triangles)[near]
        after = self._loads(x + dx, self.triangles)[near]
        return float(np.max(np.abs(after - load) / (1 - load)))

    def tightest(self, x: Floats) -> str:
        """The stretch nearest to its limit, if its y is at least TIGHT."""
        stretches = kernels.stretches(x, self.triangles, self.inverses)
        y, _ = self._range(stretches, np.arange(len(stretches)))
        worst = np.unravel_index(int(y.argmax()), y.shape)
        if y[worst] < TIGHT:
            return ""
        return f"effects.strain_limit is nearly active: a stretch of {stretches[worst]:.4g} of {self.limits[worst]:g}"

    def stretches(self, x: Floats) -> Floats:
        """Stretches s1, s2, la, lb of the triangles at x, (m, 4)."""
        return kernels.stretches(x, self.triangles, self.inverses)

    def beyond(self, x: Floats) -> Ints:
        """The triangles with a stretch at its limit or beyond."""
        return np.flatnonzero((self._loads(x, self.triangles) >= 1).any(axis=1))

    def _loads(self, x: Floats, triangles: Ints, rows: Ints | slice = slice(None)) -> Floats:
        """Stretches relative to their limits, (m, 4): 1 where the barrier is infinite."""
        return kernels.stretches(x, triangles, self.inverses[rows]) / self.limits[rows]

    def _near(self, x: Floats) -> tuple[Ints, Floats, Floats, Floats]:
        """The triangles past s_hat, with their stretches, A dpsi/ds [N m] and A d2psi/ds2, (k, 4) each."""
        stretches = kernels.stretches(x, self.triangles, self.inverses)
        near = np.flatnonzero((stretches > self.begins).any(axis=1))
        stretches = stretches[near]
        y, ranges = self._range(stretches, near)
        slopes = ranges * (y * y / (1 - y) - 2 * y * np.log1p(-y))
        return near, stretches, (self.areas * self.stiffness)[near, None] * slopes, self._curvature(stretches, near)

    def _curvature(self, stretches: Floats, near: Ints) -> Floats:
        y, _ = self._range(stretches, near)
        return (self.areas * self.stiffness)[near, None] * ((4 * y + y * y / (1 - y)) / (1 - y) - 2 * np.log1p(-y))

    def _range(self, stretches: Floats, near: Ints) -> tuple[Floats, Floats]:
        """y (k, 4), 0 below s_hat and without a limit, and S - s_hat (k, 4), 0 without a limit."""
        begins, limits = self.begins[near], self.limits[near]
        limited = np.isfinite(limits)
        ranges = np.where(limited, limits, 1.0) - np.where(limited, begins, 1.0)
        past = np.maximum(stretches - begins, 0.0)
        return np.divide(past, ranges, out=np.zeros_like(past), where=limited), ranges


def _of_threads(values: Floats) -> Floats:
    """The columns of la and lb of (k, 4), and 0 for I8, (k, 3)."""
    return np.column_stack([values[:, 2:], np.zeros(len(values))])
