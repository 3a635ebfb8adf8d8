"""Mid-edge bending: Kirchhoff plate energy of the curvature of each triangle, convergent on any mesh.

    E = sum A D/2 [(1 - nu) |S|^2 + nu tr(S)^2] = |G (theta - theta0)|^2/2

with S the mid-edge curvature less that at rest and G its constant matrix over the angles of the hinges
(`kinematics.curvature`). D and nu are the material's; a fabric with its own bending stiffness along warp and weft has
the orthotropic law of `kinematics.plate_law` instead, which changes G alone. Where the hinge model has a spring on each
angle, this one couples the angles in and around each triangle: the moments are M (theta - theta0) with M = G'G.

The curvature of a triangle is a mean over its neighbourhood: waves of a few cells bend too easily. With a weight f the
energy has besides f times what the mean loses (`kinematics.curvature_gradient`), four more rows of G a triangle. Laws
that are not linear take the strains at three points of a triangle instead, whose mean has the same energy (`by_point`).
f = 1 makes waves right within 1 % from 10 cells and within 4 % from 6 cells on, where 4 to 8 and 9 to 18 % are lost.

As in the hinge model angles are not wrapped and all lengths are those at rest. A free strip bends with D (1 - nu^2), a
wide plate with D: D is the plate's stiffness, E t^3/(12 (1 - nu^2)).

Its Hessian couples all vertices around a triangle, 8 on regular and 12 on other meshes: a matrix with it takes twice
as long to factorise as one with hinges. So Newton's matrix has springs on the angles instead, stiff enough that their
energy bounds this one (|c' K c| <= sum_i c_i^2 sum_j |K_ij|), and the exact Hessian acts on vectors only
(`ImplicitHessian`): Lanczos' method needs no more.
"""

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from clothsim.base.arrays import Floats, Ints
from clothsim.base.memo import Memo
from clothsim.geometry.kinematics.curvature import bending_strains
from clothsim.geometry.kinematics.curvature_gradient import point_strains
from clothsim.mesh.cloth import Hinges
from clothsim.mesh.world import World
from clothsim.physics.energies import hinge_kernels
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.hessians import ImplicitHessian, LanesHessian, LowRankHessian, SumHessian
from clothsim.physics.energies.protocols import ElementGradients, Restrictable


@dataclass(frozen=True)
class MidedgeBending(ElementGradients, Energy, Restrictable):
    """E = |G (theta - theta0)|^2/2; +inf where a triangle beside a hinge has no area.

    Such a hinge adds nothing to gradient and Hessian. An element is a triangle with the hinges of its r rows of G: its
    three strains, and four more where short waves count.
    Short rows of an element are padded with their first entry, at weight 0. Angles and factors of the last positions
    are memoised: value, gradient and both Hessians are evaluated at the same x.

    Parameters
    ----------
    vertices : (h, 4) int array
        Rows of x of the hinges.
    rest_angles : (h,) array
        theta0 [rad].
    bounds : (h,) array
        k [N m] of a spring on each angle whose energy bounds the change of E: the sums of |G'G| over its rows.
    triangles : (m,) int array
        The world's triangle of each element.
    stiffnesses : (m,) array
        A D of the elements [J m2].
    stencils, weights : (m, j) int array, (m, r, j) array
        The hinges of each element and their entries in G [sqrt(J)].
    points : (m, 3 p, r) array
        Isometries from the rows of an element to the strains at its p points, three each.
    elements : (m, k) int array
        Rows of x of each element.
    slots : (m, j, 4) int8 array
        Positions of the hinges' vertices in `elements`.
    """

    vertices: Ints
    rest_angles: Floats
    bounds: Floats
    triangles: Ints
    stiffnesses: Floats
    stencils: Ints
    weights: Floats
    points: Floats
    elements: Ints
    slots: NDArray[np.int8]

    per_triangle: ClassVar[tuple[str, ...]] = ("triangles", "stiffnesses", "weights", "points", "elements", "slots")

    _bent: Memo[Floats] = field(default_factory=Memo, init=False, repr=False, compare=False)

    def reads_beyond(self, n: int) -> bool:
        """True where a hinge has a row from n on."""
        return bool(self.vertices.max(initial=-1) >= n)

    def by_point(self) -> Self:
        """The same energy with an element of three strains for each point."""
        n = self.points.shape[1] // 3
        apart: dict[str, Any] = {
            name: np.repeat(getattr(self, name), n, axis=0) for name in (*self.per_triangle, "stencils")
        }
        weights = (self.points @ self.weights).reshape(-1, 3, self.weights.shape[2])
        apart |= {"weights": weights, "points": alone(len(weights)), "stiffnesses": apart["stiffnesses"] / n}
        return replace(self, **apart)

    def areas(self, world: World) -> Floats:
        """The rest area that each element stands for, (m,) [m2]."""
        share = 1.0 / np.bincount(self.triangles)[self.triangles]
        return np.asarray(share * world.rest_areas[self.triangles], np.float64)

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        change = self._change(x)
        return hinge_kernels.value(self.stencils, self.weights, change) if np.isfinite(change).all() else np.inf

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return hinge_kernels.gradient(self.vertices, self._moments(x), x)

    def hessian(self, x: Floats, project: bool = True) -> LanesHessian | SumHessian:
        """Exact: J' G'G J + moments d2theta/dx2, J = dtheta/dx [N/m]; projected: J' k J with the bounds k, by hinge."""
        moments = np.zeros(len(self.vertices)) if project else self._moments(x)
        bounds = self.bounds if project else np.zeros(len(self.vertices))
        by_hinge = hinge_kernels.hinge_hessian(self.vertices, moments, bounds, x)
        return by_hinge if project else SumHessian((by_hinge, self._squares(x)))

    def element_gradients(self, x: Floats) -> tuple[Ints, Floats]:
        """The force of each hinge's moment, (h, 4, 3)."""
        apart = np.arange(self.vertices.size).reshape(self.vertices.shape)
        forces = hinge_kernels.gradient(apart, self._moments(x), x[self.vertices].reshape(-1, 3))
        return self.vertices, np.asarray(forces).reshape(-1, 4, 3)

    def _squares(self, x: Floats) -> ImplicitHessian:
        """J' G'G J: the Gauss-Newton Hessian."""
        slopes = hinge_kernels.angle_gradients(self.vertices, x)
        elementwise = self.vertices, self.stencils, self._tangents(x)

        def by_element() -> LowRankHessian:
            factors = hinge_kernels.factors(*elementwise, self.slots, self.elements.shape[1], slopes)
            rows = self.weights.shape[1]
            count = np.full(len(self.elements), rows)
            return LowRankHessian(self.elements, np.arange(0, len(factors), rows), count, factors)

        return ImplicitHessian(self.elements, lambda v: hinge_kernels.product(*elementwise, slopes, v), by_element)

    def _tangents(self, x: Floats) -> Floats:
        """The weights (m, r, j) of which the Gauss-Newton Hessian is made."""
        return self.weights

    def restricted_to(self, moving: np.ndarray, x: Floats) -> Self:
        """The elements with a moving vertex, and their hinges."""
        chosen = np.flatnonzero(moving[self.elements].any(axis=1))
        used = np.zeros(len(self.vertices), bool)
        used[self.stencils[chosen]] = True
        hinges = np.flatnonzero(used)
        return replace(
            self,
            vertices=self.vertices[hinges],
            rest_angles=self.rest_angles[hinges],
            bounds=self.bounds[hinges],
            stencils=(np.cumsum(used) - 1)[self.stencils[chosen]],
            **{name: getattr(self, name)[chosen] for name in self.per_triangle},
        )

    def strains_of_angles(self) -> tuple[sparse.csr_array, Floats]:
        """B (r m, h) [1/m] and w (m,) [J m2] of E = sum w |B (theta - theta0)|^2/2: r strains an element."""
        m, r, j = self.weights.shape
        entries = self.weights / np.sqrt(self.stiffnesses)[:, None, None]
        columns = np.broadcast_to(self.stencils[:, None, :], entries.shape)
        rows = np.repeat(np.arange(r * m), j)
        shape = (r * m, len(self.vertices))
        return sparse.coo_array((entries.ravel(), (rows, columns.ravel())), shape=shape).tocsr(), self.stiffnesses

    def widths(self, of_hinges: Floats) -> Floats:
        """The mean over each element's hinges of their widths (h,), (m,) [m]."""
        acting = (self.weights != 0).any(axis=1)
        return np.asarray((of_hinges[self.stencils] * acting).sum(axis=1) / acting.sum(axis=1), np.float64)

    def _change(self, x: Floats) -> Floats:
        """theta - theta0, (h,) [rad]; +inf where a triangle has no area."""
        return self._bent.at(x, lambda x: hinge_kernels.angles(self.vertices, x)) - self.rest_angles

    def _moments(self, x: Floats) -> Floats:
        """dE/dtheta, (h,) [N m]."""
        change = self._change(x)
        return hinge_kernels.moments(self.stencils, self.weights, np.where(np.isinf(change), 0.0, change))


def midedge_bending(
    hinges: Hinges, world: World, angles: Floats | None = None, short_waves: float = 0.0
) -> MidedgeBending:
    """The bending energy of hinges, all or some of a world's.

    Parameters
    ----------
    angles : (m,) array, optional
        Angles of the warp [rad], 0 if not given.
    short_waves : float
        Weight of the energy that the mean over the neighbourhood loses.
    """
    rows, points = bending_strains(world, hinges, angles), alone(len(world.triangles))
    if short_waves:
        rows, points = point_strains(world, hinges, rows, angles, short_waves)
    triangles, stencils, weights = rows_of_elements(rows, rows.shape[0] // len(world.triangles))
    bounds = np.asarray(abs(rows.T @ rows).sum(axis=1), np.float64).ravel()
    elements, slots = _distinct(hinges.vertices[stencils])
    by_hinge = hinges.vertices, hinges.rest_angles, bounds
    stiffnesses = (world.per_triangle("bending_stiffness") * world.rest_areas)[triangles]
    return MidedgeBending(*by_hinge, triangles, stiffnesses, stencils, weights, points[triangles], elements, slots)


def alone(count: int) -> Floats:
    """The isometries of elements of one point, whose rows are their strains, (count, 3, 3)."""
    return np.broadcast_to(np.eye(3), (count, 3, 3))


def rows_of_elements(matrix: sparse.csr_array, r: int) -> tuple[Ints, Ints, Floats]:
    """The elements (m,) of r rows of a matrix (r m, h) that are not zero, columns (m, j) and entries (m, r, j)."""
    m = matrix.shape[0] // r
    sums = (sparse.kron(sparse.eye_array(m), np.ones((1, r))) @ abs(matrix)).tocsr()
    sums.sort_indices()
    counts = np.diff(sums.indptr)
    selected = np.flatnonzero(counts)
    j = np.arange(counts.max(initial=1))
    filled = j < counts[selected, None]
    columns = sums.indices[sums.indptr[selected, None] + np.where(filled, j, 0)].astype(np.int64)
    rows = r * selected[:, None] + np.arange(r)
    entries = matrix[np.repeat(rows.ravel(), len(j)), np.repeat(columns, r, axis=0).ravel()].reshape(-1, r, len(j))
    return selected, columns, np.where(filled[:, None, :], np.asarray(entries), 0.0)


def _distinct(vertices: Ints) -> tuple[Ints, NDArray[np.int8]]:
    """The distinct numbers (m, k) in each block of `vertices` (m, j, 4), and the position of each entry in them."""
    flat = vertices.reshape(len(vertices), -1)
    order = np.argsort(flat, axis=1, kind="stable")
    ordered = np.take_along_axis(flat, order, axis=1)
    rank = np.zeros_like(flat)
    rank[:, 1:] = np.cumsum(ordered[:, 1:] != ordered[:, :-1], axis=1)
    slots = np.empty(flat.shape, np.int8)
    np.put_along_axis(slots, order, rank.astype(np.int8), axis=1)
    distinct = np.repeat(ordered[:, :1], rank.max(initial=0) + 1, axis=1)
    np.put_along_axis(distinct, rank, ordered, axis=1)
    return distinct, slots.reshape(vertices.shape)
