"""Graded panels: curves under maps of their plane against points of the mapped curve, and seams that change alike."""

from dataclasses import replace

import numpy as np
import pytest
from sewing_patterns import panel, specification, stitch

from clothsim.patterns.curves import Arc, Bezier, Straight
from clothsim.patterns.graded import PlaneMap, factors_of_seams, seams_alike, with_seams_alike
from clothsim.patterns.specification import pattern_of

SHARE = np.linspace(0, 1, 9)
CURVES = [
    {"type": "quadratic", "params": [[0.4, 0.3]]},
    {"type": "cubic", "params": [[0.2, -0.2], [0.9, 0.3]]},
    *({"type": "circle", "params": [12.0, large, right]} for large in (0, 1) for right in (0, 1)),
]


def stretch(girth: float, length: float, along=(0.0, 1.0), origin=(0.03, -0.02)) -> PlaneMap:
    """A map with one factor of girth and one of length."""
    return PlaneMap(
        np.array(origin),
        np.array(along) / np.linalg.norm(along),
        lambda t: np.full(len(t), girth),
        lambda t: length * t,
    )


def one_panel(curve=None):
    """A panel of 10 x 20 cm whose right edge is a curve."""
    entries = panel()
    if curve is not None:
        entries["edges"][1]["curvature"] = curve
    return pattern_of(specification({"a": entries})).panels["a"]


def test_a_map_of_factors_one_changes_nothing():
    for curve in (None, *CURVES):
        before = one_panel(curve)
        after = stretch(1.0, 1.0, along=(0.6, 0.8)).panel(before)
        assert np.allclose(after.vertices, before.vertices, atol=1e-16)
        for number in range(4):
            points = [each.edge_points(number, SHARE) for each in (before, after)]
            assert np.allclose(*points, atol=1e-15)


@pytest.mark.parametrize("curve", CURVES, ids=str)
def test_a_similarity_maps_every_curve_exactly(curve):
    before, image = one_panel(curve), stretch(1.3, 1.3, along=(0.6, 0.8))
    after = image.panel(before)
    assert np.allclose(after.edge_points(1, SHARE), image(before.edge_points(1, SHARE)), atol=1e-14)
    assert after.edge_length(1) == pytest.approx(1.3 * before.edge_length(1), rel=1e-12)


@pytest.mark.parametrize("curve", CURVES[:2], ids=str)
def test_an_affine_map_of_a_bezier_curve_is_exact(curve):
    before, image = one_panel(curve), stretch(1.2, 0.9, along=(0.28, 0.96))
    after = image.panel(before)
    ends = [each.vertices[[each.edges[1].start, each.edges[1].end]] for each in (before, after)]
    curves = [each.edges[1].curve for each in (before, after)]
    points = [curve.at(*two, SHARE) for curve, two in zip(curves, ends, strict=True)]
    assert all(isinstance(each, Bezier) for each in curves)
    assert np.allclose(image(points[0]), points[1], atol=1e-15)


@pytest.mark.parametrize("curve", CURVES[2:], ids=str)
def test_an_arc_stays_an_arc_through_the_image_of_its_middle(curve):
    before, image = one_panel(curve), stretch(1.2, 0.9)
    after = image.panel(before)
    arc = after.edges[1].curve
    assert isinstance(arc, Arc)
    assert (arc.right, arc.large) == (before.edges[1].curve.right, before.edges[1].curve.large)
    middle = np.array([0.5])
    assert np.allclose(after.edge_points(1, middle), image(before.edge_points(1, middle)), atol=1e-15)


def test_a_girth_that_changes_along_the_panel():
    """Girth 1 + t at the height t: a straight side becomes oblique, its length by Pythagoras."""
    before = one_panel()
    image = PlaneMap(np.zeros(2), np.array([0.0, 1.0]), lambda t: 1 + t, lambda t: 2 * t)
    after = image.panel(before)
    assert np.allclose(after.vertices, [[0, 0], [0.1, 0], [0.12, 0.4], [0, 0.4]])
    assert after.edge_length(1) == pytest.approx(np.hypot(0.02, 0.4))
    assert isinstance(after.edges[1].curve, Straight)


def uneven(seed: int):
    """Two panels with three seams, one with ease and one of two curves, and its grading by other factors each."""
    rng = np.random.default_rng(seed)
    first, second = panel(), panel([[0, 0], [12, 0], [11, 21], [1, 20]])
    first["edges"][1]["curvature"], second["edges"][3]["curvature"] = CURVES[seed % 6], CURVES[(seed + 1) % 6]
    sewn = [stitch(("a", 1), ("b", 3)), stitch(("a", 3), ("b", 1)), stitch(("a", 2), ("b", 2))]
    pattern = pattern_of(specification({"a": first, "b": second}, sewn))
    maps = [stretch(*rng.uniform(0.8, 1.25, 2), along=rng.standard_normal(2)) for _ in range(2)]
    panels = {name: image.panel(pattern.panels[name]) for name, image in zip("ab", maps, strict=True)}
    return pattern, pattern_of_panels(pattern, panels)


def pattern_of_panels(pattern, panels):
    from dataclasses import replace

    return replace(pattern, panels=panels)


@pytest.mark.parametrize("seed", range(8))
def test_both_sides_of_every_seam_get_one_factor(seed):
    pattern, scaled = uneven(seed)
    before = [abs(first - second) for first, second in factors_of_seams(scaled, pattern).values()]
    alike = with_seams_alike(scaled, pattern)
    factors = factors_of_seams(alike, pattern)
    assert max(before) > 0.01
    for name, (first, second) in factors.items():
        assert first == pytest.approx(second, rel=1e-10), name
    ease = [each.panels["a"].edge_length(2) / each.panels["b"].edge_length(2) for each in (pattern, alike)]
    assert ease[0] == pytest.approx(ease[1], rel=1e-10)
    moved = max(np.abs(alike.panels[n].vertices - scaled.panels[n].vertices).max() for n in "ab")
    assert moved < 0.2 * 0.3
    found = seams_alike(scaled, pattern)
    assert (found.factors, found.before, found.moved) == (factors, max(before), moved)


def test_seams_that_are_alike_stay_where_they_are():
    pattern, _ = uneven(0)
    image = stretch(1.1, 1.1)
    scaled = pattern_of_panels(pattern, {name: image.panel(each) for name, each in pattern.panels.items()})
    alike = with_seams_alike(scaled, pattern)
    for name in "ab":
        assert np.allclose(alike.panels[name].vertices, scaled.panels[name].vertices, atol=1e-13)


def test_a_pattern_without_seams():
    pattern = pattern_of(specification({"a": panel()}))
    assert np.array_equal(with_seams_alike(pattern, pattern).panels["a"].vertices, pattern.panels["a"].vertices)


def test_the_mouth_of_a_narrow_dart_stays_open():
    """Both halves of the upper edge, beside a dart of 3 mm, change by the factors of what they are sewn to."""
    front = panel([[0, 0], [40, 0], [40, 30], [20.15, 30], [20, 18], [19.85, 30], [0, 30]])
    bands = {name: panel([[0, 0], [19.85, 0], [19.85, 4], [0, 4]]) for name in ("left", "right")}
    sewn = [stitch(("front", 2), ("left", 0)), stitch(("front", 3), ("front", 4)), stitch(("front", 5), ("right", 0))]
    original = pattern_of(specification({"front": front, **bands}, sewn))
    wider = {name: stretch(1.2, 1.0).panel(original.panels[name]) for name in bands}
    after = with_seams_alike(replace(original, panels={**original.panels, **wider}), original)
    corners = after.panels["front"].vertices
    assert corners[3, 0] - corners[5, 0] == pytest.approx(0.003, abs=0.0015)
    assert [first for first, _ in factors_of_seams(after, original).values()] == pytest.approx(
        [second for _, second in factors_of_seams(after, original).values()], rel=1e-9
    )


@pytest.mark.parametrize(("bend", "kind"), [(6.0, Bezier), (0.02, Straight)])
def test_a_straight_side_follows_a_waist_between_its_ends(bend, kind):
    """Girth 1 - bend t (0.2 - t) at the height t: a side of 20 cm is drawn in by 6 % at most, or stays."""
    before = one_panel()
    image = PlaneMap(np.zeros(2), np.array([0.0, 1.0]), lambda t: 1 - bend * t * (0.2 - t), lambda t: t)
    after = image.panel(before)
    side = after.edges[1].curve
    assert isinstance(side, kind)
    ends = after.vertices[[after.edges[1].start, after.edges[1].end]]
    points = side.at(*ends, SHARE)
    expected = image(np.column_stack([np.full(9, before.vertices[1, 0]), points[:, 1]]))
    assert np.allclose(points, expected, atol=1e-4)
    assert all(isinstance(after.edges[k].curve, Straight) for k in (0, 2))  # across: one girth along each
