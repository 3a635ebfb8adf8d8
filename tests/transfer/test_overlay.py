"""Closest compatible surface points against brute force, and points without one."""

import numpy as np

from clothsim.mesh.generators.table import GENERATORS
from transfer.gradients import centroids
from transfer.overlay import facing_surface
from transfer.triangle_surface import triangle_normals

BALL, TRIANGLES = GENERATORS["sphere"](radius=0.5, subdivisions=3)


def test_the_closest_point_is_taken_where_it_faces_the_same_way():
    directions = BALL[::7] / 0.5
    triangles, points = facing_surface(BALL, TRIANGLES).closest_valid(1.4 * directions, directions)
    np.testing.assert_allclose(points, BALL[::7], atol=1e-12)
    assert (np.einsum("ka,ka->k", triangle_normals(BALL, TRIANGLES)[triangles], directions) > 0).all()


def test_a_sheet_that_faces_away_is_passed_over():
    """Two sheets, 0.1 apart, of opposite winding: from near the wrong one the other is found."""
    flat, faces = GENERATORS["rectangle"](size=(1.0, 1.0), cells=(8, 8))
    positions = np.vstack([flat, flat + np.array([0, 0, 0.1])])
    both = np.vstack([faces, faces[:, ::-1] + len(flat)])
    up = triangle_normals(flat, faces)[0]
    queries = centroids(flat, faces) + np.array([0, 0, 0.09])
    triangles, points = facing_surface(positions, both).closest_valid(queries, np.tile(up, (len(queries), 1)))
    assert (triangles < len(faces)).all()
    np.testing.assert_allclose(np.linalg.norm(points - queries, axis=1), 0.09, atol=1e-12)


def test_a_point_with_no_facing_surface_near_has_none():
    flat, faces = GENERATORS["rectangle"](size=(1.0, 1.0), cells=(4, 4))
    down = -triangle_normals(flat, faces)[:1]
    triangles, _ = facing_surface(flat, faces).closest_valid(np.array([[0.1, 0.1, 0.3]]), down)
    assert triangles.tolist() == [-1]
