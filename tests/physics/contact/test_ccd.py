"""Collision-free fraction against sampled distances, ipctk's CCD, and motions known by hand."""

import ipctk
import numpy as np
import pytest

from clothsim.physics.contact.ccd import TOLERANCE, _separated_fraction, edge_edge_limit, point_triangle_limit

SLACK = 0.9
POINT_TRIANGLE, EDGE_EDGE = 1, 2
"""Number of a pair's four points in the first body."""
TRIANGLE = [(0.0, 0.0, 0.0), (1e-2, 0.0, 0.0), (0.0, 1e-2, 0.0)]


def fraction(split, points, motion, offset=0.0, slack=SLACK, d_hat=np.inf, limit=1.0):
    step_limit = point_triangle_limit if split == POINT_TRIANGLE else edge_edge_limit
    pair = np.array([[0, 1, 2, 3]])
    return step_limit(np.array(points, float), np.array(motion, float), pair, offset, slack, d_hat, limit)


def distance(split, points):
    if split == EDGE_EDGE and np.array_equal(points[2], points[3]):  # where ipctk's edge_edge_distance is not the least
        return np.sqrt(ipctk.point_edge_distance(points[2], points[0], points[1]))
    squared = ipctk.point_triangle_distance if split == POINT_TRIANGLE else ipctk.edge_edge_distance
    return np.sqrt(squared(*(points - points[0])))


def time_of_impact(method, split, points, motion):
    detect = method.point_triangle_ccd if split == POINT_TRIANGLE else method.edge_edge_ccd
    hit, time = detect(*points, *(points + motion))
    return time if hit else 1.0


def random_pairs(split, gap, count, rng):
    """(count, 4, 3) pairs of size 1, `gap` apart between points inside the features."""
    points = rng.uniform(-1.0, 1.0, (count, 4, 3))
    inside = [rng.dirichlet(np.ones(k), count)[..., None] for k in (split, 4 - split)]
    first = np.sum(inside[0] * points[:, :split], axis=1)
    second = np.sum(inside[1] * points[:, split:], axis=1)
    edge = points[:, 2] - points[:, 1] if split == POINT_TRIANGLE else points[:, 1] - points[:, 0]
    normal = np.cross(edge, points[:, 3] - points[:, 1 if split == POINT_TRIANGLE else 2])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    points[:, :split] += (second - first + gap * normal)[:, None]
    return points


@pytest.mark.parametrize("split", [POINT_TRIANGLE, EDGE_EDGE])
@pytest.mark.parametrize(
    ("gap", "size"), [(0.1, 3.0), (1e-3, 1e-2), (1e-3, 1.0), (1e-6, 1e-2), (1e-9, 1e-2), (1e-12, 1e-2)]
)
@pytest.mark.parametrize("portion", [0.0, 0.5])
def test_fraction_is_safe_and_ends_at_the_floor(split, gap, size, portion):
    """Never below the floor on the path, and limited only where at most TOLERANCE of the usable gap is left."""
    rng = np.random.default_rng(4)
    stopped = 0
    for points in random_pairs(split, gap, 100, rng):
        motion = size * rng.normal(size=(4, 3))
        start = distance(split, points)
        offset = portion * start
        usable = SLACK * (start - offset)
        round_off = 1e-3 * gap if gap < 1e-9 else 1e-6 * gap
        t = fraction(split, points, motion, offset)
        assert 0.0 < t <= 1.0
        for s in np.linspace(0.0, t, 50):
            assert distance(split, points + s * motion) >= start - usable - round_off
        if t < 1.0:
            stopped += 1
            assert distance(split, points + t * motion) <= start - (1 - TOLERANCE) * usable + round_off
    assert 10 < stopped < 90


@pytest.mark.parametrize("split", [POINT_TRIANGLE, EDGE_EDGE])
@pytest.mark.parametrize(("gap", "size"), [(0.3, 1.0), (1e-3, 1e-2)])
def test_fraction_against_tight_inclusion_and_additive_ccd_of_ipctk(split, gap, size):
    rng = np.random.default_rng(6)
    exact = ipctk.TightInclusionCCD(conservative_rescaling=1.0)
    additive = ipctk.AdditiveCCD(conservative_rescaling=SLACK)
    of_impact, of_additive = [], []
    for points in random_pairs(split, gap, 200, rng):
        motion = size * rng.normal(size=(4, 3))
        t = fraction(split, points, motion)
        impact = time_of_impact(exact, split, points, motion)
        assert t <= impact
        of_impact.append(t / impact)
        of_additive.append(t / time_of_impact(additive, split, points, motion))
    # a pair that grazes between the two floors may stop where ipctk goes on, so not every pair
    assert np.mean(np.array(of_impact) > 0.8) > 0.9
    assert np.mean(np.array(of_additive) > 0.98) > 0.95


@pytest.mark.parametrize("gap", [1.0, 1e-3, 1e-6, 1e-12])
@pytest.mark.parametrize("overshoot", [1.0, 10.0, 1e6])
def test_head_on_approach_ends_at_the_slack(gap, overshoot):
    still = np.zeros((3, 3))
    points = [(3e-3, 3e-3, gap), *TRIANGLE]
    motion = [(0.0, 0.0, -overshoot * gap), *still]
    assert fraction(POINT_TRIANGLE, points, motion) == pytest.approx(SLACK / overshoot, rel=1e-9)
    crossed = [(-1e-2, 0.0, gap), (1e-2, 0.0, gap), (0.0, -1e-2, 0.0), (0.0, 1e-2, 0.0)]
    assert fraction(EDGE_EDGE, crossed, [motion[0]] * 2 + [(0.0, 0.0, 0.0)] * 2) == pytest.approx(
        SLACK / overshoot, rel=1e-9
    )


def test_the_offset_is_kept_and_the_limit_passed_on():
    points = [(3e-3, 3e-3, 1e-3), *TRIANGLE]
    motion = np.zeros((4, 3))
    motion[0, 2] = -2e-3
    # from 1 mm down to 0.4 mm + 0.1 * 0.6 mm
    assert fraction(POINT_TRIANGLE, points, motion, offset=4e-4) == pytest.approx(0.54 / 2)
    assert fraction(POINT_TRIANGLE, points, motion, limit=0.2) == 0.2
    assert fraction(POINT_TRIANGLE, points, motion, limit=0.0) == 0.0
    assert fraction(POINT_TRIANGLE, points, -motion) == 1.0


@pytest.mark.parametrize("split", [POINT_TRIANGLE, EDGE_EDGE])
def test_the_least_of_many_pairs_in_any_order(split):
    rng = np.random.default_rng(8)
    points = random_pairs(split, 0.3, 60, rng)
    motion = rng.normal(size=points.shape)
    each = [fraction(split, *pair) for pair in zip(points, motion, strict=True)]
    rows = np.arange(240).reshape(60, 4)
    step_limit = point_triangle_limit if split == POINT_TRIANGLE else edge_edge_limit
    for order in (rows, rows[::-1].copy()):
        assert step_limit(points.reshape(-1, 3), motion.reshape(-1, 3), order, 0.0, SLACK, np.inf, 1.0) == min(each)
    assert step_limit(points[0], motion[0], np.zeros((0, 4), np.int64), 0.0, SLACK, np.inf, 0.7) == 0.7


@pytest.mark.parametrize("gap", [1e-3, 1e-12])
def test_slide_along_a_face_or_a_parallel_edge_is_not_limited(gap):
    slide = np.zeros((4, 3))
    slide[0, :2] = 1.0, 0.5  # from above the triangle over its edge and far off
    assert fraction(POINT_TRIANGLE, [(1e-3, 1e-3, gap), *TRIANGLE], slide) == 1.0
    edges = [(0.0, 0.0, gap), (1e-2, 0.0, gap), (2e-3, 0.0, 0.0), (1.2e-2, 0.0, 0.0)]
    assert fraction(EDGE_EDGE, edges, [(1.0, 0.0, 0.0)] * 2 + [(-1.0, 0.0, 0.0)] * 2) == 1.0


@pytest.mark.parametrize("gap", [1e-3, 1e-12])
def test_coplanar_approach_stops_and_coplanar_slide_does_not(gap):
    points = [(3e-3, -gap, 0.0), *TRIANGLE]
    still = [(0.0, 0.0, 0.0)] * 3
    assert fraction(POINT_TRIANGLE, points, [(0.0, 2 * gap, 0.0), *still]) == pytest.approx(SLACK / 2, rel=1e-9)
    assert fraction(POINT_TRIANGLE, points, [(1e-1, 0.0, 0.0), *still]) == 1.0
    # collinear edges, end to end
    edges = [(-1e-2, 0.0, 0.0), (-gap, 0.0, 0.0), (0.0, 0.0, 0.0), (1e-2, 0.0, 0.0)]
    assert fraction(EDGE_EDGE, edges, [(4 * gap, 0.0, 0.0)] * 2 + still[:2]) == pytest.approx(SLACK / 4, rel=1e-5)


def test_grazing_pass_is_limited_only_below_the_floor():
    """A point passes the vertex a, 1 away at the start, at the least distance `closest`."""
    still = [(0.0, 0.0, 0.0)] * 3
    beside = [(0.0, 0.0, 0.0), (-1e-2, -1e-2, 0.0), (-1e-2, 1e-2, 0.0)]
    for closest, free in ((0.12, True), (0.099, False)):
        start = (closest, 0.0, np.sqrt(1 - closest**2))
        t = fraction(POINT_TRIANGLE, [start, *beside], [(0.0, 0.0, -2.0), *still])
        assert (t == 1.0) == free
        assert t > 0.4


@pytest.mark.parametrize("gap", [1e-3, 1e-12])
def test_tilt_about_the_closest_point_is_not_limited(gap):
    """The far vertices of the triangle move by 1e-2, the distance to its plane by gap / 2 of first order."""
    points = [(0.0, 0.0, gap), (-1e-2, -1e-2, 0.0), (1e-2, -1e-2, 0.0), (0.0, 2e-2, 0.0)]
    tilt = [(0.0, 0.0, 0.0), (0.0, 0.0, -1e-2), (0.0, 0.0, 1e-2), (0.0, 0.0, 0.0)]
    assert fraction(POINT_TRIANGLE, points, tilt) == 1.0


@pytest.mark.parametrize("gap", [1e-8, 1e-10, 1e-12])
def test_parallel_edges_that_twist_stop_in_proportion_to_their_gap(gap):
    """The smaller the gap the sooner and the more nearly parallel; the far larger gap of 1e-6 is the reference."""
    rng = np.random.default_rng(14)
    stopped = 0
    for edge, beside, motion in zip(*rng.normal(size=(2, 60, 3)), rng.normal(size=(60, 4, 3)), strict=True):
        out = np.cross(edge, beside) / np.linalg.norm(np.cross(edge, beside))
        expected, t = (
            fraction(EDGE_EDGE, [0 * edge, edge, 0.3 * edge + d * out, 1.3 * edge + d * out], 1e-2 * motion) / d
            for d in (1e-6, gap)
        )
        if expected * 1e-6 < 1e-3:
            stopped += 1
            assert t == pytest.approx(expected, rel=2e-2)
    assert stopped > 5


@pytest.mark.parametrize("split", [POINT_TRIANGLE, EDGE_EDGE])
def test_common_motion_is_not_limited_even_in_contact(split):
    points = random_pairs(split, 1e-12, 1, np.random.default_rng(9))[0]
    for common in (np.zeros(3), np.array([100.0, -3.0, 1e-7])):
        assert fraction(split, points, np.tile(common, (4, 1)), limit=0.8) == 0.8
        assert fraction(split, np.zeros((4, 3)), np.tile(common, (4, 1)), limit=0.8) == 0.8


@pytest.mark.parametrize("split", [POINT_TRIANGLE, EDGE_EDGE])
def test_moving_pair_at_or_below_the_offset_has_fraction_zero(split):
    points = random_pairs(split, 1e-3, 1, np.random.default_rng(10))[0]
    motion = np.random.default_rng(11).normal(size=(4, 3))
    assert fraction(split, points, motion, offset=2e-3) == 0.0
    assert fraction(split, np.zeros((4, 3)), motion) == 0.0
    assert fraction(split, points, np.nan * motion) == 0.0


def test_fast_motions_of_a_hundred_metres():
    points = np.array([(3e-3, 3e-3, 1e-3), *TRIANGLE])
    motion = np.zeros((4, 3))
    motion[0] = (0.0, 0.0, -100.0)
    assert fraction(POINT_TRIANGLE, points, motion) == pytest.approx(SLACK * 1e-5, rel=1e-9)
    motion += (70.0, -30.0, 100.0)  # both move
    assert fraction(POINT_TRIANGLE, points, motion) == pytest.approx(SLACK * 1e-5, rel=1e-9)
    motion[0] = motion[1] + (-100.0, 0.0, 1e-3)  # along the triangle and away
    assert fraction(POINT_TRIANGLE, points, motion) == 1.0


@pytest.mark.parametrize("split", [POINT_TRIANGLE, EDGE_EDGE])
def test_invariance_under_scale_and_translation(split):
    rng = np.random.default_rng(12)
    for points in np.round(random_pairs(split, 0.1, 30, rng) * 2**10) / 2**10:  # exact also at 1e6 m
        motion = rng.normal(size=(4, 3))
        t = fraction(split, points, motion)
        assert fraction(split, points + 1e6, motion) == t
        assert fraction(split, 2.0**-30 * points, 2.0**-30 * motion) == t


@pytest.mark.parametrize("split", [POINT_TRIANGLE, EDGE_EDGE])
@pytest.mark.parametrize("kind", ["needle", "point", "parallel"])
def test_degenerate_features_are_safe_and_stop_at_the_floor(split, kind):
    rng = np.random.default_rng(13)
    for points in rng.uniform(-1, 1, (60, 4, 3)):
        if kind == "needle":
            points[3] = points[2] + 1e-10 * points[3]
        elif kind == "point":
            points[3] = points[2]
        else:
            points[3] = points[2] + points[1] - points[0]
        motion = np.tile(2 * (points[2] - points[0]), (4, 1)) + 0.1 * rng.normal(size=(4, 3))
        motion[split:] = 0.0
        start = distance(split, points)
        t = fraction(split, points, motion)
        sampled = [distance(split, points + s * motion) for s in np.linspace(0.0, t, 50)]
        assert min(sampled) >= (1 - SLACK) * start * (1 - 1e-6)
        if t < 1.0:
            assert sampled[-1] <= (1 - SLACK * (1 - TOLERANCE)) * start * (1 + 1e-6)


@pytest.mark.parametrize("offset", [0.0, 0.1])
def test_distant_pair_may_descend_to_the_floor_of_d_hat(offset):
    """A point 5 above a triangle moves by 4.5 of it: .5 are left, a tenth of the gap, but more than a tenth of d_hat =
    .2.
    """
    points = [(0.2, 0.2, 5.0 + offset), (0, 0, 0), (1, 0, 0), (0, 1, 0)]
    motion = [(0, 0, -4.6), (0, 0, 0), (0, 0, 0), (0, 0, 0)]
    assert fraction(POINT_TRIANGLE, points, motion, offset) == pytest.approx(4.5 / 4.6, rel=1e-2)
    assert fraction(POINT_TRIANGLE, points, motion, offset, d_hat=0.2) == 1.0
    motion[0] = (0, 0, -6.0)
    left = 5.0 - 6.0 * fraction(POINT_TRIANGLE, points, motion, offset, d_hat=0.2)
    assert 0.02 * (1 - 1e-9) <= left <= 0.02 + 5.0 * TOLERANCE
    points[0] = (0.2, 0.2, 0.1 + offset)  # nearer than that, nothing changes
    both = (fraction(POINT_TRIANGLE, points, motion, offset, d_hat=d_hat) for d_hat in (0.2, np.inf))
    assert len(set(both)) == 1


@pytest.mark.parametrize("split", [POINT_TRIANGLE, EDGE_EDGE])
def test_pair_beyond_its_displacement_is_stopped_by_the_offset(split):
    """A gap of .3 and a displacement of .25: the boxes stay apart, and the offset of .1 is reached."""
    first = [(0.2, 0.2, 0.3)] if split == POINT_TRIANGLE else [(0.2, -1, 0.3), (0.2, 1, 0.3)]
    points = [*first, (0, 0, 0), (1, 0, 0), (0, 1, 0)][:4]
    motion = [(0, 0, -0.25) if k < split else (0, 0, 0) for k in range(4)]
    left = 0.3 - 0.25 * fraction(split, points, motion, offset=0.1, d_hat=0.01)
    assert 0.1 < left < 0.1 + 0.01
    assert fraction(split, points, motion, offset=0.04, d_hat=0.01) == 1.0


def turning_directions(count, rng):
    """Directions m0 + tau m1 + tau^2 m2 with |m0| = 1, differences w beyond the floor, their changes dw, and floors."""
    for _ in range(count):
        size = np.exp(rng.uniform(-2, 2, 4))
        m = rng.standard_normal((3, 3)) * [[1.0], [size[0]], [size[1]]]
        m[0] /= np.linalg.norm(m[0])
        w, floor = rng.standard_normal((4, 3)), rng.uniform(0.0, 1.0)
        w += (floor + rng.uniform(0.0, 2.0, 4) - w @ m[0])[:, None] * m[0]
        yield m, size[2] * w, size[3] * rng.standard_normal((4, 3)), size[2] * floor


def tuples(array):
    return tuple(tuple(float(value) for value in row) for row in array)


@pytest.mark.parametrize("is_edges", [False, True])
def test_the_separated_fraction_keeps_the_floor_along_a_turning_direction(is_edges):
    """m(tau) . (w + tau dw) >= floor |m(tau)| of all vertices up to the fraction; exact where nothing turns."""
    stopped, count = 0, 4 if is_edges else 3
    for m, w, dw, floor in turning_directions(300, np.random.default_rng(5)):
        fraction = _separated_fraction(tuples(m), tuples(w), tuples(dw), is_edges, floor, 1.0)
        tau = np.linspace(0.0, fraction, 40)[:, None]
        along = m[0] + tau * m[1] + tau**2 * m[2]
        gaps = np.einsum("tk,tik->ti", along, w[:count] + tau[:, :, None] * dw[:count])
        assert (gaps - floor * np.linalg.norm(along, axis=1)[:, None]).min() > -1e-9 * np.abs(w).max()
        still = _separated_fraction(tuples(m * [[1], [0], [0]]), tuples(w), tuples(dw), is_edges, floor, 1.0)
        rates = np.minimum(dw[:count] @ m[0], -1e-300)
        assert still == pytest.approx(min(1.0, ((w[:count] @ m[0] - floor) / -rates).min()), rel=1e-9)
        stopped += fraction < 1
    assert stopped > 200


@pytest.mark.parametrize("span", [1.0, 0.5])
@pytest.mark.parametrize("order", [(1, 2), (2, 2), (2, 3)], ids=["m1 dw", "m2 w", "m2 dw"])
def test_the_separated_fraction_of_one_term_is_its_root(order, span):
    """1 - c tau^2, exact, and 1 - c tau^3, for which tau^3 <= span tau^2 is taken; c puts the root just in reach."""
    turning, power = order
    c = 1.004 / span**power
    m = np.zeros((3, 3))
    m[0, 2], m[turning, 0] = 1.0, 2.0
    w, dw = np.tile([0.0, 0.0, 1.0], (4, 1)), np.zeros((4, 3))
    (w if turning == power == 2 else dw)[:, 0] = -c / 2.0
    found = _separated_fraction(tuples(m), tuples(w), tuples(dw), True, 0.0, span)
    assert found == pytest.approx(span / np.sqrt(1.004), rel=1e-12)


def test_a_gap_that_round_off_hides_is_no_way_through():
    """In a trash compactor (B26b) a wall went through a vertex 1.4e-16 m before it: its fraction was 1."""
    x = np.array([[-0.08, 0.08, 5e-4], [0, -0.165, 0.195], [0, 0.165, -0.135], [0, 0.165, 0.195]])
    gap = np.array([1.5e-16, 1.5e-16, 1.2e-16])
    x[1:, 0] = x[0, 0] - gap
    dx = np.zeros_like(x)
    dx[1:, 0] = 6.6e-8
    pair = np.array([[0, 1, 2, 3]])
    assert point_triangle_limit(x, dx, pair, 0.0, 0.9, 2e-3, 1.0) == 0.0
    x[1:, 0] = x[0, 0] - 1e-13
    assert 0.85e-13 < 6.6e-8 * point_triangle_limit(x, dx, pair, 0.0, 0.9, 2e-3, 1.0) < 1e-13
