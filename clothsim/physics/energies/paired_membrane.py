"""Membrane on pairs of triangles, with less locking where folds are about as fine as the mesh.

Triangles of constant strain cannot bend about a line other than one of their edges without stretch: the membrane locks
folds that cross the edges. Here the energy of two neighbours depends on the mean of their deformation gradients, which
is determined by the diagonals of their quadrilateral alone (Green's theorem): a net of quadrilaterals whose diagonals
keep lengths and angle bends freely (Jiang et al. 2020, "Quad-mesh based isometric mappings and developable surfaces").
The mean does not resist the hourglass mode of the quadrilateral. Out of the plane that is the bend that locks; in the
plane it is the bending of the sheet as a beam, which needs its stiffness. So a small fraction `own` of the energy
remains with the triangles, and a larger one, `in_plane`, resists the mode in the tangent plane alone
(`paired_kernels`). A quarter is the ratio of the bending stiffness of a rectangle to that of its two triangles:
bending of one, two, four pairs across is then right within 1 %.

The patch test holds, since in an affine state all F are equal. A curved rest shape is free of stress: there the mean F
is taken relative to its stretch in that shape.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.world import World
from clothsim.physics.energies import paired_kernels as kernels
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.physics.energies.protocols import Elementwise
from clothsim.physics.energies.triangle_pairs import (
    hourglass_modes,
    pairs,
    shape_gradients,
    turns,
    unbending,
    without_affine_part,
)

OWN = 0.05
"""Fraction of the energy that remains with each triangle."""
IN_PLANE = 0.25
"""Fraction of the triangles' stiffness against the hourglass mode in the tangent plane, `OWN` among it."""


@dataclass(frozen=True)
class PairedMembrane(Elementwise, Energy):
    """E = sum over pairs of A [(1 - own) psi(w1 F1 + w2 F2) + own (w1 psi(F1) + w2 psi(F2))] + E_h, psi Neo-Hookean.

    E_h is the energy of the in-plane hourglass modes (`paired_kernels`).

    Parameters
    ----------
    elements : (p, 4) int array
        Rows of x: the shared edge and both opposite corners; a single triangle has its last corner twice.
    rates : (p, 3, 4, 2) array
        Gradients of the shape functions of the pair and of both triangles, in one frame [1/m].
    weights : (p, 3) array
        Areas that the three parts are weighted with [m2].
    hourglass : (p, 4) array
        Coefficients of the hourglass mode of each pair [1/m], 0 for a single triangle.
    normals : (p, 2) array
        Unit normals of the shared edges at rest.
    areas : (p,) array
        Areas that the modes are weighted with [m2].
    mu, lam : (p,) arrays
        Lame parameters [N/m].
    """

    elements: Ints
    rates: Floats
    weights: Floats
    hourglass: Floats
    normals: Floats
    areas: Floats
    mu: Floats
    lam: Floats

    per_element = ("elements", "rates", "weights", "hourglass", "normals", "areas", "mu", "lam")

    def value(self, x: Floats) -> float:
        """Elastic energy [J]; +inf where a triangle has lost its area."""
        return kernels.value(x, *self._arrays) + kernels.hourglass_value(x, *self._modes)

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        out = kernels.gradient(x, *self._arrays)
        kernels.add_hourglass_gradient(out, x, *self._modes)
        return out

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (p, 12, 12) [N/m]; projected in the space of the metric, or exact."""
        blocks = kernels.hessian(x, *self._arrays, project)
        kernels.add_hourglass_hessian(blocks, x, *self._modes, project)
        return ElementHessian(self.elements, blocks)

    @property
    def _arrays(self) -> tuple[Ints, Floats, Floats, Floats, Floats]:
        return self.elements, self.rates, self.weights, self.mu, self.lam

    @property
    def _modes(self) -> tuple[Any, ...]:
        names = ("elements", "rates", "hourglass", "normals", "areas", "mu", "lam")
        return tuple(getattr(self, name) for name in names)


def paired_membrane(world: World, own: float = OWN, in_plane: float = IN_PLANE) -> PairedMembrane:
    """The membrane of all triangles that have a stiffness, in pairs where possible.

    Parameters
    ----------
    own : float
        Fraction of the energy that remains with the triangles.
    in_plane : float
        Fraction of the triangles' stiffness against the hourglass mode in the tangent plane; at least `own`.
    """
    mu, lam = world.per_triangle("shear_modulus"), world.per_triangle("lame_modulus")
    corners, both = pairs(world)
    n, alone = len(both), np.setdiff1d(np.arange(len(world.triangles)), both)
    elements = np.concatenate([corners, world.triangles[alone][:, [0, 1, 2, 2]]])
    first = np.concatenate([both[:, 0], alone])
    rates = np.zeros((len(elements), 3, 4, 2))
    rates[:, 1] = shape_gradients(world, elements, first)
    rates[n:, 1, 3] = 0.0
    rates[:n, 2] = shape_gradients(world, corners, both[:, 1]) @ turns(world, corners, both).transpose(0, 2, 1)
    areas = np.column_stack([world.rest_areas[first], np.zeros(len(first))])
    areas[:n, 1] = world.rest_areas[both[:, 1]]
    total = areas.sum(axis=1)
    modes, normals = hourglass_modes(world, elements, both, rates)
    rates[:, 0] = np.einsum("pi,pivk->pvk", areas / total[:, None], rates[:, 1:])
    rates[:n, 0] = rates[:n, 0] @ unbending(world, corners, rates[:n, 0])
    weights = np.column_stack([(1 - own) * total, own * areas])
    stiff = (mu[first] != 0) | (lam[first] != 0)
    hourglass = without_affine_part(world, elements, rates[:, 0], modes)
    mode_areas = (in_plane - own) * areas[:, 0] * areas[:, 1] / total
    arrays = (elements, rates, weights, hourglass, normals, mode_areas, mu[first], lam[first])
    return PairedMembrane(*(array[stiff] for array in arrays))
