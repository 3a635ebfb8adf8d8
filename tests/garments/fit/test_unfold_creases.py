"""Folds opened by curvature flow, against the flow of spheres and cylinders."""

import numpy as np
import pytest

from clothsim.garments.fit.guaranteed_path import SMALLEST_FRACTION, TIMES, unfolding
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.mesh.generators.shapes import capsule, sphere
from transfer.signed_distance import body_surface


def test_a_sphere_stays_a_sphere_and_shrinks_at_each_implicit_step_by_its_curvature():
    radius = 0.16
    positions, triangles = sphere(radius=radius, subdivisions=4)
    expected, before = radius, 0.0
    shrunk = list(unfolding(positions, triangles))
    for time, x in zip(TIMES, shrunk, strict=False):
        expected /= 1 + 2 * (time - before) / expected**2  # the Laplacian of x on a sphere is -2 x / r^2
        before = time
        length = np.linalg.norm(x, axis=1)
        np.testing.assert_allclose(length, expected, rtol=5e-3)
    following = expected / (1 + 2 * (TIMES[len(shrunk)] - before) / expected**2)
    assert following < SMALLEST_FRACTION * radius <= expected  # what is smaller is no body any more


def test_the_middle_of_a_long_capsule_shrinks_as_a_cylinder():
    radius = 0.1
    positions, triangles = capsule(radius=radius, height=2.0, segments=48)
    x = next(unfolding(positions, triangles))
    middle = np.abs(positions[:, 2]) < 0.3
    np.testing.assert_allclose(np.linalg.norm(x[middle, :2], axis=1), radius / (1 + TIMES[0] / radius**2), rtol=5e-3)
    np.testing.assert_allclose(x[middle, 2], positions[middle, 2], atol=1e-4)


def test_folds_open_and_nothing_leaves_the_hull():
    positions, triangles = capsule(radius=0.1, height=0.6, segments=24)
    waist = 1 - 0.7 * np.exp(-((positions[:, 2] / 0.04) ** 2))
    body = body_surface(positions * np.column_stack([waist, waist, np.ones(len(waist))]), triangles)
    folded = body.positions + 0.06 * body.vertex_normals  # the two sides of the waist go through one another
    assert len(intersecting_pairs(folded, triangles)) > 0
    frames = list(unfolding(folded, triangles))
    assert len(intersecting_pairs(frames[1], triangles)) == 0
    for x in frames:
        assert (x >= folded.min(axis=0) - 1e-6).all()
        assert (x <= folded.max(axis=0) + 1e-6).all()


def test_slivers_and_isolated_vertices_do_no_harm():
    positions, triangles = sphere(radius=0.5, subdivisions=1)
    positions = np.vstack([positions, [[2.0, 0.0, 0.0]], positions[:1]])
    flat = np.array([[0, len(positions) - 1, 1]])  # no area: two of its corners are at one place
    for x in unfolding(positions, np.concatenate([triangles, flat])):
        assert np.isfinite(x).all()
    assert x[len(positions) - 2] == pytest.approx([2.0, 0.0, 0.0])
