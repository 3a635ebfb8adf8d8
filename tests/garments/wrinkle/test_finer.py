"""Subdivision: areas, shared edges, the order of vertices, planes and curved surfaces."""

import numpy as np
import pytest

from clothsim.garments.wrinkle.finer import normals_or_zero, subdivision
from clothsim.mesh.generators.shapes import sphere
from clothsim.mesh.topology import unique_edges

SQUARE = np.array([[0, 1, 2], [0, 2, 3]])
CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


@pytest.mark.parametrize("parts", [1, 2, 3, 4, 5])
def test_a_square_keeps_its_corners_area_and_edges(parts):
    finer = subdivision(SQUARE, 4, parts)
    points = finer.linear(CORNERS)
    assert len(points) == (parts + 1) ** 2
    np.testing.assert_array_equal(points[:4], CORNERS)
    a, b, c = points[finer.triangles].transpose(1, 0, 2)
    np.testing.assert_allclose(np.cross(b - a, c - a)[:, 2], 1 / parts**2, atol=1e-14)
    assert len(unique_edges(finer.triangles)) == 3 * parts**2 + 2 * parts
    np.testing.assert_allclose(finer.of_triangles(CORNERS[SQUARE]), points[finer.triangles], atol=1e-15)
    np.testing.assert_allclose(finer.curved(CORNERS), points, atol=1e-15)


def test_a_curved_sphere_is_rounder_than_a_flat_one():
    points, triangles = sphere(radius=1.0, subdivisions=1)
    finer = subdivision(triangles, len(points), 3)
    curved, flat = (np.linalg.norm(each, axis=1) for each in (finer.curved(points), finer.linear(points)))
    assert abs(curved - 1).max() < 0.1 * abs(flat - 1).max()
    np.testing.assert_allclose(curved[: len(points)], 1, atol=1e-14)
    normals = normals_or_zero(finer.curved(points), finer.triangles)
    assert (normals * finer.curved(points)).sum(axis=1).min() > 0.99


def test_a_vertex_of_no_triangle_is_named():
    with pytest.raises(ValueError, match="vertex 4"):
        subdivision(SQUARE, 5, 2)
