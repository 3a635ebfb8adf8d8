"""Triangle meshes as arrays, against closed forms."""

import numpy as np
import pytest

from clothsim.base.triangles import (
    area_vectors,
    barycentric,
    connected,
    cotangent_laplacian,
    cotangents,
    distinct_edges,
    thirds_at_vertices,
    triangle_areas,
    unit_or,
    vertex_area_vectors,
)

RANDOM = np.random.default_rng(0)


def test_area_vectors_are_the_bits_of_numpy():
    corners = RANDOM.standard_normal((50, 3, 3))
    expected = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.array_equal(area_vectors(corners), expected)
    assert np.array_equal(triangle_areas(corners), 0.5 * np.linalg.norm(expected, axis=1))
    assert area_vectors(corners.astype(np.float32)).dtype == np.float32


def test_amounts_and_normals_of_a_tetrahedron_go_to_its_vertices():
    x = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [5, 5, 5]])
    triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    thirds = thirds_at_vertices(triangle_areas(x[triangles]), triangles, len(x))
    assert np.allclose(thirds, [0.5, *(3 * [(1 + np.sqrt(3) / 2) / 3]), 0.0])
    summed = vertex_area_vectors(x, triangles)
    assert np.allclose(summed[0], [-1, -1, -1])
    assert np.allclose(unit_or(summed, [0, 0, 1])[[0, 4]], [3 * [-1 / np.sqrt(3)], [0, 0, 1]])


def test_barycentric_coordinates_return_the_foot_of_a_point():
    corners, weights = RANDOM.standard_normal((20, 3, 3)), RANDOM.dirichlet(np.ones(3), 20)
    feet = np.einsum("kc,kcd->kd", weights, corners)
    assert np.allclose(barycentric(corners, feet + area_vectors(corners)), weights, atol=1e-10)
    assert barycentric(np.zeros((1, 3, 3)), np.ones((1, 3))).tolist() == [[1, 0, 0]]


def test_connected_components_join_both_ways():
    assert connected(np.array([3, 1]), np.array([0, 4]), 5).tolist() == [0, 1, 2, 0, 1]


def test_cotangents_of_a_triangle_with_a_right_angle():
    found = cotangents(np.array([[[0.0, 0, 0], [np.sqrt(3), 0, 0], [0, 1, 0]]]))
    assert np.allclose(found, [[0.0, np.sqrt(3), 1 / np.sqrt(3)]])


def test_the_laplacian_of_a_linear_function_is_its_dirichlet_energy():
    x = np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [0.7, 0.4, 0]])
    matrix = cotangent_laplacian(x, np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]))
    u = 3 * x[:, 0] - x[:, 1]
    assert np.isclose(u @ matrix @ u, 10 * 2.0)  # |grad u|^2 times the area
    assert abs((matrix @ u)[4]) < 1e-12


def test_weights_of_the_laplacian_are_bounded():
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 0.01, 0]])
    assert np.isclose(cotangent_laplacian(flat, np.array([[0, 1, 2]]), (0.1, 2.0))[0, 1], -0.1)


@pytest.mark.parametrize("dtype", [np.int32, np.int64])
@pytest.mark.parametrize("n", [3, 50, 3_000_000])
def test_distinct_edges_are_the_distinct_rows(n, dtype):
    ends = RANDOM.integers(0, n, (300, 2)).astype(dtype)
    rows, number, count = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True)
    edges, found, times = distinct_edges(ends)
    assert edges.dtype == np.int64
    assert np.array_equal(edges, rows)
    assert np.array_equal(found, number.ravel())
    assert np.array_equal(times, count)


def test_no_pairs_have_no_edges():
    assert [each.shape for each in distinct_edges(np.zeros((0, 2), np.int64))] == [(0, 2), (0,), (0,)]
