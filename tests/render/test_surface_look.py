"""Looks of surfaces: normals, colours, smooth surfaces, strokes."""

import numpy as np
import pytest
import trimesh
from meshes import grid
from render_scenes import NO_STRETCHES, ball, sheet

from clothsim.base.triangles import vertex_normals
from clothsim.mesh.topology import border_edges
from clothsim.render.colour_scale import stretch_scale
from clothsim.render.surface_look import (
    BODY_GREY,
    FABRICS,
    HALF_LENGTH,
    LEVELS,
    LIFT,
    MOST_TRIANGLES,
    WIDTHS,
    Surface,
    creased_normals,
    crosses,
    evenly_spaced,
    looks,
    ribbons,
    spacing_of,
    subdivided,
)

TENT = np.array([[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, -1, 0]], float)
SIDES = np.array([[0, 1, 2], [0, 3, 1]])


def folded(degrees):
    """Two triangles about the x axis, their normals `degrees` apart."""
    angle = np.radians(degrees)
    positions = TENT.copy()
    positions[3] = [0.5, -np.cos(angle), -np.sin(angle)]
    return positions


def test_normals_of_a_ball_are_radial():
    surface = ball(centre=(0, 0, 0))
    radial = surface.positions / np.linalg.norm(surface.positions, axis=1, keepdims=True)
    along = (vertex_normals(surface.positions, surface.triangles) * radial).sum(axis=1)
    used = np.linalg.norm(surface.positions[:, :2], axis=1) > 0.05  # the poles' degenerate triangles have no normal
    assert np.abs(along[used]).min() > 0.98


def test_a_sharp_crease_splits_and_a_blunt_one_does_not():
    sharp, blunt = (creased_normals(folded(d), SIDES) for d in (90, 20))
    np.testing.assert_allclose(sharp[0], np.tile([0, 0, 1.0], (3, 1)), atol=1e-12)
    np.testing.assert_allclose(sharp[1], np.tile([0, -1.0, 0], (3, 1)), atol=1e-12)
    np.testing.assert_allclose(blunt[0, 0], blunt[1, 0])
    assert blunt[0, 0] @ [0, 0, 1] > np.cos(np.radians(11))


def test_lone_vertices_and_empty_triangles_give_finite_normals():
    positions, triangles = grid(2, 2)
    positions = np.concatenate([positions, [[9.0, 9, 9]]])
    triangles = np.concatenate([triangles, [[0, 0, 1]]])
    assert np.isfinite(vertex_normals(positions, triangles)).all()
    assert np.isfinite(creased_normals(positions, triangles)).all()


def test_the_back_of_a_cloth_is_darker_and_bodies_are_grey():
    cloth, body = looks([sheet(), ball()], scale=stretch_scale([np.array([0.1])]))
    assert (cloth.back < cloth.front).all()
    assert (cloth.front[..., 0] > cloth.front[..., 2]).all()  # stretched: red
    np.testing.assert_array_equal(body.front, np.broadcast_to(BODY_GREY, body.front.shape))


def test_plain_cloths_differ_in_colour():
    first = sheet()
    second = Surface("other", first.positions, first.triangles, "cloth", NO_STRETCHES)
    colours = [look.front[0, 0] for look in looks([first, second], scale=None)]
    assert np.abs(colours[0] - colours[1]).max() > 0.1


def test_each_fabric_has_a_plain_colour_also_on_the_smooth_surface():
    positions, triangles = grid(2, 2)
    fabrics = np.arange(len(triangles)) % 2
    surface = Surface("cloth", positions, triangles, "cloth", NO_STRETCHES, fabrics=fabrics)
    fine = subdivided(surface)
    for each in (surface, fine):
        (look,) = looks([each], None)
        assert np.array_equal(look.front[:, 0], FABRICS[each.fabrics])
    areas = [
        np.linalg.norm(np.cross(*np.moveaxis(np.diff(each.positions[each.triangles], axis=1), 1, 0)), axis=1)
        for each in (surface, fine)
    ]
    for number in (0, 1):
        old, new = (area[each.fabrics == number].sum() for area, each in zip(areas, (surface, fine), strict=True))
        assert np.isclose(old, new)


NONE = np.zeros((0, 2))


def smooth_ball(role: str = "cloth", subdivisions: int = 2) -> Surface:
    made = trimesh.creation.icosphere(subdivisions=subdivisions)
    return Surface("ball", np.asarray(made.vertices), np.asarray(made.faces), role, NONE)


def test_vertices_stay_and_each_triangle_becomes_sixteen():
    before = smooth_ball()
    after = subdivided(before)
    assert np.array_equal(after.positions[: len(before.positions)], before.positions)
    assert len(after.triangles) == 4**LEVELS * len(before.triangles)
    assert len(border_edges(after.triangles)[0]) == 0


def test_a_ball_is_rounder_and_nothing_sinks_into_it():
    before, after = smooth_ball(), subdivided(smooth_ball())
    flat = np.linalg.norm(before.positions[before.triangles].mean(axis=1), axis=1).min()
    radii = np.linalg.norm(after.positions, axis=1)
    centres = np.linalg.norm(after.positions[after.triangles].mean(axis=1), axis=1)
    assert radii.min() > 1 - 0.25 * (1 - flat)
    assert radii.max() < 1 + 0.1 * (1 - flat)
    assert centres.min() > flat


def test_a_plane_stays_one_and_its_values_are_interpolated():
    x = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    after = subdivided(Surface("sheet", x, triangles, "cloth", NONE, values=x[:, 0]))
    assert np.abs(after.positions[:, 2]).max() == 0
    assert np.allclose(after.values, after.positions[:, 0])
    assert len(border_edges(after.triangles)[0]) == 4 * 2**LEVELS


def test_a_sharp_fold_is_not_rounded():
    x = np.array([[0, 0, 0], [0, 1, 0], [1, 0.5, 0.05], [1, 0.5, -0.05]])
    triangles = np.array([[0, 1, 2], [1, 0, 3]])
    after = subdivided(Surface("fold", x, triangles, "cloth", NONE))
    assert after.positions[:, 0].min() > -0.3


@pytest.mark.parametrize(("gap", "is_round"), [(2e-4, False), (0.1, True)])
def test_a_cloth_shows_through_no_other_one_that_lies_on_it(gap, is_round):
    """An arch of facets 3 cm wide, the uppermost level and below a flat sheet: rounded, it rises by a millimetre."""
    angles = 0.3 * (np.arange(8) - 3.5)
    x, triangles = grid(7, 7)
    column, row = (np.unique(np.round(x[:, k], 9), return_inverse=True)[1] for k in (0, 1))
    arch = 0.1 * np.column_stack([np.sin(angles)[column], 0.3 * row, np.cos(angles)[column] - np.cos(0.15)])
    sheet = np.column_stack([0.03 * (column - 3.5), 0.03 * row, np.full(len(x), gap)])
    below, above = (Surface(name, at, triangles, "cloth", NONE) for name, at in (("arch", arch), ("sheet", sheet)))
    assert (subdivided(below, [above]).positions[:, 2].max() > 5e-4) == is_round
    assert subdivided(below).positions[:, 2].max() > 5e-4
    assert np.ptp(subdivided(above, [below]).positions[:, 2]) == 0


LOW = 5e-4
"""Height of the level facet of a bent layer over a flat one [m]."""
BENT = [(0.075, 0.009), (0.025, LOW), (-0.025, LOW), (-0.075, 0.009)]


def swept(profile):
    """Rows of points (x, z) swept along y, as one cloth."""
    x, triangles = grid(len(profile) - 1, 3)
    column, row = (np.unique(np.round(x[:, k], 9), return_inverse=True)[1] for k in (0, 1))
    along = np.array(profile)
    return np.column_stack([along[column, 0], 0.05 * row, along[column, 1]]), triangles


@pytest.mark.parametrize("turned", [False, True])
def test_layers_of_one_cloth_that_lie_on_one_another_are_not_rounded(turned):
    """A layer bent towards a flat one below: its arcs would reach through it. turned: they face to one side, or not."""
    flat, triangles = swept([(-x, 0.0) for x, _ in BENT])
    bent, others = swept(BENT if turned else BENT[::-1])
    x, both = np.concatenate([flat, bent]), np.concatenate([triangles, others + len(flat)])
    after = subdivided(Surface("layers", x, both, "cloth", NONE)).positions
    alone = subdivided(Surface("layer", bent, others, "cloth", NONE)).positions
    assert alone[:, 2].min() < 0
    assert after[:, 2].min() == 0


def test_layers_beside_their_fold_are_not_rounded():
    """Vertices of both layers are two edges apart along the cloth, but face away from one another."""
    x, triangles = swept([(0.025, 0.0), (0.09, 0.004), *BENT[1:3]])
    after = subdivided(Surface("fold", x, triangles, "cloth", NONE)).positions
    level = np.abs(after[:, 0]) < 0.025 - 1e-9
    assert after[level, 2].min() == pytest.approx(LOW, abs=1e-12)


@pytest.mark.parametrize("surface", [smooth_ball("body"), smooth_ball(subdivisions=6)])
def test_bodies_and_fine_cloths_are_drawn_as_they_are(surface):
    after = subdivided(surface)
    assert np.array_equal(after.positions, surface.positions)
    assert len(surface.triangles) * 4 > MOST_TRIANGLES or surface.role == "body"


def test_strokes_lie_along_the_directions_and_are_as_long_as_the_stretches():
    directions = np.array([[[0.6, -0.8], [0.8, 0.6], [0.0, 0.0]]])
    strokes = crosses(np.array([[1.0, 2.0, 3.0]]), directions, np.array([[1.2, 0.7]]), 0.1)
    along = strokes[0, :, 1] - strokes[0, :, 0]
    assert along == pytest.approx(2 * HALF_LENGTH * 0.1 * np.array([[1.2], [0.7]]) * directions[0].T)
    assert strokes.mean(axis=2)[0] == pytest.approx(np.tile([1.0, 2.0, 3.0], (2, 1)))


def test_ribbons_lie_on_both_sides_of_the_cloth():
    strokes = crosses(np.zeros((1, 3)), np.eye(3)[None, :, :2], np.ones((1, 2)), 1.0)
    corners, normals = ribbons(strokes, 1.0)
    assert corners.shape == normals.shape == (8, 3, 3)
    assert corners[..., 2] == pytest.approx(LIFT * normals[..., 2])
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.linalg.norm(facing, axis=1).sum() / 2 == pytest.approx(2 * 2 * HALF_LENGTH * sum(WIDTHS))


def test_chosen_triangles_are_about_as_far_apart_as_asked():
    surface = sheet(n=60)
    centres = surface.positions[surface.triangles].mean(axis=1)
    spacing = spacing_of(surface.positions, surface.triangles)
    chosen = evenly_spaced(centres, spacing)
    assert 0.5 / spacing**2 < len(chosen) < 3 / spacing**2  # of a bent sheet of side 1
    assert (np.diff(chosen) > 0).all()


def test_crosses_are_no_closer_than_the_triangles_are_large():
    surface = sheet(n=3)
    assert spacing_of(surface.positions, surface.triangles) >= np.sqrt(0.5) / 3
    centres = surface.positions[surface.triangles].mean(axis=1)
    assert len(evenly_spaced(centres, 1e-3)) == len(surface.triangles)
