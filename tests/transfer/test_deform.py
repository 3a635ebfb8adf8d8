"""Deformation transfer: exact reproduction, a single factorisation, and singular inputs."""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from clothsim.mesh.generators.table import GENERATORS
from transfer import deform
from transfer.deform import WEAK, deformation_transfer
from transfer.errors import TransferError
from transfer.gradients import deformation_gradients, gradient_operator, inverse_frames

BALL, TRIANGLES = GENERATORS["sphere"](radius=0.7, subdivisions=3)
RNG = np.random.default_rng(5)
SAME = np.column_stack([np.arange(len(TRIANGLES))] * 2)
SIZE = 1.4


def potato(points):
    """Another shape of the same topology."""
    x, y, z = points.T
    return np.column_stack([1.3 * x + 0.2 * y**2, 0.8 * y + 0.1 * np.sin(3 * z), 1.1 * z]) + np.array([0.3, -0.1, 0.2])


def bent(points, angle=1.2):
    """The upper half turns about the x axis, as a limb does; smooth and far from a similarity."""
    turn = angle / (1 + np.exp(-6 * points[:, 2]))
    y, z = points[:, 1], points[:, 2]
    return np.column_stack([points[:, 0], np.cos(turn) * y - np.sin(turn) * z, np.sin(turn) * y + np.cos(turn) * z])


def rotation():
    turn = np.linalg.qr(RNG.normal(size=(3, 3)))[0]
    return turn * np.sign(np.linalg.det(turn))


TARGET = potato(BALL)


@pytest.mark.parametrize("scale", [1.0, 0.3, 4.0])
@pytest.mark.parametrize("anchor", [0.0, 10.0])
def test_a_similarity_of_the_source_is_that_of_the_target(scale, anchor):
    transfer = deformation_transfer(TARGET, TRIANGLES, SAME, anchor=anchor)
    turn, shift = rotation(), np.array([3.0, -2.0, 1.0])
    posed = transfer.pose(BALL, TRIANGLES, scale * BALL @ turn.T + shift)
    assert np.abs(posed - (scale * TARGET @ turn.T + shift)).max() < 1e-9 * scale * SIZE


def test_a_source_at_rest_leaves_the_target_at_rest():
    posed = deformation_transfer(TARGET, TRIANGLES, SAME).pose(BALL, TRIANGLES, BALL)
    assert np.abs(posed - TARGET).max() < 1e-9 * SIZE


def test_an_affine_map_is_reproduced_where_the_target_is_the_source_and_only_there():
    affine, shift = np.eye(3) + 0.4 * RNG.normal(size=(3, 3)), np.array([1.0, 2.0, 3.0])
    moved = BALL @ affine.T + shift
    assert np.abs(deformation_transfer(BALL, TRIANGLES, SAME).pose(BALL, TRIANGLES, moved) - moved).max() < 1e-9
    other = deformation_transfer(TARGET, TRIANGLES, SAME).pose(BALL, TRIANGLES, moved)
    assert np.abs(other - (TARGET @ affine.T + shift)).max() > 1e-3


def test_any_pose_is_reproduced_where_the_target_is_the_source():
    posed = deformation_transfer(BALL, TRIANGLES, SAME).pose(BALL, TRIANGLES, bent(BALL))
    assert np.abs(posed - bent(BALL)).max() < 1e-9


def test_a_pose_there_and_back_returns_the_start_within_a_hundredth_of_the_size():
    pose = bent(BALL, angle=0.3)
    posed = deformation_transfer(TARGET, TRIANGLES, SAME).pose(BALL, TRIANGLES, pose)
    assert np.abs(posed - TARGET).max() > 0.15 * SIZE
    back = deformation_transfer(posed, TRIANGLES, SAME).pose(pose, TRIANGLES, BALL)
    assert np.abs(back - TARGET).max() < 0.01 * SIZE


def test_it_is_the_minimum_over_vertices_and_fourth_vertices():
    """The oracle is the full system of Sumner & Popovic, n + m unknowns, with many-to-many pairs and bare triangles."""
    pairs = np.unique(np.concatenate([SAME[50:], RNG.integers(0, len(TRIANGLES), (300, 2))]), axis=0)
    bare = np.setdiff1d(np.arange(len(TRIANGLES)), pairs[:, 1])
    assert len(bare)
    transfer = deformation_transfer(TARGET, TRIANGLES, pairs)
    followed = transfer.averages[bare]
    lent = np.column_stack([followed.tocoo().col, bare[followed.tocoo().row]])
    sources = deformation_gradients(inverse_frames(BALL, TRIANGLES, ""), bent(BALL), TRIANGLES)
    operator = gradient_operator(inverse_frames(TARGET, TRIANGLES, ""), TRIANGLES, len(TARGET)).tocsr()
    rows = [3 * t + b for _, t in (*pairs, *lent) for b in range(3)]
    weights = np.concatenate([np.ones(len(pairs)), WEAK * followed.tocoo().data])
    wanted = np.concatenate([sources[s].T for s, _ in (*pairs, *lent)])
    chosen = operator[rows][:, 1:]  # vertex 0 is pinned
    weighted = chosen.multiply(np.repeat(weights, 3)[:, None]).T.tocsr()
    full = np.vstack([np.zeros((1, 3)), spsolve((weighted @ chosen).tocsc(), weighted @ wanted)])[: len(TARGET)]
    posed = transfer.pose(BALL, TRIANGLES, bent(BALL))
    assert np.abs((posed - posed[0]) - full).max() < 1e-9 * SIZE


def test_one_factorisation_serves_all_poses(monkeypatch):
    calls = []
    factorise = deform.factorise
    monkeypatch.setattr(deform, "factorise", lambda matrix: calls.append(1) or factorise(matrix))
    transfer = deformation_transfer(TARGET, TRIANGLES, SAME)
    follow = transfer.follow(BALL, TRIANGLES)
    angles = (0.2, 0.4, 0.6)
    followed = [follow(bent(BALL, angle)) for angle in angles]
    posed = [transfer.pose(BALL, TRIANGLES, bent(BALL, angle)) for angle in angles]
    assert len(calls) == 1
    np.testing.assert_array_equal(followed, posed)
    alone = deformation_transfer(TARGET, TRIANGLES, SAME).pose(BALL, TRIANGLES, bent(BALL, angles[-1]))
    np.testing.assert_array_equal(alone, posed[-1])


def test_the_factor_costs_at_least_15_solves_of_three_coordinates():
    """Counted, not timed: multiplications of the Cholesky factorisation against two triangular solves, three times."""
    ball, triangles = GENERATORS["sphere"](radius=1.0, subdivisions=5)  # 10,242 vertices
    transfer = deformation_transfer(ball, triangles, np.column_stack([np.arange(len(triangles))] * 2))
    entries = np.diff(transfer.factor.L.tocsc().indptr).astype(float)
    assert (entries**2).sum() / (3 * 2 * entries.sum()) > 15


def test_each_component_finds_its_place():
    second = BALL * 0.2 + [0, 0, 1.2]
    rest, triangles = np.vstack([BALL, second]), np.vstack([TRIANGLES, TRIANGLES + len(BALL)])
    pairs = np.column_stack([np.arange(len(triangles))] * 2)
    target = potato(rest)
    turn, shift = rotation(), np.array([0.0, 5.0, 0.0])
    posed = deformation_transfer(target, triangles, pairs).pose(rest, triangles, 2 * rest @ turn.T + shift)
    assert np.abs(posed - (2 * target @ turn.T + shift)).max() < 1e-9


def test_a_component_without_any_pair_rides_along():
    second = BALL * 0.2 + [0, 0, 1.2]
    rest, triangles = np.vstack([BALL, second]), np.vstack([TRIANGLES, TRIANGLES + len(BALL)])
    turn = rotation()
    posed = deformation_transfer(rest, triangles, SAME).pose(BALL, TRIANGLES, BALL @ turn.T)
    assert np.abs(posed - rest @ turn.T).max() < 1e-9


def test_missing_pairs_do_not_spoil_a_similarity():
    turn = rotation()
    posed = deformation_transfer(TARGET, TRIANGLES, SAME[::7]).pose(BALL, TRIANGLES, 2 * BALL @ turn.T)
    assert np.abs(posed - 2 * TARGET @ turn.T).max() < 1e-9


def test_a_surface_with_holes_is_as_good_as_a_closed_one():
    open_triangles = TRIANGLES[TARGET[TRIANGLES].mean(axis=1)[:, 2] < 0.5]
    pairs = np.column_stack([np.arange(len(open_triangles))] * 2)
    turn = rotation()
    moved = deformation_transfer(TARGET, open_triangles, pairs).pose(BALL, open_triangles, BALL @ turn.T)
    assert np.abs(moved - TARGET @ turn.T).max() < 1e-9  # with vertices that no triangle uses


def test_vertices_of_no_triangle_go_with_the_nearest():
    rest = np.vstack([TARGET, [[0.3, 0.1, 3.0]]])
    turn = rotation()
    posed = deformation_transfer(rest, TRIANGLES, SAME).pose(BALL, TRIANGLES, 2 * BALL @ turn.T + 1)
    assert np.abs(posed - (2 * rest @ turn.T + 1)).max() < 1e-9


def test_zero_area_triangles_are_named_in_target_and_source():
    flat = np.vstack([TRIANGLES, [[0, 1, 1]]])
    with pytest.raises(TransferError, match=rf"triangle {len(TRIANGLES)}\b.*target"):
        deformation_transfer(TARGET, flat, SAME)
    transfer = deformation_transfer(TARGET, TRIANGLES, SAME)
    collapsed = BALL.copy()
    collapsed[TRIANGLES[40, 1]] = collapsed[TRIANGLES[40, 0]]
    with pytest.raises(TransferError, match=r"triangle \d+ .*source"):
        transfer.pose(collapsed, TRIANGLES, BALL)


def test_a_source_triangle_that_nothing_follows_may_be_flat():
    flat = np.vstack([[[0, 1, 1]], TRIANGLES])
    posed = deformation_transfer(TARGET, TRIANGLES, SAME + np.array([1, 0])).pose(BALL, flat, BALL)
    assert np.abs(posed - TARGET).max() < 1e-9


@pytest.mark.parametrize(
    ("pairs", "weights", "output"),
    [
        (np.zeros((0, 2), int), None, "pairs"),
        (SAME.astype(float), None, "float64"),
        ([[0, len(TRIANGLES)]], None, "triangle"),
        ([[-1, 0]], None, "triangle"),
        ([[0, 0]], [0.0], "positive|weights"),
        ([[0, 0]], [1.0, 2.0], "positive|weights"),
    ],
)
def test_bad_pairs_are_refused(pairs, weights, output):
    with pytest.raises(TransferError, match=output):
        deformation_transfer(TARGET, TRIANGLES, pairs, weights)


def test_a_source_of_another_size_is_refused():
    transfer = deformation_transfer(TARGET, TRIANGLES, SAME)
    with pytest.raises(TransferError, match=r"pairs.*triangle 1279\b.*source"):
        transfer.pose(BALL, TRIANGLES[:-1], BALL)
    with pytest.raises(TransferError):
        transfer.pose(BALL, TRIANGLES, np.vstack([BALL, BALL[:1]]))


def test_pairs_in_another_order_follow_the_same_triangles():
    """As many pairs as triangles is not yet one to one: each names the triangle that it follows."""
    order = np.random.default_rng(4).permutation(len(TRIANGLES))
    straight = deformation_transfer(BALL, TRIANGLES, SAME)
    shuffled = deformation_transfer(BALL, TRIANGLES, np.column_stack([np.argsort(order), np.arange(len(TRIANGLES))]))
    bent = BALL * [1.3, 1.0, 0.8] + 0.2 * np.sin(3 * BALL[:, [1, 2, 0]])
    expected = straight.pose(BALL, TRIANGLES, bent)
    np.testing.assert_allclose(shuffled.pose(BALL, TRIANGLES[order], bent), expected, atol=1e-9)
