"""The effect `pressure`: a fluid pushes on every triangle along its normal, wherever it turns (a follower load).

For a closed cloth E = -p V is exact, V the sum of the tetrahedra from its triangles to a point (Hibbitt 1979: the load
of a uniform pressure has a potential where its region is closed or its border is held). For an open cloth the point is
the mean of its border and V the volume over that cone: the forces on all vertices but the border's are p A n / 3 from
each triangle, as they should be, and the border's do not matter where it is held. On a free border no energy gives them
(the load does work around a closed path there), so what is missing is added as a dead load taken at the start of the
step, and so is the point: the border's forces are then those of one step ago, an error of first order in dt.
"""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.energies.base import Energy, Off
from clothsim.energies.example import Example, Idle
from clothsim.energies.hessians import ElementHessian
from clothsim.energies.protocols import Idling
from clothsim.energies.step import Step
from clothsim.energies.varying_values import Schedule, by_cloth
from clothsim.linalg import cross_matrices
from clothsim.mesh.topology import border_vertices
from clothsim.mesh.world import World


@dataclass(frozen=True)
class Patch:
    """One cloth under pressure: triangles (m, 3) and border (b,) as rows of x, pressure [Pa]; outward: +1, or -1 where
    the triangles of a closed cloth face inward.
    """

    triangles: Ints
    border: Ints
    pressure: Schedule
    outward: float


@dataclass(frozen=True)
class Pressure(Energy, Idling):
    """E = -sum p (x0 - c) . ((x1 - c) x (x2 - c)) / 6 - sum f . (x - x_n), c the apex of the cone.

    patches: the cloths; bound to a step: triangles (m, 3), pressures p (m,) [Pa], apexes c (m, 3) [m], border (b,),
    its missing forces f (b, 3) [N] and places x_n (b, 3) [m] at the start of the step.
    """

    patches: tuple[Patch, ...]
    triangles: Ints
    pressures: Floats
    apexes: Floats
    border: Ints
    missing: Floats
    places: Floats

    @property
    def idle(self) -> bool:
        """True where there is no pressure at this time."""
        return not self.pressures.any()

    def begin(self, step: Step) -> Self:
        """Bound to the pressure at the end of the step and to the borders at its start.

        A quasi-static ramp scales a pressure that is constant; one that varies in time is its own ramp.
        """
        now, x = step.time + step.dt, step.positions
        shares = [step.load if patch.pressure.is_constant else 1.0 for patch in self.patches]
        levels = [share * p.outward * p.pressure.at(now) for share, p in zip(shares, self.patches, strict=True)]
        counts = [len(patch.triangles) for patch in self.patches]
        rims = [patch.border if len(patch.border) else patch.triangles[:, 0] for patch in self.patches]
        centres = [x[rim].mean(axis=0) for rim in rims]
        bound = replace(
            self,
            pressures=np.repeat(levels, counts),
            apexes=np.repeat(centres, counts, axis=0),
            missing=np.zeros_like(self.missing),
            places=x[self.border],
        )
        if bound.idle:
            return bound
        return replace(bound, missing=(bound._true_forces(x) + bound.gradient(x))[self.border])

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        a, b, c = self._arms(x)
        volumes = np.einsum("ti,ti->t", a, np.cross(b, c)) / 6
        return -float(self.pressures @ volumes + np.sum(self.missing * (x[self.border] - self.places)))

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        a, b, c = self._arms(x)
        shares = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
        out = _gathered(-self.pressures[:, None, None] / 6 * shares, self.triangles, len(x))
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

    def _true_forces(self, x: Floats) -> Floats:
        """p A n / 3 on each corner, (N, 3) [N]."""
        corners = x[self.triangles]
        area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        thirds = np.repeat((self.pressures[:, None] * area / 3)[:, None], 3, axis=1)
        return _gathered(thirds, self.triangles, len(x))


def pressure(world: World, *, value: Any = 0.0) -> Energy | Off:
    """A pressure `value` [Pa] on all cloths: a number, key frames or a function of the time, or a table by cloth.

    It pushes out of a closed cloth, and along the normals of an open one (a flat sheet's, as generated: +z). Off where
    it is 0 at all times. `energies.values` has the errors.
    """
    levels = by_cloth("effects.pressure.value", value, world)
    cloths = [each for each in zip(world.cloths, world.cloth_slices, levels, strict=True) if not each[2].is_zero]
    patches = tuple(_patch(cloth.triangles, rows, cloth.positions, level) for cloth, rows, level in cloths)
    if not patches:
        return Off("the pressure is 0")
    triangles = np.concatenate([patch.triangles for patch in patches])
    border = np.concatenate([patch.border for patch in patches])
    none, places = np.zeros(len(triangles)), np.zeros((len(border), 3))
    return Pressure(patches, triangles, none, np.zeros((len(triangles), 3)), border, places, places)


def _patch(triangles: Ints, rows: slice, positions: Floats, level: Schedule) -> Patch:
    border = border_vertices(triangles)
    a, b, c = (positions[triangles[:, k]] - positions[triangles[0, 0]] for k in range(3))
    inward = not len(border) and np.einsum("ti,ti->", a, np.cross(b, c)) < 0
    return Patch(triangles + rows.start, border + rows.start, level, -1.0 if inward else 1.0)


def _gathered(shares: Floats, triangles: Ints, n_vertices: int) -> Floats:
    """The sum of each triangle's shares (m, 3, 3) on its corners, (N, 3)."""
    corners, flat = triangles.ravel(), shares.reshape(-1, 3)
    return np.stack([np.bincount(corners, flat[:, k], n_vertices) for k in range(3)], axis=1)


def _positive_part(corners: Floats, pressures: Floats) -> Floats:
    """The positive part of -p K, K the symmetric part of the follower stiffness of each triangle, (m, 9, 9).

    On corner i acts p (o_j x dx_j) / 6 summed over j, o_j the edge opposite to j: K_ij = [o_j - o_i]x / 12. Summed over
    the triangles around a vertex this is the Hessian of V, but it depends on the edges only, not on the apex.
    It couples motions in the plane u with motions w along the normal n by u . B w, so its eigenvalues are +- the
    singular values s of B, with the vectors (B v +- s v n) / (s sqrt 2). All is in proportion to |p|, which comes last.
    A triangle without area has no normal, and adds nothing.
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
