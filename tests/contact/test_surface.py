"""Who may touch whom, and the test for intersections."""

from dataclasses import replace

import numpy as np
import pytest
from meshes import cloth, grid

from clothsim.contact.surface import cloth_body_surface
from clothsim.mesh.body import make_body
from clothsim.mesh.generate import GENERATORS
from clothsim.mesh.world import make_world


def sheet(height, name="sheet"):
    positions, triangles = grid(4, 4)
    return replace(cloth(positions, triangles, name=name), positions=positions + np.array([-0.5, -0.5, height]))


def ball(centre=(0.0, 0.0, 0.0), name="ball", radius=0.3):
    positions, triangles = GENERATORS["sphere"](radius=radius, subdivisions=1)
    return make_body(name, positions + np.array(centre), triangles)


@pytest.mark.parametrize(("height", "meets"), [(0.31, False), (0.29, True), (0.0, True), (-0.31, False)])
def test_a_sheet_and_a_ball(height, meets):
    world = make_world([sheet(height)], [ball()])
    assert cloth_body_surface(world).intersects(world.start()) is meets


def test_cloths_may_cross_each_other_and_bodies_too():
    """Cloth against cloth and body against body are other effects."""
    positions, triangles = grid(4, 4)
    upright = replace(cloth(positions, triangles, name="upright"), positions=positions[:, [0, 2, 1]] - 0.5)
    world = make_world([sheet(0.0), upright], [ball((5, 0, 0)), ball((5.1, 0, 0), "other")])
    assert not cloth_body_surface(world).intersects(world.start())


def test_every_body_counts():
    world = make_world([sheet(1.0)], [ball(), ball((0, 0, 1.0), "second")])
    assert cloth_body_surface(world).intersects(world.start())


def test_only_cloth_and_body_rows_collide_and_ghosts_do_not():
    world = make_world([sheet(1.0)], [ball()])
    with_ghosts = replace(world, ghosts=np.zeros((2, 3)))
    surface = cloth_body_surface(with_ghosts)
    assert surface.n_surface == world.n_vertices
    assert surface.n_cloth == world.n_cloth
    rows = surface.rows(with_ghosts.start())
    assert rows.shape == (world.n_vertices, 3)
    assert rows.flags.f_contiguous


def test_a_coarse_body_weighs_no_more_than_the_cloth():
    """Vertex areas of a large slab, as ipctk takes them, are brought down to the cloth's triangles."""
    size = 100.0
    corners = size * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    world = make_world([sheet(1.0)], [make_body("slab", corners, np.array([[0, 1, 2], [0, 2, 3]]))])
    mesh = cloth_body_surface(world).mesh
    areas = np.array([mesh.vertex_area(k) for k in range(world.n_vertices)])
    assert np.allclose(areas[: world.n_cloth], world.vertex_areas)
    assert areas[world.n_cloth :].max() <= 2 * world.rest_areas.mean() / 3 * 1.001
    fine = make_world([sheet(1.0)], [ball(radius=0.05)])
    areas = np.array([cloth_body_surface(fine).mesh.vertex_area(k) for k in range(fine.n_vertices)])
    assert areas[fine.n_cloth :].sum() == pytest.approx(4 * np.pi * 0.05**2, rel=0.15)
