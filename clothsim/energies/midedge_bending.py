"""Mid-edge bending: the plate energy of the material on the curvature of every triangle; it converges on any mesh.

E = sum A D/2 [(1 - nu) |S|^2 + nu tr(S)^2] = |G (theta - theta0)|^2/2, with S the mid-edge curvature less that at rest
and G its constant matrix over the angles of the hinges (`kinematics.curvature`). D and nu are the material's own. Where
the hinge model has a spring on each angle, this one couples the nine angles in and round each triangle: the moments are
M (theta - theta0) with M = G'G.

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
    """vertices (h, 4); rest_angles (h,) [rad]; strains G (3 m, h) [sqrt(J)].

    The Hessian's elements are triangles with their neighbours: stencils (m, j) the hinges, weights (m, 3, j) their
    entries in G, elements (m, k) their vertices, places (m, j, 4) where each hinge's vertices stand among those, owners
    (h, 2) an element that holds the hinge, and where. Short rows are filled up with their first entry, weight 0.
    The value is +inf where a triangle beside a hinge has no area; such a hinge adds nothing to gradient and Hessian.
    """

    vertices: Ints
    rest_angles: Floats
    strains: sparse.csr_array
    stencils: Ints
    weights: Floats
    elements: Ints
    places: Ints
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
        """3 k x 3 k a triangle [N/m]; projected: Gauss-Newton, else with the moments times d2theta/dx2 too."""
        blocks = _gauss_newton(self.vertices, self.stencils, self.weights, self.places, self.elements.shape[1], x)
        if not project:
            _add_moments(blocks, self.vertices, self._moments(x), self.owners, self.places, x)
        return ElementHessian(self.elements, blocks)

    def _moments(self, x: Floats) -> Floats:
        """dE/dtheta, (h,) [N m]."""
        angles = kernels.angles(self.vertices, x)
        change = np.where(np.isinf(angles), 0.0, angles - self.rest_angles)
        return self.strains.T @ (self.strains @ change)


def midedge_bending(hinges: Hinges, world: World) -> MidedgeBending:
    """The energy of `hinges`, all or some of a world's."""
    strains = bending_strains(world, hinges)
    stencils, weights = _rows_in_threes(strains)
    elements, places = _distinct(hinges.vertices[stencils])
    owners = np.zeros((len(hinges.vertices), 2), np.int64)
    rows, columns = np.indices(stencils.shape)
    owners[stencils] = np.stack([rows, columns], axis=2)
    return MidedgeBending(hinges.vertices, hinges.rest_angles, strains, stencils, weights, elements, places, owners)


def _rows_in_threes(matrix: sparse.csr_array) -> tuple[Ints, Floats]:
    """The columns (m, j) and entries (m, 3, j) of a matrix (3 m, h), three rows at a time, but for threes of zeros."""
    m = matrix.shape[0] // 3
    threes = (sparse.kron(sparse.eye_array(m), np.ones((1, 3))) @ abs(matrix)).tocsr()
    threes.sort_indices()
    counts = np.diff(threes.indptr)
    kept = np.flatnonzero(counts)
    j = np.arange(counts.max(initial=1))
    filled = j < counts[kept, None]
    columns = threes.indices[threes.indptr[kept, None] + np.where(filled, j, 0)].astype(np.int64)
    rows = 3 * kept[:, None] + np.arange(3)
    entries = matrix[np.repeat(rows.ravel(), len(j)), np.repeat(columns, 3, axis=0).ravel()].reshape(-1, 3, len(j))
    return columns, np.where(filled[:, None, :], np.asarray(entries), 0.0)


def _distinct(vertices: Ints) -> tuple[Ints, Ints]:
    """The distinct numbers of each of m blocks `vertices (m, j, 4)`, (m, k), and where each entry stands in them."""
    flat = vertices.reshape(len(vertices), -1)
    order = np.argsort(flat, axis=1, kind="stable")
    ordered = np.take_along_axis(flat, order, axis=1)
    rank = np.zeros_like(flat)
    rank[:, 1:] = np.cumsum(ordered[:, 1:] != ordered[:, :-1], axis=1)
    places = np.empty_like(flat)
    np.put_along_axis(places, order, rank, axis=1)
    distinct = np.repeat(ordered[:, :1], rank.max(initial=0) + 1, axis=1)
    np.put_along_axis(distinct, rank, ordered, axis=1)
    return distinct, places.reshape(vertices.shape)


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
def _gauss_newton(vertices: Ints, stencils: Ints, weights: Floats, places: Ints, n_places: int, x: Floats) -> Floats:
    """Sum of s s' over the three strains of a triangle, s = sum_j weight_j dtheta_j/dx."""
    angle_gradients = _angle_gradients(vertices, x)
    size = 3 * n_places
    blocks = np.empty((len(stencils), size, size))
    strains = np.empty((3, size))
    for t in range(len(stencils)):
        strains[:] = 0.0
        for j in range(stencils.shape[1]):
            for k in range(4):
                at = 3 * places[t, j, k]
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
def _add_moments(blocks: Floats, vertices: Ints, moments: Floats, owners: Ints, places: Ints, x: Floats) -> None:
    """Each hinge's moment times d2theta/dx2, added to the block of an element that holds the hinge."""
    curved = np.empty((12, 12))
    for h in range(len(vertices)):
        a, b, c, d = four_points(x, vertices, h)
        hinge_hessian(a, b, c, d, moments[h], 0.0, curved)
        t = owners[h, 0]
        place = places[t, owners[h, 1]]
        for k in range(4):
            for i in range(3):
                for m in range(4):
                    for j in range(3):
                        blocks[t, 3 * place[k] + i, 3 * place[m] + j] += curved[3 * k + i, 3 * m + j]
