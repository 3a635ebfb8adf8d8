"""Membrane against scikit-fem: an independent assembly of the same energy, derivatives in tensor form."""

import numpy as np
import pytest
from differences import dense_hessian
from effect_builders import membrane
from meshes import cloth, deformed, irregular_grid

from clothsim.mesh.world import make_world

skfem = pytest.importorskip("skfem", reason="scikit-fem is not installed")


def assembled(world, x, mu, lam):
    """(energy, gradient (n, 3), Hessian (3n, 3n)) by scikit-fem: three P1 displacement components on a flat mesh.

    P = mu F + b F C^-1, b = lam ln J - mu; dP = mu dF + b (dF - F C^-1 dC) C^-1 + lam tr(C^-1 dC)/2 F C^-1,
    dC = dF'F + F'dF.
    """
    mesh = skfem.MeshTri(world.cloths[0].rest_positions[:, :2].T, world.triangles.T)
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP1(), 3), intorder=1)
    F = np.array(basis.interpolate(x.ravel()).grad)
    C = np.einsum("ki...,kj...->ij...", F, F)
    determinant = C[0, 0] * C[1, 1] - C[0, 1] ** 2
    inverse = np.array([[C[1, 1], -C[0, 1]], [-C[0, 1], C[0, 0]]]) / determinant
    log_J = 0.5 * np.log(determinant)
    b = lam * log_J - mu
    pulled = np.einsum("ki...,ij...->kj...", F, inverse)
    P = mu * F + b * pulled

    @skfem.Functional
    def energy(w):
        return mu / 2 * (C[0, 0] + C[1, 1] - 2 - 2 * log_J) + lam / 2 * log_J**2

    @skfem.LinearForm
    def force(v, w):
        return np.einsum("ki...,ki...->...", P, v.grad)

    @skfem.BilinearForm
    def stiffness(u, v, w):
        dF = u.grad
        half = np.einsum("ki...,kj...->ij...", dF, F)
        dC = half + np.swapaxes(half, 0, 1)
        change = dF - np.einsum("ki...,ij...->kj...", pulled, dC)
        dP = mu * dF + b * np.einsum("ki...,ij...->kj...", change, inverse)
        dP = dP + 0.5 * lam * np.einsum("ij...,ij...->...", inverse, dC) * pulled
        return np.einsum("ki...,ki...->...", dP, v.grad)

    return energy.assemble(basis), force.assemble(basis).reshape(-1, 3), stiffness.assemble(basis).toarray()


@pytest.mark.parametrize("seed", range(3))
def test_value_gradient_and_hessian(seed):
    world = make_world([cloth(*irregular_grid(seed))])
    x = deformed(world, seed)
    ours = membrane(world)
    energy, gradient, hessian = assembled(world, x, ours.mu[0], ours.lam[0])
    assert ours.value(x) == pytest.approx(energy, rel=1e-12)
    assert np.abs(ours.gradient(x) - gradient).max() < 1e-12 * np.abs(gradient).max()
    assert np.abs(dense_hessian(ours, x) - hessian).max() < 1e-12 * np.abs(hessian).max()
    assert np.abs(gradient).max() > 0.1
