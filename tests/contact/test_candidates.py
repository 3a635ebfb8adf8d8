"""The cache of pairs never changes what is found; a step limit never lets anything through."""

import numpy as np
import pytest
from contacts import body_surface, jittered, self_surface, sheet_on_ball, two_sheets

from clothsim.contact.barrier_kernels import near_pairs
from clothsim.contact.candidates import Candidates, strays
from clothsim.intersection.pairs import intersecting_pairs

D_HAT = 0.05


def surface_and_start(kind, height=0.34):
    return body_surface(sheet_on_ball(height)) if kind == "body" else self_surface(two_sheets())


def crosses(surface, x):
    second = None if surface.itself else surface.second.triangles
    return len(intersecting_pairs(x, surface.first.triangles, second)) > 0


def described(pairs):
    return sorted((tuple(rows), round(w, 12)) for rows, w in zip(pairs.elements.tolist(), pairs.weights, strict=True))


def all_pairs(surface, x):
    """The pairs below d_hat from fresh candidates with a generous margin."""
    return described(Candidates(surface, D_HAT, 1.0).near(x))


@pytest.mark.parametrize("kind", ["body", "self"])
@pytest.mark.parametrize("reach", [1e-9, 0.01, 0.1])
def test_the_pairs_are_all_pairs_wherever_the_cache_comes_from(kind, reach):
    surface, x = surface_and_start(kind)
    candidates = Candidates(surface, D_HAT, reach)
    rng = np.random.default_rng(0)
    found = 0
    for _ in range(5):
        dx = 0.02 * rng.standard_normal(x.shape)
        candidates.step_limit(x, dx)
        for fraction in (0.0, 1.0):
            y = x + fraction * dx
            pairs = described(candidates.near(y))
            assert pairs == all_pairs(surface, y)
            found += len(pairs)
        x = x + 0.3 * dx
    assert found > 20


def test_every_pair_of_primitives_is_looked_at():
    """Against brute force over all point-triangle and edge-edge pairs."""
    for kind in ("body", "self"):
        surface, x = surface_and_start(kind)
        x = jittered(x, len(surface.first.points), 0.01)
        first, second = surface.first, surface.second
        sides = [(first, second)] if surface.itself else [(first, second), (second, first)]
        points = [(p, *t) for a, b in sides for p in a.points for t in b.triangles if p not in t]
        edges = [
            (*e, *f)
            for i, e in enumerate(first.edges)
            for j, f in enumerate(second.edges)
            if not set(e) & set(f) and (not surface.itself or i < j)
        ]
        elements = np.array(points + edges)
        numbers, _ = near_pairs(x, elements, len(points), 0.15)
        brute = sorted(tuple(elements[k]) for k in numbers)
        assert len(brute) > 20
        assert sorted(map(tuple, Candidates(surface, 0.15, 0.01).near(x).elements)) == brute


def test_the_cache_is_used_and_forgotten():
    surface, x = surface_and_start("body")
    candidates = Candidates(surface, D_HAT, reach=0.05)
    candidates.near(x)
    candidates.near(x + 0.01)
    candidates.near(x - 0.01)
    assert candidates.builds == 1
    candidates.near(x + 0.1)
    assert candidates.builds == 2
    candidates.forget()
    candidates.near(x + 0.1)
    assert candidates.builds == 3
    assert candidates.pairs == len(candidates.near(x + 0.1))


def test_the_step_limit_stops_before_the_first_touch():
    surface, x = surface_and_start("body", height=0.4)
    dx = np.zeros_like(x)
    dx[surface.first.points, 2] = -0.5
    limit = Candidates(surface, D_HAT, D_HAT).step_limit(x, dx)
    assert 0.1 < limit < 0.2  # the ball's top is 0.1 below
    assert not crosses(surface, x + limit * dx)
    assert crosses(surface, x + 2 * limit * dx)


@pytest.mark.parametrize("kind", ["body", "self"])
@pytest.mark.parametrize("seed", range(6))
def test_no_step_within_its_limit_intersects(kind, seed):
    surface, x = surface_and_start(kind)
    rng = np.random.default_rng(seed)
    dx = rng.standard_normal(x.shape) * 0.2
    dx[surface.first.points, 2] -= 0.5
    candidates = Candidates(surface, D_HAT, D_HAT)
    limit = candidates.step_limit(x, dx)
    assert 0 < limit < 1
    assert candidates.ccd_calls == 1
    for fraction in np.linspace(0, limit, 9):
        assert not crosses(surface, x + fraction * dx)


def test_a_free_step_is_not_limited():
    surface, x = surface_and_start("body")
    dx = np.zeros_like(x)
    dx[surface.first.points, 2] = 7.0
    assert Candidates(surface, D_HAT, D_HAT).step_limit(x, dx) == 1.0


@pytest.mark.parametrize("speed", [1.0, 100.0, 1e4])
def test_nothing_tunnels_at_any_speed(speed):
    surface, x = surface_and_start("body", height=0.5)
    dx = np.zeros_like(x)
    dx[surface.first.points, 2] = -speed
    limit = Candidates(surface, D_HAT, D_HAT).step_limit(x, dx)
    assert 0.15 < limit * speed < 0.2


def test_the_offset_is_kept_free():
    surface, x = surface_and_start("body", height=0.5)
    dx = np.zeros_like(x)
    dx[surface.first.points, 2] = -1.0
    candidates = Candidates(surface, D_HAT + 0.02, D_HAT, offset=0.02)
    limit = candidates.step_limit(x, dx)
    assert 0.15 < limit < 0.18
    assert candidates.minimum_gap(x + limit * dx) > 0


def test_how_far_a_point_strays_from_where_all_would_be():
    start, end = np.zeros((3, 3)), np.array([[2.0, 0, 0], [0, 0, 0], [0, 1, 0]])
    halfway = 0.5 * end + np.array([[0, 0.3, 0], [0, 0, 0.2], [0, 0, 0.1]])
    assert strays(halfway, start, end) == pytest.approx(0.3)
    each_its_own = np.array([[2.0, 0, 0], [0, 0, 0], [0, 0, 0]])  # the first arrived, the third stayed
    assert strays(each_its_own, start, end) == pytest.approx(0.8)  # at the common share .8, the third is .8 behind
    assert strays(start + 0.1, start, start) == pytest.approx(0.1 * np.sqrt(3))


def test_the_change_of_a_gap_is_seen_pair_by_pair():
    """Two layers that move as one keep their gap; a tenth of the way to the other layer is a tenth of the gap."""
    surface, x = surface_and_start("self")
    layers = np.array_split(surface.first.points, 2)
    gap = np.abs(x[layers[0], 2].mean() - x[layers[1], 2].mean())
    candidates = Candidates(surface, 1.5 * gap, D_HAT)
    together = np.zeros_like(x)
    together[surface.first.points] = [0.3, -0.2, 0.1]
    closer = np.zeros_like(x)
    closer[layers[0], 2] = 0.1 * (x[layers[1], 2].mean() - x[layers[0], 2].mean())
    assert candidates.gap_change(x, together) < 1e-9
    assert candidates.gap_change(x, closer) == pytest.approx(0.1, rel=1e-6)


def test_a_gap_that_only_the_step_makes_small_counts_too():
    surface, x = surface_and_start("self")
    layers = np.array_split(surface.first.points, 2)
    gap = np.abs(x[layers[0], 2].mean() - x[layers[1], 2].mean())
    closer = np.zeros_like(x)
    closer[layers[0], 2] = 0.5 * (x[layers[1], 2].mean() - x[layers[0], 2].mean())
    candidates = Candidates(surface, 0.7 * gap, gap)
    assert not len(candidates.near(x))
    assert candidates.gap_change(x, closer) == pytest.approx(0.5, rel=1e-6)


@pytest.mark.parametrize("kind", ["body", "self"])
@pytest.mark.parametrize("share", [0.06, 0.15])
def test_what_few_vertices_meet_is_found_by_searching_for_them_alone(kind, share):
    """Some vertices go further than the reach, and again: the same pairs in the same order as from a new search."""
    surface, x = surface_and_start(kind)
    cloth, rng = surface.first.points, np.random.default_rng(4)
    candidates = Candidates(surface, D_HAT, 0.02)
    candidates.near(x)
    found, n_searches = set(), 8
    for _ in range(n_searches):
        dx = np.zeros_like(x)
        some = rng.choice(cloth, max(1, int(share * len(cloth))), replace=False)
        dx[some] = 0.06 * rng.standard_normal((len(some), 3))
        limit = candidates.step_limit(x, dx)
        fresh = Candidates(surface, D_HAT, 0.02)
        assert limit == pytest.approx(fresh.step_limit(x, dx))
        for fraction in (0.0, 0.7 * limit, limit):
            pairs = candidates.near(x + fraction * dx)
            np.testing.assert_array_equal(pairs.elements, fresh.near(x + fraction * dx).elements)
            found.add(len(pairs))
        x = x + 0.9 * limit * dx
    assert len(found) > 2
    assert candidates.searched < (0.4 if share < 0.1 else 0.7) * n_searches * len(surface.rows)


@pytest.mark.parametrize("kind", ["body", "self"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_no_number_leaves_nothing_behind(kind, bad):
    surface, x = surface_and_start(kind)
    candidates = Candidates(surface, D_HAT, D_HAT)
    known = described(candidates.near(x))
    for rows in (slice(None), slice(3, 4)):
        nowhere = x.copy()
        nowhere[rows] = bad
        with np.errstate(invalid="ignore"):
            candidates.near(nowhere)
            candidates.step_limit(x, nowhere - x)
        assert described(candidates.near(x)) == known
        falling = np.zeros_like(x)
        falling[surface.first.points[: len(surface.first.points) // 2], 2] = -1.0
        assert candidates.step_limit(x, falling) == Candidates(surface, D_HAT, D_HAT).step_limit(x, falling)


def test_a_step_limit_does_not_depend_on_where_the_base_lies():
    """Two layers that have moved apart since the base and now meet: the floor is a tenth of the gap that they have."""
    surface, start = self_surface(two_sheets())
    d_hat, m = 0.1, 0.02
    upper = surface.labels == surface.labels[-1]
    start[:, 2] = np.where(upper, 2.3 * m, 0.0)
    away = np.where(upper, m, -m)[:, None] * np.array([0.0, 0.0, 1.0])
    held = Candidates(surface, d_hat, 0.5 * d_hat)
    held.near(start)
    limit = held.step_limit(start + away, -2.0 * away)
    assert limit == Candidates(surface, d_hat, 0.5 * d_hat).step_limit(start + away, -2.0 * away)
    assert 4.3 * m - 4.0 * m * limit == pytest.approx(0.43 * m, rel=0.1)
