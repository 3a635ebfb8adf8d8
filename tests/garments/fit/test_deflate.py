"""Thinner bodies, against spheres and capsules."""

import numpy as np
import pytest

from clothsim.garments.fit.guaranteed_path import (
    LARGEST_FRACTION,
    OPENING,
    RAYS,
    deflated,
    half_thickness,
    outward_normals,
    smoothed,
)
from clothsim.mesh.generators.shapes import capsule, rectangle, sphere
from transfer.signed_distance import body_surface

BALL = body_surface(*sphere(radius=0.3, subdivisions=3))


def test_the_half_thickness_of_a_sphere_is_its_radius_seen_through_the_cone():
    # all rays but the middle one are OPENING off the diameter: their chords are 2 r cos(OPENING)
    assert RAYS > 2
    np.testing.assert_allclose(half_thickness(BALL), 0.3 * np.cos(OPENING), rtol=0.02)


def test_the_half_thickness_of_a_capsule_is_measured_across_it():
    body = body_surface(*capsule(radius=0.1, height=1.0, segments=32))
    middle = np.abs(body.positions[:, 2]) < 0.2
    half = half_thickness(body)[middle]
    # along the axis a tilted ray goes 2 r / cos, around it 2 r cos
    assert half.min() > 0.1 * np.cos(OPENING) - 0.002
    assert half.max() < 0.1 / np.cos(OPENING) + 0.002


def test_a_deflated_sphere_is_a_smaller_sphere():
    half = half_thickness(BALL)
    for depth in (0.0, 0.01, 0.1):
        radius = np.linalg.norm(deflated(BALL, depth, half, outward_normals(BALL)), axis=1)
        np.testing.assert_allclose(radius, 0.3 - depth, rtol=2e-3)


def test_no_vertex_goes_beyond_the_middle():
    half = half_thickness(BALL)
    radius = np.linalg.norm(deflated(BALL, 10.0, half, outward_normals(BALL)), axis=1)
    np.testing.assert_allclose(radius, 0.3 - LARGEST_FRACTION * half, rtol=2e-2)


def test_vertices_move_on_straight_lines():
    half = half_thickness(BALL)
    first, second = (BALL.positions - deflated(BALL, depth, half, outward_normals(BALL)) for depth in (0.01, 0.05))
    np.testing.assert_allclose(second, 5 * first, atol=1e-12)


def test_the_rim_of_an_open_body_stays():
    positions, triangles = capsule(radius=0.1, height=1.0, segments=16)
    open_body = body_surface(positions, triangles[(positions[triangles][:, :, 2] < 0.3).all(axis=1)])
    assert open_body.open_edges > 0
    half = half_thickness(open_body)
    assert np.isfinite(half).all()
    assert np.isfinite(deflated(open_body, 0.02, half, outward_normals(open_body))).all()


def test_smoothing_keeps_constants_and_evens_out_a_spike():
    _, triangles = rectangle(cells=(6, 6))
    np.testing.assert_allclose(smoothed(np.full(49, 2.5), triangles), 2.5, rtol=1e-15)
    spike = np.zeros(49)
    spike[24] = 1.0
    even = smoothed(spike, triangles)
    assert 0 < even[24] < 0.3
    assert even.min() >= 0
    assert smoothed(np.array([1.0, 1.0, 1.0, 7.0]), np.array([[0, 1, 2]]))[3] == pytest.approx(7.0)  # isolated
