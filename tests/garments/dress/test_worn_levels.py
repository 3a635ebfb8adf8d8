"""Levels at which panels are worn: down the chest, gaps closed at seams, what hangs from the waist as it is drawn."""

import numpy as np
import pytest
from sewing_patterns import panel, specification, stitch

from clothsim.garments.dress.worn_levels import hanging_line, worn_levels
from clothsim.garments.inputs import BodyMesh
from clothsim.mesh.generators.table import GENERATORS
from clothsim.patterns.specification import pattern_of


@pytest.fixture(scope="module")
def body() -> BodyMesh:
    """The mannequin of the package, z upward."""
    return BodyMesh("mannequin", *GENERATORS["mannequin"](), 1.0, ())


def box(width: float, low: float, high: float, depth: float):
    """A panel from one height to another in front of the body, or behind it [cm]."""
    corners = [[-width, 0], [width, 0], [width, high - low], [-width, high - low]]
    return panel(corners, translation=[0, low, depth])


def dress(top: float, waist: float, gap: float):
    """A bodice and a skirt below it, whose panels are drawn with a gap between them [cm]."""
    panels = {}
    for side, depth in (("front", 20), ("back", -20)):
        panels[side] = box(25, waist, top, depth)
        panels[f"skirt_{side}"] = box(30, waist - gap - 40, waist - gap, depth)
    sewn = [stitch((side, 0), (f"skirt_{side}", 2)) for side in ("front", "back")]
    sewn += [stitch((f"{what}front", k), (f"{what}back", k)) for what in ("", "skirt_") for k in (1, 3)]
    return pattern_of(specification(panels, sewn))


@pytest.mark.parametrize("front", [True, False])
def test_cloth_from_the_shoulder_is_as_long_as_its_way_and_convex(body, front):
    depths, heights = hanging_line(body, front)
    assert depths[0] == 0
    drops = -np.diff(heights)
    assert np.all(drops > 0)
    slopes = np.sqrt(np.diff(depths) ** 2 - drops**2) / drops  # outward for each metre downward
    assert np.all(np.diff(slopes) < 1e-9)
    marks = body.parts.landmarks
    assert marks["armpit"] < heights[0] < marks["neck"]
    larger = BodyMesh("larger", 1.2 * body.positions, body.triangles, 1.0, ())
    other_depths, other_heights = hanging_line(larger, front)  # points on one line are corners or not by round-off
    at = np.linspace(0.0, depths[-1], 50)
    np.testing.assert_allclose(
        np.interp(1.2 * at, other_depths, other_heights), 1.2 * np.interp(at, depths, heights), rtol=1e-9
    )


def test_the_front_of_a_bodice_is_worn_higher_than_it_is_drawn(body):
    levels = worn_levels(dress(140, 95, 0), body, 0.0)
    shoulder = float(hanging_line(body, True)[1][0])
    assert levels["front"](np.array([1.40]))[0] == pytest.approx(shoulder)
    front, back = (float(levels[name](np.array([0.95]))[0]) for name in ("front", "back"))
    assert front > back > 0.95 + shoulder - 1.40
    below = levels["front"](np.array([0.5, 0.95]))
    assert np.diff(below)[0] == pytest.approx(0.45)  # it hangs straight below the chest


def test_gaps_between_panels_close_at_their_seams(body):
    apart, joined = (worn_levels(dress(140, 95, gap), body, 0.0) for gap in (8.0, 0.0))
    for side in ("front", "back"):
        waist = apart[side](np.array([0.95]))
        assert apart[f"skirt_{side}"](np.array([0.95 - 0.08])) == pytest.approx(waist)
        assert joined[f"skirt_{side}"](np.array([0.95])) == pytest.approx(waist)


def test_what_hangs_from_the_waist_is_worn_as_it_is_drawn(body):
    levels = worn_levels(dress(105, 100, 6.0), body, 0.0)
    heights = np.array([0.6, 0.9])
    assert np.allclose(levels["front"](heights), heights)
    assert np.allclose(levels["skirt_back"](heights), heights + 0.06)
    raised = worn_levels(dress(5, 0, 6.0), body, 1.0)
    assert np.allclose(raised["skirt_front"](heights), heights + 0.06)


def test_sleeves_and_collars_have_no_levels(body):
    panels = {"front": box(25, 95, 140, 20), "collar": box(8, 138, 145, 0), "left_sleeve": box(10, 120, 130, 5)}
    assert set(worn_levels(pattern_of(specification(panels)), body, 0.0)) == {"front"}
    assert worn_levels(pattern_of(specification({"collar": panels["collar"]})), body, 0.0) == {}
