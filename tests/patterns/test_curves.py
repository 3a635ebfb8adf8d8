"""Curves of pattern edges: closed forms, and svgpathtools where it is installed."""

import numpy as np
import pytest
from real_data import DATA, needs_data
from sewing_patterns import PATTERN_FILES

from clothsim.patterns.curves import Arc, Bezier, Straight
from clothsim.patterns.specification import read_specification

START, END = np.array([0.2, -0.1]), np.array([1.1, 0.5])
CHORD = float(np.linalg.norm(END - START))
CURVES = [
    Straight(),
    Bezier(((0.3, 0.4),)),
    Bezier(((0.2, -0.5), (0.9, 0.6))),
    *(Arc(1.3 * CHORD, large, right) for large in (False, True) for right in (False, True)),
]


@pytest.mark.parametrize("curve", CURVES, ids=str)
def test_samples_by_length_are_equally_long_and_end_at_the_ends(curve):
    points = curve.by_length(START, END, np.linspace(0, 1, 4001))
    assert np.array_equal(points[0], START)
    assert np.array_equal(points[-1], END)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert np.abs(np.cumsum(steps) / steps.sum() - np.linspace(0, 1, 4001)[1:]).max() < 5e-6
    assert abs(steps.sum() / curve.length(START, END) - 1) < 1e-6


def test_quadratic_is_the_polynomial_of_its_control_point():
    curve, t = CURVES[1], np.linspace(0, 1, 7)
    control = START + 0.3 * (END - START) + 0.4 * np.array([-(END - START)[1], (END - START)[0]])
    expected = np.outer((1 - t) ** 2, START) + np.outer(2 * t * (1 - t), control) + np.outer(t**2, END)
    assert np.abs(curve.at(START, END, t) - expected).max() < 1e-15


@pytest.mark.parametrize(("large", "right"), [(a, b) for a in (False, True) for b in (False, True)])
def test_arc_lies_on_its_circle_on_the_side_that_it_names(large, right):
    radius = 0.7 * CHORD
    curve = Arc(radius, large, right)
    centre, found, sweep = curve.circle(START, END)
    points = curve.at(START, END, np.linspace(0, 1, 9))
    assert np.abs(np.linalg.norm(points - centre, axis=1) - radius).max() < 1e-14
    assert found == radius
    assert (abs(sweep) > np.pi) is large
    middle, chord = points[4] - (START + END) / 2, END - START
    assert bool(chord[0] * middle[1] - chord[1] * middle[0] < 0) is right


def test_arc_of_too_small_a_radius_is_a_half_circle():
    curve = Arc(0.1 * CHORD, False, True)
    assert np.isclose(curve.length(START, END), np.pi * CHORD / 2, rtol=1e-12)


@pytest.mark.parametrize("radius", [1e3, 1e6, 1e9, 1e300])
def test_a_flat_arc_keeps_its_digits(radius):
    """Sagitta h^2 / 2 R of half the chord h, on the side that the arc names."""
    point = Arc(radius, False, True).at(START, END, np.array([0.5]))[0]
    across = np.array([(END - START)[1], -(END - START)[0]]) / CHORD
    assert (
        abs((point - (START + END) / 2) @ across - CHORD**2 / 8 / radius) < 1e-15 + 0.1 * CHORD * (CHORD / radius) ** 3
    )


def test_against_svgpathtools():
    svg = pytest.importorskip("svgpathtools")
    a, b = complex(*START), complex(*END)
    for curve in CURVES[1:]:
        if isinstance(curve, Bezier):
            made = [complex(*point) for point in curve.points(START, END)]
            other = (svg.QuadraticBezier if len(made) == 3 else svg.CubicBezier)(*made)
        else:
            other = svg.Arc(a, complex(curve.radius, curve.radius), 0, curve.large, curve.right, b)
        assert abs(other.length(error=1e-9) / curve.length(START, END) - 1) < 1e-6
        t = np.linspace(0, 1, 11)
        theirs = np.array([[other.point(s).real, other.point(s).imag] for s in t])
        assert np.abs(curve.at(START, END, t) - theirs).max() < 1e-7 * CHORD


@needs_data
@pytest.mark.parametrize("name", PATTERN_FILES)
def test_curves_of_real_patterns_against_svgpathtools(name):
    """P-1: samples lie on the curve (1e-12 of a Bezier, 1e-7 of the chord of an arc), lengths agree to 1e-6."""
    svg = pytest.importorskip("svgpathtools")
    share = np.array([0.0, 0.13, 0.5, 0.81, 1.0])
    for piece in read_specification(DATA / "patterns" / name).panels.values():
        for number, edge in enumerate(piece.edges):
            start, end = piece.vertices[edge.start], piece.vertices[edge.end]
            samples, a, b = piece.edge_points(number, share) @ [1, 1j], start @ [1, 1j], end @ [1, 1j]
            if isinstance(edge.curve, Bezier):
                made = edge.curve.points(start, end) @ [1, 1j]
                other = (svg.QuadraticBezier if len(made) == 3 else svg.CubicBezier)(*made)
                assert max(distance(other.poly(), sample) for sample in samples) < 1e-12
            elif isinstance(edge.curve, Arc):
                r = max(edge.curve.radius, abs(b - a) / 2)
                other = svg.Arc(a, complex(r, r), 0, edge.curve.large, edge.curve.right, b)
                assert np.abs(np.abs(samples - other.center) - other.radius.real).max() < 1e-7 * abs(b - a)
                assert np.abs(samples - [other.point(t) for t in share]).max() < 1e-7 * abs(b - a)
            else:
                continue
            assert abs(other.length(error=1e-8) / piece.edge_length(number) - 1) < 1e-6


def distance(curve: np.poly1d, point: complex) -> float:
    """Least distance of a point to a plane curve x + i y of t in [0, 1]: the roots of the derivative of its square."""
    x, y = np.poly1d(curve.coeffs.real) - point.real, np.poly1d(curve.coeffs.imag) - point.imag
    slope = x * x.deriv() + y * y.deriv()
    roots = slope.roots
    t = np.concatenate([[0, 1], np.clip(roots[np.abs(roots.imag) < 1e-4].real, 0, 1)])
    for _ in range(3):  # a root of an almost double root has half of its digits
        second = slope.deriv()(t)
        t = np.clip(t - np.where(second > 0, slope(t) / np.where(second > 0, second, 1), 0), 0, 1)
    return float(np.hypot(x(t), y(t)).min())
