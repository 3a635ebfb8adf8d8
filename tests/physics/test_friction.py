"""Coulomb friction of a sheet on an incline and of a belt round a drum (docs/results/validation.md, A5)."""

import numpy as np
import pytest

from tests.known_answers.a5_contact import G, belt_tensions, sliding


def test_sliding_acceleration_is_g_sin_minus_mu_g_cos():
    """Backward Euler: x = a T (T + dt) / 2."""
    angle, mu, dt, duration = np.radians(30), 0.5, 0.01, 1.0
    way, velocity = sliding(angle, mu, dt, duration)
    a = G * (np.sin(angle) - mu * np.cos(angle))
    expected = a * duration * (duration + dt) / 2
    assert expected == pytest.approx(0.33185842, abs=6e-9)
    # while the sheet is slower than eps_v friction is not yet full: less than eps_v times the duration
    assert way[:, 0] == pytest.approx(expected, abs=1e-3 * duration)
    assert velocity[:, 0] == pytest.approx(a * duration, abs=1e-3)
    assert np.abs(way[:, 1:]).max() < 1e-6


def test_sliding_of_bdf2_is_as_far_as_its_free_fall():
    """x = a (T^2/2 + 3/4 dt^2): friction takes its velocities from the same formula."""
    angle, mu, dt, duration = np.radians(30), 0.5, 0.02, 0.5
    way, velocity = sliding(angle, mu, dt, duration, eps_v=1e-5, formula="bdf2")
    a = G * (np.sin(angle) - mu * np.cos(angle))
    assert way[:, 0] == pytest.approx(a * (duration**2 / 2 + 0.75 * dt**2), abs=2e-5)
    assert velocity[:, 0] == pytest.approx(a * duration, abs=2e-5)


@pytest.mark.parametrize("formula", ["backward_euler", "bdf2"])
@pytest.mark.parametrize("fraction", [0.25, 0.5, 0.9])
def test_below_the_threshold_it_creeps_at_the_fraction_of_eps_v_that_ipc_friction_has(fraction, formula):
    mu, eps_v = 0.6, 1e-2
    _, velocity = sliding(np.arctan(fraction * mu), mu, 0.05, 1.0, eps_v, formula=formula)
    expected = 1 - np.sqrt(1 - fraction)
    if fraction == 0.5:
        assert expected == pytest.approx(0.29289322, abs=5e-9)
    assert velocity[:, 0] / eps_v == pytest.approx(expected, rel=1e-5)


def test_above_the_threshold_it_slides_away():
    mu = 0.5
    _, velocity = sliding(np.arctan(1.1 * mu), mu, 0.02, 0.5)
    angle = np.arctan(1.1 * mu)
    assert velocity[:, 0].min() > 100 * 1e-3
    assert velocity[:, 0] == pytest.approx(G * (np.sin(angle) - mu * np.cos(angle)) * 0.5, rel=0.01)


def test_without_a_coefficient_nothing_holds():
    way, _ = sliding(np.radians(30), 1e-12, 0.01, 0.2)
    assert way[:, 0] == pytest.approx(G * 0.5 * 0.2 * 0.21 / 2, rel=1e-6)


def test_more_passes_of_lagging_do_not_change_a_steady_slide():
    one, _ = sliding(np.radians(30), 0.5, 0.02, 0.2)
    three, _ = sliding(np.radians(30), 0.5, 0.02, 0.2, iterations=3)
    assert three == pytest.approx(one, abs=1e-7)


def test_capstan():
    """T2 / T1 = exp(mu phi), phi the angle of contact."""
    mu = 0.3
    expected = np.exp(mu * np.pi)
    assert expected == pytest.approx(2.56633240, abs=5e-9)
    tight, slack = belt_tensions(mu, 80)
    assert tight / slack == pytest.approx(expected, rel=5e-3)
    tight, slack = belt_tensions(1e-9, 40, steps=3)
    assert tight == pytest.approx(slack, rel=1e-3)
