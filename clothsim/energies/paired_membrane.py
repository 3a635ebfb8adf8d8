"""Membrane on pairs of triangles, with less locking where folds are about as fine as the mesh.

Triangles of constant strain cannot bend about a line other than one of their edges without stretch: the membrane locks
folds that cross the edges. Here the energy of two neighbours depends on the mean of their deformation gradients, which
is determined by the diagonals of their quadrilateral alone (Green's theorem): a net of quadrilaterals whose diagonals
keep lengths and angle bends freely (Jiang et al. 2020, "Quad-mesh based isometric mappings and developable surfaces").
The mean does not resist the hourglass mode of the quadrilateral, so that a fraction `own` of the energy remains with
the triangles.

The patch test holds, since in an affine state all F are equal. A curved rest shape is free of stress: there the mean F
is taken relative to its stretch in that shape.
"""

from dataclasses import dataclass

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.energies import paired_kernels as kernels
from clothsim.energies.base import Energy
from clothsim.energies.elementwise import Elementwise
from clothsim.energies.hessians import ElementHessian
from clothsim.mesh.topology import interior_edges
from clothsim.mesh.world import World

OWN = 0.05
"""Fraction of the energy that remains with each triangle."""
SHARP = 1.0
"""Rest angle [rad] from which two neighbours do not form a pair."""


@dataclass(frozen=True)
class PairedMembrane(Elementwise, Energy):
    """E = sum over pairs of A [(1 - own) psi(w1 F1 + w2 F2) + own (w1 psi(F1) + w2 psi(F2))], psi Neo-Hookean.

    Parameters
    ----------
    elements : (p, 4) int array
        Rows of x: the shared edge and both opposite corners; a single triangle has its last corner twice.
    rates : (p, 3, 4, 2) array
        Gradients of the shape functions of the pair and of both triangles, in one frame [1/m].
    weights : (p, 3) array
        Areas that the three parts are weighted with [m2].
    mu, lam : (p,) arrays
        Lame parameters [N/m].
    """

    elements: Ints
    rates: Floats
    weights: Floats
    mu: Floats
    lam: Floats

    per_element = ("elements", "rates", "weights", "mu", "lam")

    def value(self, x: Floats) -> float:
        """Elastic energy [J]; +inf where a triangle has lost its area."""
        return kernels.value(x, *self._arrays)

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return kernels.gradient(x, *self._arrays)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (p, 12, 12) [N/m]; projected in the space of the metric, or exact."""
        return ElementHessian(self.elements, kernels.hessian(x, *self._arrays, project))

    @property
    def _arrays(self) -> tuple[Ints, Floats, Floats, Floats, Floats]:
        return self.elements, self.rates, self.weights, self.mu, self.lam


def paired_membrane(world: World, own: float = OWN) -> PairedMembrane:
    """The membrane of all triangles that have a stiffness, in pairs where possible."""
    mu, lam = world.per_triangle("shear_modulus"), world.per_triangle("lame_modulus")
    corners, both = pairs(world)
    n, alone = len(both), np.setdiff1d(np.arange(len(world.triangles)), both)
    elements = np.concatenate([corners, world.triangles[alone][:, [0, 1, 2, 2]]])
    first = np.concatenate([both[:, 0], alone])
    rates = np.zeros((len(elements), 3, 4, 2))
    rates[:, 1] = _rates(world, elements, first)
    rates[n:, 1, 3] = 0.0
    rates[:n, 2] = _rates(world, corners, both[:, 1]) @ _turns(world, corners, both).transpose(0, 2, 1)
    areas = np.column_stack([world.rest_areas[first], np.zeros(len(first))])
    areas[:n, 1] = world.rest_areas[both[:, 1]]
    total = areas.sum(axis=1)
    rates[:, 0] = np.einsum("pi,pivk->pvk", areas / total[:, None], rates[:, 1:])
    rates[:n, 0] = rates[:n, 0] @ _unbent(world, corners, rates[:n, 0])
    weights = np.column_stack([(1 - own) * total, own * areas])
    stiff = (mu[first] != 0) | (lam[first] != 0)
    return PairedMembrane(elements[stiff], rates[stiff], weights[stiff], mu[first][stiff], lam[first][stiff])


def pairs(world: World) -> tuple[Ints, Ints]:
    """Disjoint pairs of neighbours of one fabric: (p, 4) shared edge and the corners beside it; (p, 2) the triangles.

    Greedy, by how near the angles opposite to the shared edge are to right angles. No pair is bent by more than SHARP
    at rest: across a sharp crease the diagonals do not determine the strain.
    """
    corners, both = interior_edges(world.triangles)
    mu, lam = world.per_triangle("shear_modulus"), world.per_triangle("lame_modulus")
    alike = (mu[both[:, 0]] == mu[both[:, 1]]) & (lam[both[:, 0]] == lam[both[:, 1]])
    flat, rest = _rest(world)
    a, b, c, d = (rest[corners[:, k]] for k in range(4))
    one, other = np.cross(b - a, c - a), np.cross(d - a, b - a)
    size = np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1)
    alike &= flat[corners[:, 0]] | ((one * other).sum(axis=1) > np.cos(SHARP) * size)
    skew = sum(np.abs(_cosines(world, corners, both[:, k], 2 + k)) for k in range(2))
    taken, chosen = np.zeros(len(world.triangles), bool), []
    for pair in np.argsort(np.round(skew, 9), kind="stable"):
        if alike[pair] and not taken[both[pair]].any():
            taken[both[pair]] = True
            chosen.append(pair)
    selected = np.array(chosen, np.int64)
    return corners[selected], both[selected]


def _rest(world: World) -> tuple[np.ndarray, Floats]:
    """For each cloth vertex whether its cloth is flat at rest (n,), and its rest position (n, 3) [m]."""
    flat = np.concatenate([np.full(len(cloth.positions), cloth.flat) for cloth in world.cloths])
    return flat, np.concatenate([cloth.rest_positions for cloth in world.cloths])


def _material(world: World) -> Floats:
    """The corners of all triangles at rest, each triangle in its own frame, (m, 3, 2) [m]."""
    return np.concatenate([cloth.material_coordinates for cloth in world.cloths])


def _rest_positions(world: World, corners: Ints, triangles: Ints) -> Floats:
    """Rest positions of the vertices `corners` (p, k) in the frames of `triangles` (p,), (p, k, 2) [m]."""
    where = (world.triangles[triangles][:, None, :] == corners[:, :, None]).argmax(axis=2)
    return np.asarray(np.take_along_axis(_material(world)[triangles], where[:, :, None], axis=1), np.float64)


def _cosines(world: World, corners: Ints, triangles: Ints, opposite: int) -> Floats:
    """Cosines of the angles at the corner number `opposite`, opposite to the shared edge, (p,)."""
    a, b, c = np.moveaxis(_rest_positions(world, corners[:, [0, 1, opposite]], triangles), 1, 0)
    u, v = a - c, b - c
    return np.asarray((u * v).sum(axis=1) / np.linalg.norm(u, axis=1) / np.linalg.norm(v, axis=1), np.float64)


def _rates(world: World, corners: Ints, triangles: Ints) -> Floats:
    """Shape-function gradients of four vertices in a triangle's frame, 0 for a vertex of the other, (p, 4, 2) [1/m]."""
    inverses = world.rest_shape_inverses[triangles]
    own = np.concatenate([-inverses.sum(axis=1, keepdims=True), inverses], axis=1)
    there = world.triangles[triangles][:, None, :] == corners[:, :, None]
    return np.asarray(there.astype(np.float64) @ own, np.float64)


def _turns(world: World, corners: Ints, both: Ints) -> Floats:
    """Rotations (p, 2, 2) from the frame of the second triangle to that of the first, matching the shared edge."""
    edges = [np.diff(_rest_positions(world, corners[:, :2], both[:, k]), axis=1)[:, 0] for k in range(2)]
    z = [edge[:, 0] + 1j * edge[:, 1] for edge in edges]
    turn = z[0] / z[1]
    turn = turn / np.abs(turn)
    return np.stack([np.stack([turn.real, -turn.imag], 1), np.stack([turn.imag, turn.real], 1)], 1)


def _unbent(world: World, corners: Ints, rates: Floats) -> Floats:
    """U^-1 (p, 2, 2), U the stretch of the pairs' mean F in the rest shape, 1 where that is flat."""
    flat, rest = _rest(world)
    F = np.einsum("pvk,pvi->pki", rest[corners], rates)
    C = np.where(flat[corners[:, 0], None, None], np.eye(2), np.einsum("pki,pkj->pij", F, F))
    values, vectors = np.linalg.eigh(C)
    return np.asarray(np.einsum("pij,pj,pkj->pik", vectors, values**-0.5, vectors), np.float64)
