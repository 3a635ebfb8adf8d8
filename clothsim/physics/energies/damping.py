"""Damping of velocity, of the strain rate and of the bending rate: the effect `damping`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.jit import kernel
from clothsim.base.linalg import eigen_2x2
from clothsim.geometry.kinematics.deformation_gradient import deformation_gradients
from clothsim.keys.typed_effects import Damping
from clothsim.mesh.cloth import dihedral_angles
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off, Step
from clothsim.physics.energies.example import Example
from clothsim.physics.energies.hessians import (
    ByElement,
    ElementHessian,
    LanesHessian,
    diagonal_hessian,
    every_vertex,
    weighted_difference,
    weighted_square,
)
from clothsim.physics.energies.hinge_bending import HingeBending, hinge_bending
from clothsim.physics.energies.key_values import over_cloth
from clothsim.physics.energies.protocols import Elementwise, PastSensitivity, Restrictable, StartDerivatives, restricted


@dataclass(frozen=True)
class MassDamping(Elementwise, Energy, PastSensitivity):
    """E = rate sum m |x - x_n|^2 / (2 h): the force is -rate m v (Rayleigh's mass term).

    With BDF2 x^ and b h replace x_n and h (docs/theory.md#time-integration).

    Parameters
    ----------
    rows : (n, 1) int array
        Rows of x.
    masses : (n,) array
        [kg].
    rate : float
        [1/s].
    start : (n, 3) array
        x_n of the step [m].
    dt : float
        h [s].
    """

    rows: Ints
    masses: Floats
    rate: float
    start: Floats
    dt: float

    per_element = ("rows", "masses", "start")
    incremental = True

    def begin(self, step: Step) -> Self:
        """A copy with x_n and h of the step."""
        past = step.past
        return replace(self, start=past.positions[self.rows[:, 0]], dt=past.dt)

    def value(self, x: Floats) -> float:
        """Incremental dissipation [J]."""
        return self.rate * weighted_square(self.rows, self.masses, x, self.start) / (2 * self.dt)

    def gradient(self, x: Floats) -> Floats:
        """rate m (x - x_n) / h, (N, 3) [N]."""
        return weighted_difference(self.rows, self.rate * self.masses / self.dt, x, self.start)

    def past_sensitivity(self, step: Step, x: Floats, adjoint: Floats) -> StartDerivatives:
        """-rate m a / h by x_n."""
        weights, zero = -self.rate * self.masses / self.dt, np.zeros_like(self.start)
        return StartDerivatives(past_positions=weighted_difference(self.rows, weights, adjoint, zero))

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """rate m / h on the diagonal [N/m]."""
        return self._hessian

    @cached_property
    def _hessian(self) -> ElementHessian:
        return diagonal_hessian(self.rows, self.rate * self.masses / self.dt)


@dataclass(frozen=True)
class Dampings(Energy, Restrictable):
    """Sum of several dampings."""

    parts: tuple[Energy, ...]

    incremental = True

    def begin(self, step: Step) -> Self:
        """A copy with each part bound to the step."""
        return replace(self, parts=tuple(part.begin(step) for part in self.parts))

    def restricted_to(self, moving: np.ndarray, x: Floats) -> Self:
        """A copy with each part restricted to the moving vertices."""
        return replace(self, parts=tuple(restricted(part, moving, x) for part in self.parts))

    def value(self, x: Floats) -> float:
        """Incremental dissipation [J]."""
        return sum(part.value(x) for part in self.parts)

    def gradient(self, x: Floats) -> Floats:
        """(N, 3) [N]."""
        return np.sum([part.gradient(x) for part in self.parts], axis=0)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks of one size [N/m]: a smaller one repeats its last vertex, with zeros."""
        hessians = [part.hessian(x, project) for part in self.parts]
        by_element = [h for h in hessians if isinstance(h, ByElement)]  # all of them
        size = max(h.elements.shape[1] for h in by_element)
        elements, blocks = [], []
        for h in by_element:
            missing = size - h.elements.shape[1]
            elements.append(np.concatenate([h.elements, np.repeat(h.elements[:, -1:], missing, axis=1)], axis=1))
            blocks.append(np.pad(h.blocks, ((0, 0), (0, 3 * missing), (0, 3 * missing))) if missing else h.blocks)
        return ElementHessian(np.concatenate(elements), np.concatenate(blocks))


def damping(world: World, keys: Damping) -> Energy | Off:
    """Dampings of all cloths; those on strain and bending leave rigid motions undamped. Off where all three are 0."""
    rates = over_cloth("effects.damping.rate", keys.rate, world, least=0.0)
    of_rods = []  # the number of all, or that of its name
    for rod, _ in world.rods:
        rate = keys.rate.get(rod.name, keys.rate.get("other")) if isinstance(keys.rate, Mapping) else keys.rate
        if not isinstance(rate, int | float):
            raise InputError(
                f"effects.damping.rate has no number for the rod {rod.name}.", f"Write {{ {rod.name} = 4.0 }}."
            )
        of_rods.append(float(rate))
    beta = keys.stiffness
    eta = over_cloth("effects.damping.strain_rate", keys.strain_rate, world, least=0.0)
    shear, trace = eta + 2 * beta * world.per_triangle("shear_modulus"), beta * world.per_triangle("lame_modulus")
    parts: list[Energy] = []
    if rates.any() or any(of_rods):
        rows, start = every_vertex(world.n_cloth), world.start()[: world.n_cloth]
        every = np.append(rates, of_rods)
        if (every == every[0]).all():
            parts.append(MassDamping(rows, world.masses, float(every[0]), start, 1.0))
        else:
            thirds = np.repeat(rates * world.per_triangle("density") * world.rest_areas / 3, 3)
            weights = np.bincount(world.triangles.ravel(), thirds, world.n_cloth).astype(np.float64)
            for (_, place), rate in zip(world.rods, of_rods, strict=True):
                weights[place] = rate * world.masses[place]
            parts.append(MassDamping(rows, weights, 1.0, start, 1.0))
    if shear.any():
        some = np.flatnonzero(shear)
        of_triangles = world.triangles[some], world.rest_shape_inverses[some], world.rest_areas[some]
        parts.append(StrainDamping(*of_triangles, shear[some], trace[some], np.zeros((len(some), 2, 2)), 1.0))
    if beta and world.hinges.stiffness.any():
        spring = hinge_bending(world.hinges)
        stiff = np.flatnonzero(spring.stiffnesses)
        hinges = HingeBending(spring.vertices[stiff], spring.rest_angles[stiff], spring.stiffnesses[stiff])
        parts.append(HingeDamping(beta * hinges.stiffnesses, hinges))
    if not parts:
        given = beta > 0  # but no part of the fabric has a stiffness
        return Off("the fabric has no stiffness to be proportional to" if given else "rate is 0")
    return parts[0] if len(parts) == 1 else Dampings(tuple(parts))


EXAMPLE = Example(
    keys={"rate": 1.0, "stiffness": 0.3, "strain_rate": 0.2}, in_scene={"rate": 2.0}, zero={"rate": 0}, external=True
)


# Viscosity of strain and bending (Kelvin-Voigt), exactly zero in rigid motions.
#
# In the plane of a triangle, with the Green strain E = (F'F - 1) / 2 and its rate (E - E^) / h:
#
#     E = sum A / (2 h) (a |E - E^|^2 + l tr(E - E^)^2)
#
# About a hinge of stiffness k: beta k (theta - theta^)^2 / (2 h), the spring of `hinge_bending` with rest angle theta^.
# With a = 2 beta mu, l = beta lam this is Rayleigh's beta K in small strains: a mode of frequency w decays with
# exp(-beta w^2 t / 2). E^, theta^: past strain and angle in the difference formula of the step (`past_of`).


def past_of(step: Step, quantity: Callable[[Floats], Floats]) -> Floats:
    """The past value q^ with which (q(x) - q^) / past.dt is the rate of q at the end of the step.

    docs/theory.md#time-integration.

    Backward Euler: q(x_n). BDF2: ((1+r)^2 q(x_n) - r^2 q(x_(n-1))) / (1+2r), with the weights that `step.past` has for
    the positions. q of the weighted positions would be wrong: they are not a state of the cloth, and a rotating cloth
    would seem to stretch.
    """
    past = step.past
    ratio = past.dt / step.dt  # b = (1+r) / (1+2r)
    if ratio == 1.0:
        return quantity(step.positions)
    r = (1 - ratio) / (2 * ratio - 1)
    new, old = (1 + r) ** 2 / (1 + 2 * r), r**2 / (1 + 2 * r)
    before = (new * step.positions - past.positions) / old
    return new * quantity(step.positions) - old * quantity(before)


@dataclass(frozen=True)
class StrainDamping(Elementwise, Energy):
    """E = sum A / (2 h) (a |E - E^|^2 + l tr(E - E^)^2).

    Parameters
    ----------
    triangles : (m, 3) int array
        Rows of x.
    inverses : (m, 2, 2) array
        Dm^-1 [1/m].
    areas : (m,) array
        A at rest [m2].
    shear, trace : (m,) arrays
        a and l [N s/m].
    past : (m, 2, 2) array
        E^ of the step.
    dt : float
        h [s].
    """

    triangles: Ints
    inverses: Floats
    areas: Floats
    shear: Floats
    trace: Floats
    past: Floats
    dt: float

    per_element = ("triangles", "inverses", "areas", "shear", "trace", "past")

    incremental = True

    def begin(self, step: Step) -> Self:
        """A copy with the past strains."""
        return replace(self, past=past_of(step, self._strain), dt=step.past.dt)

    def value(self, x: Floats) -> float:
        """Incremental dissipation [J]."""
        return float(np.einsum("tij,tij->", self._stress(x), self._strain(x) - self.past)) / 2

    def gradient(self, x: Floats) -> Floats:
        """F S g_p on corner p, (N, 3) [N]; F = sum of x_p g_p'."""
        forces = np.einsum("tij,tjk,tpk->tpi", self._deformation(x), self._stress(x), self._g)
        corners, flat = self.triangles.ravel(), forces.reshape(-1, 3)
        return np.stack([np.bincount(corners, flat[:, k], len(x)) for k in range(3)], axis=1)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (m, 9, 9) [N/m]: g_p.S g_q 1 + A/h (a/2 (g_p.g_q F F' + F g_q (F g_p)') + l F g_p (F g_q)').

        Projected: the positive part of S; the other terms are positive semi-definite.
        """
        F, S, g = self._deformation(x), self._stress(x), self._g
        if project:
            values, vectors = eigen_2x2(S)
            S = np.einsum("tik,tk,tjk->tij", vectors, np.maximum(values, 0.0), vectors)
        scale = self.areas / self.dt
        return ElementHessian(self.triangles, _blocks(F, S, g, scale * self.shear, scale * self.trace))

    @property
    def _g(self) -> Floats:
        """The gradients of the corners' shape functions at rest, (m, 3, 2) [1/m]."""
        return np.concatenate([-self.inverses.sum(axis=1, keepdims=True), self.inverses], axis=1)

    def _deformation(self, x: Floats) -> Floats:
        return np.asarray(deformation_gradients(x, self.triangles, self.inverses), np.float64)

    def _strain(self, x: Floats) -> Floats:
        F = self._deformation(x)
        return np.asarray(0.5 * (np.einsum("tki,tkj->tij", F, F) - np.eye(2)), np.float64)

    def _stress(self, x: Floats) -> Floats:
        """S = A/h (a (E - E^) + l tr(E - E^) 1), (m, 2, 2) [N m]."""
        change = self._strain(x) - self.past
        isotropic = (self.trace * np.trace(change, axis1=1, axis2=2))[:, None, None] * np.eye(2)
        return (self.areas / self.dt)[:, None, None] * (self.shear[:, None, None] * change + isotropic)


@dataclass(frozen=True)
class HingeDamping(Energy, Restrictable):
    """Viscous hinges.

    Parameters
    ----------
    viscosities : (h,) array
        beta k [N m s].
    spring : HingeBending
        The hinges; bound to a step with stiffness beta k / h and rest angle theta^.
    """

    viscosities: Floats
    spring: HingeBending

    incremental = True

    def begin(self, step: Step) -> Self:
        """A copy with the past angles."""
        angles = past_of(step, lambda x: dihedral_angles(x, self.spring.vertices))
        return replace(self, spring=HingeBending(self.spring.vertices, angles, self.viscosities / step.past.dt))

    def restricted_to(self, moving: np.ndarray, x: Floats) -> Self:
        """The hinges with a moving vertex."""
        return replace(self, spring=self.spring.restricted_to(moving, x))

    def value(self, x: Floats) -> float:
        """Incremental dissipation [J]."""
        return self.spring.value(x)

    def gradient(self, x: Floats) -> Floats:
        """(N, 3) [N]."""
        return self.spring.gradient(x)

    def hessian(self, x: Floats, project: bool = True) -> LanesHessian:
        """12 x 12 a hinge [N/m]."""
        return self.spring.hessian(x, project)


@kernel
def _blocks(F: Floats, S: Floats, g: Floats, shear: Floats, trace: Floats) -> Floats:
    """The blocks of `StrainDamping.hessian`; shear = A a / h, trace = A l / h."""
    blocks = np.empty((len(F), 9, 9))
    left, Fg = np.empty((3, 3)), np.empty((3, 3))
    for t in range(len(F)):
        for i in range(3):
            for j in range(3):
                left[i, j] = F[t, i, 0] * F[t, j, 0] + F[t, i, 1] * F[t, j, 1]
                Fg[j, i] = F[t, i, 0] * g[t, j, 0] + F[t, i, 1] * g[t, j, 1]
        for p in range(3):
            for q in range(3):
                along = 0.0
                for i in range(2):
                    along += g[t, p, i] * (S[t, i, 0] * g[t, q, 0] + S[t, i, 1] * g[t, q, 1])
                turn = 0.5 * shear[t] * (g[t, p, 0] * g[t, q, 0] + g[t, p, 1] * g[t, q, 1])
                for i in range(3):
                    for j in range(3):
                        swap, same = Fg[q, i] * Fg[p, j], Fg[p, i] * Fg[q, j]
                        entry = turn * left[i, j] + 0.5 * shear[t] * swap + trace[t] * same
                        blocks[t, 3 * p + i, 3 * q + j] = entry + along if i == j else entry
    return blocks
