"""Bodies and garments read from files."""

import re

import numpy as np
import pytest
from fitting_cases import capsule_figure, in_file, moebius_strip, tube_garment
from tangles import joined

from clothsim import Body
from clothsim.base.errors import InputError
from clothsim.garments import inputs
from clothsim.garments.inputs import as_body_mesh, is_closed, known_surface, read_body_mesh, read_garment, worn_in_scene
from clothsim.mesh.generators.shapes import capsule, rectangle, slab, sphere, tube
from transfer.triangle_surface import triangle_normals

CAPSULE = capsule(radius=0.2, height=1.7, segments=12)
SCENE = """
[cloth]
name = "sheet"
mesh = "rectangle"
size = [0.6, 0.6]
cells = [2, 2]
position = [0.0, 0.0, 0.9]
[body]
name = "post"
mesh = "capsule"
radius = 0.2
height = 1.7
segments = 12
[effects.inertia]
[effects.body_contact]
"""


@pytest.fixture(autouse=True)
def _coarse_wrap(monkeypatch):
    """Bodies in several pieces are wrapped on a lattice three times as coarse: which piece is read is what counts."""
    monkeypatch.setattr(inputs, "CELL", 3 * inputs.CELL)


@pytest.mark.parametrize(("unit", "metres"), [("m", 1.0), ("dm", 0.1), ("cm", 0.01), ("mm", 0.001)])
def test_the_unit_is_guessed_from_the_height(tmp_path, unit, metres):
    file = in_file(tmp_path, "body.obj", CAPSULE[0] / metres, CAPSULE[1])
    figure = read_body_mesh(file)
    assert figure.scale == metres
    np.testing.assert_allclose(figure.positions, CAPSULE[0], atol=1e-6)
    guesses = [note for note in figure.notes if "read as" in note]
    assert guesses == ([] if unit == "m" else [f"body.obj: {1.7 / metres:.3g} units tall: read as {unit} (1.7 m)"])


@pytest.mark.parametrize(("extent", "metres"), [(0.501, 1.0), (2.99, 1.0), (5.01, 0.1), (29.9, 0.1), (50.1, 0.01)])
def test_the_bounds_of_the_guess(tmp_path, extent, metres):
    assert read_body_mesh(in_file(tmp_path, "body.obj", CAPSULE[0] * extent / 1.7, CAPSULE[1])).scale == metres


@pytest.mark.parametrize("extent", [0.4, 3.01, 30.5, 4000.0, 1e-9])
def test_what_is_a_person_in_no_unit_is_refused(tmp_path, extent):
    file = in_file(tmp_path, "body.obj", CAPSULE[0] * extent / 1.7, CAPSULE[1])
    with pytest.raises(InputError, match="scale="):
        read_body_mesh(file)
    assert np.ptp(read_body_mesh(file, scale=1.7 / extent).positions[:, 2]) == pytest.approx(1.7, rel=1e-5)


def test_the_largest_closed_long_piece_is_the_body(tmp_path):
    eye = sphere(radius=0.02, subdivisions=3)  # closed, more vertices, but short
    cloak = tube(radius=0.4, height=1.6, cells=(30, 20))  # long and larger, but open
    x, triangles = joined(eye, CAPSULE, cloak)
    figure = read_body_mesh(in_file(tmp_path, "all.obj", x, triangles))
    assert len(figure.positions) == len(CAPSULE[0])
    np.testing.assert_allclose(figure.positions, CAPSULE[0], atol=1e-6)
    assert any(re.search(r"\b3\b", note) for note in figure.notes)


def test_where_no_piece_is_closed_the_largest_is_the_body_and_reported(tmp_path):
    open_capsule = CAPSULE[0], CAPSULE[1][:-1]
    x, triangles = joined(tube(radius=0.1, height=1.5, cells=(8, 4)), open_capsule)
    figure = read_body_mesh(in_file(tmp_path, "open.obj", x, triangles))
    assert len(figure.positions) == len(CAPSULE[0])
    assert any("not closed" in note for note in figure.notes)


def test_of_two_closed_bodies_far_apart_one_is_taken_and_called_closed(tmp_path):
    x, triangles = joined(sphere(radius=0.3, subdivisions=1), (sphere(radius=0.3)[0] + [1, 0, 0], sphere()[1]))
    figure = read_body_mesh(in_file(tmp_path, "two.obj", x, triangles))
    assert len(figure.positions) == len(sphere()[0])
    assert any(re.search(r"\b2\b", note) for note in figure.notes)


def test_closed_means_two_triangles_at_each_edge():
    assert is_closed(CAPSULE[1])
    assert not is_closed(CAPSULE[1][1:])
    assert not is_closed(rectangle(cells=(2, 2))[1])
    assert not is_closed(np.concatenate([CAPSULE[1], [[*CAPSULE[1][0, :2], 40]]]))


def test_a_group_of_the_file_is_taken_as_it_is(tmp_path):
    file = tmp_path / "groups.obj"
    x, triangles = joined(CAPSULE, sphere(radius=0.9, subdivisions=1))
    split = len(CAPSULE[1])
    lines = [f"v {a} {b} {c}" for a, b, c in x.tolist()]
    for name, rows in (("skin", triangles[:split]), ("ball", triangles[split:])):
        lines += [f"g {name}", *(f"f {a} {b} {c}" for a, b, c in (rows + 1).tolist())]
    file.write_text("\n".join(lines))
    assert len(read_body_mesh(file, group="skin").positions) == len(CAPSULE[0])
    assert len(read_body_mesh(file, group="ball").positions) == 42
    with pytest.raises(InputError, match="hair"):
        read_body_mesh(file, group="hair")


def test_up_is_the_longer_of_y_and_z():
    figure = capsule_figure()
    np.testing.assert_array_equal(figure.up, [0, 0, 1])
    lying = figure.__class__("t-pose", figure.positions[:, [2, 2, 0]] * [3, 1, 1], figure.triangles, 1.0, ())
    np.testing.assert_array_equal(lying.up, [0, 1, 0])


def test_a_garment_takes_the_unit_and_the_part_that_are_asked_for(tmp_path):
    own = tube_garment(0.11, cells=(8, 2))
    x, triangles = joined((own.positions, own.triangles), slab())
    file = in_file(tmp_path, "wardrobe.obj", 100 * x, triangles)
    garment = read_garment(file, file, 0.01, part=(0, 24))
    np.testing.assert_allclose(garment.positions, own.positions, atol=1e-6)
    np.testing.assert_array_equal(garment.triangles, own.triangles)
    assert not garment.sewn


def test_welded_borders_are_sewn(tmp_path):
    left, triangles = rectangle(size=(0.2, 0.2), cells=(2, 2))
    x, both = joined((left, triangles), (left + np.array([0.2005, 0.0, 0.0]), triangles))
    file = in_file(tmp_path, "panels.obj", x, both)
    garment = read_garment(file, file, 1.0, weld=0.002)
    assert garment.sewn
    assert len(garment.positions) == 15
    assert any(re.search(r"\b3\b.*weld", note) for note in garment.notes)
    assert len(read_garment(file, file, 1.0).positions) == 18


@pytest.mark.parametrize("bad", ["bow-tie", "fin", "Moebius"])
def test_a_mesh_that_is_no_cloth_is_refused(tmp_path, bad):
    x, triangles = rectangle(size=(0.2, 0.2), cells=(2, 2))
    if bad == "bow-tie":
        x, triangles = np.vstack([x, [[1, 1, 0], [1, 1.1, 0]]]), np.concatenate([triangles, [[0, 9, 10]]])
    elif bad == "fin":
        edge = triangles[0, :2]
        x, triangles = np.vstack([x, [[0, 0, 1]]]), np.concatenate([triangles, [[*edge, 9], [*edge[::-1], 9]]])
    else:
        x, triangles = moebius_strip()
    with pytest.raises(InputError, match=r"garment\.obj: "):
        read_garment(in_file(tmp_path, "garment.obj", x, triangles), "body.obj", 1.0)


def test_of_a_two_sided_mesh_one_side_is_read(tmp_path):
    own = tube_garment(0.11, cells=(8, 4))
    both = np.concatenate([own.triangles, own.triangles[:, ::-1]])
    garment = read_garment(in_file(tmp_path, "g.obj", own.positions, both), "b.obj", 1.0)
    assert np.array_equal(garment.triangles, own.triangles)
    assert any(re.search(r"two-sided.*\b64\b", note) for note in garment.notes)
    with pytest.raises(InputError, match="opposite winding"):
        read_garment(in_file(tmp_path, "few.obj", own.positions, both[:70]), "b.obj", 1.0)


def test_a_moebius_strip_is_named_with_an_edge(tmp_path):
    with pytest.raises(InputError, match=r"strip\.obj: .*edge \d+-\d+: triangles "):
        read_garment(in_file(tmp_path, "strip.obj", *moebius_strip()), "body.obj", 1.0)


@pytest.mark.parametrize("majority", [0.2, 0.8])
def test_an_inconsistent_garment_is_rewound_outwards_with_a_note(tmp_path, majority):
    own, figure = tube_garment(0.11, cells=(8, 4)), capsule_figure()
    turned = np.random.default_rng(0).random(len(own.triangles)) < majority
    triangles = np.where(turned[:, None], own.triangles[:, [0, 2, 1]], own.triangles)
    garment = read_garment(in_file(tmp_path, "g.obj", own.positions, triangles), "b.obj", 1.0, body=figure.positions)
    corners = garment.positions[garment.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", normals, corners.mean(axis=1) * [1, 1, 0]) > 0).all()
    assert any(re.search(rf"of {len(triangles)} triangles.*rewound away", note) for note in garment.notes)


@pytest.mark.parametrize("scale", [1e7, 1e200])
def test_a_garment_out_of_this_world_is_refused(tmp_path, scale):
    file = in_file(tmp_path, "garment.obj", *rectangle(size=(0.5, 0.5), cells=(2, 2)))
    with pytest.raises(InputError, match=r"garment\.obj.* 2\.5e\+\d+ m"):
        read_garment(file, file, scale)


def test_the_cloth_and_the_body_of_a_scene(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(SCENE)
    garment, figure = worn_in_scene(file)
    assert (garment.name, figure.name, figure.scale) == ("sheet", "post", 1.0)
    np.testing.assert_allclose(garment.positions[:, 2], 0.9)
    np.testing.assert_allclose(figure.positions, CAPSULE[0], atol=1e-12)
    alone = read_body_mesh(file)
    np.testing.assert_array_equal(alone.positions, figure.positions)


def test_effects_that_a_fit_has_not_are_named(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(SCENE)
    assert not any("left out" in note for note in worn_in_scene(file)[0].notes)
    file.write_text(SCENE + '[effects.pins]\nselect = "left"\n[effects.pressure]\nvalue = 1.0\n')
    [note] = [note for note in worn_in_scene(file)[0].notes if "left out" in note]
    assert "pins, pressure" in note


def test_of_several_cloths_and_bodies_the_first_is_taken_and_reported(tmp_path):
    file = tmp_path / "scene.toml"
    body = SCENE[SCENE.index("[body]") : SCENE.index("[effects.inertia]")]
    several = SCENE.replace("[cloth]", "[[cloth]]").replace("[body]", "[[body]]")
    second = body.replace("[body]", "[[body]]").replace('"post"', '"other"\nposition = [5.0, 0.0, 0.0]')
    file.write_text(several.replace("[effects.inertia]", f"{second}[effects.inertia]"))
    garment, figure = worn_in_scene(file)
    assert figure.name == "post"
    assert "scene.toml: only the first of 2 bodies is fitted" in garment.notes
    assert not any("cloths" in note for note in garment.notes)


def test_a_scene_far_from_the_origin_comes_back_where_it_is(tmp_path):
    file = tmp_path / "far.toml"
    file.write_text(SCENE.replace("0.9]", "0.9e3]").replace('name = "post"', 'name = "post"\nposition = [0, 0, 899.1]'))
    garment, figure = worn_in_scene(file)
    np.testing.assert_allclose(garment.positions[:, 2], 900.0)
    assert figure.positions[:, 2].mean() == pytest.approx(899.1, abs=1e-6)


def test_a_scene_without_a_body_is_refused(tmp_path):
    file = tmp_path / "scene.toml"
    body = SCENE.index("[body]")
    file.write_text(SCENE[:body] + SCENE[SCENE.index("[effects.inertia]") :].replace("[effects.body_contact]", ""))
    with pytest.raises(InputError, match="body"):
        worn_in_scene(file)
    with pytest.raises(InputError, match="body"):
        read_body_mesh(file)


def test_the_surface_of_a_body_is_found_once():
    positions, triangles = sphere(radius=0.3, subdivisions=1)
    found = known_surface(positions, triangles)
    assert known_surface(positions.copy(), triangles.copy()) is found
    assert known_surface(2.0 * positions, triangles) is not found


HALF = (CAPSULE[0], CAPSULE[1][(CAPSULE[0][CAPSULE[1], 0] < 0.05).all(axis=1)])
"""An open body: the sign of a volume about a point that is far away is that of its hole."""


@pytest.mark.parametrize("mesh", [CAPSULE, HALF], ids=["closed", "open"])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("shift", [0.0, -30.0])
def test_triangles_of_a_body_that_face_inwards_are_turned_with_a_note(tmp_path, mesh, turned, shift):
    positions, triangles = mesh[0] + [shift, 0.0, 0.0], mesh[1].copy()
    triangles = triangles[:, ::-1] if turned else triangles
    file = in_file(tmp_path, "body.obj", positions, triangles)
    for body in (as_body_mesh(Body(positions, triangles)), read_body_mesh(file)):
        np.testing.assert_allclose(
            triangle_normals(body.positions, body.triangles), triangle_normals(positions, mesh[1]), atol=1e-4
        )
        assert any("inwards" in note for note in body.notes) is turned


def test_pieces_that_face_otherwise_are_left():
    """Of two people one that faces inwards, an inner surface, and a sphere whose triangles share no vertices."""
    positions, triangles = CAPSULE
    beside = np.concatenate([positions, positions + np.array([1.0, 0.0, 0.0])])
    hollow = np.concatenate([positions, 0.5 * positions])
    inward = np.concatenate([triangles, triangles[:, ::-1] + len(positions)])
    apart = positions[triangles].reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)
    for mesh in ((beside, inward), (hollow, inward), apart):
        body = as_body_mesh(Body(*mesh))
        assert np.array_equal(body.triangles, mesh[1])
        assert not any("inwards" in note for note in body.notes)


def test_the_body_of_a_scene_is_turned_as_one_to_fit_to_and_as_one_to_fit_from(tmp_path):
    inward = in_file(tmp_path, "body.obj", CAPSULE[0], CAPSULE[1][:, ::-1])
    shape = 'mesh = "capsule"\nradius = 0.2\nheight = 1.7\nsegments = 12'
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.replace(shape, f'mesh = "{inward}"'))
    for body in (read_body_mesh(scene), worn_in_scene(scene)[1]):
        assert any("inwards" in note for note in body.notes)
        outward = triangle_normals(*CAPSULE)
        np.testing.assert_allclose(triangle_normals(body.positions, body.triangles), outward, atol=1e-4)
