import numpy as np
from meshes import grid
from render_scenes import NO_STRETCHES, ball, sheet

from clothsim.render.colour_scale import stretch_scale
from clothsim.render.surface_look import BODY_GREY, FABRICS, Surface, creased_normals, looks, smoothed, vertex_normals

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
    fine = smoothed(surface)
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
