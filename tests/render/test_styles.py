"""Styles: outlines where surfaces end, weave fixed to the material, bodies seen through, ranges and sizes by hand."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFilter
from render_scenes import ball, sheet

from clothsim.base.errors import InputError
from clothsim.cli.arguments import as_limits, as_printed_size, join_vectors
from clothsim.render import movie as movie_module
from clothsim.render import picture as picture_module
from clothsim.render.camera import Viewpoint
from clothsim.render.colour_scale import Quantity
from clothsim.render.picture import centre_of, draw, picture_setup, rendered, rendered_without_legend, scale_of
from clothsim.render.ray_caster import pixel_geometry
from clothsim.render.styles import _BANDS, INK, STYLES, _shadow_texture, outlined, woven

DOWN = Viewpoint(np.array([0.0, 0.0, 10.0]), np.eye(3), np.array([0.1, 0.1]))
"""Looks down on the square of side 2 about the origin."""
WHITE = np.ones((60, 60, 3))


def flat(**changes):
    x, triangles = sheet().positions * [1.0, 1.0, 0.0], sheet().triangles
    return replace(sheet(), positions=x, triangles=triangles, **changes)


def setup(surfaces, **changes):
    keywords = {"size": (160, 120), "colour": "auto", "up": "z", "view": "auto", "title": "", "renderer": "ray"}
    return picture_setup([surfaces], **keywords | changes)


def test_geometry_is_that_of_the_surfaces():
    geometry = pixel_geometry([flat(), ball()], DOWN, (60, 60))
    assert set(np.unique(geometry.surface)) == {-1, 0}  # the ball lies below the sheet
    middle = geometry.material[30, 30]
    assert middle == pytest.approx([1 / 60, -1 / 60, 0.0], abs=1e-5)
    assert geometry.depth[30, 30] == pytest.approx(10.0, rel=1e-4)
    assert geometry.facing[30, 30] == pytest.approx(1.0, abs=1e-4)
    assert np.isinf(geometry.depth[0, 0])


def test_outlines_run_round_a_sheet_and_not_over_it():
    geometry = pixel_geometry([flat()], DOWN, (60, 60))
    ink = np.abs(outlined(WHITE, geometry, 1) - INK).max(axis=2) < 1e-9
    assert 2 * 4 * 28 <= ink.sum() <= 2 * 4 * 32  # a square of 30 pixels, two pixels wide
    assert not ink[20:40, 20:40].any()


def test_a_layer_above_another_has_an_outline_where_depth_jumps():
    upper = flat().positions * 0.5 + np.array([0.0, 0.0, 0.5])
    both = [replace(flat(), positions=np.concatenate([flat().positions, upper]),
                    triangles=np.concatenate([flat().triangles, flat().triangles + len(upper)]))]  # fmt: skip
    ink = np.abs(outlined(WHITE, pixel_geometry(both, DOWN, (60, 60)), 1) - INK).max(axis=2) < 1e-9
    assert ink[22:38, 22:38].sum() > 40


def test_a_weave_moves_with_the_material():
    grey = np.full((60, 60, 3), 0.5)
    first = woven(grey, pixel_geometry([flat(material=flat().positions)], DOWN, (60, 60)), np.array([True]), 1)
    assert first[20:40, 20:40].std() > 0.01
    assert np.array_equal(first[0, 0], grey[0, 0])
    moved = replace(DOWN, position=DOWN.position + np.array([1 / 3, 0.0, 0.0]))  # by ten pixels
    second = woven(grey, pixel_geometry([flat(material=flat().positions)], moved, (60, 60)), np.array([True]), 1)
    assert np.abs(second[20:40, 20:30] - first[20:40, 30:40]).max() < 0.03
    none = woven(grey, pixel_geometry([flat()], DOWN, (60, 60)), np.array([False]), 1)
    assert np.array_equal(none, grey)


@pytest.mark.parametrize("style", STYLES)
def test_each_style_draws_a_picture_of_its_own(style, tmp_path):
    if STYLES[style].traced:
        pytest.importorskip("mitsuba_oidn", reason="an extra: pip install 'clothsim[look]'")
    surfaces = [sheet(), ball()]
    made = rendered_without_legend(setup(surfaces, style=style), surfaces)
    usual = rendered_without_legend(setup(surfaces), surfaces)
    assert np.array_equal(made, usual) == (style == "fields")
    assert (made[0, 0] == 1.0).all() == STYLES[style].paper
    assert (setup(surfaces, style=style).scale is None) == (STYLES[style].colour == "plain")


def test_a_body_is_half_transparent_in_print():
    front = [flat(), ball(centre=(0.0, 0.0, 0.5))]
    printed = setup(front, style="print", view=(0, 0, 1), up="y", colour="plain")
    opaque = replace(printed, style=replace(printed.style, body_opacity=1.0))
    through, hidden = (rendered_without_legend(each, front)[55:65, 75:85] for each in (printed, opaque))
    assert np.ptp(hidden, axis=2).max() < 0.02  # grey
    assert np.ptp(through, axis=2).mean() > 0.05  # the blue sheet behind it


def test_a_range_by_hand_is_the_scale_s():
    cloth = [replace(sheet(), values=np.linspace(0.0, 1.0, len(sheet().positions)))]
    scale = scale_of(Quantity("stress", "N/m"), cloth, (0.0, 40.0))
    assert (scale.low, scale.high) == (0.0, 40.0)
    assert [text for _, text in scale.ticks] == ["0", "10", "20", "30", "40"]
    assert scale_of("stretch", cloth, (0.9, 1.05)).high == pytest.approx(-np.log(0.9))
    too_narrow, too_large = (5.0, 5.0 + 1e-9), (-1e308, 1e308)
    for bad in ((1.0, 1.0), (2.0, 1.0), (0.0, np.inf), (np.nan, 1.0), (1.0,), "ab", too_narrow, too_large):
        with pytest.raises(InputError, match="range of colours"):
            scale_of("stretch", cloth, bad)
    for bad in ((0.0, 1.0), (-0.5, 1.1), (1e-7, 1.0), (1.0, 1e9)):
        with pytest.raises(InputError, match="stretches"):
            scale_of("stretch", cloth, bad)
    with pytest.raises(InputError, match="plain"):  # as "fabric" is, and what has no stretches
        scale_of("plain", cloth, (0.9, 1.1))
    with pytest.raises(InputError, match="style"):
        setup(cloth, style="oil")


@pytest.mark.parametrize("limits", [(1.2, 1.4), (0.9, 1.2), (0.999, 1.001), (0.02, 3.0), (0.95, 1.05)])
def test_labels_of_a_range_of_stretches_are_on_its_bar(limits):
    scale = scale_of("stretch", [sheet()], limits)
    assert scale.high == pytest.approx(max(abs(np.log(limits))))
    assert len(scale.ticks) >= 3
    for value, label in scale.ticks:
        assert scale.low - 1e-9 <= value <= scale.high + 1e-9
        assert float(label) == pytest.approx(np.exp(value), rel=1e-5)


@pytest.mark.parametrize("name", ["x.png", "x.gif", "x.mp4"])
def test_what_cannot_be_written_is_named_before_it_is_drawn(tmp_path, name, monkeypatch):
    drawn = []
    for module in (picture_module, movie_module):
        monkeypatch.setattr(module, "rendered", lambda *_: drawn.append(1))
    (tmp_path / name).mkdir()

    def write(target):
        if name.endswith("png"):
            draw(target, [sheet()], renderer="ray")
        else:
            movie_module.movie(target, [[sheet()]], renderer="ray")

    for target in (tmp_path / name, tmp_path / "nowhere" / name):
        with pytest.raises(InputError, match=f"{name} cannot be written"):
            write(target)
    assert not drawn


def test_a_movie_that_is_stopped_leaves_the_one_before(tmp_path, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    file = tmp_path / "x.gif"
    file.write_bytes(b"before")
    monkeypatch.setattr(movie_module, "rendered", stop)
    with pytest.raises(KeyboardInterrupt):
        movie_module.movie(file, [[sheet()]], renderer="ray")
    assert file.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [file]


def test_a_camera_that_follows_sees_the_cloth_in_one_place():
    frames = [[replace(sheet(), positions=sheet().positions + np.array([0.0, 3.0 * k, 0.0])), ball()] for k in range(2)]
    keywords = {"size": (160, 120), "colour": "auto", "up": "z", "view": "auto", "title": "", "renderer": "ray"}
    following = picture_setup(frames, follow=True, **keywords)
    assert centre_of(frames[1]) - centre_of(frames[0]) == pytest.approx([0.0, 3.0, 0.0])
    first, last = (rendered(following, [frame[0]]).astype(float) for frame in frames)
    assert np.abs(first - last).mean() < 0.5
    held = picture_setup(frames, **keywords)
    first, last = (rendered(held, [frame[0]]).astype(float) for frame in frames)
    assert np.abs(first - last).mean() > 2.0


def test_a_camera_that_follows_shows_the_whole_figure_and_leaves_out_the_ground():
    """A cloth of 1 m on a body of 1.5 m that walks 3 m, over a ground of 40 m."""
    cloth, steps = sheet(), np.array([0.0, 3.0, 0.0])
    body, ground = ball(radius=0.75, centre=(0.0, 0.0, 0.0)), ball(radius=20.0, centre=(0.0, 0.0, -22.0))
    moved = [
        [replace(each, positions=each.positions + k * steps) for each in (cloth, body)] + [ground] for k in range(2)
    ]
    keywords = {"size": (120, 160), "colour": "auto", "up": "z", "view": "auto", "title": "", "renderer": "ray"}
    setup = picture_setup(moved, follow=True, **keywords)
    camera = replace(setup.camera, position=setup.camera.position + centre_of(moved[1]))
    assert np.abs(camera.project(moved[1][1].positions)).max() < 1.0
    assert np.abs(camera.project(ground.positions)).max() > 1.0


def test_sizes_of_paper_and_ranges_of_the_command_line(tmp_path):
    assert as_printed_size("85x64mm") == ((1004, 756), 300.0)
    assert as_printed_size("100x50mm@254") == ((1000, 500), 254.0)
    assert as_printed_size("640x480") == ((640, 480), 0.0)
    assert as_limits("--range", "0.9,1.1") == (0.9, 1.1)
    assert join_vectors(["--range", "-0.5,1"]) == ["--range=-0.5,1"]
    for bad in ("1", "1,2,3", "a,b", ""):
        with pytest.raises(InputError, match="--range"):
            as_limits("--range", bad)
    file = tmp_path / "small.png"
    draw(file, [sheet()], size=(100, 80), renderer="ray", dots_per_inch=300.0)
    assert Image.open(file).info["dpi"] == pytest.approx((300.0, 300.0), rel=1e-3)


def test_triangles_of_the_same_texels_leave_one_shadow():
    rng = np.random.default_rng(0)
    angle = np.linspace(0.0, 2 * np.pi, 61)
    ring = 160.0 + 40.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    drawn = np.stack([np.full((60, 2), 160.0), ring[:-1], ring[1:]], axis=1)
    heights = rng.uniform(0.0, 1.0, 60)
    turned, again = drawn[:, [1, 2, 0]], np.floor(drawn) + rng.uniform(0.01, 0.99, drawn.shape)
    light = _shadow_texture(np.concatenate([drawn, turned, again]), np.tile(heights, 3), 10.0)
    expected = np.ones(light.shape)
    for end, blur, dark in _BANDS:
        stencil = Image.new("L", light.shape, 0)
        for xy in drawn[heights < end].reshape(-1, 6).tolist():
            ImageDraw.Draw(stencil).polygon(xy, fill=255)
        expected *= 1 - dark * np.asarray(stencil.filter(ImageFilter.GaussianBlur(10.0 * blur)), float) / 255
    np.testing.assert_array_equal(light, expected)
    assert light.min() < 0.7
