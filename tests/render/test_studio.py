"""Pictures with traced light: cloth with a thickness, and what is lit by what."""

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from render_scenes import ball, sheet

from clothsim.base.errors import InputError
from clothsim.base.srgb import linear_rgb
from clothsim.render import studio, surface_look
from clothsim.render import surface_look as shells
from clothsim.render.camera import Viewpoint
from clothsim.render.cloth_kinds import KINDS
from clothsim.render.picture import draw, picture_setup, rendered_without_legend
from clothsim.render.styles import dyes_of
from clothsim.render.surface_look import Surface


def square(side=0.4, cells=40):
    """A flat cloth of `side` metres in z = 0."""
    x, y = np.meshgrid(np.linspace(0, side, cells + 1), np.linspace(0, side, cells + 1))
    number = np.arange((cells + 1) ** 2).reshape(cells + 1, -1)
    a, b, c, d = (number[i : i + cells, j : j + cells].ravel() for i, j in ((0, 0), (0, 1), (1, 1), (1, 0)))
    positions = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    return Surface(
        "square", positions, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]), "cloth", np.zeros((0, 2))
    )


def area_of(corners):
    return 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()


def test_a_shell_is_closed_and_as_thick_as_its_hem():
    shell, _ = shells.cloth_shell(square())
    assert np.ptp(shell.corners[..., 2]) == pytest.approx(shells.THICKNESS * shells.HEM_LAYERS)
    # closed: by the divergence theorem the area vectors sum to nothing, and their moments to three times the volume
    vectors = 0.5 * np.cross(shell.corners[:, 1] - shell.corners[:, 0], shell.corners[:, 2] - shell.corners[:, 0])
    assert np.abs(vectors.sum(axis=0)).max() < 1e-12
    volume = np.einsum("ij,ij->", shell.corners.mean(axis=1), vectors) / 3
    hem = 0.4**2 - (0.4 - 2 * shells.HEM_WIDTH) ** 2
    wanted = shells.THICKNESS * (0.4**2 + (shells.HEM_LAYERS - 1) * hem)
    assert volume == pytest.approx(wanted, rel=0.05)  # the step of a hem is as wide as a cell
    assert np.einsum("ij,ij->i", vectors, shell.normals.mean(axis=1)).min() > 0


def test_a_tiny_cloth_is_thin():
    shell, _ = shells.cloth_shell(square(side=1e-3))
    assert np.ptp(shell.corners[..., 2]) == pytest.approx(1e-3 * shells.THICKEST)


def test_stitches_run_along_the_hem_in_the_share_of_their_length():
    _, stitches = shells.cloth_shell(square())
    points = stitches.reshape(-1, 3)
    inset = np.minimum(points[:, :2], 0.4 - points[:, :2]).min(axis=1)
    assert inset == pytest.approx(0.9 * shells.HEM_WIDTH, abs=2 * shells.THREAD + 1e-3)
    # four sides of a square prism about each thread, on two faces of the cloth
    length = area_of(stitches) / (2 * 4 * np.sqrt(2) * shells.THREAD)
    around = 4 * (0.4 - 2 * 0.9 * shells.HEM_WIDTH)
    assert length / around == pytest.approx(shells.STITCH / (shells.STITCH + shells.GAP), abs=0.06)


def test_a_closed_cloth_and_a_small_one_have_no_hem():
    globe = trimesh.creation.icosphere(2, 0.3)
    closed = Surface("globe", np.array(globe.vertices), np.array(globe.faces), "cloth", np.zeros((0, 2)))
    for surface in (closed, square(side=0.1)):
        shell, stitches = shells.cloth_shell(surface)
        assert len(stitches) == 0
        rims = 2 * 4 * 40 if surface.name == "square" else 0
        assert len(shell.corners) == 2 * len(surface.triangles) + rims


def test_a_cloth_that_is_cut_has_no_hem():
    shell, stitches = shells.cloth_shell(square(), hem=False)
    assert len(stitches) == 0
    assert np.ptp(shell.corners[..., 2]) == pytest.approx(shells.THICKNESS)


def test_without_mitsuba_the_remedy_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "mitsuba", None)
    with pytest.raises(InputError, match=r"clothsim\[look\]"):
        draw(tmp_path / "a.png", [sheet()], style="studio")
    assert not (tmp_path / "a.png").exists()


def test_whole_figures_are_in_the_picture_and_ground_is_not():
    cloth = square()
    figure = Surface("figure", ball().positions * 0.5, ball().triangles, "body", np.zeros((0, 2)))
    ground = Surface("ground", square().positions * 100, square().triangles, "body", np.zeros((0, 2)))
    settings = {"size": (80, 80), "colour": "plain", "up": "z", "view": "auto", "title": "1 s", "renderer": "auto"}
    setup = picture_setup([[cloth, figure, ground]], style="studio", **settings)
    assert np.abs(setup.camera.project(figure.positions)).max() <= 1
    assert np.abs(setup.camera.project(ground.positions)).max() > 1
    assert setup.title == ""
    assert setup.renderer == "mitsuba"


def test_bodies_alone_are_in_the_picture():
    settings = {"size": (80, 80), "colour": "plain", "up": "z", "view": "auto", "title": "", "renderer": "auto"}
    setup = picture_setup([[ball()]], style="studio", **settings)
    assert np.abs(setup.camera.project(ball().positions)).max() <= 1


def test_a_cloth_of_kilometres_costs_no_more_points_of_its_border(monkeypatch):
    counted = []
    tree = surface_look.cKDTree
    monkeypatch.setattr(surface_look, "cKDTree", lambda points: counted.append(len(points)) or tree(points))
    monkeypatch.setattr(surface_look, "_MOST_STEPS", 1000)
    shells.cloth_shell(square(side=1e4))
    assert 1000 <= counted[0] <= 1000 + 4 * 40


def test_traced_cloth_has_its_colour_and_a_shadow():
    pytest.importorskip("mitsuba_oidn", reason="an extra: pip install 'clothsim[look]'")
    above = square()
    settings = {
        "size": (96, 72),
        "colour": "plain",
        "up": "z",
        "view": (0.0, -1.0, 0.8),
        "title": "",
        "renderer": "auto",
    }
    setup = picture_setup([[above]], style="studio", samples=1, **settings)
    image = rendered_without_legend(setup, [above])
    assert image.shape == (72, 96, 3)
    assert np.isfinite(image).all() and image.min() >= 0 and image.max() <= 1  # noqa: PT018
    middle, corner = image[36, 48], image[4, 4]
    assert middle[2] > 1.3 * middle[0]  # indigo
    assert corner.min() > middle.max()
    assert np.ptp(corner) < 0.08  # the backdrop is grey


def seen_from(camera, facing, kind="plain"):
    """A cloth of half a metre whose normal is `facing`, as a camera in the direction `camera` sees it, sRGB (3,)."""
    flat = square()
    across = np.cross(facing, [0.0, 1.0, 0.0] if abs(facing[2]) > 0.9 else [0.0, 0.0, 1.0])
    axes = np.stack([across, np.cross(facing, across), facing]) / np.linalg.norm(across)
    card = replace(flat, positions=flat.positions @ axes, material=flat.positions, kind=kind)
    settings = {"size": (64, 64), "up": "z", "view": camera, "title": "", "renderer": "auto"}
    setup = picture_setup([[card]], colour=DYE, style="studio", samples=1, **settings)
    return rendered_without_legend(setup, [card])[24:40, 24:40].mean(axis=(0, 1))


DYE = "#8f2a24"


@pytest.mark.parametrize(
    ("camera", "facing"),
    [((0.0, -1.0, 0.1), (0, -1, 0)), ((1.0, 0.0, 0.1), (1, 0, 0)), ((0.0, -1.0, 0.8), (0, 0, 1)), ("top", (0, 0, 1))],
)
def test_cloth_before_the_camera_has_the_colour_of_its_dye(camera, facing):
    pytest.importorskip("mitsuba_oidn", reason="an extra: pip install 'clothsim[look]'")
    assert 255 * seen_from(camera, facing) == pytest.approx(np.array([0x8F, 0x2A, 0x24]), abs=14)


@pytest.mark.parametrize("kind", [each for each in KINDS if each not in ("plain", "foil")])
def test_each_kind_of_cloth_has_the_colour_of_its_dye(kind):
    pytest.importorskip("mitsuba_oidn", reason="an extra: pip install 'clothsim[look]'")
    assert 255 * seen_from((0.0, -1.0, 0.1), (0, -1, 0), kind) == pytest.approx(np.array([0x8F, 0x2A, 0x24]), abs=14)


def test_a_foil_has_the_hue_of_its_dye_and_highlights():
    pytest.importorskip("mitsuba_oidn", reason="an extra: pip install 'clothsim[look]'")
    red, green, blue = seen_from((0.0, -1.0, 0.1), (0, -1, 0), "foil")
    assert red > 2 * max(green, blue)


def test_bright_light_is_compressed_without_a_change_of_hue():
    light = np.array([[0.3, 0.2, 0.1], [3.0, 0.3, 0.03], [0.9, 0.9, 0.9], [1.8, 1.8, 1.8]])
    shown = linear_rgb(studio._developed(light))
    assert shown[0] == pytest.approx(light[0])
    assert shown[1] / shown[1, 0] == pytest.approx([1.0, 0.1, 0.01])
    assert studio.SHOULDER < shown[2, 0] < shown[3, 0] < 1.0


def test_the_faster_variant_is_taken_where_its_library_is_named(monkeypatch):
    taken = []
    for name in ("mitsuba", "mitsuba_oidn"):
        monkeypatch.setitem(sys.modules, name, SimpleNamespace(set_variant=taken.append))
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    studio._mitsuba()
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "libLLVM.so")
    studio._mitsuba()
    assert taken == ["scalar_rgb", "llvm_ad_rgb"]

    def unusable(variant):
        raise ImportError(variant)

    monkeypatch.setitem(sys.modules, "mitsuba", SimpleNamespace(set_variant=unusable))
    with pytest.raises(InputError, match=r"libLLVM\.so"):
        studio._mitsuba()


def test_traced_light_has_no_noise():
    pytest.importorskip("mitsuba_oidn", reason="an extra: pip install 'clothsim[look]'")
    settings = {"size": (96, 96), "up": "z", "view": (0.0, -1.0, 0.4), "title": "", "renderer": "auto"}
    setup = picture_setup([[square()]], colour="red", style="studio", samples=1, **settings)
    wall = rendered_without_legend(setup, [square()])[:16].mean(axis=2)
    assert np.abs(np.diff(wall, axis=1)).mean() < 0.004  # four paths of a pixel differ by ten times as much


def test_the_plane_of_a_weave_does_not_change_from_fold_to_fold():
    flat = square()
    x = flat.positions.copy()
    x[:, 2] = 0.012 * np.sin(150 * x[:, 0])  # slopes up to 60 degrees
    folded = replace(flat, material=x)
    assert np.array_equal(shells.material_coordinates(folded), x[flat.triangles][..., :2])
    globe = trimesh.creation.icosphere(4, 0.3)
    closed = Surface("globe", np.array(globe.vertices), np.array(globe.faces), "cloth", np.zeros((0, 2)))
    corners = closed.positions[closed.triangles]
    seen = shells.material_coordinates(closed)
    for axis, others in ((0, [1, 2]), (1, [0, 2]), (2, [0, 1])):
        end = corners.mean(axis=1)[:, axis].argmax()
        assert np.array_equal(seen[end], corners[end][:, others])


def test_fairing_rounds_folds_and_stays_near():
    flat = square()
    x = flat.positions.copy()
    x[:, 2] = 0.02 * np.abs(x[:, 0] - 0.2)  # a fold along a row of vertices
    smooth = surface_look.faired(x, flat.triangles)
    moved = np.linalg.norm(smooth - x, axis=1).max()
    assert 0.1 * surface_look.FARTHEST < moved <= surface_look.FARTHEST * (1 + 1e-9)
    kinks = [np.abs(np.diff(each[:, 2].reshape(41, 41)[20], n=2)).max() for each in (x, smooth)]
    assert kinks[1] < 0.7 * kinks[0]
    assert np.allclose(surface_look.faired(flat.positions, flat.triangles)[:, 2], 0.0)


def test_no_normal_of_a_triangle_that_is_seen_is_turned_away():
    camera = Viewpoint(np.array([0.0, 0.0, 50.0]), np.eye(3), np.ones(2))
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 1, 0], [1, 0, 0]]], float)
    away = np.broadcast_to([np.sqrt(0.99), 0.0, -0.1], (2, 3, 3))
    turned = studio._facing(corners, away, camera)
    assert (turned[0] @ [0, 0, 1]).min() > 0.5 * studio.GRAZING
    assert np.array_equal(turned[1], away[1])  # the camera sees its back
    upright = np.broadcast_to([0.0, 0.0, 1.0], (2, 3, 3))
    assert np.allclose(studio._facing(corners, upright, camera), upright)


def test_a_body_is_round_without_creases_and_away_from_the_cloth():
    globe, box = trimesh.creation.icosphere(2, 0.3), trimesh.creation.box((0.4, 0.4, 0.4)).subdivide()
    bodies = [
        Surface(name, np.array(each.vertices), np.array(each.faces), "body", np.zeros((0, 2)))
        for name, each in (("globe", globe), ("box", box))
    ]
    off = []
    for cloths in ([], [bodies[0]]):  # a cloth that lies on the globe
        x = surface_look.rounded(bodies[0], cloths).positions
        assert len(x) == 10 * 16**2 + 2
        off.append(0.3 - np.linalg.norm(x, axis=1).min())
    assert off[0] < 0.2 * off[1]
    x = surface_look.rounded(bodies[1], []).positions
    assert np.abs(x).max() == pytest.approx(0.2)
    assert np.allclose(np.abs(x).max(axis=1), 0.2)


def test_stitches_that_are_narrower_than_a_pixel_are_a_line_as_wide_as_it():
    _, line = shells.cloth_shell(square(), 2e-3)
    around = 4 * (0.4 - 2 * 0.9 * shells.HEM_WIDTH)
    edges = 2 * 4 * np.hypot(1e-3, shells.THREAD)  # both faces, four sides of a prism
    assert area_of(line) / edges == pytest.approx(around, rel=0.03)


def test_a_cloth_has_the_colours_that_are_given():
    assert dyes_of("red, #0000ff/white").shape == (2, 2, 3)
    for wrong in ("reed", "red/white/blue", ""):
        with pytest.raises(InputError, match="colour"):
            dyes_of(wrong)
    settings = {"size": (80, 80), "up": "z", "view": "auto", "title": "", "renderer": "ray"}
    setup = picture_setup([[square()]], colour="red", samples=1, **settings)
    image = rendered_without_legend(setup, [square()])
    assert image[40, 40, 0] > 2 * image[40, 40, 2]


def test_a_traced_check_has_both_dyes():
    pytest.importorskip("mitsuba_oidn", reason="an extra: pip install 'clothsim[look]'")
    settings = {"size": (96, 72), "up": "z", "view": (0.0, -1.0, 0.8), "title": "", "renderer": "auto"}
    setup = picture_setup([[square()]], colour="red/white", style="studio", samples=1, **settings)
    image = rendered_without_legend(setup, [square()])[28:44, 36:60]
    assert np.ptp(image[..., 1]) > 0.3
    assert (image[..., 0] > 1.1 * image[..., 1]).mean() > 0.5
