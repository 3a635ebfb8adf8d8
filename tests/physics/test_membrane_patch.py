"""The patch test: an affine boundary makes an affine sheet, to round-off, on a mesh with slivers (VALIDATION A1)."""

import numpy as np
import pytest
from meshes import cloth, irregular_grid, random_rotation
from solving import equilibrium, held

from clothsim.energies.membrane import membrane
from clothsim.mesh.fabric import Fabric
from clothsim.mesh.topology import border_edges, border_vertices
from clothsim.mesh.world import make_world

MU, LAM = 1.0, 1.5
FABRIC = Fabric(1.0, 1.0, 4 * MU * (LAM + MU) / (LAM + 2 * MU), LAM / (LAM + 2 * MU), 0.0)


def sliver_sheet(seed):
    """An irregular square with slivers of aspect 1e3 about one inner vertex; corners shuffled: random material axes."""
    rng = np.random.default_rng(seed)
    positions, triangles = irregular_grid(seed, nx=5, ny=4)
    inner = np.setdiff1d(np.arange(len(positions)), border_vertices(triangles))
    apex = inner[len(inner) // 2]
    corners = triangles[np.flatnonzero((triangles == apex).any(axis=1))[0]]
    others = corners[corners != apex]
    middle = positions[others].mean(axis=0)
    positions[apex] = middle + 1e-3 * (positions[apex] - middle)
    rolls = rng.integers(0, 3, len(triangles))
    triangles = np.array([np.roll(t, k) for t, k in zip(triangles, rolls, strict=True)])
    return positions, triangles


def stress(F):
    inverse = F @ np.linalg.inv(F.T @ F)
    return MU * (F - inverse) + LAM * 0.5 * np.log(np.linalg.det(F.T @ F)) * inverse


def psi(F):
    C = F.T @ F
    log_J = 0.5 * np.log(np.linalg.det(C))
    return MU / 2 * (np.trace(C) - 2 - 2 * log_J) + LAM / 2 * log_J**2


STATES = {
    "biaxial": np.array([[1.3, 0.2], [0.1, 1.2], [0, 0]]),
    "sheared": np.array([[1.1, 0.6], [0.0, 1.4], [0, 0]]),
    "stretched far": np.array([[2.5, 0.0], [0.3, 1.1], [0, 0]]),
}


@pytest.mark.parametrize("F", STATES.values(), ids=STATES)
@pytest.mark.parametrize("seed", [0, 1])
def test_patch(F, seed):
    positions, triangles = sliver_sheet(seed)
    turn = random_rotation(seed + 10)
    world = make_world([cloth(positions @ turn.T, triangles, FABRIC)])
    F = random_rotation(seed + 20) @ F
    affine = positions[:, :2] @ F.T + [1.0, -2.0, 0.5]
    border = border_vertices(triangles)
    start = affine.copy()
    inner = np.setdiff1d(np.arange(len(start)), border)
    start[inner] += 1e-3 * np.random.default_rng(seed).standard_normal((len(inner), 3))
    start[inner[0]] += [0.01, 0.02, -0.03]
    energy = membrane(world)
    x = equilibrium(world, {"membrane": energy}, start, held(affine, border))

    size = np.ptp(positions, axis=0).max()
    assert np.abs(start - affine)[inner].max() > 1e-3
    assert np.abs(x - affine).max() < 1e-10 * size
    area = world.rest_areas.sum()
    assert energy.value(x) == pytest.approx(area * psi(F), rel=1e-12)
    force = energy.gradient(x)
    assert np.abs(force[inner]).max() < 1e-10 * MU * size
    # the force on the border is P N: half of each border edge's to either end; edges run with their triangle
    edges, _ = border_edges(triangles)
    along = (positions[edges[:, 1]] - positions[edges[:, 0]])[:, :2]
    outward = np.column_stack([along[:, 1], -along[:, 0]])
    expected = np.zeros_like(force)
    np.add.at(expected, edges.ravel(), np.repeat(0.5 * outward @ stress(F).T, 2, axis=0))
    assert np.abs(force - expected).max() < 1e-10 * np.abs(expected).max()
