"""Refinement of meshes: its smooth surface against a sphere, a plane and a curved border."""

import numpy as np

from clothsim.mesh.generators.shapes import disk, rectangle, sphere
from clothsim.mesh.refinement import refined
from clothsim.mesh.topology import border_vertices, unique_edges


def test_new_vertices_of_a_sphere_lie_on_it():
    ball, triangles = sphere(1.0, 2)
    edges = unique_edges(triangles)
    middles = np.linalg.norm(ball[edges].mean(axis=1), axis=1)
    weights, finer = refined(triangles, len(ball), 2)
    radii = np.linalg.norm(weights @ ball, axis=1)
    assert len(finer) == 16 * len(triangles)
    assert np.abs(radii - 1.0).max() < 0.3 * (1.0 - middles).max()
    assert abs(radii.mean() - 1.0) < 0.03 * (1.0 - middles.mean())
    np.testing.assert_allclose((weights @ ball)[: len(ball)], ball, atol=1e-15)


def test_a_plane_and_its_corners_stay():
    flat, triangles = rectangle((1.0, 0.6), (5, 4))
    weights, finer = refined(triangles, len(flat), 2)
    points = weights @ flat
    np.testing.assert_allclose(points @ [0.0, 0.0, 1.0], 0.0, atol=1e-15)
    low, high = points.min(axis=0), points.max(axis=0)
    np.testing.assert_allclose([low, high], [flat.min(axis=0), flat.max(axis=0)], atol=1e-12)
    a, b, c = (points[finer[:, k]] for k in range(3))
    areas = np.cross(b - a, c - a)[:, 2] / 2
    assert areas.min() * areas[0] > 0
    np.testing.assert_allclose(abs(areas.sum()), 0.6, rtol=1e-12)


def test_a_border_is_the_curve_through_its_vertices():
    flat, triangles = disk(1.0, 6)
    weights, finer = refined(triangles, len(flat))
    radii = np.linalg.norm((weights @ flat)[border_vertices(finer)], axis=1)
    polygon = 1.0 - np.cos(np.pi / len(border_vertices(triangles)))
    away = np.abs(radii - 1.0)
    assert np.quantile(away, 0.8) < 0.01 * polygon
    assert away.max() < 0.51 * polygon  # beside vertices of two triangles, which are taken for corners
