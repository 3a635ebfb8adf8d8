"""Limbs: names on a body, what is between the sides of a seam, tubes of legs, the body posed for sewing and back."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from capsule_bodies import signed_volume
from scipy.spatial import cKDTree
from sewing_patterns import panel, specification, stitch
from sewn_tubes import tube

from clothsim.base.triangles import unique_edges
from clothsim.engine import intersecting_pairs
from clothsim.garments.dress.limbs import (
    Wearer,
    form_a_tube,
    goes_round,
    legs_beside,
    limb_names,
    limbs_between,
    sewing_pose,
)
from clothsim.garments.dress.pipeline import DressTask, returned_body
from clothsim.garments.dress.placement import arm_line
from clothsim.garments.dress.sewing_state import Fabrics, as_placed
from clothsim.garments.inputs import BodyMesh
from clothsim.garments.penetration import count_penetrations
from clothsim.mesh.generators.table import GENERATORS
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of
from transfer.signed_distance import body_surface

UP = np.array([0.0, 1.0, 0.0])


@pytest.fixture(scope="module")
def wearer() -> Wearer:
    """The mannequin of the package, y upward."""
    positions, triangles = GENERATORS["mannequin"]()
    body = BodyMesh("mannequin", positions[:, [0, 2, 1]] * [1, 1, -1], triangles, 1.0, ())
    return Wearer(body, body_surface(body.positions, body.triangles))


def test_limbs_are_named_by_where_they_are(wearer):
    names, points = limb_names(wearer.body), wearer.body.positions
    assert names[points[:, 1].argmax()] == "head"
    assert sorted(names[[points[:, 0].argmin(), points[:, 0].argmax()]]) == ["left hand", "right hand"]
    low = points[:, 1] < 0.3
    assert set(names[low]) == {"left leg", "right leg"}
    assert len(np.unique(np.sign(points[low][names[low] == "left leg", 0]))) == 1


def test_a_body_that_does_not_stand_has_no_limbs():
    ball = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    body = BodyMesh("ball", ball, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]), 1.0, ())
    assert set(limb_names(body)) == {"body"}


def two_panels(x: float, y: float):
    """Panels of 10 by 20 cm before and behind the body about a place [cm], sewn along one side."""
    panels = {"front": panel(translation=[x, y, 40]), "back": panel(translation=[x, y, -40])}
    return mesh_pattern(pattern_of(specification(panels, [stitch(("front", 3), ("back", 3), "right_wrong")])), 0.05)


def test_what_is_between_the_sides_of_a_seam_is_named(wearer):
    body = wearer.body
    leg = 100 * body.positions[(body.positions[:, 1] < 0.4) & (body.positions[:, 0] > 0)].mean(axis=0)
    state = as_placed(two_panels(leg[0], leg[1]))
    (found,) = limbs_between(state, state.mesh.seams, wearer, 0.0)
    assert found.endswith("leg")
    assert limbs_between(state, state.mesh.seams, wearer, 1.0) == ()  # no string is as long
    shell = body.positions + 0.007 * wearer.surface.vertex_normals
    both = np.concatenate([body.positions, shell])
    joined = np.concatenate([body.triangles, body.triangles + len(shell)])
    dressed = Wearer(BodyMesh("dressed", both, joined, 1.0, (), body), body_surface(both, joined))
    assert limbs_between(state, state.mesh.seams, dressed, 0.0) == (f"clothes on the {found}",)
    clear = as_placed(two_panels(150, 100))
    assert limbs_between(clear, clear.mesh.seams, wearer, 0.0) == ()


def test_front_and_back_of_a_leg_are_a_tube_and_gores_are_none():
    flat = [[0, 0], [20, 0], [20, 80], [0, 80]]
    panels = {"front": panel(flat, translation=[2, 0, 20]), "back": panel(flat, translation=[2, 0, -20])}
    both = [stitch(("front", k), ("back", k), "right_wrong") for k in (1, 3)]
    leg = mesh_pattern(pattern_of(specification(panels, both)), 0.05)
    gores = mesh_pattern(pattern_of(specification(panels, both[:1])), 0.05)
    assert form_a_tube(leg, ["front", "back"], UP)
    assert not form_a_tube(gores, ["front", "back"], UP)


def test_a_corner_on_the_level_of_a_cut_is_no_obstacle():
    front, back = ([[0, 0], [20, 0], [20, 43], [20, 100], [0, 100], [0, low]] for low in (10, 17))
    panels = {"front": panel(front, translation=[2, 0, 20]), "back": panel(back, translation=[2, 0, -20])}
    both = [stitch(("front", k), ("back", k), "right_wrong") for k in (1, 2, 4)]
    leg = mesh_pattern(pattern_of(specification(panels, both)), 0.05)
    assert (leg.positions[:, 1] == 0.1).sum() == 1  # at a tenth of the height
    assert form_a_tube(leg, ["front", "back"], UP)


def test_segments_round_the_origin():
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], float)
    sides = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    assert goes_round(sides)
    assert not goes_round(sides[:3])
    assert not goes_round(sides + 3)


@pytest.mark.parametrize(("limbs", "moved"), [(["left leg"], "leg"), (["right hand"], "arm"), (["torso"], "leg")])
def test_limbs_move_out_of_the_way_and_back(wearer, limbs, moved):
    posed, said = sewing_pose(wearer, limbs)
    assert moved in said
    assert np.allclose(posed.way[-1], wearer.body.positions, atol=1e-12)
    assert np.array_equal(posed.way[0], posed.body.positions)
    shift = np.linalg.norm(posed.way[0] - posed.way[-1], axis=1)
    names = limb_names(wearer.body)
    trunk = (names == "head") | ((names == "torso") & (np.abs(wearer.body.positions[:, 0]) < 0.05))
    assert shift[trunk].max() < 0.02
    of_limb = {"leg": ["left leg"], "arm": ["left hand", "left forearm"]}[moved]
    assert shift[np.isin(names, of_limb)].max() > 0.1
    for frame in posed.way[[0, 3]]:
        assert signed_volume(frame, wearer.body.triangles) > 0
        assert not len(intersecting_pairs(frame, wearer.body.triangles))


def test_each_leg_is_turned_to_its_side_where_the_legs_join_below_the_crotch(wearer):
    """The crotch is found at a vertex, and the triangles below one may still join the legs: they are pieces lower."""
    parts = wearer.body.parts
    high = {**parts.landmarks, "crotch": parts.landmarks["crotch"] + 0.02}
    body = replace(wearer.body)
    body.__dict__["parts"] = replace(parts, landmarks=high)
    posed, _ = sewing_pose(Wearer(body, wearer.surface), ["left leg"])
    low = body.positions[:, 1] < 0.5 * high["crotch"]
    moved, side = (posed.way[0] - posed.way[-1])[low, 0], body.positions[low, 0]
    assert np.all(moved * side > 0)
    assert not len(intersecting_pairs(posed.way[0], body.triangles))


def test_a_wrap_of_a_leg_moves_with_it_where_the_leg_reaches_across_the_middle(wearer):
    """Both legs lean to the right, so that half of the left one is there; a sleeve round it is a piece of its own."""
    own, positions = wearer.body, wearer.body.positions.copy()
    crotch = own.parts.landmarks["crotch"]
    depth = np.sin(np.pi * np.clip(positions[:, 1] / crotch, 0.0, 1.0))
    left = (positions[:, 0] > 0) & (positions[:, 1] < 0.8 * crotch)
    positions[:, 0] -= 0.15 * depth
    faces = own.triangles[left[own.triangles].all(axis=1)]
    rows, triangles = np.unique(faces, return_inverse=True)
    both = np.concatenate([positions, positions[rows] * [1.0, 1.0, 1.05]])
    joined = np.concatenate([own.triangles, triangles.reshape(-1, 3) + len(positions)])
    body = BodyMesh("wrapped", both, joined, 1.0, (), own)
    assert (both[len(positions) :, 0] < 0).any()
    posed, _ = sewing_pose(Wearer(body, body_surface(both, joined)), ["left leg"])
    shift = posed.way[0] - posed.way[-1]
    assert np.abs(shift[len(positions) :] - shift[rows]).max() < 5e-3
    assert (shift[len(positions) :, 0] >= 0).all()


@pytest.mark.parametrize("lean", [0.0, 0.15])
def test_a_shoe_that_is_a_piece_of_its_own_is_no_leg(wearer, lean):
    """lean: distance by which both thighs lean to the right [m]; from 0.1 on, the left one reaches across."""
    own, crotch = wearer.body, wearer.body.parts.landmarks["crotch"]
    foot = (own.positions[:, 0] > 0) & (own.positions[:, 1] < 0.12 * crotch)
    of_foot = foot[own.triangles].all(axis=1)
    rows, faces = np.unique(own.triangles[of_foot], return_inverse=True)
    depth = np.clip((own.positions[:, 1] / crotch - 0.2) / 0.6, 0.0, 1.0)
    leaning = own.positions - lean * np.outer(np.sin(np.pi * depth), [1.0, 0.0, 0.0])
    positions = np.concatenate([leaning, leaning[rows] - [0.0, 2e-3, 0.0]])
    triangles = np.concatenate([own.triangles[~of_foot], faces.reshape(-1, 3) + len(own.positions)])
    shod = BodyMesh("shod", positions, triangles, 1.0, (), own)
    way = sewing_pose(Wearer(shod, wearer.surface), ["left leg"])[0].way
    alone = replace(own, positions=leaning)
    alone.__dict__["parts"] = own.parts
    bare = sewing_pose(Wearer(alone, wearer.surface), ["left leg"])[0].way
    expected = np.concatenate([bare[0] - bare[-1], (bare[0] - bare[-1])[rows]])
    used = np.unique(triangles)
    assert np.abs(way[0] - way[-1] - expected)[used].max() < 2e-3


@pytest.mark.parametrize(("low", "high", "beside"), [(0.2, 0.5, True), (0.6, 0.95, True), (0.9, 1.2, False)])
def test_springs_of_a_seam_below_the_crotch_are_beside_the_legs(wearer, low, high, beside):
    state = as_placed(tube(0.3, low, high).mesh)
    crotch = wearer.body.parts.landmarks["crotch"]
    assert 0.6 < crotch < 0.9
    assert bool(legs_beside(state, wearer.body)) is beside
    assert legs_beside(state.weld(range(len(state.mesh.seams))), wearer.body) == ()


def test_nothing_helps_where_no_limb_is_between(wearer):
    assert sewing_pose(wearer, []) == (wearer, "")


def test_a_garment_goes_back_with_the_body(wearer, tmp_path):
    posed, _ = sewing_pose(wearer, ["left leg"])
    state = tube(0.3, 0.6, 0.66)
    fabrics = Fabrics("cotton")
    task = DressTask(wearer.body, wearer.surface, fabrics, False, tmp_path, lambda stage: None, None, None)
    run = returned_body(state, posed, task)
    assert run.status == "completed"
    assert count_penetrations(run.positions(-1), state.triangles, wearer.surface).clean


@pytest.mark.parametrize("finer", [0, 1, 2])
def test_cloth_on_the_trunk_beside_a_hanging_arm_is_of_the_trunk(finer):
    """Three quarters of the way from the trunk to an arm it is nearer to that, but faces it; also on finer meshes."""
    positions, triangles = GENERATORS["mannequin"](pose="arms_down")
    for _ in range(finer):
        positions, triangles = trimesh.remesh.subdivide(positions, triangles)
    own = BodyMesh("mannequin", positions, triangles, 1.0, ())
    names = limb_names(own)
    arms = positions[np.char.endswith(names, " arm")]
    distance, nearest = cKDTree(arms).query(positions)
    beside = (names == "torso") & (distance < 0.07) & (positions @ own.up < 0.7 * own.height)
    rows, faces = np.unique(triangles[beside[triangles].all(axis=1)], return_inverse=True)
    shell = positions[rows] + 0.75 * (arms[nearest[rows]] - positions[rows])
    both = np.concatenate([positions, shell])
    joined = np.concatenate([triangles, faces.reshape(-1, 3) + len(positions)])
    dressed = BodyMesh("dressed", both, joined, 1.0, (), own)
    assert len(rows) > 20
    assert np.mean(limb_names(dressed)[len(positions) :] == "torso") > 0.97
    assert np.array_equal(limb_names(dressed)[: len(positions)], names)


def test_the_arms_of_a_dressed_body_are_raised_with_what_it_wears(wearer):
    own = wearer.body
    both = np.concatenate([own.positions, own.positions + 0.007 * wearer.surface.vertex_normals])
    joined = np.concatenate([own.triangles, own.triangles + len(own.positions)])
    dressed = BodyMesh("dressed", both, joined, 1.0, (), own)
    posed, bare = (sewing_pose(each, ["left arm"])[0].body for each in (wearer._replace(body=dressed), wearer))
    assert posed.parts.landmarks == own.parts.landmarks
    right = np.cross(own.up, own.front)
    lines = [arm_line(body, right, body.middle) for body in (posed, bare)]
    np.testing.assert_allclose(lines[0].direction, lines[1].direction, atol=1e-9)
    assert abs(lines[0].direction @ own.up) < 0.3


def test_raised_arms_pull_no_spikes_out_of_a_wrap(wearer):
    """A shell round the trunk alone, which goes with it, but for the armholes."""
    own, names = wearer.body, limb_names(wearer.body)
    rows, faces = np.unique(own.triangles[(names == "torso")[own.triangles].all(axis=1)], return_inverse=True)
    shell = own.positions[rows] + 0.03 * wearer.surface.vertex_normals[rows]
    joined = np.concatenate([own.triangles, faces.reshape(-1, 3) + len(own.positions)])
    dressed = BodyMesh("dressed", np.concatenate([own.positions, shell]), joined, 1.0, (), own)
    moved = sewing_pose(wearer._replace(body=dressed), ["left arm"])[0].body.positions[len(own.positions) :]
    edges = unique_edges(faces.reshape(-1, 3))
    before, after = (np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1) for points in (shell, moved))
    assert (after / before).max() < 2.0


@pytest.mark.parametrize("dressed", [False, True])
@pytest.mark.parametrize("limbs", [["left arm"], ["left leg"], ["left leg", "left arm"]])
def test_a_pose_changes_neither_landmarks_nor_the_limb_of_a_vertex(wearer, dressed, limbs):
    body = wearer.body
    if dressed:
        both = np.concatenate([body.positions, body.positions + 0.007 * wearer.surface.vertex_normals])
        body = BodyMesh(
            "dressed", both, np.concatenate([body.triangles, body.triangles + len(both) // 2]), 1.0, (), body
        )
    posed = sewing_pose(wearer._replace(body=body), limbs)[0].body
    assert posed.own_pose is body
    assert posed.parts.landmarks == body.parts.landmarks
    assert np.array_equal(limb_names(posed), limb_names(body))
    elsewhere = replace(posed, positions=posed.positions + 0.3 * body.up)  # by vertex, wherever a pose takes it
    assert np.array_equal(limb_names(elsewhere), limb_names(body))
    assert posed.frame is body.frame
    assert "_union" not in posed.__dict__  # pieces in a pose are not wrapped anew
    again = sewing_pose(wearer._replace(body=posed), ["left leg"])[0].body
    assert again.own_pose is body
    assert np.array_equal(posed.up, body.up)
    assert np.array_equal(posed.front, body.front)
