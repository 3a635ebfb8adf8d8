"""Dressing: a skirt on a cylinder, sewn, welded and draped; and what cannot be dressed."""

import json
from dataclasses import replace

import numpy as np
import pytest
from capsule_bodies import person
from sewing_patterns import panel, specification, stitch

import clothsim
from clothsim.base.errors import InputError
from clothsim.garments import pictures
from clothsim.garments.dress import corrections
from clothsim.garments.dress.closing import BELOW, DART, ONTO, WITHIN, order_of, sewing_phases
from clothsim.garments.dress.corrections import _best_lift, approached, crossing_panels, lifted, separated
from clothsim.garments.dress.pipeline import end_of_drape
from clothsim.garments.dress.placement import placed_on, turned_to_arms
from clothsim.garments.dress.sewing_state import as_placed, count_crossing_body, worst_gap
from clothsim.garments.inputs import BodyMesh
from clothsim.garments.penetration import count_penetrations
from clothsim.garments.pictures import frames_of, seam_strokes
from clothsim.keys.fabric_table import fabric_named
from clothsim.mesh.cloth import make_cloth
from clothsim.mesh.world import make_world
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of
from transfer.signed_distance import body_surface

WIDTH, HEIGHT, DISTANCE, SPACING = 40, 30, 20, 0.06
"""Panels of the skirt, their distance from the axis [cm], and the size of the mesh [m]."""


def skirt(distance: float = DISTANCE) -> dict:
    """A skirt of two panels of 40 x 30 cm."""
    front = [[-WIDTH / 2, 0], [WIDTH / 2, 0], [WIDTH / 2, HEIGHT], [-WIDTH / 2, HEIGHT]]
    back = [[-x, y] for x, y in front]
    panels = {
        "front": panel(front, translation=[0, 80, distance]),
        "back": panel(back, translation=[0, 80, -distance]),
    }
    return specification(panels, [stitch(("front", 1), ("back", 3)), stitch(("front", 3), ("back", 1))])


def shirt() -> dict:
    """Front and back of a torso with sleeves placed along x, for arms held out."""
    torso = [[-25, 0], [25, 0], [25, 40], [10, 50], [-10, 50], [-25, 40]]
    sleeve = [[0, 0], [20, 0], [20, 20], [0, 20]]
    panels = {"front": panel(torso, translation=[0, 85, 22]), "back": panel(torso, translation=[0, 85, -22])}
    for side, x in (("left", 30), ("right", -50)):
        for name, z in (("f", 15), ("b", -15)):
            panels[f"{side}_sleeve_{name}"] = panel(sleeve, translation=[x, 120, z], label="arm")
    sewn = [stitch(("front", k), ("back", k), "right_wrong") for k in (1, 2, 4, 5)]
    for side, cap in (("left", 3), ("right", 1)):
        sewn += [stitch((f"{side}_sleeve_f", k), (f"{side}_sleeve_b", k), "right_wrong") for k in (0, 2)]
        sewn.append(stitch((f"{side}_sleeve_f", cap), (f"{side}_sleeve_b", cap), "right_wrong"))
    return specification(panels, sewn)


STEPS = []
"""Progress of the dress of the fixture `dressed`."""


@pytest.fixture(scope="module")
def body() -> BodyMesh:
    """A person of capsules, 1.7 m tall, arms half raised."""
    positions, triangles = person(0.05)
    return BodyMesh("person", positions, triangles, 1.0, ())


@pytest.fixture(scope="module")
def dressed(body, tmp_path_factory):
    """The skirt on the person."""
    worn = clothsim.Body(body.positions, body.triangles, name="person")
    folder = tmp_path_factory.mktemp("worn")
    return clothsim.dress(pattern_of(skirt()), worn, folder, size=SPACING, progress=STEPS.append)


def test_each_run_of_a_dress_is_named_with_its_round(dressed):
    labels = list(dict.fromkeys(step.stage for step in STEPS))
    assert all(labels)
    assert labels[-1].startswith("drape")
    rounds = [label for label in labels if label.startswith("close, round")]
    assert rounds[0].startswith("close, round 1 of at most ")
    assert len(rounds) == len(set(rounds)) == len(dressed.closing)
    assert STEPS[-1].until_rest


def test_a_skirt_is_sewn_and_rests_on_the_body(dressed, body):
    assert dressed.status == "completed"
    assert dressed.counts.clean
    assert dressed.state.open_seams == ()
    low, high = dressed.stretch
    assert low > 0.9
    assert high < 1.1
    assert [stage.name for stage in dressed.stages] == ["place", "approach", "close", "weld", "drape"]
    height = dressed.positions[:, 1]
    assert 0.3 < height.min() < height.max() < 1.35


def test_a_garment_of_a_fine_mesh_is_sewn_on_a_coarser_one_and_refined_before_its_drape(body, tmp_path):
    worn = clothsim.Body(body.positions, body.triangles, name="person")
    done = clothsim.dress(pattern_of(skirt()), worn, tmp_path, size=SPACING / 3)
    coarse = len(mesh_pattern(pattern_of(skirt()), 2 * SPACING / 3).positions)
    counts = [len(stage.positions) for stage in done.stages]
    assert (done.status, done.state.open_seams) == ("completed", ())
    assert [stage.name for stage in done.stages] == ["place", "approach", "close", "weld", "refine", "drape"]
    assert counts[0] == coarse
    assert counts[-1] == counts[-2] > 3 * counts[-3]
    assert done.counts.clean


def test_the_weight_of_a_sewn_garment_is_that_of_its_cloth(dressed):
    assert np.isclose(
        _masses(dressed).sum(), 2 * WIDTH * HEIGHT / 1e4 * fabric_named("fabric", "cotton").density, rtol=1e-12
    )


def _masses(dressed) -> np.ndarray:
    cloth = make_cloth(
        "garment",
        dressed.positions,
        dressed.state.triangles,
        fabric_named("fabric", "cotton"),
        material_coordinates=dressed.state.mesh.material_coordinates,
    )
    return make_world([cloth]).masses


def test_files_of_a_dressed_garment(dressed):
    names = {file.name for file in dressed.directory.iterdir()}
    assert {"garment.obj", "pattern.json", "pattern.svg", "summary.json", "trajectory.vtkhdf"} <= names
    summary = json.loads((dressed.directory / "summary.json").read_text())
    assert summary["status"] == "completed"
    assert summary["cpu_seconds"] >= sum(stage["seconds"] for stage in summary["stages"]) > 0.0
    assert [seam["welded"] for seam in summary["seams"]] == [True, True]
    assert all(seam["gap"] == 0.0 for seam in summary["seams"])
    assert np.isclose(summary["measurements"]["cloth_area"], 2 * WIDTH * HEIGHT / 1e4)
    lines = (dressed.directory / "garment.obj").read_text().splitlines()
    assert sum(line.startswith("vt ") for line in lines) == len(dressed.state.mesh.positions)
    assert [line for line in lines if line.startswith("g ")] == ["g front", "g back"]


@pytest.mark.parametrize(
    ("change", "draped", "title"),
    [({}, True, "worn"), ({"status": "sewn"}, True, pictures.MOVING), ({"status": "sewn", "run": None}, False, "sewn"),
     ({"status": "failed"}, False, "failed")],
)  # fmt: skip
def test_a_picture_says_whether_the_garment_rests(dressed, monkeypatch, change, draped, title):
    titles = []
    monkeypatch.setattr(pictures, "_pair", lambda file, title, *others: titles.append(title))
    done = replace(dressed, **change)
    assert done.draped is draped
    pictures.draw_dress(done)
    assert titles[1].startswith(title)
    assert ("not draped" in titles[1]) == (done.run is None)


def test_pictures_of_a_dressed_garment(dressed, monkeypatch):
    monkeypatch.setattr(pictures, "SIZE", (100, 150))
    monkeypatch.setenv("CLOTHSIM_RENDERER", "ray")
    files = pictures.draw_dress(dressed)
    assert [file.name for file in files] == ["placed.png", "worn.png", "stretch.png"]
    assert all(file.stat().st_size > 5_000 for file in files)
    whole, near = (pictures._focus(dressed.positions, dressed.body, whole) for whole in (True, False))
    heights = dressed.body.positions @ dressed.body.up
    assert np.ptp(whole @ dressed.body.up) == np.ptp(heights) > np.ptp(near @ dressed.body.up)  # from head to feet


def test_frames_of_the_sewing(dressed):
    frames = frames_of(dressed)
    assert len(frames) == 1 + sum(len(run) for run in dressed.closing) + len(dressed.run)
    panels, welded = len(dressed.state.mesh.positions), len(dressed.positions)
    assert [len(garment.positions) for garment, _ in frames[:: len(frames) - 1]] == [panels, welded]
    assert np.array_equal(frames[-1][0].positions, dressed.positions)


def test_seams_are_drawn_along_all_sewn_edges(dressed):
    strokes = seam_strokes(dressed.state, dressed.positions)
    lengths = np.linalg.norm(strokes[:, 0, 1] - strokes[:, 0, 0], axis=1)
    assert np.isclose(lengths.sum(), 2 * HEIGHT / 100, rtol=0.05)
    both = strokes[:, :, 1] - strokes[:, :, 0]
    assert np.allclose((both[:, 0] * both[:, 1]).sum(axis=1), 0, atol=1e-12)


def test_an_earlier_run_is_not_replaced_unasked(dressed, body):
    worn = clothsim.Body(body.positions, body.triangles, name="person")
    with pytest.raises(InputError):
        clothsim.dress(pattern_of(skirt()), worn, dressed.directory, size=SPACING)


def test_overlapping_panels_are_moved_apart(body):
    entries = skirt()
    entries["pattern"]["panels"]["front"]["translation"][2] = -DISTANCE  # in the plane of the back
    state = as_placed(mesh_pattern(pattern_of(entries), SPACING))
    surface = body_surface(body.positions, body.triangles)
    assert crossing_panels(state) == {"front", "back"}
    moved, description = separated(state, body, surface)
    assert count_penetrations(moved.positions, moved.triangles, surface).clean
    assert "mm" in description


def test_panels_inside_the_body_move_out(body):
    state = as_placed(mesh_pattern(pattern_of(skirt(distance=8)), SPACING))
    surface = body_surface(body.positions, body.triangles)
    moved, _ = separated(state, body, surface)
    assert not count_penetrations(state.positions, state.triangles, surface).clean
    assert count_penetrations(moved.positions, moved.triangles, surface).clean


def test_a_hood_whose_lower_edge_is_inside_the_shoulders_moves_upward(body):
    """Both halves beside the head, 4 cm from the middle, begin 12 cm below the top of the shoulders."""
    hood = [[-10, 0], [10, 0], [10, 45], [-10, 45]]
    sides = {
        f"{name}_hood": panel(hood, translation=[x, 128, 0], rotation=[0, 90, 0]) for name, x in (("l", 4), ("r", -4))
    }
    state = as_placed(mesh_pattern(pattern_of(specification(sides, [stitch(("l_hood", 1), ("r_hood", 1))])), SPACING))
    surface = body_surface(body.positions, body.triangles)
    moved, description = separated(state, body, surface)
    assert count_penetrations(moved.positions, moved.triangles, surface).clean
    way = moved.positions - state.positions
    assert np.abs(way[:, 0]).min() > 0.05
    assert way[:, 1].min() > 0.01
    assert "l_hood" in description


def test_a_panel_with_no_way_out_fails_by_name(body, tmp_path):
    entries = skirt()
    entries["pattern"]["panels"]["front"]["translation"] = [0, 110, 0]  # the trunk stands through it
    entries["pattern"]["panels"]["front"]["rotation"] = [90, 0, 0]
    worn = clothsim.Body(body.positions, body.triangles, name="person")
    done = clothsim.dress(pattern_of(entries), worn, tmp_path, size=SPACING)
    assert done.status == "failed"
    assert "front" in done.reason
    assert done.run is None


def test_the_reason_names_seams_that_strings_hold(dressed):
    assert end_of_drape(dressed.state, dressed.run, "person") == (dressed.status, dressed.reason)
    opened = dressed.placed
    _, reason = end_of_drape(opened, dressed.run, "person")
    assert f"{len(opened.welded)} of {len(opened.mesh.seams)}" in reason
    assert worst_gap(opened)[1] in reason


def test_placement_by_axes_and_origin(body):
    mesh = mesh_pattern(pattern_of(skirt()), SPACING)
    placed, _ = placed_on(mesh, body)
    assert np.allclose(placed.positions - mesh.positions, [0, body.positions[:, 1].min(), 0])
    turned = BodyMesh("z up", body.positions[:, [0, 2, 1]] * [1, -1, 1], body.triangles, 1.0, ())
    upright, _ = placed_on(mesh, turned)
    assert np.allclose(upright.positions[:, [0, 2, 1]] * [1, 1, -1], placed.positions)
    with pytest.raises(InputError):
        placed_on(mesh, body, origin="head")


def test_a_pattern_round_its_origin_is_lifted_to_the_waist(body):
    entries = skirt()
    for each in entries["pattern"]["panels"].values():
        each["translation"][1] -= 115
    placed, notes = placed_on(mesh_pattern(pattern_of(entries), SPACING), body)
    assert 0.75 < placed.positions[:, 1].min() < 0.9
    assert len(notes) == 1


def test_sleeves_turn_to_the_arms(body):
    mesh = mesh_pattern(pattern_of(shirt()), SPACING)
    turned, notes = turned_to_arms(mesh, body)
    assert len(notes) in (0, 2)
    for name, rows in mesh.vertices.items():
        lengths = [np.linalg.norm(np.diff(each.positions[rows], axis=0), axis=1) for each in (mesh, turned)]
        assert np.allclose(*lengths, atol=1e-12), name


def test_order_of_seams(body):
    surface = body_surface(body.positions, body.triangles)
    state = as_placed(mesh_pattern(pattern_of(shirt()), SPACING))
    assert {order_of(seam, state) for seam in state.mesh.seams} == {WITHIN}
    entries = shirt()
    entries["pattern"]["stitches"].append(stitch(("front", 0), ("left_sleeve_f", 1)))
    state = as_placed(mesh_pattern(pattern_of(entries), SPACING))
    assert order_of(state.mesh.seams[-1], state) == ONTO
    assert [len(turn.closing) for turn in sewing_phases(state, surface)] == [len(state.mesh.seams) - 1, 1]
    entries["pattern"]["panels"]["skirt"] = panel([[-25, -40], [25, -40], [25, 0], [-25, 0]], translation=[0, 80, 22])
    entries["pattern"]["stitches"].append(stitch(("back", 0), ("skirt", 2)))
    state = as_placed(mesh_pattern(pattern_of(entries), SPACING))
    assert order_of(state.mesh.seams[-1], state) == BELOW
    assert [len(turn.closing) for turn in sewing_phases(state, surface)] == [len(state.mesh.seams) - 2, 1, 1]
    assert [turn.hold for turn in sewing_phases(state, surface)] == [False, False, True]
    dart = panel([[0, 0], [4, 0], [5, 8], [6, 0], [10, 0], [10, 20], [0, 20]])
    state = as_placed(mesh_pattern(pattern_of(specification({"a": dart}, [stitch(("a", 1), ("a", 2))])), 0.02))
    assert order_of(state.mesh.seams[0], state) == DART


@pytest.mark.parametrize("upward", [1, 2], ids=["y up", "z up"])
def test_what_a_lower_edge_is_sewn_to_hangs_below_wherever_the_middles_lie(body, upward):
    """The quarter of a bodice, its middle 20 cm aside of that of its waistband and 17 cm above; a side of both."""
    panels = {
        "quarter": panel([[0, 0], [40, 0], [40, 20], [0, 20]], translation=[0, 94, 20]),
        "band": panel([[-40, 0], [40, 0], [40, 5], [-40, 5]], translation=[0, 84, 20]),
    }
    onto = [stitch(("quarter", 0), ("band", 2)), stitch(("quarter", 1), ("band", 1))]
    mesh = mesh_pattern(pattern_of(specification(panels, onto)), SPACING)
    if upward == 2:
        body = BodyMesh("z up", body.positions[:, [0, 2, 1]] * [1, -1, 1], body.triangles, 1.0, ())
    state = as_placed(placed_on(mesh, body)[0])
    assert [order_of(seam, state) for seam in state.mesh.seams] == [BELOW, WITHIN]


def test_panels_approach_the_body(body):
    surface = body_surface(body.positions, body.triangles)
    state = as_placed(placed_on(mesh_pattern(pattern_of(skirt(60)), SPACING), body)[0])
    nearer, _ = approached(state, body, surface)
    assert count_penetrations(nearer.positions, nearer.triangles, surface).clean
    moved = nearer.positions - state.positions
    rigid = [moved[rows] - moved[rows][0] for rows in state.mesh.vertices.values()]
    assert max(np.abs(rows).max() for rows in rigid) < 1e-15
    distance = surface.closest(nearer.positions).signed_distance
    assert min(distance[rows].min() for rows in state.mesh.vertices.values()) > 0
    for rows in state.mesh.vertices.values():
        assert 0.01 < distance[rows].min() < 0.03
    assert np.abs(moved).max() > 0.3


@pytest.mark.parametrize(("x", "y", "falls"), [(-10, 175, True), (40, 140, False)], ids=["over", "past"])
def test_half_a_collar_does_not_fall_past_the_shoulder(body, x, y, falls):
    panels = shirt()["pattern"]["panels"]
    half = panel([[0, 0], [20, 0], [20, 20], [0, 20]], translation=[x, y, 0], rotation=[-90, 0, 0])
    panels = {"front": panels["front"], "collar": half}
    state = as_placed(mesh_pattern(pattern_of(specification(panels, [stitch(("front", 3), ("collar", 0))])), SPACING))
    nearer, _ = approached(state, body, body_surface(body.positions, body.triangles))
    rows = state.mesh.vertices["collar"]
    lowered = np.unique((state.positions - nearer.positions)[rows, 1].round(9))
    assert len(lowered) == 1
    assert (lowered[0] > 0.05) == falls
    assert falls or lowered[0] == 0


def test_springs_through_the_body_wait_for_a_second_phase(body):
    surface = body_surface(body.positions, body.triangles)
    state = as_placed(placed_on(mesh_pattern(pattern_of(shirt()), SPACING), body)[0])
    first = sewing_phases(state, surface)[0]
    through = sum(count_crossing_body(state.positions[state.pairs(seam)], surface) for seam in first.closing)
    drawn = sum(len(first.drawn_pairs(state, seam, surface)) for seam in first.closing)
    assert through > 0
    assert first.is_partial(state, surface)
    every = sum(len(state.pairs(seam)) for seam in first.closing)
    assert drawn == every - through
    second = replace(first, patient=False)
    assert not second.is_partial(state, surface)
    assert sum(len(second.drawn_pairs(state, seam, surface)) for seam in first.closing) == every


def test_low_shoulders_are_lifted(body):
    surface = body_surface(body.positions, body.triangles)
    entries = shirt()
    for name in ("front", "back"):
        entries["pattern"]["panels"][name]["translation"][1] = 80
    state = as_placed(mesh_pattern(pattern_of(entries), SPACING))
    moved, note = lifted(state, body, surface)
    before, after = (
        sum(count_crossing_body(each.positions[each.pairs(seam)], surface) for seam in each.mesh.seams[:4])
        for each in (state, moved)
    )
    assert after < before
    assert note


def test_the_lift_is_chosen_by_parts_of_seams(body, monkeypatch):
    seen = []
    monkeypatch.setattr(corrections, "_best_lift", lambda through: seen.append(through) or 0)
    entries = shirt()
    entries["pattern"]["panels"]["front"]["translation"][1] = 80
    lifted(as_placed(mesh_pattern(pattern_of(entries), SPACING)), body, body_surface(body.positions, body.triangles))
    assert 0 < np.max(seen) <= 1


@pytest.mark.parametrize(("side", "best"), [((0, 2, 4, 4, 2, 0), 1), ((4, 2, 0, 0, 0, 0), 2), ((0, 0, 0, 0, 0, 0), 1)])
def test_a_side_seam_is_not_lifted_over_an_arm(side, best):
    """A shoulder seam whose three springs are free from the second lift on, beside a side seam."""
    through = np.column_stack([[3, 0, 0, 0, 0, 0], side]) / [3, 4]
    assert _best_lift(through) == best


@pytest.mark.parametrize("finer", [1, 10])
def test_a_short_shoulder_seam_counts_as_much_as_a_long_side(finer):
    """The shoulder is free from the second lift on, where more springs of the side run through the arm than it has."""
    through = finer * np.array([[4, 0], [4, 3], [0, 5], [0, 7]])
    assert _best_lift(through / [4 * finer, 22 * finer]) == 2
    assert _best_lift(through) == 0
