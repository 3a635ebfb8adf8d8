"""Exact intersection test on cases made by hand, and against the rational oracle on degenerate lattice points."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from meshes import random_rotation
from rational import intersect

from clothsim.base.jit import kernel
from clothsim.geometry.intersection import triangle_pair
from clothsim.geometry.intersection.predicates import scaled

triangles_intersect = kernel(triangle_pair.triangles_intersect)  # compiled, as in use

T = [(0, 0, 0), (4, 0, 0), (0, 4, 0)]
FREE = {
    "in one plane, overlapping": ([(1, 1, 0), (5, 1, 0), (1, 5, 0)], True),
    "in one plane, one inside the other": ([(1, 1, 0), (2, 1, 0), (1, 2, 0)], True),
    "in one plane, the other inside": ([(-9, -9, 0), (30, -9, 0), (-9, 30, 0)], True),
    "in one plane, the same places": (T, True),
    "in one plane, touching along an edge": ([(1, 0, 0), (3, 0, 0), (2, -3, 0)], True),
    "in one plane, touching at a corner": ([(4, 0, 0), (6, 0, 0), (6, 1, 0)], True),
    "in one plane, corner on edge": ([(2, 2, 0), (6, 2, 0), (6, 6, 0)], True),
    "in one plane, apart": ([(3, 3, 0), (6, 3, 0), (6, 6, 0)], False),
    "in one plane, on one line of an edge, apart": ([(5, 0, 0), (7, 0, 0), (6, -2, 0)], False),
    "parallel": ([(0, 0, 1), (4, 0, 1), (0, 4, 1)], False),
    "point in face": ([(1, 1, 0), (1, 1, 3), (2, 1, 3)], True),
    "point on edge": ([(2, 0, 0), (2, -1, 3), (3, -1, 3)], True),
    "point on vertex": ([(0, 0, 0), (-2, -1, 3), (-3, -1, 3)], True),
    "edge through edge": ([(2, -1, -1), (2, 1, 1), (2, -5, 5)], True),
    "edge along edge": ([(1, 0, 0), (3, 0, 0), (2, -1, 1)], True),
    "edge in plane, beside": ([(3, 3, 0), (5, 1, 0), (4, 2, 5)], False),
    "through": ([(1, 1, -1), (1, 1, 1), (9, 9, 0)], True),
    "passing by": ([(3, 3, -1), (3, 3, 1), (9, 9, 0)], False),
    "segment through": ([(1, 1, -1), (1, 1, 1), (1, 1, 0)], True),
    "segment that ends on the face": ([(1, 1, 2), (1, 1, 1), (1, 1, 0)], True),
    "segment beside": ([(3, 3, -1), (3, 3, 1), (3, 3, 0)], False),
    "segment in the plane, inside": ([(1, 1, 0), (2, 1, 0), (1, 1, 0)], True),
    "segment in the plane, beside": ([(4, 1, 0), (1, 4, 0), (4, 1, 0)], False),
    "point inside": ([(1, 1, 0)] * 3, True),
    "point on the edge": ([(2, 2, 0)] * 3, True),
    "point beside, in the plane": ([(3, 3, 0)] * 3, False),
    "point above": ([(1, 1, 1)] * 3, False),
}
"""Corners of a second triangle without a common vertex."""

CORNER = {
    "a fan, flat": ([(-4, 0, 0), (0, -4, 0)], False),
    "a fan, touching along an edge's line": ([(0, 5, 0), (-4, 0, 0)], True),
    "over each other in one plane": ([(3, 1, 0), (1, 3, 0)], True),
    "the same places": ([(4, 0, 0), (0, 4, 0)], True),
    "upright, away": ([(-1, -1, 3), (-1, -1, -3)], False),
    "upright, through": ([(1, 1, 3), (1, 1, -3)], True),
    "far edge through": ([(3, 3, 1), (-1, -1, -1)], True),
    "upright, its edge in the face": ([(1, 1, 0), (1, 1, 3)], True),
    "upright, its edge on the other's": ([(9, 0, 0), (2, -1, 3)], True),
    "a segment away": ([(-1, -1, 0), (-2, -2, 0)], False),
    "a segment into the face": ([(1, 1, 0), (2, 2, 0)], True),
    "a segment through the corner, away": ([(-1, 1, 1), (1, -1, -1)], False),
    "a segment through the corner, in": ([(-1, -1, 0), (1, 1, 0)], True),
    "a point": ([(0, 0, 0), (0, 0, 0)], False),
    "a segment from the corner's place": ([(0, 0, 0), (0, 0, 2)], False),
    "a segment in the plane from the corner's place": ([(0, 0, 0), (1, 1, 0)], True),
}
"""Corners of a second triangle beside the common one, T[0]."""

EDGE = {
    "flat": ((0, -4, 0), False),
    "at a right angle": ((0, 0, 4), False),
    "folded sharply": ((0, 4, 2.0**-30), False),
    "folded onto the other": ((0, 4, 0), True),
    "folded onto the other, larger": ((9, 1, 0), True),
    "without area": ((2, 0, 0), False),
    "without area, beyond": ((9, 0, 0), False),
}
"""Third corner of a second triangle beside the common edge, T[0] T[1]."""


def poses(points):
    """The points as they are, far away, tiny, mirrored; each of them exact in doubles."""
    points = np.array(points, np.float64)
    yield points
    yield points * 2.0**-30
    yield points + 2.0**20
    yield -points[:, [2, 0, 1]]
    yield points * 2.0**500


def checked(x, s, t):
    """The answer, the same for all orders of vertices and arguments and by the oracle."""
    x = np.ascontiguousarray(x, np.float64)
    y = scaled(x)
    answers = {triangles_intersect(y, a, t) for a in permutations(s)}
    answers |= {triangles_intersect(y, b, s) for b in permutations(t)}
    assert answers == {intersect(x, s, t)}
    return answers.pop()


@pytest.mark.parametrize("name", FREE)
def test_triangles_without_a_common_vertex(name):
    corners, meets = FREE[name]
    for x in poses([*T, *corners]):
        assert checked(x, (0, 1, 2), (3, 4, 5)) is meets


@pytest.mark.parametrize("name", CORNER)
def test_triangles_with_a_common_vertex(name):
    corners, meets = CORNER[name]
    for x in poses([*T, *corners]):
        assert checked(x, (0, 1, 2), (3, 0, 4)) is meets


@pytest.mark.parametrize("name", EDGE)
def test_triangles_with_a_common_edge(name):
    corner, meets = EDGE[name]
    for x in poses([*T, corner]):
        assert checked(x, (0, 1, 2), (1, 0, 3)) is meets


def test_the_same_three_vertices():
    x = np.random.default_rng(0).random((3, 3))
    assert checked(x, (0, 1, 2), (2, 1, 0)) is True


@pytest.mark.parametrize("gap", [1e-12, 1e-15, 5e-16])
def test_one_unit_in_the_last_place_decides(gap):
    """A cap of height `gap` above a face, and its tip just below."""
    above = [*T, (1, 1, gap), (3, 1, gap), (2, 1, 2 * gap)]
    assert checked(above, (0, 1, 2), (3, 4, 5)) is False
    assert checked([*above[:3], (1, 1, -gap), *above[4:]], (0, 1, 2), (3, 4, 5)) is True


@pytest.mark.parametrize("seed", range(4))
def test_a_cap_and_an_edge_that_passes_its_tip(seed):
    rng = np.random.default_rng(seed)
    hits = 0
    for _ in range(60):
        x = rng.standard_normal((6, 3))
        x[2] = 0.5 * (x[0] + x[1]) + 1e-12 * rng.standard_normal(3)
        x[3:] += x[2] - x[3:5].mean(axis=0) + 1e-12 * rng.standard_normal(3)
        hits += checked(x, (0, 1, 2), (3, 4, 5))
    assert 5 < hits < 55


@pytest.mark.parametrize("seed", range(4))
def test_a_flat_sheet_turned_at_random(seed):
    """Rounded, its triangles lie in one plane but for the last digits, and where they touch it is they that decide."""
    rng = np.random.default_rng(seed)
    answers = []
    for offset in (0.0, 1e6):
        for _ in range(40):
            flat = np.column_stack([rng.integers(-2, 3, (5, 2)), np.zeros(5)])
            x = flat @ random_rotation(seed).T + offset
            answers.append(checked(x, (0, 1, 2), (2, 3, 4)))
            answers.append(checked(x, (0, 1, 2), (2, 1, 4)))
    assert {True, False} == set(answers)


lattice = some.lists(some.tuples(*[some.integers(-2, 2)] * 3), min_size=6, max_size=6)


@settings(max_examples=300, deadline=None)
@given(lattice, some.permutations(range(6)), some.integers(0, 2))
def test_any_points_of_a_small_lattice(points, order, shared):
    s = tuple(order[:3])
    t = (*order[:shared], *order[3 : 6 - shared])
    x = np.array(points, np.float64)
    assert triangles_intersect(scaled(x), s, t) == triangles_intersect(scaled(x), t, s) == intersect(x, s, t)


@settings(max_examples=200, deadline=None)
@given(lattice, some.tuples(*[some.integers(0, 5)] * 6))
def test_vertices_named_twice(points, rows):
    x = np.array(points, np.float64)
    assert triangles_intersect(scaled(x), rows[:3], rows[3:]) == intersect(x, rows[:3], rows[3:])
