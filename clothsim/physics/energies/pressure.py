"""Uniform fluid pressure, a follower load along the normals: the effect `pressure`.

For a closed cloth E = -p V is exact, V the sum of the tetrahedra from its triangles to an apex (Hibbitt 1979: a uniform
pressure has a potential where its surface is closed or its border is fixed). For an open cloth the apex is the mean of
its border and V the volume of that cone: the forces on all interior vertices are p A n / 3 from each triangle, and
those on a fixed border do not matter. On a free border they have no potential (the load does work around a closed
path), so the difference is added as a dead load, taken at the start of the step, as is the apex: forces on a free
border lag by one step, an error of first order in dt.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import cross_matrices
from clothsim.base.triangles import area_vectors
from clothsim.keys.typed_effects import Pressure
from clothsim.mesh.topology import border_vertices
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off, Step
from clothsim.physics.energies.example import Example, Idle
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.physics.energies.key_values import Schedule, by_cloth
from clothsim.physics.energies.protocols import Idling, Nonconservative


@dataclass(frozen=True)
class PressurizedCloth:
    """One cloth under pressure.

    Parameters
    ----------
    triangles, border : (m, 3) and (b,) int arrays
        Rows of x.
    pressure : Schedule
        [Pa].
    outward : float
        1, or -1 where the triangles of a closed cloth face inward.
    """

    triangles: Ints
    border: Ints
    pressure: Schedule
    outward: float


@dataclass(frozen=True)
class PressureEnergy(Energy, Idling, Nonconservative):
    """E = -sum p (x0 - c).((x1 - c) x (x2 - c)) / 6 - sum f.(x - x_n), c the apex of the cone.

    Parameters
    ----------
    patches : tuple of PressurizedCloth
        The cloths.
    triangles, border : (m, 3) and (b,) int arrays
        Rows of x of all patches.
    pressures : (m,) array
        p of the step [Pa].
    apexes : (m, 3) array
        c [m].
    missing, start : (b, 3) arrays
        Dead load f [N] and position x_n [m] of the border at the start of the step.
    """

    patches: tuple[PressurizedCloth, ...]
    triangles: Ints
    pressures: Floats
    apexes: Floats
    border: Ints
    missing: Floats
    start: Floats

    @property
    def idle(self) -> bool:
        """True where all pressures of the step are 0."""
        return not self.pressures.any()

    @property
    def rows_without_potential(self) -> Ints:
        """The border vertices of cloths under pressure."""
        return np.intersect1d(self.border, self.triangles[self.pressures != 0])

    def begin(self, step: Step) -> Self:
        """A copy with the pressure of the end of the step and the borders of its start.

        A quasi-static ramp scales a constant pressure; one that varies over time is a ramp of its own.
        """
        now, x = step.time + step.dt, step.positions
        loads = [step.load if patch.pressure.is_constant else 1.0 for patch in self.patches]
        levels = [load * p.outward * p.pressure.at(now) for load, p in zip(loads, self.patches, strict=True)]
        counts = [len(patch.triangles) for patch in self.patches]
        rims = [patch.border if len(patch.border) else patch.triangles[:, 0] for patch in self.patches]
        centres = [x[rim].mean(axis=0) for rim in rims]
        bound = replace(
            self,
            pressures=np.repeat(levels, counts),
            apexes=np.repeat(centres, counts, axis=0),
            missing=np.zeros_like(self.missing),
            start=x[self.border],
        )
        if bound.idle:
            return bound
        area = 0.5 * area_vectors(x[self.triangles])
        thirds = np.repeat((bound.pressures[:, None] * area / 3)[:, None], 3, axis=1)
        forces = _gathered(thirds, self.triangles, len(x))  # p A n / 3 on each corner [N]
        return replace(bound, missing=(forces + bound.gradient(x))[self.border])

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        a, b, c = self._arms(x)
        volumes = np.einsum("ti,ti->t", a, np.cross(b, c)) / 6
        return -float(self.pressures @ volumes + np.sum(self.missing * (x[self.border] - self.start)))

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        a, b, c = self._arms(x)
        normals = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
        out = _gathered(-self.pressures[:, None, None] / 6 * normals, self.triangles, len(x))
        out[self.border] -= self.missing
        return out

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (m, 9, 9) [N/m]: exact, or the positive part of each triangle's own follower stiffness."""
        if project:
            return ElementHessian(self.triangles, _positive_part(x[self.triangles], self.pressures))
        a, b, c = (cross_matrices(arm) for arm in self._arms(x))
        none = np.zeros_like(a)
        rows = [[none, -c, b], [c, none, -a], [-b, a, none]]
        blocks = np.concatenate([np.concatenate(row, axis=2) for row in rows], axis=1)
        return ElementHessian(self.triangles, -self.pressures[:, None, None] / 6 * blocks)

    def _arms(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        a, b, c = (x[self.triangles[:, k]] - self.apexes for k in range(3))
        return a, b, c


def pressure(world: World, keys: Pressure) -> Energy | Off:
    """Pressure on all cloths, outward of a closed cloth and along the normals of an open one (+z for generated sheets).

    Off where it is 0 at all times.
    """
    levels = by_cloth("effects.pressure.value", keys.value, world)
    every = zip(world.cloths, world.cloth_slices, levels, strict=True)
    cloths = [each for each in every if len(each[0].triangles) and not each[2].is_zero]
    patches = []
    for cloth, rows, level in cloths:
        border = border_vertices(cloth.triangles)
        a, b, c = (cloth.positions[cloth.triangles[:, k]] - cloth.positions[cloth.triangles[0, 0]] for k in range(3))
        outward = -1.0 if not len(border) and np.einsum("ti,ti->", a, np.cross(b, c)) < 0 else 1.0
        patches.append(PressurizedCloth(cloth.triangles + rows.start, border + rows.start, level, outward))
    if not patches:
        sheets = any(len(cloth.triangles) for cloth in world.cloths)
        return Off("the pressure is 0" if sheets else "there is no cloth that has triangles")
    triangles = np.concatenate([patch.triangles for patch in patches])
    border = np.concatenate([patch.border for patch in patches])
    none, still = np.zeros(len(triangles)), np.zeros((len(border), 3))
    return PressureEnergy(tuple(patches), triangles, none, np.zeros((len(triangles), 3)), border, still, still)


def _gathered(forces: Floats, triangles: Ints, n_vertices: int) -> Floats:
    """Sum of the forces (m, 3, 3) on the corners of triangles, (N, 3)."""
    corners, flat = triangles.ravel(), forces.reshape(-1, 3)
    return np.stack([np.bincount(corners, flat[:, k], n_vertices) for k in range(3)], axis=1)


def _positive_part(corners: Floats, pressures: Floats) -> Floats:
    """The positive part of -p K, K the symmetric part of the follower stiffness of each triangle, (m, 9, 9).

    On corner i acts p (o_j x dx_j) / 6 summed over j, o_j the edge opposite to j: K_ij = [o_j - o_i]x / 12. Summed over
    the triangles around a vertex this is the Hessian of V, but it depends on the edges only, not on the apex. It
    couples in-plane displacements u with displacements w along the normal n by u.B w, so that its eigenvalues are +-
    the singular values s of B, with the vectors (B v +- s v n) / (s sqrt 2). B has the sign of p; the factor |p| is
    applied to the blocks. A triangle without area has no normal and adds nothing.
    """
    opposite = np.stack([corners[:, (k + 2) % 3] - corners[:, (k + 1) % 3] for k in range(3)], axis=1)
    normals = np.cross(opposite[:, 0], opposite[:, 1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)[:, None]
    spans = opposite[:, None, :] - opposite[:, :, None]
    B = -np.sign(pressures)[:, None, None, None] / 12 * np.cross(spans, normals[:, None, None])
    B = B.transpose(0, 1, 3, 2).reshape(-1, 9, 3)
    squares, v = np.linalg.eigh(B.transpose(0, 2, 1) @ B)
    s = np.sqrt(np.maximum(squares, 0.0))
    along = (v[:, :, None] * normals[:, None, :, None]).reshape(-1, 9, 3)
    modes = B @ v + s[:, None] * along
    weights = np.divide(0.5, s, out=np.zeros_like(s), where=s > 1e-12 * s.max(axis=1, initial=0.0, keepdims=True))
    blocks = (modes * weights[:, None]) @ modes.transpose(0, 2, 1)
    return np.asarray(np.abs(pressures)[:, None, None] * blocks, np.float64)


EXAMPLE = Example(
    keys={"value": 1.7},
    in_scene={"value": 0.1},
    zero={"value": 0},
    external=True,
    idle=Idle(
        always={"value": [[0.0, 0.0], [10.0, 0.0], [11.0, 5.0]]},
        sometimes={"value": [[0.0, 0.0], [0.05, 0.0], [0.06, 20.0]]},
    ),
)
