"""Mid-edge bending: Kirchhoff plate energy of the curvature of each triangle, convergent on any mesh.

    E = sum A D/2 [(1 - nu) |S|^2 + nu tr(S)^2] = |G (theta - theta0)|^2/2

with S the mid-edge curvature less that at rest and G its constant matrix over the angles of the hinges
(`kinematics.curvature`). D and nu are the material's. Where the hinge model has a spring on each angle, this one
couples the angles in and around each triangle: the moments are M (theta - theta0) with M = G'G.

As in the hinge model angles are not wrapped and all lengths are those at rest. A free strip bends with D (1 - nu^2), a
wide plate with D: D is the plate's stiffness, E t^3/(12 (1 - nu^2)).
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from clothsim.arrays import Floats, Ints
from clothsim.energies import hinge_kernels as kernels
from clothsim.energies.base import Energy
from clothsim.energies.hessians import ElementHessian
from clothsim.indexing import four_points
from clothsim.jit import kernel
from clothsim.kinematics.curvature import bending_strains
from clothsim.kinematics.hinge_angle import hinge_angle_gradient, hinge_hessian
from clothsim.mesh.hinges import Hinges
from clothsim.mesh.world import World


@dataclass(frozen=True)
class MidedgeBending(Energy):
    """E = |G (theta - theta0)|^2/2; +inf where a triangle beside a hinge has no area.

    Such a hinge adds nothing to gradient and Hessian. An element of the Hessian is a triangle with its neighbours.
    Short rows of an element are padded with their first entry, at weight 0.

    Parameters
    ----------
    vertices : (h, 4) int array
        Rows of x of the hinges.
    rest_angles : (h,) array
        theta0 [rad].
    strains : (3m, h) sparse array
        G [sqrt(J)].
    stencils, weights : (m, j) int array, (m, 3, j) array
        The hinges of each element and their entries in G.
    elements : (m, k) int array
        Rows of x of each element.
    slots : (m, j, 4) int array
        Positions of the hinges' vertices in `elements`.
    owners : (h, 2) int array
        An element that contains the hinge, and the hinge's position in its stencil.
    """

    vertices: Ints
    rest_angles: Floats
    strains: sparse.csr_array
    stencils: Ints
    weights: Floats
    elements: Ints
    slots: Ints
    owners: Ints

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        angles = kernels.angles(self.vertices, x)
        if np.isinf(angles).any():
            return np.inf
        return 0.5 * float(np.sum((self.strains @ (angles - self.rest_angles)) ** 2))

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return _gradient(self.vertices, self._moments(x), x)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """3k x 3k a triangle [N/m]; projected: Gauss-Newton; exact: plus the moments times d2theta/dx2."""
        blocks = _gauss_newton(self.vertices, self.stencils, self.weights, self.slots, self.elements.shape[1], x)
        if not project:
            _add_moments(blocks, self.vertices, self._moments(x), self.owners, self.slots, x)
        return ElementHessian(self.elements, blocks)

    def _moments(self, x: Floats) -> Floats:
        """dE/dtheta, (h,) [N m]."""
        angles = kernels.angles(self.vertices, x)
        change = np.where(np.isinf(angles), 0.0, angles - self.rest_angles)
        return self.strains.T @ (self.strains @ change)


def midedge_bending(hinges: Hinges, world: World) -> MidedgeBending:
    """The bending energy of hinges, all or some of a world's."""
    strains = bending_strains(world, hinges)
    stencils, weights = _rows_in_threes(strains)
    elements, slots = _distinct(hinges.vertices[stencils])
    owners = np.zeros((len(hinges.vertices), 2), np.int64)
    rows, columns = np.indices(stencils.shape)
    owners[stencils] = np.stack([rows, columns], axis=2)
    return MidedgeBending(hinges.vertices, hinges.rest_angles, strains, stencils, weights, elements, slots, owners)


def _rows_in_threes(matrix: sparse.csr_array) -> tuple[Ints, Floats]:
    """The columns (m, j) and entries (m, 3, j) of a matrix (3m, h), three rows at a time, without rows of zeros."""
    m = matrix.shape[0] // 3
    threes = (sparse.kron(sparse.eye_array(m), np.ones((1, 3))) @ abs(matrix)).tocsr()
    threes.sort_indices()
    counts = np.diff(threes.indptr)
    selected = np.flatnonzero(counts)
    j = np.arange(counts.max(initial=1))
    filled = j < counts[selected, None]
    columns = threes.indices[threes.indptr[selected, None] + np.where(filled, j, 0)].astype(np.int64)
    rows = 3 * selected[:, None] + np.arange(3)
    entries = matrix[np.repeat(rows.ravel(), len(j)), np.repeat(columns, 3, axis=0).ravel()].reshape(-1, 3, len(j))
    return columns, np.where(filled[:, None, :], np.asarray(entries), 0.0)


def _distinct(vertices: Ints) -> tuple[Ints, Ints]:
    """The distinct numbers (m, k) in each block of `vertices` (m, j, 4), and the position of each entry in them."""
    flat = vertices.reshape(len(vertices), -1)
    order = np.argsort(flat, axis=1, kind="stable")
    ordered = np.take_along_axis(flat, order, axis=1)
    rank = np.zeros_like(flat)
    rank[:, 1:] = np.cumsum(ordered[:, 1:] != ordered[:, :-1], axis=1)
    slots = np.empty_like(flat)
    np.put_along_axis(slots, order, rank, axis=1)
    distinct = np.repeat(ordered[:, :1], rank.max(initial=0) + 1, axis=1)
    np.put_along_axis(distinct, rank, ordered, axis=1)
    return distinct, slots.reshape(vertices.shape)


@kernel
def _angle_gradients(vertices: Ints, x: Floats) -> Floats:
    """dtheta/dx of each hinge, (h, 4, 3) [1/m]."""
    gradients = np.empty((len(vertices), 4, 3))
    for h in range(len(vertices)):
        a, b, c, d = four_points(x, vertices, h)
        g = hinge_angle_gradient(a, b, c, d)
        for k in range(4):
            for i in range(3):
                gradients[h, k, i] = g[k][i]
    return gradients


@kernel
def _gradient(vertices: Ints, moments: Floats, x: Floats) -> Floats:
    """Sum of the moments times dtheta/dx."""
    gradient = np.zeros_like(x)
    angle_gradients = _angle_gradients(vertices, x)
    for h in range(len(vertices)):
        for k in range(4):
            for i in range(3):
                gradient[vertices[h, k], i] += moments[h] * angle_gradients[h, k, i]
    return gradient


@kernel
def _gauss_newton(vertices: Ints, stencils: Ints, weights: Floats, slots: Ints, n_slots: int, x: Floats) -> Floats:
    """Sum of s s' over the three strains of a triangle, s = sum_j weight_j dtheta_j/dx."""
    angle_gradients = _angle_gradients(vertices, x)
    size = 3 * n_slots
    blocks = np.empty((len(stencils), size, size))
    strains = np.empty((3, size))
    for t in range(len(stencils)):
        strains[:] = 0.0
        for j in range(stencils.shape[1]):
            for k in range(4):
                at = 3 * slots[t, j, k]
                for i in range(3):
                    slope = angle_gradients[stencils[t, j], k, i]
                    for q in range(3):
                        strains[q, at + i] += weights[t, q, j] * slope
        r, s, u = strains[0], strains[1], strains[2]
        for row in range(size):
            line, a, b, c = blocks[t, row], r[row], s[row], u[row]
            for column in range(size):
                line[column] = a * r[column] + b * s[column] + c * u[column]
    return blocks


@kernel
def _add_moments(blocks: Floats, vertices: Ints, moments: Floats, owners: Ints, slots: Ints, x: Floats) -> None:
    """Add each hinge's moment times d2theta/dx2 to the block of an element that contains the hinge."""
    curved = np.empty((12, 12))
    for h in range(len(vertices)):
        a, b, c, d = four_points(x, vertices, h)
        hinge_hessian(a, b, c, d, moments[h], 0.0, curved)
        t = owners[h, 0]
        slot = slots[t, owners[h, 1]]
        for k in range(4):
            for i in range(3):
                for m in range(4):
                    for j in range(3):
                        blocks[t, 3 * slot[k] + i, 3 * slot[m] + j] += curved[3 * k + i, 3 * m + j]
