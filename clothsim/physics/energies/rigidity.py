"""Rigidity of affine bodies: the energy that keeps their maps near a rotation."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import dot
from clothsim.mesh.rigid_body import CORNERS
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.hessians import ElementHessian


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
