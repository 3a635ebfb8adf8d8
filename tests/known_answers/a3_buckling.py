"""Flat strips under their own weight in their plane: the load where they leave it (docs/results/validation.md A3)."""

import numpy as np
from scipy import sparse

from clothsim.base.arrays import Floats, Ints
from clothsim.keys.fabric import Fabric
from clothsim.mesh.world import make_world
from clothsim.physics.energies.pins import clamped
from tests.known_answers.plates import flat
from tests.known_answers.unit_solver import second_derivatives
from tests.support.effect_builders import bending, membrane

SMALL = 1e-10
"""The fraction of E2 that the weight is: small enough for its stresses to be proportional to it."""


def critical_weight(
    points: Floats, triangles: Ints, towards: tuple[float, float], nu: float = 0.0, model: str = "midedge"
) -> float:
    """rho_A g L^3/B, B = D (1 - nu^2), of a strip 0 <= x <= 1 that is clamped at x = 0, at which it buckles.

    The membrane's stresses under a weight along `towards` make its stiffness out of the plane, k per unit of weight;
    the lowest load with (bending + load k) w = 0.
    """
    from scipy.sparse.linalg import eigsh, spsolve

    pinned = np.flatnonzero(points[:, 0] < 1e-9)
    fabric = Fabric(density=1.0, thickness=1.0, youngs_modulus=1.0, poisson_ratio=nu, bending_stiffness=1.0)
    world, _ = clamped(make_world([flat(points, triangles, fabric)]), [pinned])
    free = np.setdiff1d(np.arange(world.n_cloth), pinned)
    x, sheet = world.start(), membrane(world)
    in_plane = np.sort(np.concatenate([3 * free, 3 * free + 1]))
    weight = np.zeros_like(x)
    weight[: world.n_cloth, :2] = SMALL * world.masses[:, None] * np.array(towards)
    moved = np.zeros(x.size)
    stiffness = second_derivatives(sheet, x)
    moved[in_plane] = spsolve(stiffness[in_plane][:, in_plane].tocsc(), weight.ravel()[in_plane])
    stressed = _across(second_derivatives(sheet, x + moved.reshape(-1, 3)), free) / SMALL
    bent = _across(second_derivatives(bending(world, model=model), x), free)
    largest = eigsh(-stressed, k=1, M=bent, which="LA", return_eigenvectors=False)[0]
    return float(1 / (largest * (1 - nu**2)))


def _across(matrix: sparse.csr_array, free: Ints) -> sparse.csc_array:
    """The entries of a (3 N, 3 N) matrix between the z of free vertices."""
    return matrix[3 * free + 2][:, 3 * free + 2].tocsc()
