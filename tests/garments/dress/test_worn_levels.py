"""Heights at which panels are worn: cloth over an outline in closed form, the lift of what hangs from the shoulders."""

import numpy as np
import pytest
from sewing_patterns import panel, specification, stitch

from clothsim.garments.dress.grading import LIFT, sewn_together, worn_levels
from clothsim.garments.inputs import BodyMesh
from clothsim.mesh.generators.table import GENERATORS
from clothsim.patterns.specification import pattern_of
from transfer import body_parts
from transfer.body_parts import length_over

TURN = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
SIDE_OF_NECK = 0.05
HEIGHTS = np.linspace(1.0, 0.2, 33)


@pytest.fixture(scope="module")
def body() -> BodyMesh:
    """The mannequin of the package, z upward."""
    return BodyMesh("mannequin", *GENERATORS["mannequin"](), 1.0, ())


def hanging_line(body):
    return body_parts.hanging_line(body.positions, body.triangles, body.parts)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("hollow", [False, True])
def test_cloth_over_a_wedge_is_as_long_as_its_side_and_hangs_straight_below(sign, hollow):
    """The outline goes 0.3 m outward on 0.4 m downward, straight or through a hollow, and back."""
    points = np.array([[1.0, 0.0], [0.8, 0.05 if hollow else 0.15], [0.6, 0.3], [0.2, 0.0]]) * [1.0, sign]
    other_side = np.array([[[1.0, -sign], [0.2, -sign]]])
    outline = np.concatenate([np.stack([points[:-1], points[1:]], axis=1), other_side])
    lengths = length_over(HEIGHTS, 0.0, sign, outline)
    expected = np.where(HEIGHTS > 0.6, (1.0 - HEIGHTS) * 1.25, 0.5 + 0.6 - HEIGHTS)
    np.testing.assert_allclose(lengths, expected, atol=1e-12)


def test_cloth_over_a_body_is_longer_than_its_way_down_and_follows_the_body(body):
    lengths, heights = hanging_line(body)
    marks = body.parts.landmarks
    assert lengths[0] == 0
    assert marks["armpit"] < heights[0] < marks["neck"]
    local = body.parts.frame.local(body.positions)
    aside = np.abs(np.abs(local[:, 0]) / body.height - SIDE_OF_NECK) < 0.005
    shoulder = local[aside & (local[:, 1] < marks["neck"]), 1].max()
    assert heights[0] == pytest.approx(shoulder, abs=0.015)
    assert heights[-1] == pytest.approx(marks["crotch"])
    slopes = np.diff(lengths) / -np.diff(heights)
    assert np.all(slopes > 1 - 1e-12)
    assert slopes[0] > 1.2
    assert slopes[-1] == pytest.approx(1.0)
    for scale, points in (
        (1.2, 1.2 * body.positions),
        (1.0, body.positions @ TURN.T + [3.0, -2.0, 0.0]),
        (1.0, body.positions[:, [0, 2, 1]] * [1, 1, -1]),
    ):
        other = hanging_line(BodyMesh("other", points, body.triangles, 1.0, ()))
        np.testing.assert_allclose(other, [scale * lengths, scale * heights], atol=2e-3)


def test_a_body_without_shoulders_beside_its_neck_lets_cloth_hang_straight(body):
    local = body.parts.frame.local(body.positions)
    narrow = body.triangles[(np.abs(local[body.triangles, 0]) < 0.04 * body.height).all(axis=1)]
    lengths, heights = body_parts.hanging_line(body.positions, narrow, body.parts)
    assert heights[0] == pytest.approx(body.parts.landmarks["neck"])
    np.testing.assert_allclose(lengths, heights[0] - heights, atol=1e-12)


def box(width: float, low: float, high: float, depth: float):
    """A panel from one height to another in front of the body, or behind it [cm]."""
    corners = [[-width, 0], [width, 0], [width, high - low], [-width, high - low]]
    return panel(corners, translation=[0, low, depth])


def bodice(top: float, floor: float = 0.0):
    """Front and back from the height of the waist to another one, above a floor [cm]."""
    panels = {side: box(25, 95 - floor, top - floor, depth) for side, depth in (("front", 20), ("back", -20))}
    return pattern_of(specification(panels, [stitch(("front", k), ("back", k)) for k in (1, 3)]))


def levels_at(pattern, body, drawn, floor=0.0):
    """Heights at which front and back are worn of one at which they are drawn [m]."""
    worn = worn_levels(pattern, body, floor)
    return [float(worn[name](np.array([drawn]))[0]) for name in ("front", "back")]


def test_a_bodice_is_worn_higher_than_it_is_drawn_alike_in_front_and_behind(body):
    lengths, heights = hanging_line(body)
    shoulder = heights[0]
    top = 100 * shoulder - 3.0
    assert levels_at(bodice(top), body, shoulder - 0.03) == pytest.approx([shoulder] * 2)
    front, back = levels_at(bodice(top), body, 0.95)
    assert front == back
    assert shoulder - 0.03 - 0.95 == pytest.approx(np.interp(-front, -heights, lengths), abs=1e-6)
    assert front > 0.95 + 0.03 + 0.02
    assert np.diff([levels_at(bodice(top), body, drawn)[0] for drawn in (0.5, 0.6)])[0] == pytest.approx(0.1)
    assert levels_at(bodice(top, 100.0), body, 0.95, 1.0) == pytest.approx([front] * 2)  # y = 0 is at the waist


def test_the_lift_changes_gradually_and_ends_at_a_strapless_bodice(body):
    heights = hanging_line(body)[1]
    lift = LIFT * body.height
    tops = heights[0] + np.linspace(0.05, -4.5 * lift, 60)
    worn = [levels_at(bodice(100 * top), body, top)[0] - top for top in tops]
    below = heights[0] - tops
    np.testing.assert_allclose(worn, np.interp(below, [0.0, lift, 3 * lift], [0.0, lift, 0.0]), atol=1e-9)
    waists = np.array([levels_at(bodice(100 * top), body, 0.95)[0] for top in tops])
    assert np.abs(np.diff(waists)).max() < 0.02  # no jump, however the top changes by a millimetre


def test_what_hangs_from_the_waist_is_worn_where_it_is_drawn(body):
    assert levels_at(bodice(105.0), body, 0.96) == pytest.approx([0.96] * 2, abs=2e-3)


def test_garments_of_one_file_hang_from_their_own_tops(body):
    panels = {"front": box(25, 95, 140, 20), "back": box(25, 95, 140, -20), "skirt": box(25, 60, 104, 20)}
    pattern = pattern_of(specification(panels, [stitch(("front", 1), ("back", 1))]))
    assert sorted(map(sorted, sewn_together(pattern, pattern.panels))) == [["back", "front"], ["skirt"]]
    worn = worn_levels(pattern, body, 0.0)
    assert worn["skirt"](np.array([0.8]))[0] == pytest.approx(0.8, abs=2e-3)
    assert worn["front"](np.array([0.8]))[0] > 0.83


def test_sleeves_and_collars_are_worn_as_they_are_drawn(body):
    panels = {"front": box(25, 95, 140, 20), "collar": box(8, 138, 145, 0), "left_sleeve": box(10, 120, 130, 5)}
    heights = np.array([1.0, 1.2])
    worn = worn_levels(pattern_of(specification(panels)), body, 0.0)
    assert {name for name, levels in worn.items() if np.array_equal(levels(heights), heights)} == {
        "collar",
        "left_sleeve",
    }
    kept = worn_levels(pattern_of(specification(panels)), body, 0.0, ["front"])
    assert all(np.array_equal(levels(heights), heights) for levels in kept.values())
