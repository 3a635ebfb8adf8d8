"""Closest points against ipctk, and by the optimality condition of the distance of convex bodies."""

import ipctk
import numpy as np
import pytest

from clothsim.physics.contact.distance import (
    edge_edge_closest,
    edge_edge_region,
    point_triangle_closest,
    point_triangle_region,
)

EDGE_CODES = {(0, 0): 0, (0, 1): 1, (1, 0): 2, (1, 1): 3, (-1, 0): 4, (-1, 1): 5, (0, -1): 6, (1, -1): 7, (-1, -1): 8}
"""ipctk.EdgeEdgeDistanceType of our pair of codes."""


def closest_vector(points, split):
    """Weights of the four points and the difference of the closest points; `split` of them are the first body."""
    a, b, c, d = (tuple(point) for point in points)
    if split == 1:
        u, v, w = point_triangle_closest(a, b, c, d)
        weights = np.array([1.0, -u, -v, -w])
        assert min(u, v, w) >= 0.0
        assert u + v + w == pytest.approx(1.0, abs=1e-12)
    else:
        s, t = edge_edge_closest(a, b, c, d)
        weights = np.array([1 - s, s, t - 1, -t])
        assert 0.0 <= s <= 1.0
        assert 0.0 <= t <= 1.0
    return weights, weights @ (points - points[0])


def assert_closest(points, split, tolerance=1e-14):
    """Optimality: no point of either body is nearer along the difference r of closest points, |r|^2 <= r . (y - z)."""
    _, r = closest_vector(points, split)
    size = np.ptp(points, axis=0).max()
    separation = min(r @ (y - z) for y in points[:split] for z in points[split:])
    # a shortfall e means that the true distance d has |r|^2 - e <= |r| d
    assert r @ r - separation <= tolerance * size**2


def configurations(kind, count, rng):
    """(count, 4, 3) random pairs of one kind, for point-triangle and edge-edge."""
    points = rng.uniform(-1.0, 1.0, (count, 4, 3))
    if kind == "near":
        points[:, 0] = points[:, 1:].mean(axis=1) + 0.1 * points[:, 0]
    elif kind == "coplanar":
        points[..., 2] = 0.5
    elif kind == "collinear":
        points = points[:, :, :1] * points[:, :1]
    elif kind == "needle":
        points[:, 3] = points[:, 2] + 1e-9 * points[:, 3]
    elif kind == "thin":  # two nearly parallel edges; a triangle of nearly no area
        points[:, 3] = points[:, 2] + (points[:, 1] - points[:, 0]) + 1e-9 * points[:, 3]
        points[::2, 3] = points[::2, 1:3].mean(axis=1) + 1e-9 * points[::2, 0]
    elif kind == "parallel":
        points[:, 3] = points[:, 2] + rng.uniform(-2, 2, (count, 1)) * (points[:, 1] - points[:, 0])
    elif kind == "grid":  # many equal coordinates: coincident points, right angles, ties
        points = np.round(points)
    elif kind == "one point":
        points[:, 2:] = points[:, 1:2]
    elif kind == "all one point":
        points[:] = points[:, :1]
    return points


KINDS = (
    "random",
    "near",
    "coplanar",
    "collinear",
    "needle",
    "thin",
    "parallel",
    "grid",
    "one point",
    "all one point",
)


@pytest.mark.parametrize("split", [1, 2])
@pytest.mark.parametrize("kind", KINDS)
def test_optimality_condition(kind, split):
    for points in configurations(kind, 300, np.random.default_rng(3)):
        assert_closest(points, split)
        assert_closest(1e-9 * points, split)


@pytest.mark.parametrize("kind", ["random", "near", "coplanar", "parallel"])
def test_distances_against_ipctk(kind):
    for points in configurations(kind, 500, np.random.default_rng(5)):
        _, r = closest_vector(points, 1)
        assert r @ r == pytest.approx(ipctk.point_triangle_distance(*points), rel=1e-9, abs=1e-14)
        _, r = closest_vector(points, 2)
        assert r @ r == pytest.approx(ipctk.edge_edge_distance(*points), rel=1e-9, abs=1e-14)


def test_regions_against_ipctk():
    regions = set()
    for points in configurations("random", 1500, np.random.default_rng(7)):
        region = point_triangle_region(*point_triangle_closest(*map(tuple, points)))
        assert region == int(ipctk.point_triangle_distance_type(*points))
        edges = EDGE_CODES[edge_edge_region(*edge_edge_closest(*map(tuple, points)))]
        assert edges == int(ipctk.edge_edge_distance_type(*points))
        regions |= {("triangle", region), ("edges", edges)}
    assert len(regions) == 16


def test_a_point_over_each_feature_of_a_triangle():
    a, b, c = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    over = [(-1.0, -1.0), (2.0, -0.5), (-0.5, 2.0), (0.5, -1.0), (1.0, 1.0), (-1.0, 0.5), (0.25, 0.25)]
    for region, (x, y) in enumerate(over):
        assert point_triangle_region(*point_triangle_closest((x, y, 0.3), a, b, c)) == region


@pytest.mark.parametrize("angle", [1e-1, 1e-4, 1e-7, 1e-9, 1e-11])
def test_edges_that_cross_at_a_tiny_angle_are_their_gap_apart(angle):
    rng = np.random.default_rng(9)
    above = np.array([0.0, 0.0, 1e-9])
    for _ in range(50):
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        lengths = rng.uniform(0.2, 2.0, 4) * [-1, 1, -1, 1]
        directions = np.array([(1.0, 0.0, 0.0)] * 2 + [(np.cos(angle), np.sin(angle), 0.0)] * 2)
        points = lengths[:, None] * directions
        points[2:] += above
        _, r = closest_vector(points @ axes, 2)
        assert np.linalg.norm(r) == pytest.approx(1e-9, rel=1e-5)
        # a sliver of the same angle at a, the point above its inside
        sliver = np.array([(-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 2.0 * np.tan(angle), 0.0)])
        _, r = closest_vector(np.concatenate([[sliver.mean(axis=0) + above], sliver]) @ axes, 1)
        assert np.linalg.norm(r) == pytest.approx(1e-9, rel=1e-5)


def test_a_gap_far_below_the_size_of_the_triangle_is_exact():
    a, b, c = (0.0, 0.0, 0.0), (1e-2, 0.0, 0.0), (0.0, 1e-2, 0.0)
    _, r = closest_vector(np.array([(3e-3, 3e-3, 1e-12), a, b, c]), 1)
    assert np.linalg.norm(r) == pytest.approx(1e-12, rel=1e-5)
