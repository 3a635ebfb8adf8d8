import sys
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from render_scenes import NO_STRETCHES, ball, sheet

from clothsim.base.errors import InputError, MissingPackageError
from clothsim.render import ray_caster
from clothsim.render.camera import Viewpoint
from clothsim.render.colour_scale import stretch_colours, stretch_scale
from clothsim.render.display import why_not_vtk
from clothsim.render.picture import draw, picture_setup
from clothsim.render.styles import backdrop
from clothsim.render.surface_look import Surface, looks

SIZE = (200, 150)
STRETCH = stretch_scale([np.array([-0.1, 0.1])])
DOWN = Viewpoint(np.array([0.0, 0.0, 10.0]), np.eye(3), np.array([0.1, 0.1]))
"""Looks down on the square of side 2 about the origin."""


@pytest.fixture(params=["ray", "vtk"])
def renderer(request):
    if request.param == "vtk" and why_not_vtk():
        pytest.skip(why_not_vtk())
    return request.param


def render(renderer, surfaces, camera, size, scale=STRETCH):
    if renderer == "vtk":
        from clothsim.render import vtk_scene

        return vtk_scene.render(looks(surfaces, scale), camera, size, np.array([0.0, 0, 1]))
    return ray_caster.render(looks(surfaces, scale), camera, size, np.array([0.0, 0, 1]))


def aim(surfaces, **changed):
    keywords = {"size": SIZE, "colour": "stretch", "up": "z", "view": "auto", "title": "", "renderer": "ray"} | changed
    return picture_setup([surfaces], **keywords)


def test_a_picture_has_its_size_and_shows_the_cloth(tmp_path, renderer):
    note = draw(tmp_path / "picture.png", [sheet(), ball()], size=SIZE, renderer=renderer, title="a sheet")
    pixels = np.asarray(Image.open(tmp_path / "picture.png").convert("RGB")).astype(float)
    assert pixels.shape == (150, 200, 3)
    assert pixels.std() > 10
    red = pixels[:, :150, 0] - pixels[:, :150, 2] > 20  # stretched by 5 % everywhere; left of the scalar bar
    assert 0.1 < red.mean() < 0.8
    assert note
    assert "\n" not in note


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_the_whole_scene_is_inside_with_free_margins(renderer, size):
    surfaces = [sheet(size=size)]
    covered = render(renderer, surfaces, aim(surfaces).camera, SIZE)[:, :, 3]
    assert max(covered[:5].max(), covered[-5:].max(), covered[:, :7].max()) == 0
    assert covered[:, -50:].max() == 0  # the scalar bar
    assert 0.1 < covered.mean() < 0.7


def test_coverage_is_the_projected_area(renderer):
    flat = replace(sheet(n=3), positions=sheet(n=3).positions * [1, 1, 0])
    covered = render(renderer, [flat], DOWN, (120, 120))[:, :, 3]
    assert covered.mean() == pytest.approx(0.25, abs=0.005)  # a square of side 1 of 2
    assert covered[60, 60] == 1


def test_both_renderers_see_the_same():
    if why_not_vtk():
        pytest.skip(why_not_vtk())
    surfaces = [sheet(), ball()]
    one, other = (render(name, surfaces, aim(surfaces).camera, SIZE) for name in ("ray", "vtk"))
    assert np.abs(one[..., 3] - other[..., 3]).mean() < 0.004
    assert np.abs(one[..., :3] - other[..., :3]).mean() < 0.06


def test_each_side_shows_its_own_shade(renderer):
    flat = replace(sheet(n=3), positions=sheet(n=3).positions * [1, 1, 0])
    turned = replace(flat, triangles=flat.triangles[:, ::-1].copy())
    front, back = (render(renderer, [surface], DOWN, (60, 60))[30, 30, :3] for surface in (flat, turned))
    assert (back < 0.95 * front).all()


def test_stretched_is_red_and_compressed_is_blue(renderer):
    flat = replace(sheet(n=3), positions=sheet(n=3).positions * [1, 1, 0])
    squeezed = replace(flat, principal_stretches=1 / flat.principal_stretches[:, ::-1])
    red, blue = (render(renderer, [surface], DOWN, (60, 60))[30, 30, :3] for surface in (flat, squeezed))
    assert red[0] > red[2] + 0.1
    assert blue[2] > blue[0] + 0.1


def test_a_ground_that_reaches_behind_the_camera_is_drawn(renderer):
    corners = 50 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) - [0, 0, 0.6]
    ground = Surface("ground", corners, np.array([[0, 1, 2], [0, 2, 3]]), "body", NO_STRETCHES)
    surfaces = [sheet(), ground]
    camera = aim(surfaces, view=(0.0, -1.0, 0.3)).camera
    seen = render(renderer, surfaces, camera, SIZE)
    assert camera.position[1] > -50  # the ground reaches behind the camera
    assert seen[-1, :, 3].min() == 1
    grey = seen[-5:, :, :3]
    assert np.ptp(grey, axis=2).max() < 0.1
    assert grey.mean() > 0.3


def test_a_cloth_shades_what_is_below_it():
    flat = replace(sheet(n=3), positions=sheet(n=3).positions * [1, 1, 0])
    roof = replace(flat, name="roof", positions=flat.positions * 0.5 + [-0.1, 0.0, 0.15])
    alone, under = (render("ray", surfaces, DOWN, (120, 120)) for surfaces in ([flat], [flat, roof]))
    shaded = (alone[..., :3] - under[..., :3]).max(axis=2)
    beside = np.s_[62:70, 71:76]  # right of the roof, where the key light from the left cannot come
    assert shaded[beside].mean() > 0.1


def test_the_floor_below_is_shaded_and_the_sky_is_not():
    surfaces = [sheet()]
    setup = aim(surfaces)
    triangles = np.concatenate([each.corners for each in looks(surfaces, STRETCH)])
    with_floor = backdrop(triangles, setup.camera, SIZE, setup.up)
    from_below = backdrop(triangles, aim(surfaces, view=(0.3, 0.8, -0.4)).camera, SIZE, setup.up)
    assert (from_below - with_floor).max() > 0.1
    np.testing.assert_array_equal(with_floor[0], from_below[0])


def test_plain_pictures_have_no_scalar_bar(tmp_path):
    for colour in ("plain", "stretch"):
        draw(tmp_path / f"{colour}.png", [sheet()], size=SIZE, colour=colour, renderer="ray")
    pictures = [np.asarray(Image.open(tmp_path / f"{c}.png")).astype(int) for c in ("plain", "stretch")]
    darkest_blue = 255 * stretch_colours(np.array([-1.0]), 1.0)[0]
    found = [(np.abs(picture - darkest_blue).max(axis=2) < 8).any() for picture in pictures]
    assert found == [False, True]


def test_a_missing_ray_caster_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex.rtcore_scene", None)
    with pytest.raises(MissingPackageError, match="embreex"):
        draw(tmp_path / "picture.png", [sheet()], size=SIZE, renderer="ray")


def test_an_unknown_stretch_is_drawn_plain():
    assert aim([replace(sheet(), principal_stretches=NO_STRETCHES), ball()]).scale is None


@pytest.mark.parametrize(
    ("changes", "keywords", "message"),
    [
        ({"role": "ghost"}, {}, "role"),
        ({"triangles": np.array([[0, 1, 999]])}, {}, "999"),
        ({"triangles": np.zeros((0, 3), int)}, {}, "no triangles"),
        ({"principal_stretches": np.ones((2, 2))}, {}, "2 principal_stretches"),
        ({"positions": np.full((169, 3), np.nan)}, {}, "finite"),
        ({}, {"colour": "rainbow"}, "rainbow"),
        ({}, {"size": (40, 40)}, "too small"),
        ({}, {"size": (99_999, 70)}, "too large"),
        ({}, {"size": (8_000, 8_000)}, "too large"),
        ({}, {"up": (0, 0, 0)}, "up"),
        ({}, {"up": "w"}, "up"),
        ({}, {"view": "sideways"}, "sideways"),
        ({}, {"renderer": "crayon"}, "crayon"),
    ],
)
def test_bad_arguments_are_named(tmp_path, changes, keywords, message):
    with pytest.raises(InputError, match=message):
        draw(tmp_path / "picture.png", [replace(sheet(), **changes)], **keywords)
    assert not (tmp_path / "picture.png").exists()


@pytest.mark.parametrize(("stretched", "whole"), [([0.6, 0.3, 4.0], True), ([4.0, 4.0, 0.3], False)])
def test_a_figure_that_wears_the_cloth_is_whole_and_a_table_is_not(stretched, whole):
    figure = replace(ball(), positions=ball().positions * stretched)
    worn = replace(ball(), name="worn", role="cloth", positions=ball().positions * [0.7, 0.4, 1.0])
    camera = aim([worn, figure]).camera
    assert (np.abs(camera.project(figure.positions)).max() <= 1) == whole
    assert np.abs(camera.project(worn.positions)).max() <= 1
