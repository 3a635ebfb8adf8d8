"""Surface nets of functions with known surfaces; lattices that thin ridges run between."""

import numpy as np
import pytest

from clothsim.mesh.checks import examine
from clothsim.mesh.generators.garments.implicit import half_surface
from clothsim.mesh.generators.garments.relax import both_halves, relaxed
from clothsim.mesh.topology import unique_edges


def lattice(cell, reach=1.3):
    x = np.arange(-0.5 * cell, reach, cell)
    return x, np.arange(-reach, reach, cell), np.arange(-reach, reach, cell)


def at_nodes(function, nodes):
    return function(*np.meshgrid(*nodes, indexing="ij"))


def euler(positions, triangles):
    return len(positions) - len(unique_edges(triangles)) + len(triangles)


def volume(positions, triangles):
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    return (a * np.cross(b, c)).sum() / 6


def sphere_field(points):
    r = np.linalg.norm(points, axis=1)
    return r - 1, points / r[:, None]


def test_a_sphere():
    nodes = lattice(0.1)
    half = half_surface(at_nodes(lambda x, y, z: np.sqrt(x * x + y * y + z * z) - 1, nodes), nodes)
    positions, triangles = both_halves(*half)
    assert examine("sphere", positions, triangles).findings == ()
    assert euler(positions, triangles) == 2
    assert volume(positions, triangles) == pytest.approx(4 / 3 * np.pi, rel=0.02)
    smooth, same = both_halves(*relaxed(*half, sphere_field))
    assert euler(smooth, same) == 2
    np.testing.assert_allclose(np.linalg.norm(smooth, axis=1), 1, atol=1e-6)


def test_a_torus_keeps_its_hole():
    nodes = lattice(0.1)
    values = at_nodes(lambda x, y, z: (np.hypot(x, y) - 0.8) ** 2 + z * z - 0.09, nodes)
    positions, triangles = both_halves(*half_surface(values, nodes))
    assert euler(positions, triangles) == 0
    assert examine("torus", positions, triangles).findings == ()


@pytest.mark.parametrize("seed", range(8))
def test_noise_gives_a_manifold(seed):
    rng = np.random.default_rng(seed)
    nodes = lattice(0.2)
    values = rng.standard_normal([len(axis) for axis in nodes])
    values[-1] = values[:, 0] = values[:, -1] = values[:, :, 0] = values[:, :, -1] = 1.0
    positions, triangles = both_halves(*half_surface(values, nodes))
    kinds = {finding.kind for finding in examine("noise", positions, triangles).findings}
    assert not kinds & {"fin", "mixed winding", "one-sided", "duplicate", "repeated corner"}
    count = np.unique(np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_counts=True)[1]
    assert (count == 2).all()
