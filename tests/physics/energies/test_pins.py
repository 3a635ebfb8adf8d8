"""Pins: selected vertices, prescribed positions, and refused selections."""

from dataclasses import replace

import numpy as np
import pytest
from effect_builders import bending, pins
from meshes import UNIT, cloth, grid, irregular_grid, random_rotation, small_world
from scipy.spatial.transform import Rotation

from clothsim import Scene
from clothsim.base.errors import InputError
from clothsim.mesh.body import make_body
from clothsim.mesh.cloth import dihedral_angles, make_cloth
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Off
from clothsim.physics.energies.pins import clamped
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


NONE = np.zeros(0, np.int64)


def left_and_right(world, which=0):
    """The vertices on x = 0 and on x = 1 of one cloth, world numbers."""
    rows = world.cloth_slices[which]
    x = world.cloths[which].positions[:, 0]
    return [rows.start + np.flatnonzero(x < 1e-9), rows.start + np.flatnonzero(x > 1 - 1e-9)]


def clamped_sheet(nx=4, ny=3, **keywords):
    return cloth(*grid(nx, ny), **keywords)


def test_ghosts_mirror_the_border_triangles():
    world = make_world([clamped_sheet()])
    held, (left, right) = clamped(world, left_and_right(world))
    assert left.tolist() == [20, 21, 22]
    assert right.tolist() == [23, 24, 25]
    assert held.n_vertices == 26
    x = held.start()
    assert np.allclose(sorted(x[left, 1]), [1 / 3, 2 / 3, 1])
    assert np.allclose(x[left, 0], -0.25)
    assert np.allclose(x[right, 0], 1.25)
    assert not x[:, 2].any()
    assert np.array_equal(x[:20], world.start())


def test_ghost_hinges_are_flat_twice_as_stiff_and_as_large_as_two_border_triangles():
    world = make_world([clamped_sheet()])
    held, (left, right) = clamped(world, left_and_right(world))
    old, new = len(world.hinges.vertices), slice(len(world.hinges.vertices), None)
    assert np.array_equal(held.hinges.vertices[:old], world.hinges.vertices)
    assert np.array_equal(held.hinges.stiffness[:old], world.hinges.stiffness)
    assert held.hinges.vertices[new, 3].tolist() == [*left, *right]
    assert (held.hinges.stiffness[new] == 2 * UNIT.bending_stiffness).all()
    assert np.allclose(held.hinges.edge_lengths[new], 1 / 3)
    assert np.allclose(held.hinges.areas[new], 2 * (1 / 12) / 2)
    assert np.abs(dihedral_angles(held.start(), held.hinges.vertices)).max() < 1e-15
    assert (held.hinges.held[:old] == -1).all()
    assert (held.hinges.held[new] == 1).all()


@pytest.mark.parametrize("model", ["hinge", "quadratic", "midedge"])
def test_a_sheet_turned_about_its_clamped_edge_is_bent_and_one_turned_with_it_is_not(model):
    world = make_world([clamped_sheet(fabric=replace(UNIT, poisson_ratio=0.0))])
    (left, _), angle = left_and_right(world), 0.1
    held, (ghosts,) = clamped(world, [left])
    x = held.start()
    free = np.setdiff1d(np.arange(world.n_cloth), left)
    turned = x.copy()
    turned[free] = x[free] * [np.cos(angle), 1, 0] - x[free, :1] * [0, 0, np.sin(angle)]
    energy = bending(held, model=model)
    # one hinge of twice D over the cell 1/4: E = 2 D angle^2 / (2 * 1/4)
    exact = 2 * UNIT.bending_stiffness * angle**2 / (2 * 0.25)
    assert energy.value(turned) == pytest.approx(exact, rel=1e-3)
    turned[ghosts] = x[ghosts] * [np.cos(angle), 1, 0] - x[ghosts, :1] * [0, 0, np.sin(angle)]
    assert energy.value(turned) < 1e-25
    assert bending(world, model=model).value(turned[: world.n_cloth]) < 1e-25


def test_ghosts_lie_in_the_plane_of_the_start_and_come_after_the_bodies():
    positions, triangles = irregular_grid(3, 3, 3)
    start = 1.2 * positions @ random_rotation(4).T + [0, 0, 5]
    body = make_body("table", np.eye(3), np.array([[0, 1, 2]]))
    limp = cloth(*irregular_grid(1), name="other")
    world = make_world([limp, make_cloth("sheet", positions, triangles, UNIT, positions=start)], [body])
    border = world.cloth_slices[1].start + np.array([0, 1, 2])
    held, (ghosts,) = clamped(world, [border])
    assert ghosts[0] == world.n_vertices
    x = held.start()
    rows = np.isin(held.hinges.vertices[:, 3], ghosts)
    a, b, c, ghost = (x[held.hinges.vertices[rows, k]] for k in range(4))
    middle = (c + ghost) / 2
    assert np.linalg.norm(ghost - a, axis=1) == pytest.approx(np.linalg.norm(c - a, axis=1))
    assert np.linalg.norm(ghost - b, axis=1) == pytest.approx(np.linalg.norm(c - b, axis=1))
    assert np.abs(np.cross(middle - a, b - a)).max() < 1e-14
    assert np.linalg.norm(c - ghost, axis=1).min() > 0.1
    at_rest = held.hinges.corners[rows]
    assert np.linalg.norm(b - a, axis=1) == pytest.approx(1.2 * at_rest[:, 1, 0])
    assert np.linalg.norm(c - ghost, axis=1) == pytest.approx(1.2 * 2 * at_rest[:, 2, 1])


def test_whole_pinned_triangles_double_the_hinges_on_their_line_and_need_no_ghost():
    world = make_world([clamped_sheet()])
    band = np.flatnonzero(world.start()[:, 0] < 0.3)
    held, (ghosts,) = clamped(world, [band])
    ratio = held.hinges.stiffness / world.hinges.stiffness
    middle = world.start()[world.hinges.vertices[:, :2]].mean(axis=1)
    on_line = np.ptp(world.start()[world.hinges.vertices[:, :2], 0], axis=1) < 1e-9
    line = on_line & (np.abs(middle[:, 0] - 0.25) < 1e-9)
    assert line.sum() == 3
    assert (ratio == np.where(line, 2.0, 1.0)).all()
    pinned = np.isin(held.hinges.vertices[:, 2:], band)
    assert (held.hinges.held == np.where(line, np.where(pinned[:, 0], 0, 1), -1)).all()
    assert len(ghosts) == 0
    assert held.n_vertices == world.n_vertices


def test_an_edge_between_two_groups_is_not_clamped_and_an_empty_group_has_no_ghosts():
    world = make_world([clamped_sheet()])
    held, ghosts = clamped(world, [np.array([0, 1]), NONE, np.array([2, 3])])
    assert [len(g) for g in ghosts] == [1, 0, 1]
    assert len(held.hinges.vertices) == len(world.hinges.vertices) + 2
    same, (none,) = clamped(world, [NONE])
    assert same is world
    assert len(none) == 0


def test_each_cloth_has_its_own_stiffness():
    soft = clamped_sheet(fabric=replace(UNIT, bending_stiffness=0.1), name="soft")
    world = make_world([clamped_sheet(name="stiff"), soft])
    groups = [left_and_right(world, 0)[0], left_and_right(world, 1)[0]]
    held, ghosts = clamped(world, groups)
    for rows, stiffness in zip(ghosts, (2 * 0.7, 2 * 0.1), strict=True):
        mine = np.isin(held.hinges.vertices[:, 3], rows)
        assert mine.sum() == 3
        assert (held.hinges.stiffness[mine] == stiffness).all()


@pytest.mark.parametrize("group", [[0], [0, 19], [5, 6]])
def test_a_group_with_nothing_to_clamp_is_refused(group):
    world = make_world([clamped_sheet()])
    with pytest.raises(InputError, match=r"\b1\b"):
        clamped(world, [left_and_right(world)[0], np.array(group)])


def test_a_border_triangle_without_area_at_the_start_is_refused():
    flat = grid(4, 3)[0]
    world = make_world([make_cloth("sheet", *grid(4, 3), UNIT, positions=flat * [0.0, 1.0, 1.0])])
    with pytest.raises(InputError):
        clamped(world, [np.arange(4)])
