"""Gap and reaction force of a sheet that rests on a slab (docs/results/validation.md, A5)."""

import numpy as np
import pytest
from meshes import UNIT
from solving import equilibrium

from clothsim.physics.contact.stiffness import barrier_stiffness
from clothsim.physics.energies.base import Step
from tests.known_answers.a5_contact import G, gap_ratio, resting, slope


def test_the_reference_has_the_digits_of_the_table():
    assert gap_ratio(1.0) == pytest.approx(0.78004076, abs=6e-9)
    assert slope(0.53) == pytest.approx(3.85, rel=0.02)


@pytest.mark.parametrize(("d_hat", "stiffness"), [(0.1, 50.0), (0.01, 50.0), (0.01, 5e3), (0.001, 2.0)])
def test_gap_and_reaction_of_a_sheet_at_rest(d_hat, stiffness):
    """ipctk weighs a vertex and a face by a quarter of the vertex's area: kappa A/4 |b'| = m g at every vertex."""
    expected = gap_ratio(4 * UNIT.density * G / stiffness)
    world, energies = resting(d_hat, stiffness, height=0.9 * d_hat)
    x = equilibrium(world, energies, world.start(), tolerance=1e-12, max_iterations=200)
    n = world.n_cloth
    assert np.abs(x[:n, 2] / d_hat - expected).max() < 1e-8
    weight = world.masses.sum() * G
    reaction = energies["body_contact"].gradient(x)
    assert reaction[n:, 2].sum() == pytest.approx(weight, rel=1e-8)
    assert np.abs(-reaction[:n, 2] - world.masses * G).max() < 1e-8 * weight
    assert np.abs(reaction[:, :2]).max() < 1e-9 * weight
    assert energies["body_contact"].minimum_gap(x) == pytest.approx(expected * d_hat, rel=1e-7)


def test_the_adaptive_stiffness_holds_the_weight_at_about_half_of_d_hat():
    world, energies = resting(0.01, "auto", height=0.009)
    x = world.start()
    load = energies["gravity"].gradient(x)
    step = Step(0.0, 1e3, x, np.zeros_like(x), 1.0, load)
    stiffness = energies["body_contact"].begin(step).stiffness
    assert stiffness == pytest.approx(UNIT.density * G)
    assert gap_ratio(4 * UNIT.density * G / stiffness) == pytest.approx(0.53, abs=0.01)


def test_what_pulls_at_a_pin_out_of_reach_does_not_stiffen_contact():
    world, energies = resting(0.01, "auto", height=0.5)
    x = world.start()
    pulled = np.zeros_like(x)
    pulled[0, 2] = 1e6
    begun = energies["body_contact"].begin(Step(0.0, 0.1, x, np.zeros_like(x), 1.0, pulled))
    assert begun.stiffness == pytest.approx(UNIT.density * 0.01 / 0.1**2)


def test_a_fast_sheet_is_stopped_within_the_step():
    speed, dt = 30.0, 0.01
    assert barrier_stiffness(0.0, 1.3, speed, 0.001, dt, dt) == pytest.approx(1.3 * speed / dt)


def test_the_error_of_the_gap_is_of_first_order_in_d_hat():
    """A sheet at rest hovers where contact would let it lie as d_hat goes to zero: the same fraction of each d_hat."""
    heights = []
    for d_hat in (0.08, 0.04, 0.02):
        world, energies = resting(d_hat, 50.0, height=0.9 * d_hat)
        heights.append(equilibrium(world, energies, world.start(), tolerance=1e-10)[: world.n_cloth, 2].mean())
    orders = np.log2(np.array(heights[:-1]) / heights[1:])
    np.testing.assert_allclose(orders, 1.0, atol=1e-6)
