"""Contact surfaces: pairs of objects that may touch, and the areas of the pairs."""

from dataclasses import replace

import ipctk
import numpy as np
import pytest
from contacts import ball, sheet

from clothsim.mesh.body import make_body
from clothsim.mesh.world import make_world
from clothsim.physics.contact.surface import cloth_body_surface, cloth_surface


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
    assert areas[fine.n_cloth :].sum() == pytest.approx(4 * np.pi * 0.05**2, rel=0.15)


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
