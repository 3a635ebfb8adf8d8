"""Ties of cloth to rigid bodies: a button, a charm, a hanger."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import dot
from clothsim.mesh.rigid_body import CORNERS, RigidBody
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.elementwise import Elementwise
from clothsim.physics.energies.hessians import ElementHessian


@dataclass(frozen=True)
class RigidTies(Elementwise, Energy):
    """E = sum k |r|^2 / 2, r = x - c - sum_j f_j z_j from a material point of a rigid body to a vertex of cloth.

    The point is where the vertex is at the start, fixed in the body; z_j are its coordinates (`mesh.rigid_body`).

    Parameters
    ----------
    rows : (t, 5) int array
        Rows of x of the vertex and of the coordinates; where there are fewer, the last is repeated with a weight of 0.
    weights : (t, 5) array
        1 and -f_j.
    offsets : (t, 3) array
        c [m].
    stiffness : (t,) array
        k [N/m].
    """

    rows: Ints
    weights: Floats
    offsets: Floats
    stiffness: Floats

    per_element = ("rows", "weights", "offsets", "stiffness")

    def value(self, x: Floats) -> float:
        """Energy of the ties [J]."""
        return 0.5 * dot(self.stiffness, (self._stretches(x) ** 2).sum(axis=1))

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        out = np.zeros_like(x)
        forces = self.stiffness[:, None] * self._stretches(x)
        np.add.at(out, self.rows, self.weights[:, :, None] * forces[:, None])
        return out

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (t, 15, 15) [N/m], the same at every x."""
        return self._hessian

    @cached_property
    def _hessian(self) -> ElementHessian:
        products = np.einsum("t,ta,tb,pq->tapbq", self.stiffness, self.weights, self.weights, np.eye(3))
        size = 3 * self.rows.shape[1]
        return ElementHessian(self.rows, products.reshape(len(self.rows), size, size))

    def _stretches(self, x: Floats) -> Floats:
        """r of each tie, (t, 3) [m]."""
        return np.asarray(np.einsum("ta,tap->tp", self.weights, x[self.rows]) - self.offsets, np.float64)


@dataclass(frozen=True)
class Tied:
    """Vertices of cloth, rows (t,) of x, that are tied to rigid body `number` with `stiffness` each [N/m]."""

    number: int
    vertices: Ints
    stiffness: float


def rigid_ties(world: World, tied: Sequence[Tied]) -> RigidTies:
    """Return the ties of a world; each vertex is tied to the point of the body that is where it is now."""
    start = world.start()
    rows, weights, offsets, stiffness = [], [], [], []
    for each in tied:
        body, at = world.rigid[each.number], world.coordinate_slices[each.number]
        functions, constant = functions_at(body, start[each.vertices])
        padded = np.zeros((len(each.vertices), len(CORNERS)))
        padded[:, : functions.shape[1]] = functions
        own = np.minimum(np.arange(at.start, at.start + len(CORNERS)), at.stop - 1)
        rows.append(np.column_stack([each.vertices, np.tile(own, (len(each.vertices), 1))]))
        weights.append(np.column_stack([np.ones(len(each.vertices)), -padded]))
        offsets.append(constant)
        stiffness.append(np.full(len(each.vertices), each.stiffness))
    return RigidTies(*(np.concatenate(parts) for parts in (rows, weights, offsets, stiffness)))


def functions_at(body: RigidBody, points: Floats) -> tuple[Floats, Floats]:
    """f_j (p, k) and c (p, 3) [m] of a body at material points that are at `points` (p, 3) [m] at the start."""
    away = points - body.positions[0]
    return body.weights[0] + away @ body.gradients.T, body.offset[0] + away @ body.constant.T
