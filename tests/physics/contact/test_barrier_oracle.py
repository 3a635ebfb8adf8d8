"""Barrier against ipctk: energy, gradient, Hessian, gap and step limit."""

import ipctk
import numpy as np
import pytest
from contacts import jittered, sheet, sheet_on_ball, two_sheets
from differences import dense_hessian
from effect_builders import body_contact, self_contact
from ipctk_barrier import by_ipctk

from clothsim.mesh.world import make_world

D_HAT = 0.06


def folded():
    """A sheet folded over itself: neighbours across the fold, and the two halves, are close."""
    one = sheet()
    x = one.positions.copy()
    far = x[:, 0] > 0
    x[far] = np.column_stack([-x[far, 0] + 0.01, x[far, 1] + 0.013, 0.04 + 0.1 * x[far, 0]])
    return make_world([one]), x


def configurations():
    """Builder, world and x: sheet on a ball, parallel sheets, a folded sheet; exact and jittered."""
    ball = sheet_on_ball()
    yield "ball", body_contact, ball, ball.start()
    yield "ball, all but exact", body_contact, ball, jittered(ball.start(), ball.n_cloth, 1e-7)
    low = sheet_on_ball(0.31)
    for seed in range(3):
        yield f"ball {seed}", body_contact, low, jittered(low.start(), low.n_cloth, 0.002, seed)
    pair = two_sheets()
    yield "parallel", self_contact, pair, pair.start()
    for seed in range(3):
        yield f"parallel {seed}", self_contact, pair, jittered(pair.start(), pair.n_cloth, 0.004 * seed + 1e-6, seed)
    world, x = folded()
    for seed in range(2):
        yield f"folded {seed}", self_contact, world, jittered(x, world.n_cloth, 0.004, seed)


@pytest.mark.parametrize(
    ("builder", "world", "x"), [p[1:] for p in configurations()], ids=[p[0] for p in configurations()]
)
def test_energy_gradient_hessian_and_gap_against_ipctk(builder, world, x):
    mine = builder(world, d_hat=D_HAT, stiffness=3.0)
    oracle = by_ipctk(mine)
    energy = oracle.value(x)
    assert energy > 0
    assert mine.value(x) == pytest.approx(energy, rel=1e-11)
    gradient = oracle.gradient(x)
    assert np.abs(mine.gradient(x) - gradient).max() <= 1e-10 * np.abs(gradient).max()
    if builder is self_contact or not np.array_equal(x, world.start()):
        # the sheet's vertices stand exactly over the ball's edges at its start: the second derivative jumps there from
        # one region to the next, and either side is right; moved by 1e-7 both agree to 1e-15
        hessian = dense_hessian(oracle, x)
        assert np.abs(dense_hessian(mine, x) - hessian).max() <= 1e-8 * np.abs(hessian).max()
    assert mine.minimum_gap(x) == pytest.approx(oracle.minimum_gap(x), rel=1e-10)


@pytest.mark.parametrize(
    ("builder", "world", "x"), [p[1:] for p in configurations()], ids=[p[0] for p in configurations()]
)
def test_step_limit_is_at_most_that_of_tight_inclusion(builder, world, x):
    mine = builder(world, d_hat=D_HAT)
    oracle = by_ipctk(mine).candidates
    rng = np.random.default_rng(1)
    shortened = 0
    for size in (0.01, 0.1, 1.0):
        dx = size * rng.standard_normal(x.shape)
        found = ipctk.Candidates()
        paths = oracle.rows_of(x), oracle.rows_of(x + dx)
        found.build(oracle.mesh, *paths, 0.0, ipctk.LBVH())
        tight = ipctk.TightInclusionCCD(tolerance=1e-9, max_iterations=100_000_000, conservative_rescaling=1.0)
        impact = found.compute_collision_free_stepsize(oracle.mesh, *paths, 0.0, tight)
        limit = mine.step_limit(x, dx)
        assert 0.0 < limit <= impact * (1 + 1e-6)
        shortened += impact < 1.0
    assert shortened


@pytest.mark.parametrize(
    ("builder", "world", "x"), [p[1:] for p in configurations()], ids=[p[0] for p in configurations()]
)
def test_projected_hessian_is_positive_and_above_the_exact_one(builder, world, x):
    contact = builder(world, d_hat=D_HAT, stiffness=3.0)
    projected = contact.hessian(x, True).blocks
    exact = contact.hessian(x, False).blocks
    scale = np.abs(projected).max(axis=(1, 2))
    assert (np.linalg.eigvalsh(projected)[:, 0] >= -1e-12 * scale).all()
    assert (np.linalg.eigvalsh(projected - exact)[:, 0] >= -1e-9 * scale).all()
    assert (np.linalg.eigvalsh(exact)[:, 0] < -1e-3 * scale).any()
