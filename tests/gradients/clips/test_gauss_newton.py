"""Pieces of the search over few numbers: the update of derivatives, steps that are halved until the sum falls."""

from types import SimpleNamespace

import numpy as np

from clothsim.gradients.clips.gauss_newton import HALVINGS, broyden_update, halved_until_lower


def outcome(at, total=0.0, positions=()):
    return SimpleNamespace(at=np.asarray(at, float), total=total, positions=np.asarray(positions, float), failure="")


def test_updated_derivatives_give_the_change_and_nothing_across_it():
    rng = np.random.default_rng(0)
    moves, positions = rng.standard_normal((6, 3)), rng.standard_normal((2, 2, 3))
    before, after = outcome([0.1, 0.2, 0.3], positions=positions[0]), outcome([0.4, 0.2, -0.1], positions=positions[1])
    updated = broyden_update(moves, before, after)
    np.testing.assert_allclose(updated @ (after.at - before.at), (positions[1] - positions[0]).ravel(), atol=1e-12)
    across = np.array([0.4, 0.7, 0.3])
    assert across @ (after.at - before.at) == 0
    np.testing.assert_allclose(updated @ across, moves @ across, atol=1e-12)


def test_a_step_is_halved_until_the_sum_is_lower():
    seen, tried = outcome([0.0], total=1.0), []
    lower, runs = halved_until_lower(lambda at, _: outcome(at, (at[0] - 1) ** 2), seen, np.array([4.0]), tried.append)
    assert lower.at[0] == 1.0
    assert runs == len(tried) == 3
    none, runs = halved_until_lower(lambda at, _: outcome(at, 2.0), seen, np.array([4.0]), tried.append)
    assert none is None
    assert runs == HALVINGS + 1
