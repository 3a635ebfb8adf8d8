"""Pins: selected vertices, prescribed positions, and refused selections."""

import numpy as np
import pytest
from effect_builders import pins
from meshes import cloth, grid, small_world
from scipy.spatial.transform import Rotation

from clothsim import Scene
from clothsim.base.errors import InputError
from clothsim.mesh.body import make_body
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Off
from clothsim.scene.assembly.scene_world import build


def sheet(n=3):
    """A unit square of n x n cells over a body."""
    floor = make_body("floor", np.array([[0.0, 0, -1], [1, 0, -1], [0, 1, -1]]), np.array([[0, 1, 2]]))
    return make_world([cloth(*grid(n, n))], [floor])


def selected(world, select):
    return pins(world, select=select)[1].at(0.0).vertices


@pytest.mark.parametrize(
    ("name", "where"),
    [
        ("left", lambda x, y: x == 0),
        ("right", lambda x, y: x == 1),
        ("bottom", lambda x, y: y == 0),
        ("top", lambda x, y: y == 1),
        ("boundary", lambda x, y: (x == 0) | (x == 1) | (y == 0) | (y == 1)),
        ("corners", lambda x, y: ((x == 0) | (x == 1)) & ((y == 0) | (y == 1))),
    ],
)
def test_named_selections(name, where):
    world = sheet()
    x, y, _ = world.start()[: world.n_cloth].T
    assert sorted(selected(world, name)) == np.flatnonzero(where(x, y)).tolist()


def garment(mesh):
    effects = {"membrane": {}, "gravity": {}}
    return lambda side: build(Scene(cloth={"mesh": mesh, "name": mesh}, effects=effects | {"pins": {"select": side}}))


@pytest.mark.parametrize("mesh", ["skirt", "shirt"])
def test_the_top_of_a_garment_is_its_highest_border(mesh):
    built = garment(mesh)
    up = built("top").world.start()[:, 2]
    top, bottom = (built(side).constraints["pins"].at(0.0).vertices for side in ("top", "bottom"))
    assert len(top) > 20
    assert len(bottom) > 40
    assert up[top].min() > np.median(up)
    assert up[bottom] == pytest.approx(up.min(), abs=0.02)
    assert [note for note in built("top").notes if note.startswith(f"pins: {len(top)} vertices")]


def test_the_bottom_of_trousers_is_both_hems():
    built = garment("trousers")("bottom")
    x, _, z = built.world.start()[built.constraints["pins"].at(0.0).vertices].T
    assert (x > 0).sum() > 10
    assert (x < 0).sum() > 10
    assert z == pytest.approx(z.min(), abs=0.02)


def test_the_sides_of_a_shirt_are_the_ends_of_its_sleeves_and_a_skirt_has_none():
    built = garment("shirt")("left")
    rows = built.constraints["pins"].at(0.0).vertices
    assert built.world.start()[rows, 0].max() < -0.2
    with pytest.raises(InputError, match="skirt"):
        garment("skirt")("left")


def test_a_box_selects_what_starts_in_it():
    world = sheet()
    assert selected(world, {"box": [[-1, -1, -1], [0.4, 0.4, 1]]}).tolist() == [0, 1, 4, 5]


def test_indices_are_taken_as_they_are_and_once():
    assert selected(sheet(), [5, 2, 5]).tolist() == [2, 5]


def test_a_name_means_every_cloth():
    first, second = (cloth(*grid(1, 1), name=name) for name in "ab")
    assert selected(make_world([first, second]), "left").tolist() == [0, 1, 4, 5]


def test_motion_is_a_turn_about_the_group_s_middle_and_a_shift():
    world = sheet()
    motion = {"velocity": [1.0, 0.0, 2.0], "rotate_degrees_per_second": [0.0, 0.0, 90.0]}
    _, constraint = pins(world, select="left", motion=motion)
    held = constraint.at(0.5)
    start = world.start()[held.vertices]
    middle = start.mean(axis=0)
    turn = Rotation.from_rotvec([0, 0, 45], degrees=True)
    assert np.allclose(held.positions, turn.apply(start - middle) + middle + [0.5, 0, 1], atol=1e-14)


def test_the_centre_can_be_given():
    world = sheet()
    motion = {"rotate_degrees_per_second": [0.0, 0.0, 180.0], "centre": [0.0, 0.0, 0.0]}
    held = pins(world, select="right", motion=motion)[1].at(1.0)
    assert np.allclose(held.positions, world.start()[held.vertices] * [-1, -1, 1], atol=1e-14)


def test_groups_move_by_their_own_motions():
    world = sheet()
    _, constraint = pins(
        world, group=[{"select": "left"}, {"select": "right", "motion": {"velocity": [0.0, 0.0, 1.0]}}]
    )
    held, start = constraint.at(2.0), world.start()
    moved = held.positions[:, 2] - start[held.vertices, 2]
    assert sorted(set(moved)) == [0.0, 2.0]
    assert np.array_equal(moved == 2.0, start[held.vertices, 0] == 1)


def test_clamped_groups_carry_their_ghosts():
    world = sheet()
    enlarged, constraint = pins(world, select="left", clamp=True, motion={"velocity": [0.0, 0.0, 1.0]})
    ghosts = np.arange(world.n_vertices, enlarged.n_vertices)
    assert len(ghosts) == 3
    held = constraint.at(1.0)
    assert set(ghosts) < set(held.vertices)
    assert np.allclose(held.positions[:, 2], enlarged.start()[held.vertices, 2] + 1)
    assert np.array_equal(enlarged.start()[: world.n_vertices], world.start())


def test_no_selection_is_off():
    assert pins(small_world()) == Off("no vertex is selected")
    assert pins(small_world(), select=[]) == Off("no vertex is selected")


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"select": "lefft"}, "'lefft'"),
        ({"select": [0, 99]}, r"select\[1\] = 99 .* 0\.\.15"),
        ({"select": [-1]}, r"select\[0\] = -1"),
        ({"select": [16]}, r"select\[0\] = 16"),
        ({"select": [0.5]}, "vertex numbers"),
        ({"select": [[0, 1]]}, "vertex numbers"),
        ({"select": {"ball": [0, 1]}}, "'ball'"),
        ({"select": {"box": [[5, 5, 5], [6, 6, 6]]}}, r"pins\.select\.box"),
        ({"select": {"box": [[0, 0], [1, 1]]}}, "box must have shape"),
        ({"select": {"box": [[0, 0, 0]]}}, "box"),
        ({"select": "left", "motion": {"speed": [1, 0, 0]}}, "speed"),
        ({"select": "left", "motion": {"velocity": [1, 0]}}, "velocity must be 3 numbers"),
        ({"select": "left", "group": [{"select": "corners"}]}, "vertex 0 is in two groups"),
        ({"group": [{"select": "left", "clmap": True}]}, "clmap"),
        ({"group": [{"motion": {"velocity": [0, 0, 1]}}]}, r"group\[0\] has no select"),
        ({"group": [{"select": "left", "motion": [1, 2, 3]}]}, "motion"),
    ],
)
def test_bad_pins_are_refused_in_one_sentence(keys, words):
    with pytest.raises(InputError, match=words):
        pins(sheet(), **keys)
