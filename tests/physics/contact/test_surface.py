"""Contact surfaces: pairs of objects that may touch, and the areas of the pairs."""

from dataclasses import replace

import ipctk
import numpy as np
import pytest
from contacts import ball, sheet
from meshes import UNIT, cloth, random_rotation

from clothsim.base.triangles import triangle_areas
from clothsim.mesh.body import frame_motion, make_body, rigid_motion
from clothsim.mesh.generators.table import GENERATORS
from clothsim.mesh.topology import unique_edges
from clothsim.mesh.world import make_world
from clothsim.physics.contact.surface import FLAT, cloth_body_surface, cloth_surface, flat_features
from tests.known_answers.unit_meshes import irregular_grid
from tests.support.effect_builders import body_contact


def test_allowed_pairs_of_objects():
    world = make_world([sheet(0.0), sheet(1.0, "other")], [ball(), ball((5, 0, 0), "second")])
    surface = cloth_body_surface(world)
    expected = np.zeros((4, 4), bool)
    expected[:2, 2:] = expected[2:, :2] = True
    assert (surface.allowed == expected).all()
    assert not surface.is_self_contact
    is_self_contact = cloth_surface(world)
    assert is_self_contact.allowed[:2, :2].all()
    assert is_self_contact.allowed.sum() == 4
    assert is_self_contact.is_self_contact


def test_excluded_pairs_are_not_allowed():
    world = make_world([sheet(0.0), sheet(1.0, "other")], [ball()])
    excluded = np.zeros((3, 3), bool)
    excluded[0, 1] = excluded[1, 0] = excluded[0, 2] = excluded[2, 0] = True
    assert not cloth_surface(world, excluded).allowed[0, 1]
    assert cloth_surface(world, excluded).allowed[0, 0]
    surface = cloth_body_surface(world, excluded)
    assert not surface.allowed[0, 2]
    assert surface.allowed[1, 2]


def test_only_cloth_and_body_rows_collide_and_ghosts_do_not():
    world = make_world([sheet(1.0)], [ball()])
    with_ghosts = replace(world, ghosts=np.zeros((2, 3)))
    assert (cloth_body_surface(with_ghosts).rows == np.arange(world.n_vertices)).all()
    assert (cloth_surface(with_ghosts).rows == np.arange(world.n_cloth)).all()


def test_areas_against_ipctk():
    world = make_world([sheet(1.0)], [ball()])
    surface = cloth_body_surface(world)
    edges = np.concatenate([surface.first.edges, surface.second.edges])
    mesh = ipctk.CollisionMesh(*(np.asfortranarray(a) for a in (surface.rest_positions, edges, surface.triangles)))
    assert np.allclose(surface.vertex_areas, mesh.vertex_areas, rtol=1e-12)
    assert np.allclose(surface.edge_areas(edges), mesh.edge_areas, rtol=1e-12)


def test_areas_of_a_coarse_body_are_scaled_to_the_cloth():
    """Vertex areas of a large slab are scaled down to the cloth's triangles."""
    size = 100.0
    corners = size * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    world = make_world([sheet(1.0)], [make_body("slab", corners, np.array([[0, 1, 2], [0, 2, 3]]))])
    areas = cloth_body_surface(world).vertex_areas
    assert np.allclose(areas[: world.n_cloth], world.vertex_areas)
    assert areas[world.n_cloth :].max() <= 2 * world.rest_areas.mean() / 3 * 1.001
    fine = make_world([sheet(1.0)], [ball(radius=0.05)])
    areas = cloth_body_surface(fine).vertex_areas
    (body,) = fine.bodies  # finer than the cloth: as it is
    assert areas[fine.n_cloth :].sum() == pytest.approx(triangle_areas(body.positions[body.triangles]).sum(), rel=1e-12)


def test_areas_and_lengths_of_a_flat_pattern_come_from_its_material_coordinates():
    """A sheet stretched in space by sewing weighs its contacts by the pattern, not by the stretched shape."""
    flat = sheet(1.0)
    corners = flat.rest_positions[flat.triangles][:, :, :2]
    sewn = replace(flat, rest_positions=flat.rest_positions * [3.0, 1, 1], material_coordinates=corners, flat=True)
    expected, found = cloth_surface(make_world([flat])), cloth_surface(make_world([sewn]))
    edges = found.first.edges
    assert np.allclose(found.vertex_areas, expected.vertex_areas, rtol=1e-12)
    assert np.allclose(found.edge_areas(edges), expected.edge_areas(edges), rtol=1e-12)
    assert np.allclose(found.rest_lengths(edges), expected.rest_lengths(edges), rtol=1e-12)


def test_rest_length_beside_a_seam_of_two_lengths_is_their_mean():
    corners = np.array([[[0.0, 0], [1, 0], [0, 1]], [[0.0, 0], [2, 0], [0, 1]]])
    rest = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0]])
    sewn = replace(sheet(1.0), positions=rest, rest_positions=rest, triangles=np.array([[0, 1, 2], [1, 0, 3]]))
    surface = cloth_surface(make_world([replace(sewn, material_coordinates=corners, flat=True)]))
    assert surface.rest_lengths(np.array([[0, 1]])) == 1.5


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
    assert 0.3 < contact.candidates.collision_free_fraction(pairs.elements, pairs.n_points, world.start(), down) < 0.4


def test_flat_features_that_are_known_are_those_of_the_mesh():
    points, triangles = GENERATORS["slab"](size=(1.0, 1.0, 0.1))
    plain = flat_features.__wrapped__
    bent = points.copy()
    bent[0, 2] += 0.01
    for positions in (points, bent, points, bent):
        found, expected = flat_features(positions, triangles), plain(positions, triangles)
        np.testing.assert_array_equal(found.points, expected.points)
        np.testing.assert_array_equal(found.edges, expected.edges)
    assert len(flat_features(bent, triangles).edges) < len(flat_features(points, triangles).edges)
    assert flat_features(points, triangles) is flat_features(points.copy(), triangles)
