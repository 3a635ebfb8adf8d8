"""Proved separations: the verdicts of the full search at every state, and bounds that are broken on purpose."""

import numpy as np
import pytest
from meshes import grid
from scipy.spatial.distance import cdist

from clothsim.base.jit import kernel
from clothsim.geometry.intersection import predicates, proved_separations
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.geometry.intersection.proved_separations import IDLE, Effort, ProvedSeparations
from clothsim.geometry.intersection.triangle_pair import triangles_intersect

clearance, beyond_vertex, beyond_edge, meet = map(  # compiled, as in use
    kernel,
    (
        predicates.clearance,
        predicates.clearance_beyond_vertex,
        predicates.clearance_beyond_edge,
        triangles_intersect,
    ),
)
S, T = (0, 1, 2), (3, 4, 5)


def soup(rng, count, size=0.15):
    x = rng.random((count, 1, 3)) + size * rng.standard_normal((count, 3, 3))
    return x.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def checked(proofs, x, first, second=None):
    """The pairs found with proofs, which are those of the full search."""
    found = proofs.intersecting_pairs(x, first, second)
    assert np.array_equal(found, intersecting_pairs(x, first, second))
    return found


def motions(rng, x, scale):
    """Changes of a step: none, noise, of all vertices alike, of a few vertices far."""
    kind = rng.integers(5)
    if kind == 0:
        return np.zeros_like(x)
    if kind == 1:
        return np.broadcast_to(scale * rng.standard_normal(3), x.shape)
    if kind == 2:
        return np.where(rng.random((len(x), 1)) < 0.05, rng.standard_normal(x.shape), 0.0)
    return scale * rng.standard_normal(x.shape)


@pytest.mark.parametrize("scale", [1e-7, 1e-4, 1e-2, 0.3])
@pytest.mark.parametrize("seed", range(4))
def test_a_soup_in_random_motion(seed, scale):
    rng = np.random.default_rng(seed)
    x, triangles = soup(rng, 60)
    alone, with_others = ProvedSeparations(), ProvedSeparations()
    for _ in range(40):
        checked(alone, x, triangles)
        checked(with_others, x, triangles[:25], triangles[25:])
        x = x + motions(rng, x, scale)


@pytest.mark.parametrize("seed", range(6))
def test_a_sheet_that_crumples_unfolds_and_falls_on_another(seed):
    """Neighbours share vertices: a few states have every kind of intersection, others none."""
    rng = np.random.default_rng(seed)
    sheet, small = grid(9, 9)
    ground, large = grid(3, 3)
    x0 = np.concatenate([sheet, ground * 1.5 + [-0.2, -0.2, -0.3]])
    proofs, n_found = ProvedSeparations(), []
    waves, phases = rng.normal(0, 9, (3, 2)), rng.random(3) * 6
    for k in range(60):
        fold = max(0.0, np.sin(0.1 * k)) * np.array([0.5, 0.5, 0.9])
        x = x0.copy()
        x[: len(sheet)] += fold * np.sin(sheet[:, :2] @ waves.T + phases + 0.02 * k)
        x[: len(sheet)] += 1e-4 * rng.standard_normal(sheet.shape)
        found = checked(proofs, x, small), checked(proofs, x, small, large + len(sheet))
        n_found.append([len(each) for each in found])
    assert np.all(np.max(n_found, axis=0) > 0)
    assert np.any(np.sum(n_found, axis=1) == 0)


def test_a_sheet_in_slow_motion_is_hardly_tested_again():
    sheet, triangles = grid(16, 16)
    proofs, efforts = ProvedSeparations(), []
    for k in range(200):
        x = sheet + 1e-5 * k * np.sin(9 * sheet[:, [1, 2, 0]])
        assert len(proofs.intersecting_pairs(x, triangles, None)) == 0
        efforts.append(proofs.take_effort())
    first, total = efforts[0], sum(efforts, Effort())
    assert first.pairs_proved == first.boxes_proved == 0
    assert total.states == 200
    assert total.pairs_tested < 3 * first.pairs_tested
    assert total.pairs_proved > 50 * total.pairs_tested
    assert total.boxes_proved > total.boxes_tested


def test_a_vertex_that_jumps_into_another_triangle_is_found():
    """Between two states, beyond every bound; after many states in which its proofs were not used up."""
    rng = np.random.default_rng(0)
    sheet, triangles = grid(12, 12)
    x = np.concatenate([sheet, sheet + np.array([0.0, 0.0, 0.1])])
    both = np.concatenate([triangles, triangles + len(sheet)])
    proofs = ProvedSeparations()
    for _ in range(10):
        assert len(checked(proofs, x + 1e-6 * rng.standard_normal(x.shape), both)) == 0
    proofs.take_effort()
    for vertex in (5, 70, len(sheet) + 100):
        jumped = x.copy()
        jumped[vertex, 2] += 0.15 if vertex < len(sheet) else -0.15
        assert len(checked(proofs, jumped, both)) > 0
        assert 0 < proofs.take_effort().pairs_tested < 40_000
        assert len(checked(proofs, x, both)) == 0


@pytest.mark.parametrize("gap", [1e-3, 1e-9])
def test_a_triangle_is_tested_as_soon_as_its_bound_is_used_up(gap):
    """A peg comes down on a triangle: at a height of 0 it touches, and no step below is missed."""
    x = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, 0], [1, 1.5, 2], [1.5, 1, 2]])
    proofs, first, second = ProvedSeparations(), np.array([S]), np.array([T])
    for height in gap * np.array([1.0, 1.5, 0.9, 0.6, 0.5, 0.4, 1e-3, 1e-6]):
        assert len(checked(proofs, _raised(x, height), first, second)) == 0
    assert len(checked(proofs, _raised(x, 0.0), first, second)) == 1
    assert len(checked(proofs, _raised(x, gap), first, second)) == 0
    assert len(checked(proofs, _raised(x, -gap), first, second)) == 1


def _raised(x, height):
    lifted = x.copy()
    lifted[3:, 2] += height
    return lifted


def test_what_was_proved_is_not_tested_until_the_bound_is_used_up():
    x = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, 1], [1, 1.5, 3], [1.5, 1, 3]])
    proofs, first, second = ProvedSeparations(), np.array([S]), np.array([T])
    efforts = []
    for height in (0.0, -0.3, -0.6, -0.99, -1.0):
        assert len(checked(proofs, _raised(x, height), first, second)) == (height == -1.0)
        efforts.append(proofs.take_effort())
    assert [each.boxes_tested for each in efforts] == [1, 0, 0, 0, 1]
    assert [each.pairs_tested for each in efforts] == [0, 0, 0, 0, 1]


@pytest.mark.parametrize("seed", range(3))
def test_clearances_are_below_the_distance_and_above_zero_where_there_is_one(seed):
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet(np.ones(3), 400)
    for _ in range(300):
        x = 2.0**200 * (rng.random((6, 3)) * rng.choice([1.0, 1e-3], (1, 3)))
        x[3:] += 2.0**200 * rng.standard_normal(3) * rng.choice([0.1, 1.0])
        bound = clearance(x, S, T, np.inf)
        assert (bound > 0.0) == (not meet(x, S, T))
        assert clearance(x, S, T, 0.0) <= bound
        assert bound <= cdist(weights @ x[:3], weights @ x[3:]).min()


@pytest.mark.parametrize("shared", [1, 2])
def test_neighbours_do_not_meet_while_their_edges_change_by_less_than_the_bound(shared):
    rng = np.random.default_rng(shared)
    positive = 0
    for _ in range(400):
        x = rng.standard_normal((4 if shared == 2 else 5, 3)) * [1.0, 1.0, rng.choice([1.0, 0.02])]
        if shared == 2:
            s, t, bound = (0, 1, 2), (0, 1, 3), beyond_edge(x, 0, 1, 2, 3)
        else:
            s, t, bound = (0, 1, 2), (0, 3, 4), beyond_vertex(x, 0, (1, 2), (3, 4))
        positive += bound > 0.0
        for _ in range(20 if bound > 0.0 else 0):
            change = rng.standard_normal(x.shape)
            edges = [change[each[i]] - change[each[i - 1]] for each in (s, t) for i in range(3)]
            change *= 0.999 * bound / np.max(np.linalg.norm(edges, axis=1))
            assert not meet(x + change, s, t)
    assert positive > 100


def test_unit_and_place_do_not_matter():
    rng = np.random.default_rng(3)
    x, triangles = soup(rng, 40)
    for factor in (2.0**-600, 2.0**-40, 1.0, 2.0**400):
        proofs = ProvedSeparations()
        for k in range(12):
            checked(proofs, factor * (x * 1.4**k + [0.0, 0.0, 0.1 * k]), triangles)


def test_too_many_proofs_are_given_up(monkeypatch):
    monkeypatch.setattr(proved_separations, "MOST_PAIRS", 1)
    x, triangles = soup(np.random.default_rng(4), 60)
    proofs = ProvedSeparations()
    for k in range(3):
        checked(proofs, x + 1e-3 * k, triangles)
        assert proofs.take_effort().full_searches == 1


def test_a_limit_ends_the_search():
    x, triangles = soup(np.random.default_rng(5), 40, size=0.5)
    proofs = ProvedSeparations()
    for _ in range(2):
        assert np.array_equal(
            proofs.intersecting_pairs(x, triangles, None, 3), intersecting_pairs(x, triangles, limit=3)
        )


def test_two_states_may_alternate():
    """A branch of a simulation shares the proofs of the one that it left."""
    rng = np.random.default_rng(6)
    x, triangles = soup(rng, 50)
    other = x + 0.1 * rng.standard_normal(x.shape)
    proofs = ProvedSeparations()
    for k in range(6):
        checked(proofs, x + 1e-4 * k, triangles)
        checked(proofs, other - 1e-4 * k, triangles)
    checked(proofs, np.concatenate([other, x]), np.concatenate([triangles, triangles + len(x)]))
    checked(proofs, x, triangles)


def ends_of(proofs):
    """Bounds of all pairs whose separation was proved, and the travelled distances at which they are looked at."""
    search = proofs._searches[0]
    return [array[: search._count] for array in search._front[1:]]


@pytest.mark.parametrize("excess", [0.0, 1e-6, 1e-3])
def test_a_bound_that_is_too_large_lets_a_frame_pass_that_the_proved_one_finds(excess):
    """Broken on purpose: the bound of a peg above a triangle, by the excess. It is sharp: a millionth is too much."""
    x = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, 1], [1, 1.5, 3], [1.5, 1, 3]])
    proofs, first, second = ProvedSeparations(), np.array([S]), np.array([T])
    assert len(checked(proofs, x, first, second)) == 0
    for bounds in ends_of(proofs):
        bounds[:] = (1.0 + excess) * bounds
    assert len(intersecting_pairs(_raised(x, -1.0), first, second)) == 1
    assert len(proofs.intersecting_pairs(_raised(x, -1.0), first, second)) == (excess == 0.0)


@pytest.mark.parametrize("broken", [False, True])
def test_bounds_of_a_crumpling_sheet_that_are_doubled_are_caught(broken):
    """The comparison with the full search, on which the tests here rest, sees bounds that are too large."""
    rng = np.random.default_rng(8)
    sheet, triangles = grid(7, 7)
    waves, proofs, missed = rng.normal(0, 9, (3, 2)), ProvedSeparations(), 0
    for k in range(60):
        x = sheet + np.sin(0.05 * k) * np.array([0.5, 0.5, 0.9]) * np.sin(sheet[:, :2] @ waves.T)
        found = proofs.intersecting_pairs(x, triangles, None)
        missed += not np.array_equal(found, intersecting_pairs(x, triangles))
        for bounds in ends_of(proofs) if broken else ():
            bounds[np.isfinite(bounds)] *= 2.0
    assert (missed > 0) == broken


def test_searches_of_surfaces_that_are_gone_are_dropped():
    """They were kept for good: cloth that changes its triangles filled the memory."""
    proofs, rng = ProvedSeparations(), np.random.default_rng(0)
    x, triangles = soup(rng, 6)
    for cut in range(30):
        checked(proofs, x, triangles)
        kept = proofs._searches[0]
        checked(proofs, x, rng.permutation(triangles), triangles[: 1 + cut % 5])
        proofs.end_state()
        assert len(proofs._searches) <= 2 + IDLE
    assert kept is proofs._searches[0]
    assert kept.is_of(len(x), triangles, None)


def test_a_body_that_turns_and_runs_away_with_the_cloth():
    """Its motion is taken from that of the cloth: what both do alike uses up no bound, the rest does."""
    sheet, triangles = grid(6, 6)
    ground, others = grid(2, 2)
    ground = ground * 1.4 - [0.2, 0.2, 0.15]
    proofs, found = ProvedSeparations(), []
    for k in range(50):
        angle = 0.02 * k
        turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
        x = np.concatenate([sheet, (ground - 0.5) @ turn.T + 0.5]) + k * np.array([0.3, 0.0, -7.0])
        found.append(len(checked(proofs, x, triangles, others + len(sheet))))
    assert found[0] == 0
    assert max(found) > 0


def test_a_mesh_whose_seams_are_welded_starts_without_proofs():
    """The same number of vertices: two strips become one, whose neighbours share vertices that did not before."""
    sheet, triangles = grid(4, 4)
    x = np.concatenate([sheet, sheet * [0.9, 0.9, 1.0] + [0.95, 0.05, 0.0]])
    apart = np.concatenate([triangles, triangles + len(sheet)])
    border = np.flatnonzero(sheet[:, 0] == sheet[:, 0].max())
    welded = np.arange(len(x))
    welded[len(sheet) + np.flatnonzero(sheet[:, 0] == 0.0)] = border
    proofs = ProvedSeparations()
    for mesh in (apart, welded[apart], apart):
        proofs.take_effort()
        for k in range(3):
            lifted = x.copy()
            lifted[len(sheet) :, 2] += 0.05 * k
            checked(proofs, lifted, mesh)
            effort = proofs.take_effort()
            if k == 0 and mesh is not apart:
                assert effort.pairs_proved == effort.boxes_proved == 0
                assert effort.pairs_tested > 0
