"""Topology of a triangle list, hinges over its interior edges, and the numbering of a world."""

import numpy as np
import pytest
from meshes import UNIT, cloth, grid, irregular_grid, random_rotation

from clothsim.base.errors import InputError
from clothsim.mesh.body import make_body, rigid_motion
from clothsim.mesh.cloth import cloth_hinges, dihedral_angles
from clothsim.mesh.generators.shapes import rectangle, sphere, tube
from clothsim.mesh.topology import (
    border_edges,
    border_vertices,
    components,
    half_edges,
    interior_edges,
    unique_edges,
    vertex_rings,
)
from clothsim.mesh.world import make_world

MESHES = {"irregular": irregular_grid(), "tube": tube(cells=(7, 3)), "sphere": sphere(1.0, 1)}


@pytest.mark.parametrize("name", MESHES)
def test_edges_are_interior_or_border(name):
    _, triangles = MESHES[name]
    edges = unique_edges(triangles)
    expected = sorted({tuple(sorted((t[k], t[k - 1]))) for t in triangles.tolist() for k in range(3)})
    assert edges.tolist() == [list(edge) for edge in expected]
    assert len(interior_edges(triangles)[0]) + len(border_edges(triangles)[0]) == len(edges)
    assert 2 * len(interior_edges(triangles)[0]) + len(border_edges(triangles)[0]) == len(half_edges(triangles))


@pytest.mark.parametrize("name", MESHES)
def test_interior_edges_name_their_triangles(name):
    _, triangles = MESHES[name]
    vertices, pairs = interior_edges(triangles)
    assert len(vertices)
    for (start, end, one, two), (first, second) in zip(vertices.tolist(), pairs.tolist(), strict=True):
        assert set(triangles[first]) == {start, end, one}
        assert set(triangles[second]) == {start, end, two}
        assert (start, end) in {(triangles[first][k - 1], triangles[first][k]) for k in range(3)}


def test_border_of_a_sheet():
    _, triangles = grid(3, 2)
    edges, half = border_edges(triangles)
    np.testing.assert_array_equal(half_edges(triangles)[half], edges)
    assert border_vertices(triangles).tolist() == [0, 1, 2, 3, 5, 6, 8, 9, 10, 11]
    assert len(edges) == 10


@pytest.mark.parametrize("name", MESHES)
def test_vertex_rings_are_the_neighbours(name):
    points, triangles = MESHES[name]
    starts, neighbours = vertex_rings(triangles, len(points) + 1)
    for vertex in range(len(points)):
        ring = sorted({v for t in triangles.tolist() if vertex in t for v in t} - {vertex})
        assert neighbours[starts[vertex] : starts[vertex + 1]].tolist() == ring
    assert starts[-1] == starts[-2] == len(neighbours)


def test_components_are_numbered_by_first_appearance():
    _, triangles = grid(1, 1)
    assert components(np.vstack([triangles + 5, triangles]), 10).tolist() == [0, 0, 0, 0, 1, 2, 2, 2, 2, 3]


@pytest.mark.parametrize("name", MESHES)
def test_hinges_unfold_with_the_lengths_of_the_mesh(name):
    points, triangles = MESHES[name]
    hinges = cloth_hinges(cloth(points, triangles), offset=11)
    world = hinges.vertices - 11
    for one, two in ((0, 1), (0, 2), (1, 2), (0, 3), (1, 3)):
        flat = np.linalg.norm(hinges.corners[:, one] - hinges.corners[:, two], axis=1)
        np.testing.assert_allclose(
            flat, np.linalg.norm(points[world[:, one]] - points[world[:, two]], axis=1), rtol=1e-12
        )
    assert (hinges.corners[:, 2, 1] > 0).all()
    assert (hinges.corners[:, 3, 1] < 0).all()
    np.testing.assert_allclose(hinges.edge_lengths, np.linalg.norm(points[world[:, 1]] - points[world[:, 0]], axis=1))
    np.testing.assert_array_equal(hinges.stiffness, UNIT.bending_stiffness)


@pytest.mark.parametrize("angle", [-3.0, -1.0, 0.0, 0.4, 3.1])
@pytest.mark.parametrize("seed", [0, 1])
def test_dihedral_angle_of_a_folded_pair(angle, seed):
    """Triangle (0, 1, 2) lies in z = 0 facing +z; the other wing turns about the edge by `angle` towards the back."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0.3, 0.8, 0], [0.6, -0.5 * np.cos(angle), -0.5 * np.sin(angle)]])
    moved = points @ random_rotation(seed).T + 3.0
    np.testing.assert_allclose(dihedral_angles(moved, np.array([[0, 1, 2, 3]])), angle, atol=1e-12)


def test_a_curved_rest_shape_rests_at_its_own_angles():
    points, triangles = tube(0.2, 0.4, (12, 1))
    hinges = cloth_hinges(cloth(points, triangles))
    vertical = np.ptp(points[hinges.vertices[:, :2], 2], axis=1) > 0
    along = np.abs(hinges.rest_angles) > 1e-9
    np.testing.assert_allclose(hinges.rest_angles[along], 2 * np.pi / 12, rtol=1e-12)
    assert along.sum() == 12
    assert (along <= vertical).all()


def test_a_flat_pattern_rests_flat_whatever_its_start():
    points, triangles = tube(0.2, 0.4, (12, 1))
    material = cloth(points, triangles).material_coordinates
    assert not cloth_hinges(cloth(points, triangles, material_coordinates=material)).rest_angles.any()


def two_cloths_and_a_ball():
    one = cloth(*rectangle((1, 1), (3, 3)), name="one")
    two = cloth(*rectangle((2, 1), (2, 2)), name="two", velocity=(0, 0, 2.0))
    ball = make_body("ball", *sphere(0.1, 0), rigid_motion(velocity=(1.0, 0, 0)))
    return make_world([one, two], [ball])


def test_world_numbers_cloths_then_bodies():
    world = two_cloths_and_a_ball()
    assert (world.n_cloth, world.n_vertices) == (25, 37)
    assert world.cloth_slices == (slice(0, 16), slice(16, 25))
    assert world.body_slices == (slice(25, 37),)
    assert world.triangles[18:].min() == 16
    assert world.body_triangles.min() == 25
    assert world.start().shape == (37, 3)
    np.testing.assert_array_equal(world.start_velocities()[:, 2], [0.0] * 16 + [2.0] * 9 + [0.0] * 12)
    assert world.hinges.vertices.max() == 24
    assert len(world.edges) == len(unique_edges(world.triangles))
    np.testing.assert_allclose(world.bodies[0].at(2.0)[:, 0] - world.bodies[0].positions[:, 0], 2.0)


def test_world_areas_and_masses_add_up():
    world = two_cloths_and_a_ball()
    assert world.rest_areas.sum() == pytest.approx(3.0, rel=1e-13)
    assert world.vertex_areas.sum() == pytest.approx(3.0, rel=1e-13)
    assert world.masses.sum() == pytest.approx(3.0 * UNIT.density, rel=1e-13)
    assert (world.masses > 0).all()
    products = np.einsum("mij,mjk->mik", world.rest_shapes, world.rest_shape_inverses)
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(2), products.shape), atol=1e-12)


def test_world_refuses_no_cloth_and_shared_names():
    with pytest.raises(InputError, match="cloth"):
        make_world([])
    with pytest.raises(InputError, match="'ball'"):
        make_world([cloth(*grid(1, 1), name="ball")], [make_body("ball", *sphere(0.1, 0))])
