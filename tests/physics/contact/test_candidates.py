"""Candidate cache: results independent of its content, and step limits without collisions."""

import numpy as np
import pytest
from contacts import ball, body_surface, jittered, self_surface, sheet_on_ball, two_sheets

from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.mesh.world import make_world
from clothsim.physics.contact.barrier_kernels import pairs_within
from clothsim.physics.contact.candidates import Candidates
from clothsim.physics.contact.ccd import edge_edge_limit, point_triangle_limit
from clothsim.physics.contact.filter import follows_path
from clothsim.physics.contact.surface import cloth_surface

D_HAT = 0.05


def surface_and_start(kind, height=0.34):
    return body_surface(sheet_on_ball(height)) if kind == "body" else self_surface(two_sheets())


def crosses(surface, x):
    second = None if surface.is_self_contact else surface.second.triangles
    return len(intersecting_pairs(x, surface.first.triangles, second)) > 0


def described(pairs):
    return sorted((tuple(rows), round(w, 12)) for rows, w in zip(pairs.elements.tolist(), pairs.weights, strict=True))


def all_pairs(surface, x):
    """Active pairs of new candidates with a generous skin."""
    return described(Candidates(surface, D_HAT, 1.0).active(x))


@pytest.mark.parametrize("kind", ["body", "self"])
@pytest.mark.parametrize("skin", [1e-9, 0.01, 0.1])
def test_active_pairs_do_not_depend_on_the_cache(kind, skin):
    surface, x = surface_and_start(kind)
    candidates = Candidates(surface, D_HAT, skin)
    rng = np.random.default_rng(0)
    n_found = 0
    for _ in range(5):
        dx = 0.02 * rng.standard_normal(x.shape)
        candidates.step_limit(x, dx)
        for fraction in (0.0, 1.0):
            y = x + fraction * dx
            pairs = described(candidates.active(y))
            assert pairs == all_pairs(surface, y)
            n_found += len(pairs)
        x = x + 0.3 * dx
    assert n_found > 20


@pytest.mark.parametrize("kind", ["body", "self"])
def test_distances_are_known_at_the_end_of_the_searched_path(kind):
    """Where the next positions are expected; also where the pairs of few vertices are searched."""
    surface, x = surface_and_start(kind)
    candidates, dx = Candidates(surface, D_HAT, 0.01), np.zeros_like(x)
    for moved in (slice(0, len(surface.first.points)), slice(0, 3)):
        dx[:] = 0.0
        dx[moved] = [0.05, 0.0, 0.0]
        end = x + candidates.step_limit(x, dx) * dx
        assert candidates._displacements(end, end).by_row[moved].max() < 1e-12
        assert candidates._displacements(x, x).approach > 0.01
        x = end


def every_pair(surface):
    """Rows (p, 4) of all pairs without a common vertex, point-triangle pairs first, and the number of those."""
    first, second = surface.first, surface.second
    sides = [(first, second)] if surface.is_self_contact else [(first, second), (second, first)]
    points = [(p, *t) for a, b in sides for p in a.points for t in b.triangles if p not in t]
    edges = [
        (*e, *f)
        for i, e in enumerate(first.edges)
        for j, f in enumerate(second.edges)
        if not set(e) & set(f) and (not surface.is_self_contact or i < j)
    ]
    return np.array(points + edges), len(points)


def test_active_pairs_against_brute_force():
    """Against all point-triangle and edge-edge pairs."""
    for kind in ("body", "self"):
        surface, x = surface_and_start(kind)
        x = jittered(x, len(surface.first.points), 0.01)
        elements, n_points = every_pair(surface)
        numbers, _ = pairs_within(x, elements, n_points, 0.15)
        expected = sorted(tuple(elements[k]) for k in numbers)
        assert len(expected) > 20
        assert sorted(map(tuple, Candidates(surface, 0.15, 0.01).active(x).elements)) == expected


def random_displacement(rng, surface, x, skin):
    """Displacement of few or many vertices, small or large, common or individual; sometimes of the body, or of none."""
    size = skin * 10.0 ** rng.uniform(-2.0, 1.5)
    dx = size * rng.standard_normal(x.shape)
    kind = rng.integers(5)
    if kind < 2:
        dx[rng.random(len(x)) > rng.uniform(0.0, 0.3)] = 0.0
    elif kind == 2:
        dx = size * rng.standard_normal(3) + 0.1 * dx
    elif kind == 3:
        dx *= 10.0 ** rng.uniform(-3, 0, (len(x), 1))
    if not surface.is_self_contact and rng.random() < 0.7:
        dx[surface.second.points] = 0.0
    return dx


@pytest.mark.parametrize("kind", ["body", "self"])
@pytest.mark.parametrize("seed", range(8))
def test_active_pairs_and_step_limits_after_random_paths(kind, seed):
    """Steps taken fully or in part, repeated positions, searches elsewhere: each list against brute force."""
    surface, x = body_surface(sheet_on_ball(0.32)) if kind == "body" else self_surface(two_sheets())
    elements, n_points = every_pair(surface)
    rng = np.random.default_rng(seed)
    offset, skin = (0.0, 0.02) if seed % 2 else (0.01, 0.008)
    limit = 0.04 + offset
    candidates, positions, n_found = Candidates(surface, limit, skin, offset), [x], 0
    for _ in range(14):
        x = positions[-1] if rng.random() < 0.8 else positions[rng.integers(len(positions))]
        if rng.random() < 0.3:
            x = x + random_displacement(rng, surface, x, skin)
        dx = random_displacement(rng, surface, x, skin)
        if rng.random() < 0.1:
            dx[rng.integers(len(x))] = rng.choice([np.nan, np.inf])
        most = 1.0 if rng.random() < 0.6 else rng.random()
        with np.errstate(invalid="ignore"):
            fraction = candidates.step_limit(x, dx, most)
            if not np.isfinite(dx).all():
                assert fraction == 0.0
                continue
        keep = offset, 0.9, limit - offset
        least = point_triangle_limit(x, dx, elements[:n_points], *keep, most)
        assert fraction == edge_edge_limit(x, dx, elements[n_points:], *keep, least)
        for portion in (fraction, rng.random() * fraction, 1.0):
            y = x + portion * dx
            for distance in (limit, limit + skin):
                pairs = candidates.active(y) if distance == limit else candidates.within(y, distance)
                numbers, _ = pairs_within(y, elements, n_points, distance)
                assert sorted(map(tuple, pairs.elements.tolist())) == sorted(map(tuple, elements[numbers].tolist()))
                assert (np.diff(pairs.keys) > 0).all()
                n_found += len(numbers)
        positions.append(x + fraction * dx)
    assert n_found > 100


def test_listed_pairs_bound_the_searched_path():
    """A vertex above the ball is close to contact; another far away, with a long displacement, is not searched."""
    surface, x = body_surface(sheet_on_ball(0.32))
    candidates = Candidates(surface, 0.04, 0.02)
    candidates.active(x)
    cloth = surface.first.points
    over = cloth[np.linalg.norm(x[cloth, :2], axis=1).argmin()]
    corner = cloth[np.linalg.norm(x[cloth, :2], axis=1).argmax()]
    dx = np.zeros_like(x)
    dx[over], dx[corner] = [0.0, 0.0, -1.0], [0.0, 0.0, 0.5]
    assert candidates.step_limit(x, dx) < 0.03
    assert candidates.builds == 1
    dx[over] = 0.0
    assert candidates.step_limit(x, dx, 0.03) == 0.03
    assert candidates.builds == 1
    assert candidates.step_limit(x, dx) == 1.0
    assert candidates.builds == 2


def layers_apart(distance):
    """Two layers at this distance with an activation distance of 0.02, the positions, and the upper rows."""
    surface, x = self_surface(two_sheets(cells=4))
    upper = surface.labels == surface.labels[-1]
    x[:, 2] = np.where(upper, distance, 0.0)
    return surface, x, upper


@pytest.mark.parametrize("apart", [1.5, 2.5, 3.5, 3.95, 4.05, 4.5, 6.0])
def test_layers_approaching_from_both_sides_are_found(apart):
    """From activation distance + `apart` skins each layer moves a little more than half: neither list nor filter may
    miss it.
    """
    limit, skin = 0.02, 0.01
    surface, x, upper = layers_apart(limit + apart * skin)
    candidates = Candidates(surface, limit, skin)
    assert not len(candidates.active(x))
    x[:, 2] += np.where(upper, -1.0, 1.0) * (0.5 * apart + 0.02) * skin
    assert len(candidates.active(x)) >= 25
    assert candidates.builds == (1 if apart < 4.0 else 2)


def test_rows_that_are_not_searched_stay_within_the_skin():
    """Few vertices of both layers meet halfway while another moves far: only rows outside the skin are searched."""
    limit, skin = 0.02, 0.01
    surface, x, upper = layers_apart(limit + 4.8 * skin)
    candidates = Candidates(surface, limit, skin)
    candidates.active(x)
    low, high = np.flatnonzero(~upper), np.flatnonzero(upper)
    x[low[:5], 2] += 2.5 * skin
    x[high[:5], 2] -= 2.5 * skin
    x[high[-1], 2] += 10.0 * skin
    assert len(candidates.active(x)) >= 5
    assert candidates.searched_vertices == 50 + 11


def test_path_that_starts_off_the_listed_one_is_searched():
    """A corner placed over the lower layer, off any listed path, falls through it."""
    surface, x, upper = layers_apart(0.5)
    candidates = Candidates(surface, 0.002, 0.001)
    candidates.active(x)
    corner = np.flatnonzero(upper)[np.argmax(x[upper, 0] + x[upper, 1])]
    x[corner] = 0.1, 0.1, 0.03
    dx = np.zeros_like(x)
    dx[corner] = 0.8, 0.0, -1.0
    limit = candidates.step_limit(x, dx)
    assert 0.02 < limit < 0.03
    assert limit == Candidates(surface, 0.002, 0.001).step_limit(x, dx)


def test_cache_is_used_and_cleared():
    surface, x = surface_and_start("body")
    candidates = Candidates(surface, D_HAT, skin=0.05)
    candidates.active(x)
    candidates.active(x + 0.01)
    candidates.active(x - 0.01)
    assert candidates.builds == 1
    candidates.active(x + 0.1)
    assert candidates.builds == 2
    candidates.clear()
    candidates.active(x + 0.1)
    assert candidates.builds == 3
    assert candidates.pairs == len(candidates.active(x + 0.1))


def test_step_limit_stops_before_the_first_contact():
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


def test_separating_step_is_not_limited():
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


def test_a_collision_in_the_last_hundredth_of_a_long_path_is_found():
    """With and without a list from before: the ball's top is 0.2 below, the path ends just above it or just within."""
    surface, x = surface_and_start("body", height=40.3)
    candidates = Candidates(surface, D_HAT, 0.01)
    for end, collides in ((0.06, False), (-0.06, True), (-0.06, True)):
        dx = np.zeros_like(x)
        dx[surface.first.points, 2] = -40.0 + end
        limit = candidates.step_limit(x, dx)
        assert (limit < 1.0) == collides
        assert limit > 0.99
        assert not crosses(surface, x + limit * dx)


def test_the_offset_is_kept_free():
    surface, x = surface_and_start("body", height=0.5)
    dx = np.zeros_like(x)
    dx[surface.first.points, 2] = -1.0
    candidates = Candidates(surface, D_HAT + 0.02, D_HAT, offset=0.02)
    limit = candidates.step_limit(x, dx)
    assert 0.15 < limit < 0.18
    assert candidates.minimum_gap(x + limit * dx) > 0


def test_follows_path_measures_the_offset_at_one_common_fraction():
    start, end = np.zeros((3, 3)), np.array([[2.0, 0, 0], [0, 0, 0], [0, 1, 0]])
    rows = np.arange(3)

    def margin_of(x, start, end):
        """The least margin with which x follows the path."""
        margins = np.linspace(0.0, 2.0, 2001)
        return margins[np.argmax([follows_path(x, start, end, rows, margin) for margin in margins])]

    halfway = 0.5 * end + np.array([[0, 0.3, 0], [0, 0, 0.2], [0, 0, 0.1]])
    assert margin_of(halfway, start, end) == pytest.approx(0.3, abs=1e-3)
    uneven = np.array([[2.0, 0, 0], [0, 0, 0], [0, 0, 0]])  # the first arrived, the third stayed
    assert margin_of(uneven, start, end) == pytest.approx(
        0.8, abs=1e-3
    )  # at the fraction .8 the third row is .8 behind
    assert margin_of(start + 0.1, start, start) == pytest.approx(0.1 * np.sqrt(3), abs=1e-3)
    invalid = halfway.copy()
    invalid[0] = np.nan
    assert not follows_path(invalid, start, end, rows, np.inf)
    assert not follows_path(invalid, start, start, rows, np.inf)
    assert follows_path(invalid, start, end, rows[1:], 1.0)


def test_gap_change_is_the_largest_relative_change_of_a_pair():
    """Layers in common motion keep their gap; a tenth of the displacement to contact is a tenth of the gap."""
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


def test_gap_change_includes_pairs_active_only_after_the_step():
    surface, x = surface_and_start("self")
    layers = np.array_split(surface.first.points, 2)
    gap = np.abs(x[layers[0], 2].mean() - x[layers[1], 2].mean())
    closer = np.zeros_like(x)
    closer[layers[0], 2] = 0.5 * (x[layers[1], 2].mean() - x[layers[0], 2].mean())
    candidates = Candidates(surface, 0.7 * gap, gap)
    assert not len(candidates.active(x))
    assert candidates.gap_change(x, closer) == pytest.approx(0.5, rel=1e-6)


@pytest.mark.parametrize("kind", ["body", "self"])
@pytest.mark.parametrize("portion", [0.06, 0.15])
def test_partial_search_equals_a_full_search(kind, portion):
    """Some vertices leave the skin, repeatedly: the same pairs in the same order as from a new search."""
    surface, x = surface_and_start(kind)
    cloth, rng = surface.first.points, np.random.default_rng(4)
    candidates = Candidates(surface, D_HAT, 0.02)
    candidates.active(x)
    n_found, n_searches = set(), 8
    for _ in range(n_searches):
        dx = np.zeros_like(x)
        some = rng.choice(cloth, max(1, int(portion * len(cloth))), replace=False)
        dx[some] = 0.06 * rng.standard_normal((len(some), 3))
        limit = candidates.step_limit(x, dx)
        fresh = Candidates(surface, D_HAT, 0.02)
        assert limit == fresh.step_limit(x, dx)
        for fraction in (0.0, 0.7 * limit, limit):
            pairs = candidates.active(x + fraction * dx)
            np.testing.assert_array_equal(pairs.elements, fresh.active(x + fraction * dx).elements)
            n_found.add(len(pairs))
        x = x + 0.9 * limit * dx
    assert len(n_found) > 2
    assert candidates.searched_vertices < (0.4 if portion < 0.1 else 0.7) * n_searches * len(surface.rows)


@pytest.mark.parametrize("kind", ["body", "self"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_non_finite_positions_do_not_corrupt_the_cache(kind, bad):
    surface, x = surface_and_start(kind)
    candidates = Candidates(surface, D_HAT, D_HAT)
    known = described(candidates.active(x))
    for rows in (slice(None), slice(3, 4)):
        invalid = x.copy()
        invalid[rows] = bad
        with np.errstate(invalid="ignore"):
            candidates.active(invalid)
            candidates.step_limit(x, invalid - x)
        assert described(candidates.active(x)) == known
        falling = np.zeros_like(x)
        falling[surface.first.points[: len(surface.first.points) // 2], 2] = -1.0
        assert candidates.step_limit(x, falling) == Candidates(surface, D_HAT, D_HAT).step_limit(x, falling)


def test_step_limit_does_not_depend_on_the_reference_positions():
    """Two layers that have moved apart since the search and now meet: the floor is a tenth of their present gap."""
    surface, start = self_surface(two_sheets())
    d_hat, m = 0.1, 0.02
    upper = surface.labels == surface.labels[-1]
    start[:, 2] = np.where(upper, 2.3 * m, 0.0)
    away = np.where(upper, m, -m)[:, None] * np.array([0.0, 0.0, 1.0])
    cached = Candidates(surface, d_hat, 0.5 * d_hat)
    cached.active(start)
    limit = cached.step_limit(start + away, -2.0 * away)
    assert limit == Candidates(surface, d_hat, 0.5 * d_hat).step_limit(start + away, -2.0 * away)
    assert 4.3 * m - 4.0 * m * limit == pytest.approx(0.43 * m, rel=0.1)


@pytest.mark.parametrize("kind", ["body", "self"])
def test_both_ends_of_a_step_are_asked_for_in_turns_and_measured_once(kind, monkeypatch):
    surface, start = surface_and_start(kind)
    candidates = Candidates(surface, D_HAT, 0.05)
    ends, measured = (start, start + 0.01 * np.random.default_rng(1).standard_normal(start.shape)), []
    monkeypatch.setattr(candidates, "within", lambda x, d: measured.append(x) or Candidates.within(candidates, x, d))
    moved = start.copy()
    for turn in range(6):
        moved[:] = ends[turn % 2]  # one array with other numbers is another position
        fresh = Candidates(surface, D_HAT, 1.0)
        np.testing.assert_array_equal(candidates.active(moved).elements, fresh.active(moved).elements)
        assert candidates.pairs == len(fresh.active(moved)) > 5
        assert candidates.minimum_gap(moved) == fresh.minimum_gap(moved)
    assert len(measured) == 2


def test_rows_of_a_body_are_not_read_by_contact_of_the_cloth_with_itself():
    alone = two_sheets()
    beside = make_world(alone.cloths, [ball((0.0, 0.0, 5.0))])
    surface, x = cloth_surface(beside), beside.start()
    assert surface.n_read == alone.n_cloth < len(x)
    candidates, other = Candidates(surface, D_HAT, 0.01), x.copy()
    other[surface.n_read :] = np.nan
    found = candidates.active(x)
    assert candidates.active(other) is found
    assert described(found) == all_pairs(*self_surface(alone))
    dx = np.zeros_like(x)
    dx[: len(dx) // 8] = [0.0, 0.0, 0.1]
    limits = [candidates.step_limit(x, dx), candidates.step_limit(other, dx)]
    assert limits[0] == limits[1] < 1.0
