"""Tension field of a Neo-Hookean sheet: it resists stretch, and nothing shorter (Pipkin 1986).

Where a sheet would wrinkle, its mean shape shortens at no cost. The relaxed density is the least over all widths that
wrinkles give it: psi(s1, s2) where s2 is at least the natural width s*(s1) of a strip under tension, psi_2(s1, s*) = 0;
psi(s1, s*) below it; 0 where s1 <= 1. It is C1, and convex where psi is.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import LANES, inlined, kernel, natural
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.hessians import ElementHessian, LanesHessian
from clothsim.physics.energies.neo_hookean_membrane import NeoHookeanMembrane
from clothsim.physics.energies.triangle_kernels import (
    VALUES_PER_LANE,
    fill_lanes,
    other_modes,
    principal_state,
    project_2x2,
    store_lane,
    stretch_block,
)
from clothsim.physics.energies.woven_membrane import LinearThreads, ThreadedMembrane


@inlined
def natural_width(mu, lam, s1):
    """s* of a strip stretched to s1 >= 1: mu (s^2 - 1) + lam ln(s1 s) = 0, by Newton's method from above."""
    s = 1.0
    for _ in range(30):
        change = (mu * (s * s - 1.0) + lam * np.log(s1 * s)) / (2.0 * mu * s + lam / s)
        s = max(s - change, 0.1 * s)
        if abs(change) < 1e-15:
            break
    return s


@inlined
def relaxed_density(mu, lam, s1, s2):
    """Density [J/m2] and its derivatives psi_1, psi_2 [N/m]."""
    if s1 <= 1.0:
        return 0.0, 0.0, 0.0
    s = max(s2, natural_width(mu, lam, s1))
    log_J = np.log(s1 * s)
    b = lam * log_J - mu
    value = 0.5 * mu * (s1 * s1 + s * s - 2.0 - 2.0 * log_J) + 0.5 * lam * log_J * log_J
    return value, mu * s1 + b / s1, (mu * s + b / s) if s2 >= s else 0.0


@kernel
def value(x, triangles, inverses, areas, mu, lam):
    """Sum of A psi [J]."""
    F, n, V, W = np.empty((3, 2)), np.empty(3), np.empty((2, 2)), np.empty((2, 3))
    alpha, beta = np.empty(3), np.empty(3)
    total = 0.0
    for t in range(len(triangles)):
        s1, s2 = principal_state(x, triangles[t], inverses[t], F, n, V, W, alpha, beta)
        total += areas[t] * relaxed_density(mu[t], lam[t], s1, s2)[0]
    return total


@kernel
def gradient(x, triangles, inverses, areas, mu, lam):
    """A (psi_1 w1 alpha' + psi_2 w2 beta') over the corners, (N, 3) [N]."""
    out = np.zeros_like(x)
    F, n, V, W = np.empty((3, 2)), np.empty(3), np.empty((2, 2)), np.empty((2, 3))
    alpha, beta = np.empty(3), np.empty(3)
    for t in range(len(triangles)):
        s1, s2 = principal_state(x, triangles[t], inverses[t], F, n, V, W, alpha, beta)
        _, p1, p2 = relaxed_density(mu[t], lam[t], s1, s2)
        for corner in range(3):
            row = natural(triangles[t, corner])
            for k in range(3):
                out[row, k] += areas[t] * (p1 * W[0, k] * alpha[corner] + p2 * W[1, k] * beta[corner])
    return out


@kernel
def fill(lanes, first, x, triangles, inverses, areas, mu, lam, project):
    """`LanesHessian.fill` of d2E/dx2; modes as of `membrane_kernels.fill`."""
    F, n, V, W = np.empty((3, 2)), np.empty(3), np.empty((2, 2)), np.empty((2, 3))
    alpha, beta = np.empty(3), np.empty(3)
    lane_values = np.zeros(VALUES_PER_LANE * LANES)
    for group in range(len(lanes)):
        for lane in range(min(LANES, len(triangles) - first - group * LANES)):
            t = first + group * LANES + lane
            s1, s2 = principal_state(x, triangles[t], inverses[t], F, n, V, W, alpha, beta)
            a, b, c, twist, flip, out1, out2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            if s1 > 1.0:
                s = natural_width(mu[t], lam[t], s1)
                if s2 >= s:
                    a, b, c = stretch_block(mu[t], lam[t], s1, s2)
                    twist, flip, out1, out2 = other_modes(mu[t], lam[t], s1, s2)
                else:
                    p1 = relaxed_density(mu[t], lam[t], s1, s2)[1]
                    full, mixed, across = stretch_block(mu[t], lam[t], s1, s)
                    a = full - mixed * mixed / across
                    twist, flip, out1 = p1 / (s1 + s2), p1 / (s1 - s2), p1 / s1
            if project:
                a, b, c = project_2x2(a, b, c)
                twist, flip, out1, out2 = max(twist, 0.0), max(flip, 0.0), max(out1, 0.0), max(out2, 0.0)
            store_lane(lane_values, lane, areas[t], alpha, beta, W, n, (a, b, c), (twist, flip, out1, out2))
        fill_lanes(lanes[group], lane_values)


@dataclass(frozen=True)
class RelaxedSheet(NeoHookeanMembrane):
    """E = f E_sheet + (1 - f) E_tension field; compression (m,): f, the fraction of the stiffness that is left."""

    compression: Floats

    per_element = (*NeoHookeanMembrane.per_element, "compression")  # type: ignore[assignment]

    def value(self, x: Floats) -> float:
        """Elastic energy [J]; +inf where a triangle has lost its area."""
        if not np.isfinite(NeoHookeanMembrane.value(self, x)):
            return np.inf
        sheet, field = self._parts
        return sheet.value(x) + value(x, *field)

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        sheet, field = self._parts
        return np.asarray(sheet.gradient(x) + gradient(x, *field), np.float64)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:  # type: ignore[override]
        """Blocks (m, 9, 9) [N/m]; each part projected in F-space in closed form, or exact."""
        sheet, field = self._parts
        own = LanesHessian(self.triangles, lambda lanes, first: fill(lanes, first, x, *field, project))
        return ElementHessian(self.triangles, sheet.hessian(x, project).blocks + own.blocks)

    @property
    def _parts(self) -> tuple[NeoHookeanMembrane, tuple[Ints, Floats, Floats, Floats, Floats]]:
        """The sheet with f of its stiffness, and the arrays of the tension field with the rest of it."""
        f, shapes = self.compression, (self.triangles, self.rest_shape_inverses, self.rest_areas)
        return NeoHookeanMembrane(*shapes, f * self.mu, f * self.lam), (*shapes, (1 - f) * self.mu, (1 - f) * self.lam)


@dataclass(frozen=True)
class SlackThreads:
    """Threads that resist less where they are shortened: a law, and softened (m,), the factor of such a strain."""

    law: LinearThreads
    softened: Floats

    def of(self, triangles: Ints) -> Self:
        """The threads of some triangles."""
        return replace(self, law=self.law.of(triangles), softened=self.softened[triangles])

    def density(self, measured: Floats) -> Floats:
        """psi, (m,) [J/m2]."""
        return self.law.density(self._counted(measured)[0])

    def slopes(self, measured: Floats) -> Floats:
        """Nominal stresses of the threads and shear stress, (m, 3) [N/m]."""
        counted, factors = self._counted(measured)
        return self.law.slopes(counted) * factors

    def curvatures(self, measured: Floats) -> Floats:
        """The second derivatives, (m, 4) [N/m]."""
        a, b, _ = self._counted(measured)[1].T
        return self.law.curvatures(measured) * np.column_stack([a * a, a * b, b * b, np.ones(len(a))])

    def _counted(self, measured: Floats) -> tuple[Floats, Floats]:
        """Measures whose strains count as they resist, and their derivatives by the real ones, (m, 3) each."""
        factors = np.where(measured < 1, self.softened[:, None], 1.0)
        factors[:, 2] = 1.0
        rest = np.array([1.0, 1.0, 0.0])
        return rest + factors * (measured - rest), factors


def with_tension_field(membrane: NeoHookeanMembrane | ThreadedMembrane, compression: float) -> Energy:
    """A membrane with a fraction `compression` of its stiffness in compression."""
    if isinstance(membrane, ThreadedMembrane):
        law = membrane.threads.law
        if not isinstance(law, LinearThreads):
            raise TypeError(f"no tension field of {type(law).__name__}")
        threads = SlackThreads(law, np.full(len(law.warp), compression**0.5))
        sheet = _relaxed_sheet(membrane.sheet, compression)
        return replace(membrane, sheet=sheet, threads=replace(membrane.threads, law=threads))
    return _relaxed_sheet(membrane, compression)


def _relaxed_sheet(membrane: NeoHookeanMembrane, compression: float) -> RelaxedSheet:
    shapes = membrane.triangles, membrane.rest_shape_inverses, membrane.rest_areas
    return RelaxedSheet(*shapes, membrane.mu, membrane.lam, np.full(len(membrane.triangles), compression))
