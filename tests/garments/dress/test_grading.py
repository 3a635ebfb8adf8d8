"""Grading: patterns between bodies that are similar, wider or longer, against closed forms; named factors."""

import json
from dataclasses import replace

import numpy as np
import pytest
from sewing_patterns import panel, specification, stitch

import clothsim
from clothsim.base.errors import InputError
from clothsim.garments.dress.grading import NAMES, TOP_OF_RISE, graded, sewn_together, sizes_between
from clothsim.garments.dress.limbs import height_of_parting
from clothsim.garments.dress.placement import height_of_origin
from clothsim.garments.dress.worn_levels import DRAWN, WornLevels
from clothsim.garments.inputs import BodyMesh
from clothsim.garments.sewing_attempts import STAGES
from clothsim.garments.stages import PlannedStage
from clothsim.mesh.generators.table import GENERATORS
from clothsim.patterns.pattern import Pattern
from clothsim.patterns.specification import pattern_of, read_specification


def figure(name: str, **keys: float) -> BodyMesh:
    """The mannequin of the package, y upward."""
    positions, triangles = GENERATORS["mannequin"](**keys)
    return BodyMesh(name, positions[:, [0, 2, 1]] * [1, 1, -1], triangles, 1.0, ())


@pytest.fixture(scope="module")
def own() -> BodyMesh:
    """The body that patterns are cut for."""
    return figure("own")


@pytest.fixture(scope="module")
def wide() -> BodyMesh:
    """One whose trunk is thicker by a seventh, of the same height."""
    return figure("wide", chest=1.15, waist=1.15, hips=1.15)


def larger(body: BodyMesh, factor: float) -> BodyMesh:
    return BodyMesh("larger", factor * body.positions, body.triangles, 1.0, ())


def garment() -> Pattern:
    """A shirt with sleeves and a collar that lies flat, and trousers' front: every kind of panel."""
    torso = [[-25, 0], [25, 0], [25, 35], [22, 50], [8, 52], [-8, 52], [-22, 50], [-25, 35]]
    sleeve = [[0, 0], [25, 2], [25, 17], [0, 20]]
    panels = {"front": panel(torso, translation=[0, 85, 22]), "back": panel(torso, translation=[0, 85, -22])}
    panels["back"]["edges"][0]["curvature"] = {"type": "circle", "params": [80.0, 0, 1]}
    for side, x, turn in (("left", 28, -25), ("right", -28, 205)):
        panels[f"{side}_sleeve"] = panel(sleeve, translation=[x, 120, 10], rotation=[0, 0, turn])
    panels["pant_f_l"] = panel([[0, 0], [20, 0], [22, 70], [-2, 70]], translation=[2, 12, 20])
    panels["collar"] = panel([[-8, -4], [8, -4], [8, 4], [-8, 4]], translation=[0, 142, 0], rotation=[90, 0, 0])
    sewn = [stitch(("front", k), ("back", k), "right_wrong") for k in (1, 3, 5, 7)]
    sewn += [stitch(("front", 2), ("left_sleeve", 3)), stitch(("front", 6), ("right_sleeve", 3))]
    return pattern_of(specification(panels, sewn))


def test_one_body_to_itself_changes_nothing(own):
    pattern = garment()
    same = graded(pattern, own, own)
    for name, each in pattern.panels.items():
        assert np.allclose(same.pattern.panels[name].vertices, each.vertices, atol=1e-14), name
        assert np.allclose(same.pattern.panels[name].translation, each.translation, atol=1e-14), name
    assert list(same.factors) == list(NAMES)
    assert same.factors == pytest.approx(dict.fromkeys(NAMES, 1.0))
    assert same.mismatch[0] < 1e-12


def test_a_larger_body_of_one_shape_has_a_similar_pattern(own):
    pattern = garment()
    made = graded(pattern, own, larger(own, 1.15))
    assert made.factors == pytest.approx(dict.fromkeys(NAMES, 1.15), rel=1e-9)
    for name, each in pattern.panels.items():
        after = made.pattern.panels[name]
        assert np.allclose(np.ptp(after.vertices, axis=0), 1.15 * np.ptp(each.vertices, axis=0), rtol=1e-9), name
        for k in range(len(each.edges)):
            assert after.edge_length(k) == pytest.approx(1.15 * each.edge_length(k), rel=1e-8), (name, k)
        assert np.allclose(after.placed(after.vertices), 1.15 * each.placed(each.vertices), atol=1e-8), name


def test_a_wider_body_has_wider_panels_of_the_same_length(own, wide):
    pattern = replace(garment(), stitches=())
    worn = WornLevels({"front": lambda heights: heights + 0.07})
    made = graded(pattern, own, wide, worn=worn)
    sizes = sizes_between(own, wide, {})
    assert made.factors["waist"] > 1.1
    front, back = (made.pattern.panels[name] for name in ("front", "back"))
    height = np.array([0.85])
    for each, at in ((front, height + 0.07), (back, height)):
        assert np.ptp(each.vertices[:2, 0]) == pytest.approx(0.5 * sizes.trunk_girth(at)[0], rel=1e-9)
    length = sizes.height(np.array([1.35])) - sizes.height(height)
    assert front.vertices[3, 1] - front.vertices[0, 1] == pytest.approx(length[0], rel=1e-9)
    assert np.allclose(front.vertices[:2].sum(axis=0), 0, atol=1e-12)  # it stays in the middle
    assert made.moved < 1e-12


def test_a_pattern_from_the_waist_is_graded_as_one_from_the_floor(own, wide):
    pattern = garment()
    down = np.array([0.0, height_of_origin(own, "waist"), 0.0])
    from_waist = {name: replace(each, translation=each.translation - down) for name, each in pattern.panels.items()}
    made = [
        graded(each, own, wide, origin).pattern
        for each, origin in ((pattern, "floor"), (replace(pattern, panels=from_waist), "waist"))
    ]
    for name in pattern.panels:
        np.testing.assert_allclose(*(each.panels[name].vertices for each in made), atol=1e-12, err_msg=name)


def test_armholes_of_a_wider_body_get_one_factor(own, wide):
    made = graded(garment(), own, wide)
    assert made.before > 0.01
    for first, second in made.seams.values():
        assert first == pytest.approx(second, rel=1e-10)
    assert 0 < made.moved < 0.03


def test_pieces_are_the_panels_that_are_joined_by_stitches():
    pattern = garment()
    pieces = sewn_together(pattern, [name for name in pattern.panels if "sleeve" not in name])
    assert sorted(map(sorted, pieces)) == [["back", "front"], ["collar"], ["pant_f_l"]]


def test_both_sides_of_a_body_are_graded_alike(own, wide):
    made = graded(garment(), own, wide).pattern
    left, right = (made.panels[f"{side}_sleeve"] for side in ("left", "right"))
    lengths = [[each.edge_length(k) for k in range(4)] for each in (left, right)]
    assert np.allclose(lengths[0], lengths[1], rtol=1e-3)


def test_named_factors_replace_those_of_the_bodies(own):
    pattern = replace(garment(), stitches=())
    made = graded(pattern, own, own, factors={"chest": 1.1, "trunk_length": 0.9, "arm_length": 1.2})
    assert made.factors["chest"] == 1.1
    assert made.factors["hips"] == pytest.approx(1.0)
    front, before = made.pattern.panels["front"], pattern.panels["front"]
    low, high = np.ptp(front.vertices[:2, 0]), np.ptp(front.vertices[[2, 7], 0])
    below, above = low / np.ptp(before.vertices[:2, 0]), high / np.ptp(before.vertices[[2, 7], 0])
    assert 1.0 - 1e-9 < below < above < 1.1 + 1e-9
    assert np.ptp(front.vertices[:, 1]) == pytest.approx(0.9 * np.ptp(before.vertices[:, 1]), rel=1e-9)
    sleeve, old = made.pattern.panels["left_sleeve"], pattern.panels["left_sleeve"]
    assert np.ptp(sleeve.vertices[:, 0]) == pytest.approx(1.2 * np.ptp(old.vertices[:, 0]), rel=0.03)
    assert np.array_equal(made.pattern.panels["pant_f_l"].rotation, pattern.panels["pant_f_l"].rotation)


@pytest.mark.parametrize("factors", [{"bust": 1.0}, {"waist": 0.0}, {"waist": -1.0}, {"waist": "wide"}])
def test_factors_that_are_none(own, factors):
    with pytest.raises(InputError):
        graded(garment(), own, own, factors=factors)


def test_a_body_without_limbs_is_refused(own):
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.8)
    round_ = BodyMesh("ball", np.asarray(ball.vertices), np.asarray(ball.faces), 1.0, ())
    with pytest.raises(InputError):
        graded(garment(), own, round_)


def test_the_graded_pattern_is_sewn_and_written(own, wide, tmp_path, monkeypatch):
    """Stopped after the placement: the files are written all the same."""
    stopped = PlannedStage("separate", lambda task, done: done.failed("Stopped."))
    monkeypatch.setattr("clothsim.garments.sewing_attempts.STAGES", (STAGES[0], stopped))
    shelf = [[-22, -22], [22, -22], [22, 22], [-22, 22]]
    pattern = pattern_of(specification({"shelf": panel(shelf, translation=[0, 110, 0], rotation=[90, 0, 0])}))
    bodies = [clothsim.Body(each.positions, each.triangles, name=each.name) for each in (own, wide)]
    done = clothsim.dress(pattern, bodies[1], tmp_path, size=0.07, made_for=bodies[0], grade={"arm": 1.25})
    assert done.status == "failed"
    written = read_specification(tmp_path / "graded_specification.json")
    assert np.allclose(written.panels["shelf"].vertices, done.pattern.panels["shelf"].vertices, atol=1e-12)
    assert done.pattern.panels["shelf"].edge_length(0) > 1.1 * 0.44
    entries = json.loads((tmp_path / "summary.json").read_text())["grading"]
    assert entries["cut_for"] == "own"
    assert entries["factors"] == pytest.approx(dict(done.grading.factors))
    assert entries["factors"]["arm"] == 1.25
    as_cut = clothsim.dress(pattern, bodies[1], tmp_path, size=0.07, overwrite=True)
    assert as_cut.grading is None
    assert np.array_equal(as_cut.pattern.panels["shelf"].vertices, pattern.panels["shelf"].vertices)


def test_a_graded_pattern_that_cannot_be_sewn_is_not_taken_for_the_file(own, wide, tmp_path, monkeypatch):
    """Without grading the same error is that of the pattern; a size is refused before anything is sewn."""

    def crossing(*_):
        raise InputError("Panel front crosses itself.", "Move a vertex.")

    monkeypatch.setattr("clothsim.garments.dressed.sewn_at", crossing)
    monkeypatch.setattr("clothsim.garments.dressed.worn_levels", lambda *_: DRAWN)
    bodies = [clothsim.Body(each.positions, each.triangles, name=each.name) for each in (own, wide)]
    with pytest.raises(InputError) as graded_error:
        clothsim.dress(garment(), bodies[1], tmp_path / "graded", made_for=bodies[0])
    with pytest.raises(InputError) as as_cut:
        clothsim.dress(garment(), bodies[1], tmp_path / "cut")
    assert as_cut.value.sentence == "Panel front crosses itself."
    assert as_cut.value.sentence in graded_error.value.sentence
    assert "wide" in graded_error.value.sentence
    assert "--made-for" in graded_error.value.remedy
    monkeypatch.setattr("clothsim.garments.dressed.worn_levels", None)
    with pytest.raises(InputError, match="size"):
        clothsim.dress(garment(), bodies[1], tmp_path / "size", size=-0.1, made_for=bodies[0])


def touching(body: BodyMesh, level: float) -> BodyMesh:
    """One whose thighs touch from the crotch down to a level, as a fraction of the crotch's height."""
    positions, crotch = body.positions.copy(), body.parts.landmarks["crotch"]
    height, aside = positions[:, 1] / crotch, np.abs(positions[:, 0])
    inner = (level < height) & (height < 1.0) & (aside < 0.06)
    positions[inner, 0] = np.sign(positions[inner, 0]) * 1e-3
    return BodyMesh("touching", positions, body.triangles, 1.0, ())


def trousers(crotch: float) -> Pattern:
    """Trousers of four panels with their crotch at a height [cm], and a gore of a skirt that is labelled as a leg."""
    left = [[2, -40], [25, -40], [25, 25], [6, 25], [6, 6], [1, 0]]
    right = [[-x, y] for x, y in left[::-1]]
    panels = {
        f"pant_{part}_{side}": panel(outline, translation=[0, crotch, z])
        for part, z in (("f", 20), ("b", -20))
        for side, outline in (("l", left), ("r", right))
    }
    panels["gore"] = panel([[0, -20], [30, -20], [20, 25], [0, 25]], translation=[0, crotch, 30], label="leg")
    sides = (("l", 1), ("l", 5), ("r", 3), ("r", 5))
    sewn = [stitch((f"pant_f_{side}", k), (f"pant_b_{side}", k), "right_wrong") for side, k in sides]
    return pattern_of(specification(panels, sewn))


def test_the_crotch_seam_grows_as_the_line_round_the_body(own):
    """A deeper body has a longer line from top to top of trousers between its legs; its trunk is as long as before."""
    deep = BodyMesh("deep", own.positions * [1.0, 1.0, 1.2], own.triangles, 1.0, ())
    sizes = sizes_between(own, deep, {})
    lines = []
    for each in (own, deep):
        trunk, marks = each.parts.trunk, each.parts.landmarks
        heights = np.linspace(trunk.levels[0], marks["crotch"] + TOP_OF_RISE * (marks["armpit"] - marks["crotch"]), 50)
        sides = [trunk.at(heights, trunk.centres)[:, 2] + k * trunk.at(heights, trunk.extents)[:, 1] for k in (1, -1)]
        down = sum(np.hypot(np.diff(heights), np.diff(side)).sum() for side in sides)
        lines.append((down + 2 * (heights[0] - height_of_parting(each)), sides[0][0] - sides[1][0]))
    (down, depth), (other_down, other_depth) = lines
    grown = sizes.named["rise"] * down + sizes.factors.trunk[0] * depth
    assert grown == pytest.approx(other_down + other_depth, rel=1e-3)
    assert sizes.named["rise"] > sizes.named["trunk_length"] + 0.01


def test_trousers_over_trousers_are_graded_by_the_bare_body(own):
    """Those below fill the room between the thighs down to the knees."""
    other = touching(own, 0.9)
    between = own.positions * [0.02, 0.35, 0.02] + [0.0, 0.1, 0.0]
    both = np.concatenate([other.positions, between])
    joined = np.concatenate([other.triangles, other.triangles + len(other.positions)])
    dressed = BodyMesh("dressed", both, joined, 1.0, (), other)
    pattern = trousers(100 * height_of_parting(own))
    assert height_of_parting(dressed) != height_of_parting(other)
    assert graded(pattern, own, dressed).factors == graded(pattern, own, other).factors
    assert graded(pattern, dressed, own).factors == graded(pattern, other, own).factors


def test_trousers_end_where_the_thighs_part(own):
    other = touching(own, 0.9)
    crotch = own.parts.landmarks["crotch"]
    assert 0.95 * crotch < height_of_parting(own) <= crotch
    assert 0.86 * crotch < height_of_parting(other) < 0.9 * crotch
    pattern = trousers(100 * height_of_parting(own))
    made = graded(pattern, own, other)
    assert made.factors["rise"] > 1.2
    for name, each in pattern.panels.items():
        after, before = (one.placed(one.vertices)[:, 1] for one in (made.pattern.panels[name], each))
        if name == "gore":
            assert np.allclose(after, before, atol=2e-3)
            continue
        point = np.abs(each.vertices[:, 0]).argmin()
        assert after[point] == pytest.approx(height_of_parting(other), abs=2e-3)
        assert after.max() == pytest.approx(before.max(), abs=0.02)
        assert after.min() / before.min() == pytest.approx(height_of_parting(other) / height_of_parting(own), rel=0.01)
    assert any("thighs" in note for note in made.notes)
    assert made.crotch == pytest.approx(height_of_parting(other))
    assert graded(pattern, own, own).crotch == np.inf
