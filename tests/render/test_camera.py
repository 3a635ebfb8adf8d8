import numpy as np
import pytest
from meshes import random_rotation

from clothsim.base.errors import InputError
from clothsim.render.camera import (
    VIEWS,
    Margins,
    Viewpoint,
    extreme_points,
    frame,
    named_view,
    seen_box,
    three_quarter_view,
)

Z = np.array([0.0, 0.0, 1.0])
VIEW = np.array([0.4, -0.8, 0.45])


def cloud(seed=0, n=300):
    return np.random.default_rng(seed).uniform(-1, 1, (n, 3)) * [0.7, 0.4, 0.3]


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("aspect", [0.5, 1.0, 16 / 9])
@pytest.mark.parametrize("margins", [Margins(), Margins(left=0.05, right=0.3, bottom=0.1, top=0.2)])
def test_everything_is_inside_the_margins_and_touches_them(scale, aspect, margins):
    points = scale * (cloud() + np.array([5.0, -3.0, 2.0]))
    seen = frame(points, points, aspect=aspect, up=Z, backward=VIEW, margins=margins).project(points)
    low, high = np.array([margins.left, margins.bottom]) - 1, 1 - np.array([margins.right, margins.top])
    assert (seen >= low - 1e-9).all()
    assert (seen <= high + 1e-9).all()
    assert np.minimum((seen - low).min(axis=0), (high - seen).min(axis=0)).min() < 1e-9


def test_the_picture_does_not_depend_on_the_unit():
    points = cloud()
    seen = [
        frame(k * points, k * points, aspect=1.3, up=Z, backward=VIEW, margins=Margins()).project(k * points)
        for k in (1e-3, 1e3)
    ]
    np.testing.assert_allclose(*seen, atol=1e-9)


def test_a_small_cloth_on_a_large_body_fills_half_the_picture():
    body, cloth = 20 * cloud(1), cloud(2) + np.array([8.0, 3.0, 1.0])
    camera = frame(cloth, np.concatenate([body, cloth]), aspect=4 / 3, up=Z, backward=VIEW, margins=Margins())
    seen = camera.project(cloth)
    assert np.ptp(seen, axis=0).max() / 2 == pytest.approx(0.5, abs=1e-6)
    assert (np.abs(seen) <= 0.92 + 1e-9).all()


def test_a_cloth_that_is_large_enough_leaves_the_whole_body_in_the_picture():
    body, cloth = 1.2 * cloud(1), cloud(2)
    camera = frame(cloth, np.concatenate([body, cloth]), aspect=4 / 3, up=Z, backward=VIEW, margins=Margins())
    assert (np.abs(camera.project(body)) <= 0.92 + 1e-9).all()


@pytest.mark.parametrize("up", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1), (0.3, 0.2, 0.9)])
def test_up_is_up_and_the_camera_looks_down_a_little(up):
    vertical = np.array(up, float) / np.linalg.norm(up)
    triangles = cloud()[:30].reshape(-1, 3, 3)
    backward = three_quarter_view(triangles, vertical)
    assert np.degrees(np.arcsin(backward @ vertical)) == pytest.approx(24)
    points = triangles.reshape(-1, 3)
    camera = frame(points, points, aspect=1.0, up=vertical, backward=backward, margins=Margins())
    low, high = camera.project(np.array([points.mean(0), points.mean(0) + 0.1 * vertical]))
    assert high[1] > low[1]
    assert camera.axes[0] @ vertical == pytest.approx(0, abs=1e-12)  # the horizon is level
    np.testing.assert_allclose(camera.axes @ camera.axes.T, np.eye(3), atol=1e-12)


def test_a_sheet_on_edge_is_seen_from_another_side():
    across = np.array([np.sin(np.radians(32)), -np.cos(np.radians(32)), 0.0])
    corners = np.array([[np.zeros(3), across, Z]])  # the first choice of view would see only its edge
    backward = three_quarter_view(corners, Z)
    assert abs(np.cross(across, Z) @ backward) > 0.5


def test_looking_straight_down_works():
    camera = frame(cloud(), cloud(), aspect=1.0, up=Z, backward=Z, margins=Margins())
    assert np.isfinite(camera.axes).all()


def test_directions_and_projection_agree():
    camera = Viewpoint(np.array([1.0, 2.0, 3.0]), random_rotation(3), np.array([0.3, 0.2]))
    rays = camera.directions(6, 4)
    seen = camera.project(camera.position + 7 * rays.reshape(-1, 3)).reshape(4, 6, 2)
    np.testing.assert_allclose(seen[0, 0], [-1 + 1 / 6, 1 - 1 / 4], atol=1e-12)
    np.testing.assert_allclose(seen[3, 5], [1 - 1 / 6, -1 + 1 / 4], atol=1e-12)


def test_extreme_points_keep_the_extent():
    points = np.random.default_rng(0).standard_normal((5000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    kept = extreme_points(points)
    assert len(kept) <= 128
    assert np.ptp(kept, axis=0).min() > 1.97


def test_a_wide_ground_does_not_set_the_scale():
    cloth, ground = cloud(), 1e3 * np.array([[-1.0, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1]])
    camera = frame(cloth, cloth, aspect=1.0, up=Z, backward=VIEW, margins=Margins())
    low, high = seen_box(np.concatenate([cloth, ground]), camera)
    np.testing.assert_array_equal([low, high], [cloth.min(axis=0), cloth.max(axis=0)])
    np.testing.assert_array_equal(seen_box(ground, camera)[1], [1e3, 1e3, -1e3])


def test_nothing_to_draw_is_refused():
    with pytest.raises(InputError):
        frame(np.zeros((0, 3)), np.zeros((0, 3)), aspect=1.0, up=Z, backward=Z, margins=Margins())


@pytest.mark.parametrize(
    ("up", "front", "left"), [((0, 0, 1), (0, -1, 0), (1, 0, 0)), ((0, 1, 0), (0, 0, 1), (1, 0, 0))]
)
def test_named_views_are_those_of_a_person_who_faces_the_front(up, front, left):
    up, front, left = (np.array(each, float) for each in (up, front, left))
    seen = {name: named_view(name, 2 * up) for name in VIEWS}
    assert seen["front"] == pytest.approx(front)
    assert seen["back"] == pytest.approx(-front)
    assert seen["left"] == pytest.approx(left)
    assert seen["right"] == pytest.approx(-left)
    assert seen["top"] == pytest.approx(up)
