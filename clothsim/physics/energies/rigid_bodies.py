"""Energies of rigid bodies: the rigidity that keeps an affine map near a rotation, and ties of cloth to a body."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import dot
from clothsim.mesh.rigid_body import CORNERS, RigidBody
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.physics.energies.protocols import Elementwise


@dataclass(frozen=True)
class Rigidity(Energy):
    """E = sum kappa V |A'A - I|^2 over the rigid bodies (Lan et al. 2022, affine body dynamics, section 3).

    V is the volume of a body and A = C + sum_j z_j g_j' the linear part of its map (`mesh.rigid_body`). With
    S = A'A - I the derivative by z_j is 4 kappa V A S g_j, and the block of z_j and z_k

        4 kappa V ((g_j . S g_k) I + (A g_k)(A g_j)' + (g_j . g_k) A A').

    Parameters
    ----------
    rows : (b, 4) int array
        Rows of x of the coordinates of each body; where it has fewer, the last is repeated with a gradient of zero.
    gradients : (b, 4, 3) array
        g_j [1/m].
    constants : (b, 3, 3) array
        C.
    stiffness : (b,) array
        kappa V [J].
    """

    rows: Ints
    gradients: Floats
    constants: Floats
    stiffness: Floats

    def value(self, x: Floats) -> float:
        """Stored energy [J]; 0 for a rotation."""
        strain = self.strains(x)
        return dot(self.stiffness, (strain**2).sum(axis=(1, 2)))

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        A, out = self._maps(x), np.zeros_like(x)
        stress = 4 * self.stiffness[:, None, None] * A @ self.strains(x)
        np.add.at(out, self.rows, np.einsum("bpq,bjq->bjp", stress, self.gradients))
        return out

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (b, 12, 12) [N/m]; projected onto the positive semi-definite ones, or exact."""
        A, g = self._maps(x), self.gradients
        images = np.einsum("bpq,bjq->bjp", A, g)
        blocks = np.einsum("bjp,bpq,bkq,rs->bjrks", g, self.strains(x), g, np.eye(3))
        blocks += np.einsum("bkr,bjs->bjrks", images, images)
        blocks += np.einsum("bjp,bkp,brq,bsq->bjrks", g, g, A, A)
        size = 3 * self.rows.shape[1]
        matrices = (4 * self.stiffness[:, None, None, None, None] * blocks).reshape(len(self.rows), size, size)
        if project:
            values, vectors = np.linalg.eigh(matrices)
            matrices = (vectors * np.maximum(values, 0.0)[:, None]) @ vectors.transpose(0, 2, 1)
        return ElementHessian(self.rows, matrices)

    def strains(self, x: Floats) -> Floats:
        """A'A - I of each body, (b, 3, 3)."""
        A = self._maps(x)
        return np.asarray(A.transpose(0, 2, 1) @ A - np.eye(3), np.float64)

    def _maps(self, x: Floats) -> Floats:
        return self.constants + np.einsum("bjp,bjq->bpq", x[self.rows], self.gradients)


def rigidity(world: World) -> Rigidity:
    """Return the rigidity of all rigid bodies of a world, of which there is at least one."""
    gradients = np.zeros((len(world.rigid), *CORNERS.shape))
    rows = np.zeros((len(world.rigid), len(CORNERS)), np.int64)
    for number, (body, at) in enumerate(zip(world.rigid, world.coordinate_slices, strict=True)):
        gradients[number, : len(body.gradients)] = body.gradients
        rows[number] = np.minimum(np.arange(at.start, at.start + len(CORNERS)), at.stop - 1)
    constants = np.stack([body.constant for body in world.rigid])
    stiffness = np.array([body.stiffness * body.volume for body in world.rigid])
    return Rigidity(rows, gradients, constants, stiffness)


# Ties: a button, a charm, a hanger.


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
