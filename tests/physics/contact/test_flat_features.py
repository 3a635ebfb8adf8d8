"""Flat features of bodies: which there are, and that they push nothing and still stop a motion."""

from dataclasses import replace

import numpy as np
import pytest
from meshes import UNIT, cloth, random_rotation

from clothsim.mesh.body import frame_motion, make_body, rigid_motion
from clothsim.mesh.generators.table import GENERATORS
from clothsim.mesh.topology import unique_edges
from clothsim.mesh.world import make_world
from clothsim.physics.contact.surface import FLAT, flat_features
from tests.known_answers.unit_meshes import irregular_grid
from tests.support.effect_builders import body_contact

D_HAT = 0.05


def plane(seed=0):
    """An irregular triangulation of a square of 2 m in z = 0 (n, 3), (m, 3)."""
    rng = np.random.default_rng(seed)
    k = np.linspace(-1, 1, 9)
    points = np.array([(x, y, 0.0) for y in k for x in k])
    inside = (np.abs(points[:, :2]) < 0.99).all(axis=1)
    points[inside, :2] += rng.uniform(-0.08, 0.08, (inside.sum(), 2))
    a = np.array([9 * j + i for j in range(8) for i in range(8)])
    return points, np.concatenate([np.column_stack([a, a + 1, a + 10]), np.column_stack([a, a + 10, a + 9])])


def world_over_plane(motion=None, rotation=None):
    """A card, 2 cm over the plane, both rotated."""
    rotation = np.eye(3) if rotation is None else rotation
    points, triangles = plane()
    positions, faces = irregular_grid()
    card = 0.4 * (positions - positions.mean(axis=0)) + np.array([0, 0, 0.02])
    card = replace(cloth(0.4 * positions, faces, UNIT), positions=card @ rotation.T)
    return make_world([card], [make_body("plane", points @ rotation.T, triangles, motion)])


def test_features_of_a_plane_are_all_but_its_border():
    points, triangles = plane()
    found = flat_features(points, triangles)
    border = (np.abs(points[:, :2]) > 0.999).any(axis=1)
    assert np.array_equal(found.points, np.flatnonzero(~border))
    edges = unique_edges(triangles)
    outer = (border[edges[:, 0]] & border[edges[:, 1]]) & (
        (points[edges[:, 0], 0] == points[edges[:, 1], 0]) | (points[edges[:, 0], 1] == points[edges[:, 1], 1])
    )
    assert {tuple(edge) for edge in found.edges.tolist()} == {tuple(edge) for edge in edges[~outer].tolist()}


def test_a_fold_is_flat_up_to_the_angle():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, -1, 0]])
    triangles = np.array([[0, 1, 2], [1, 0, 3]])
    for angle, count in ((0.5 * FLAT, 1), (2 * FLAT, 0), (np.pi, 0)):
        bent = points.copy()
        bent[2] = 0.5, np.cos(angle), np.sin(angle)
        assert len(flat_features(bent, triangles).edges) == count
    assert not len(flat_features(*GENERATORS["sphere"](radius=0.3, subdivisions=2)).edges)


def test_force_on_a_card_does_not_depend_on_its_position_over_a_plane():
    """Along the normal to 1e-12 of it, and the same everywhere to 1e-12."""
    rng = np.random.default_rng(3)
    for rotation in (np.eye(3), random_rotation(5)):
        world = world_over_plane(rotation=rotation)
        contact = body_contact(world, d_hat=D_HAT, stiffness=3.0)
        n, normal, start = world.n_cloth, rotation[:, 2], world.start()
        expected, energy = contact.gradient(start)[:n] @ normal, contact.value(start)
        assert expected == pytest.approx(expected[0] / world.vertex_areas[0] * world.vertex_areas, rel=1e-11)
        for _ in range(20):
            x = start.copy()
            x[:n] += rotation @ np.append(rng.uniform(-0.5, 0.5, 2), 0.0)
            force = contact.gradient(x)[:n]
            assert force @ normal == pytest.approx(expected, rel=1e-10)
            assert np.abs(force - np.outer(force @ normal, normal)).max() <= 1e-12 * np.abs(expected).max()
            assert contact.value(x) == pytest.approx(energy, rel=1e-10)


def test_a_body_that_deforms_has_no_flat_features():
    points, _ = plane()
    bent = points + np.array([0, 0, 0.1]) * points[:, :1] ** 2
    deforming = body_contact(world_over_plane(frame_motion(np.array([points, bent]), 1.0)), d_hat=D_HAT)
    assert not len(deforming.candidates.surface.flat.edges)
    turning = body_contact(world_over_plane(rigid_motion(rotate_degrees_per_second=(0, 0, 9.0))), d_hat=D_HAT)
    assert len(turning.candidates.surface.flat.edges)


def test_flat_features_stop_a_motion():
    """Vertices of the plane meet a triangle of the card that falls past them, and edges its edges."""
    world = world_over_plane()
    contact = body_contact(world, d_hat=1e-3)
    down = np.zeros_like(world.start())
    down[: world.n_cloth, 2] = -0.05
    pairs = contact.candidates.within(world.start() + 0.39 * down, 1e-3)
    assert len(pairs) > pairs.n_points
    assert 0.3 < contact.candidates.collision_free_fraction(pairs, world.start(), down) < 0.4
