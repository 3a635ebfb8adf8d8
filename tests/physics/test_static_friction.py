"""Static friction that holds: a card on a slope, on moving tables, and one that comes to rest."""

import numpy as np
import pytest

import clothsim

G = 9.81


def slope(tangent, friction, duration=2.0, cells=(2, 2), velocity=0.0, motion=None, solver=None, **run):
    """A card of 30 x 20 cm on a table of two triangles, across their edge; the table is tilted about y.

    Returns the times, the positions along and across the slope (k, n, 3) [m] and the summary.
    """
    angle = np.arctan(tangent)
    c, s = np.cos(angle), np.sin(angle)
    turn, degrees = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]), [0, float(np.degrees(angle)), 0]
    scene = clothsim.Scene(
        cloth={
            "mesh": "rectangle",
            "size": [0.3, 0.2],
            "cells": list(cells),
            "position": (turn @ [0.05, 0.03, 1e-3]).tolist(),
            "rotation_degrees": degrees,
            "velocity": (turn @ [velocity, 0, 0]).tolist(),
            "density": 0.3,
            "bending_stiffness": 1e-3,
        },
        body={
            "name": "table",
            "mesh": "slab",
            "size": [3, 3, 0.1],
            "position": (turn @ [0, 0, -0.05]).tolist(),
            "rotation_degrees": degrees,
            "motion": motion or {},
        },
        effects={"inertia": {}, "membrane": {}, "bending": {}, "gravity": {}}
        | {"body_contact": {"d_hat": 2e-3}, "friction": friction},
        solver={"dt": 0.02, "threads": 1, "linear": "superlu", "integrator": "backward_euler"} | (solver or {}),
        run={"duration": duration, "frames_per_second": 10},
    )
    found = clothsim.simulate(scene, **run)
    return found.times, np.array([found.positions(k) for k in range(len(found.times))]) @ turn, found.summary


@pytest.mark.parametrize("integrator", ["backward_euler", "bdf2"])
@pytest.mark.parametrize("share", [0.8, 0.99])
def test_below_mu_nothing_moves_after_the_first_second(tmp_path, share, integrator):
    times, x, summary = slope(share * 0.5, {"coefficient": 0.5}, solver={"integrator": integrator}, output=tmp_path)
    after = x[times > 1.0 - 1e-9]
    assert np.abs(after - after[0]).max() < 1e-12
    if integrator == "backward_euler":
        assert summary["certificate"]["energy_drift"] < 1e-12


def test_above_mu_static_it_slides_with_mu_kinetic(tmp_path):
    for static, kinetic in ((0.5, 0.5), (0.6, 0.3)):
        where, friction = tmp_path / str(static), {"mu_static": static, "mu_kinetic": kinetic}
        times, x, _ = slope(0.7, friction, duration=0.6, output=where)
        angle, along = np.arctan(0.7), x[:, :, 0].mean(axis=1)
        acceleration = np.diff(along, 2)[2:] / np.diff(times)[0] ** 2
        assert acceleration == pytest.approx(G * (np.sin(angle) - kinetic * np.cos(angle)), rel=1e-5)


def test_between_the_coefficients_it_holds_at_rest_and_slides_once_it_moves(tmp_path):
    friction = {"mu_static": 0.6, "mu_kinetic": 0.3}
    _, held, _ = slope(0.45, friction, duration=1.0, output=tmp_path / "held")
    assert np.abs(held[-1] - held[5]).max() < 1e-12
    times, x, _ = slope(0.45, friction, duration=1.0, velocity=0.1, output=tmp_path / "pushed")
    angle = np.arctan(0.45)
    acceleration = np.diff(x[:, :, 0].mean(axis=1), 2)[2:] / np.diff(times)[0] ** 2
    assert acceleration == pytest.approx(G * (np.sin(angle) - 0.3 * np.cos(angle)), rel=1e-4)


def test_a_card_that_slides_on_a_level_table_comes_to_rest_and_stays(tmp_path):
    """Distance of backward Euler: v falls by mu g dt in each step."""
    times, x, summary = slope(0.0, {"coefficient": 0.5}, duration=1.0, velocity=0.3, cells=(4, 3), output=tmp_path)
    speeds = 0.3 - 0.5 * G * 0.02 * np.arange(1, 4)
    assert (x[-1] - x[0])[:, 0].mean() == pytest.approx(0.02 * speeds[speeds > 0].sum(), rel=0.1)
    assert np.abs(x[-1] - x[times.searchsorted(0.5)]).max() < 1e-12
    assert summary["certificate"]["energy_drift"] < 1e-12


def test_a_moving_table_takes_the_card_along(tmp_path):
    times, x, _ = slope(0.0, {}, motion={"velocity": [0.2, 0, 0]}, output=tmp_path / "belt")
    beside = x - times[:, None, None] * [0.2, 0, 0]
    after = beside[times > 1.0 - 1e-9]
    assert np.abs(after - after[0]).max() < 1e-12
    times, x, _ = slope(0.0, {}, motion={"rotate_degrees_per_second": [0, 0, 30]}, output=tmp_path / "turntable")
    c, s = np.cos(np.radians(30) * times)[:, None], np.sin(np.radians(30) * times)[:, None]
    beside = np.stack([c * x[:, :, 0] + s * x[:, :, 1], c * x[:, :, 1] - s * x[:, :, 0], x[:, :, 2]], axis=-1)
    after = beside[times > 1.0 - 1e-9]
    assert np.abs(after - after[0]).max() < 1e-6


@pytest.mark.parametrize("integrator", ["backward_euler", "bdf2"])
def test_a_card_on_a_table_that_tilts_slips_at_mu(tmp_path, integrator):
    """Past that slope it is driven by g sqrt(1 + mu^2) w t; it was held longer, and had slid a third as far."""
    mu, start, rate, duration = 0.3, 15.5, 5.0, 0.5
    motion = {"rotate_degrees_per_second": [0, rate, 0], "centre": [0, 0, 0]}
    tilted, solver = np.tan(np.radians(start)), {"integrator": integrator, "dt": 0.01}
    times, x, _ = slope(tilted, {"coefficient": mu}, duration, motion=motion, solver=solver, output=tmp_path)
    turned = np.radians(rate) * times
    along = x[:, :, 0].mean(axis=1) * np.cos(turned) - x[:, :, 2].mean(axis=1) * np.sin(turned)
    late = duration - (np.degrees(np.arctan(mu)) - start) / rate
    slid = G * np.sqrt(1 + mu**2) * np.radians(rate) * late**3 / 6
    assert along[-1] - along[1] == pytest.approx(slid, rel=0.05)


def test_a_resumed_run_has_the_same_bits(tmp_path):
    _, whole, _ = slope(0.4, {"mu_static": 0.5, "mu_kinetic": 0.35}, duration=0.4, velocity=0.1, output=tmp_path / "a")
    once = tmp_path / "b"

    def stop(progress):
        if progress.time > 0.2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        slope(0.4, {"mu_static": 0.5, "mu_kinetic": 0.35}, duration=0.4, velocity=0.1, output=once, progress=stop)
    resumed = clothsim.resume(once)
    angle = np.arctan(0.4)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    again = np.array([resumed.positions(k) for k in range(len(resumed.times))]) @ turn
    assert np.array_equal(again, whole)
