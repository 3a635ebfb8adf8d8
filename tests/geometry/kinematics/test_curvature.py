"""Plate patch test: the bending strains of quadratic surfaces are exact on any mesh, triangle by triangle."""

from dataclasses import replace

import numpy as np
import pytest
from meshes import UNIT, cloth, grid, random_rotation
from scipy.spatial import Delaunay

from clothsim.geometry.kinematics.curvature import bending_strains
from clothsim.mesh.cloth import dihedral_angles, make_cloth
from clothsim.mesh.generators.shapes import rectangle
from clothsim.mesh.topology import border_vertices
from clothsim.mesh.world import make_world
from clothsim.physics.energies.pins import clamped

SIZE = 1e-5
"""Curvatures so small that the angles are linear in them."""
SADDLE = np.array([[0.0, 1], [1, 0]])
QUADRATICS = {
    "along": np.diag([1.0, 0]),
    "across": np.diag([0.0, 1]),
    "oblique": np.outer([0.8, 0.6], [0.8, 0.6]),
    "saddle": SADDLE,
    "sphere": np.eye(2),
    "any": np.array([[0.3, 0.4], [0.4, -0.2]]),
}
every_quadratic = pytest.mark.parametrize("curvature", QUADRATICS.values(), ids=QUADRATICS)


def random_mesh(seed, n=120):
    """Delaunay triangulation of random points in the unit square with a minimum spacing."""
    rng = np.random.default_rng(seed)
    side = np.linspace(0, 1, 9)[:-1]
    points = np.array([p for s in side for p in ((s, 0), (1, s), (1 - s, 1), (0, 1 - s))])
    for candidate in rng.uniform(0.05, 0.95, (20 * n, 2)):
        if np.linalg.norm(points - candidate, axis=1).min() > 0.05:
            points = np.vstack([points, candidate])
    triangles = Delaunay(points).simplices
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles = np.where(area[:, None] < 0, triangles[:, [0, 2, 1]], triangles)[np.abs(area) > 1e-9]
    return np.column_stack([points, 0 * points[:, 0]]), triangles.astype(np.int64)


def mesh(name):
    if name.startswith("random"):
        return random_mesh(int(name[-1]))
    positions, triangles = rectangle((1.0, 1.0), (8, 8), name)
    return positions + np.array([0.5, 0.5, 0]), triangles


every_mesh = pytest.mark.parametrize("name", ["right", "alternating", "crisscross", "delaunay", "random0", "random1"])


def lifted(positions, curvature, size=SIZE):
    """The flat mesh displaced to w = size x'Cx/2."""
    x = positions.copy()
    x[:, 2] = size * np.einsum("vi,ij,vj->v", positions[:, :2], curvature, positions[:, :2]) / 2
    return x


def densities(world, x, size=SIZE):
    """Twice the bending energy of each triangle over its area, D size^2."""
    angles = dihedral_angles(x, world.hinges.vertices) - world.hinges.rest_angles
    strains = (bending_strains(world, world.hinges) @ angles).reshape(-1, 3)
    return (strains**2).sum(axis=1) / (world.rest_areas * UNIT.bending_stiffness * size**2)


def plate(curvature, nu):
    """(1 - nu) |C|^2 + nu tr(C)^2."""
    return (1 - nu) * (curvature**2).sum() + nu * np.trace(curvature) ** 2


def interior_triangles(world, rings=1):
    """The triangles with `rings` rings of triangles between them and the border."""
    near = np.zeros(world.n_cloth, bool)
    near[border_vertices(world.triangles)] = True
    for _ in range(rings):
        near[world.triangles[near[world.triangles].any(axis=1)]] = True
    return ~near[world.triangles].any(axis=1)


@every_mesh
@every_quadratic
@pytest.mark.parametrize("nu", [0.0, 0.3, -0.5])
def test_quadratic_surface_has_the_plate_energy_in_each_interior_triangle(name, curvature, nu):
    positions, triangles = mesh(name)
    world = make_world([cloth(positions, triangles, replace(UNIT, poisson_ratio=nu))])
    inner = interior_triangles(world)
    assert inner.sum() > 10
    found = densities(world, lifted(positions, curvature))
    assert found[inner] == pytest.approx(plate(curvature, nu), rel=1e-8)


@every_mesh
@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_surface_without_border_moment_is_exact_up_to_the_border(name, nu):
    """The saddle on a rectangle."""
    positions, triangles = mesh(name)
    world = make_world([cloth(positions, triangles, replace(UNIT, poisson_ratio=nu))])
    assert densities(world, lifted(positions, SADDLE)) == pytest.approx(2 * (1 - nu), rel=1e-8)


@every_mesh
@pytest.mark.parametrize("nu", [0.3, -0.5])
def test_anticlastic_strip_is_exact_at_its_free_sides(name, nu):
    """k_yy = -nu k_xx has no moment across the sides y = 0, 1: D (1 - nu^2) there too, away from the ends."""
    positions, triangles = mesh(name)
    world = make_world([cloth(positions, triangles, replace(UNIT, poisson_ratio=nu))])
    found = densities(world, lifted(positions, np.diag([1.0, -nu])))
    middle = positions[triangles].mean(axis=1)
    away = np.abs(middle[:, 0] - 0.5) < 0.2
    assert (np.abs(middle[away, 1] - 0.5) > 0.4).sum() > 3
    assert found[away] == pytest.approx(1 - nu**2, rel=1e-8)


@every_mesh
def test_free_border_lowers_the_energy_of_a_curved_sheet(name):
    """A cylinder has less energy at the border than inside, never more: its direction of curvature is free there."""
    positions, triangles = mesh(name)
    world = make_world([cloth(positions, triangles)])
    found = densities(world, lifted(positions, np.eye(2)))
    assert (found <= plate(np.eye(2), UNIT.poisson_ratio) * (1 + 1e-8)).mean() > 0.9
    assert found @ world.rest_areas < 2.5 * 0.97


@pytest.mark.parametrize("pinned", ["border", "band"])
@pytest.mark.parametrize("seed", range(3))
def test_sheet_is_tangent_to_a_clamp(pinned, seed):
    """w = x^2/2 beyond a clamp at x = 0 is exact up to the clamp, on both kinds of clamp; the band itself is flat."""
    positions, triangles = random_mesh(seed)
    if pinned == "band":  # a row of flat triangles behind x = 0, with no vertex of its own on the border y = 0, 1
        strip, extra = grid(1, 8, 0.1, 1.0)
        strip = strip - [0.1, 0, 0]
        number = np.array([np.argmin(np.linalg.norm(positions - p, axis=1)) for p in strip[9:]])
        positions = np.vstack([positions, strip[:9]])
        new = np.concatenate([len(positions) - 9 + np.arange(9), number])
        triangles = np.vstack([triangles, new[extra]])
    held = np.flatnonzero(positions[:, 0] < 1e-9)
    world, _ = clamped(make_world([cloth(positions, triangles, replace(UNIT, poisson_ratio=0.0))]), [held])
    x = world.start()
    beyond = np.maximum(x[:, 0], 0)
    x[:, 2] = SIZE * beyond**2 / 2
    middle = x[world.triangles].mean(axis=1)
    found = densities(world, x)
    inside = middle[:, 0] > 0
    near = inside & (middle[:, 0] < 0.7) & (np.abs(middle[:, 1] - 0.5) < 0.3)
    assert near.sum() > 10
    assert found[near] == pytest.approx(1.0, rel=1e-8)
    assert not found[~inside].any()


@every_mesh
def test_only_affine_deformations_have_zero_energy(name):
    """Only the three affine vertical displacements have zero energy: no checkerboard, no loose corner."""
    world = make_world([cloth(*mesh(name))])
    strains = bending_strains(world, world.hinges).toarray()
    slopes = np.zeros((len(world.hinges.vertices), world.n_cloth))
    for vertex in range(world.n_cloth):
        x = world.start()
        x[vertex, 2] = 1e-6
        slopes[:, vertex] = dihedral_angles(x, world.hinges.vertices) / 1e-6
    singular = np.linalg.svd(strains @ slopes, compute_uv=False)
    assert singular[-3] < 1e-9 * singular[0]
    assert singular[-4] > 1e-4 * singular[0]


def test_invariance_under_rotation_and_mirrored_patterns():
    positions, triangles = random_mesh(2)
    pattern = positions[triangles][..., :2] * [-1.0, 1.0]
    plain, turned, mirrored = (
        make_world([sheet])
        for sheet in (
            cloth(positions, triangles),
            cloth(positions @ random_rotation(3).T, triangles),
            make_cloth("mirrored", positions, triangles, UNIT, material_coordinates=pattern),
        )
    )
    stiffness = [g.T @ g for g in (bending_strains(world, world.hinges) for world in (plain, turned, mirrored))]
    for other in stiffness[1:]:
        assert abs(stiffness[0] - other).max() < 1e-12 * abs(stiffness[0]).max()
