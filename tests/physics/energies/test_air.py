"""Air: plates in wind, falling sheets and the fields of wind, against their closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from effect_builders import air, gravity, inertia, membrane
from meshes import UNIT, cloth, deformed, grid, irregular_grid, random_rotation, small_world
from solving import integrator_of, run_of, step_at

from clothsim import Gust, InputError, Scene, Vortex, resume, simulate
from clothsim.mesh.world import make_world
from clothsim.physics.energies.air import swing, wind_of
from clothsim.physics.energies.base import Off, Past

G = 9.81


def sheet(velocity=(0.0, 0.0, 0.0)):
    """A flat plate of area 1 that faces +z."""
    positions, triangles = irregular_grid()
    positions /= np.sqrt(make_world([cloth(positions, triangles)]).rest_areas.sum())
    return make_world([cloth(positions, triangles, velocity=velocity)])


def force_on(world, x=None, velocities=None, dt=0.1, **keys):
    """The sum of the forces at the end of a step in which everything keeps its velocity [N]."""
    x = world.start() if x is None else x
    v = np.zeros_like(x) + (world.start_velocities() if velocities is None else velocities)
    return -air(world, **keys).begin(step_at(x, v, dt)).gradient(x + dt * v).sum(axis=0)


# --- a plate --------------------------------------------------------------------------------------------------------


def test_a_plate_face_on_feels_half_rho_area_drag_v_squared():
    force = force_on(sheet(), wind=(0, 0, 3.0), density=1.3, drag=1.1, lift=0.4)
    assert np.abs(force - [0, 0, 0.5 * 1.3 * 1.0 * 1.1 * 9.0]).max() < 1e-13


@pytest.mark.parametrize("degrees", [10.0, 45.0, 80.0])
def test_drag_and_lift_of_a_plate_at_an_angle(degrees):
    """Against b, the angle between wind and plate: drag C (sin^2 b + (1 - lift) cos^2 b), lift C lift sin b cos b."""
    b, speed = np.radians(degrees), 4.0
    force = force_on(sheet(), wind=(speed * np.cos(b), 0, speed * np.sin(b)), density=2.0, drag=1.2, lift=0.8)
    along, across = [np.cos(b), 0, np.sin(b)], [-np.sin(b), 0, np.cos(b)]
    scale = 0.5 * 2.0 * 1.2 * speed**2
    assert force @ along == pytest.approx(scale * (np.sin(b) ** 2 + 0.2 * np.cos(b) ** 2), rel=1e-13)
    assert force @ across == pytest.approx(scale * 0.8 * np.sin(b) * np.cos(b), rel=1e-13)
    assert abs(force[1]) < 1e-13


def test_a_plate_that_moves_with_the_wind_feels_nothing():
    wind = (1.0, -2.0, 3.0)
    assert np.abs(force_on(sheet(), velocities=wind, wind=wind)).max() < 1e-13
    assert np.abs(force_on(sheet(), velocities=wind)).max() > 1.0


def test_it_is_the_relative_velocity_that_counts():
    here = force_on(sheet(), velocities=(1.0, 2.0, 3.0), wind=(0, 0, 0))
    there = force_on(sheet(), velocities=(5.0, 2.0, 1.0), wind=(4.0, 0, -2.0))
    assert np.abs(here - there).max() < 1e-12 * np.abs(here).max()


def test_the_force_turns_with_everything():
    world, turn = small_world(), random_rotation(3)
    x, wind = deformed(world), np.array([3.0, 1.0, -2.0])
    force = force_on(world, x, wind=wind)
    turned = force_on(world, x @ turn.T, wind=turn @ wind)
    assert np.abs(turned - turn @ force).max() < 1e-12 * np.abs(force).max()


def test_drag_may_vary_over_the_cloth():
    world = sheet()
    left = world.start()[world.triangles].mean(axis=1)[:, 0] < 0.5
    part = force_on(world, wind=(0, 0, 2.0), drag=np.where(left, 1.0, 0.0), density=1.0)
    assert part[2] == pytest.approx(2.0 * world.rest_areas[left].sum(), rel=1e-13)
    assert 0.2 < world.rest_areas[left].sum() < 0.8


def test_the_wind_of_the_end_of_the_step_and_its_strength():
    keys = {"density": 2.0, "drag": 1.0}
    steady = force_on(sheet(), wind=(0, 0, 3.0), **keys)[2]
    assert steady == pytest.approx(9.0)
    assert force_on(sheet(), dt=0.5, wind=(0, 0, 1.0), strength=[[0, 0], [1, 6.0]], **keys)[2] == pytest.approx(steady)
    assert force_on(sheet(), dt=0.5, wind=lambda x, t: [0, 0, 6 * t], **keys)[2] == pytest.approx(steady)


@pytest.mark.parametrize("dt", [0.01, 100.0])
def test_no_step_carries_a_sheet_past_the_wind(dt):
    world = sheet()
    energies = {"inertia": inertia(world), "membrane": membrane(world), "air": air(world, wind=(0, 0, 5.0))}
    for report in run_of(integrator_of(world, energies, dt, tolerance=1e-9), 5 * dt):
        speeds = report.state.velocities[: world.n_cloth, 2]
        assert 0 < speeds.min() <= speeds.max() <= 5.0 + 1e-9


# --- falling --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("formula", ["backward_euler", "bdf2"])
def test_a_falling_sheet_reaches_its_terminal_velocity(formula):
    """v(t) = v_t tanh(g t / v_t), v_t = sqrt(2 rho_A g / (rho C))."""
    world = sheet()
    energies = {"inertia": inertia(world), "membrane": membrane(world), "gravity": gravity(world)}
    energies["air"] = air(world, density=1.2, drag=2.0)
    terminal = np.sqrt(2 * UNIT.density * G / (1.2 * 2.0))
    integrator = integrator_of(world, energies, 0.05, tolerance=1e-9)
    end = run_of(replace(integrator, formula=formula), 4.0)[-1].state
    assert np.abs(end.velocities[: world.n_cloth] - np.array([0, 0, -terminal])).max() < 1e-3 * terminal


@pytest.mark.parametrize("formula", ["backward_euler", "bdf2"])
def test_the_fall_converges_to_its_closed_form_at_first_order(formula):
    world = sheet()
    energies = {"inertia": inertia(world), "membrane": membrane(world), "gravity": gravity(world)}
    energies["air"] = air(world, density=1.2, drag=2.0)
    terminal = np.sqrt(2 * UNIT.density * G / (1.2 * 2.0))
    exact, errors = terminal * np.tanh(G * 0.4 / terminal), []
    for dt in (0.02, 0.01, 0.005):
        integrator = integrator_of(world, energies, dt, tolerance=1e-10)
        end = run_of(replace(integrator, formula=formula), 0.4)[-1].state
        errors.append(abs(-end.velocities[: world.n_cloth, 2].mean() - exact))
    assert errors[-1] < 5e-3 * exact
    assert np.log2(np.divide(errors[:-1], errors[1:])).min() > 0.9


def test_velocities_are_taken_from_the_past_of_the_formula():
    """With another past, h and x^ are its: BDF2 feels the velocity that it steps with."""
    world = sheet()
    x = world.start()
    step = step_at(x, np.tile([0, 0, 2.0], (len(x), 1)), 0.1)
    past = Past(x - [0, 0, 0.3], step.velocities, 0.15)
    energy = air(world, density=1.0, drag=1.0).begin(replace(step, multistep_past=past))
    assert -energy.gradient(x).sum(axis=0)[2] == pytest.approx(-0.5 * 2.0 * 2.0, rel=1e-13)


def test_a_wind_that_raises_is_an_error_with_its_name():
    def gusty(points, time):
        return points["x"]

    with pytest.raises(InputError, match=r"w: .*gusty raised IndexError"):
        wind_of("w", gusty).at(np.zeros((2, 3)), 0.0)


# --- the fields -----------------------------------------------------------------------------------------------------


def test_a_gust_swings_within_its_amplitude_and_travels_with_the_wind():
    gust = wind_of("w", Gust(velocity=[4.0, 0, 0], amplitude=0.5, period=0.7))
    times = np.linspace(0, 50, 4001)
    here = np.array([gust.at(np.zeros((1, 3)), time)[0] for time in times])
    assert not here[:, 1:].any()
    assert 2.0 <= here[:, 0].min() < 2.5
    assert 5.5 < here[:, 0].max() <= 6.0
    assert abs(here[:, 0].mean() - 4.0) < 0.1
    downwind = gust.at(np.array([[8.0, 3.0, -1.0]]), 12.0)
    assert np.abs(downwind - gust.at(np.zeros((1, 3)), 10.0)).max() < 1e-12


def test_a_gust_sways_to_either_side_by_its_angle():
    gust = wind_of("w", Gust(velocity=[0, 3.0, 0], amplitude=0, sway_degrees=20))
    winds = gust.at(np.zeros((1, 3)) + np.linspace(0, 90, 4001)[:, None] * [0, 1, 0], 0.0)
    angles = np.degrees(np.arctan2(-winds[:, 0], winds[:, 1]))
    assert np.allclose(np.linalg.norm(winds, axis=1), 3.0)
    assert -20 <= angles.min() < -16
    assert 16 < angles.max() <= 20


def test_swing_stays_between_minus_one_and_one():
    g = swing(np.linspace(0, 1000, 100001))
    assert -1 <= g.min() < -0.9
    assert 0.9 < g.max() <= 1
    assert abs(g.mean()) < 0.01
    u = 0.7  # three sines whose paces have no common period
    turns = [0.5 * np.sin(2 * np.pi * u), 0.3 * np.sin(2 * np.pi * np.sqrt(2) * u + 1)]
    assert swing(np.array([u])) == pytest.approx(sum(turns) + 0.2 * np.sin(2 * np.pi * np.sqrt(5) * u + 2), rel=1e-12)


def test_a_vortex_turns_about_its_line_and_is_advected():
    keys = Vortex(circulation=2.0, core=0.3, centre=[1, 0, 5], axis=[0, 0, 2])
    vortex = wind_of("w", keys)
    r = 0.3
    assert np.allclose(vortex.at(np.array([[1 + r, 0, 7.0]]), 3.0), [[0, 2.0 / (2 * np.pi * 2 * r), 0]])
    far = 3e4
    assert vortex.at(np.array([[1.0, far, 0]]), 0.0)[0, 0] * far == pytest.approx(-2.0 / (2 * np.pi))
    moved = wind_of("w", keys.with_keys(velocity=[2.0, 0, 0]))
    assert np.allclose(moved.at(np.array([[7 + r, 0, 0]]), 3.0), [[2.0, 2.0 / (2 * np.pi * 2 * r), 0]])


def test_a_field_knows_the_scenes_own_coordinates():
    """A world far from the origin is solved about its own: the wind must not notice."""
    rest, triangles = grid(1, 1)
    far = make_world([cloth(rest, triangles)])
    far, seen = replace(far, origin=np.array([100.0, 0, 0])), []
    air(far, wind=lambda points, time: seen.append(points) or (0, 0, 1)).begin(step_at(far.start()))
    assert np.allclose(seen[0][:, 0], [100 + 2 / 3, 100 + 1 / 3])


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"wind": [1, 2]}, "effects.air.wind must be 3 numbers"),
        ({"wind": "west"}, "effects.air.wind must be 3 numbers"),
        ({"wind": {"kind": "storm"}}, "effects.air.wind.kind is 'storm'. Known: gust, vortex"),
        ({"wind": {"velocity": [1, 0, 0]}}, "effects.air.wind.kind is None"),
        ({"wind": {"kind": "gust"}}, "wind has no velocity"),
        ({"wind": {"kind": "gust", "velocity": [0, 0, 0]}}, "velocity is zero"),
        ({"wind": {"kind": "gust", "velocity": [1, 0, 0], "period": 0}}, "period must be above 0"),
        ({"wind": {"kind": "gust", "velocity": [1, 0, 0], "sway": 3}}, "has no key 'sway'"),
        ({"wind": {"kind": "vortex", "circulation": 1}}, "has no core"),
        ({"wind": {"kind": "vortex", "circulation": 1, "core": 1, "axis": [0, 0, 0]}}, "axis is zero"),
        ({"wind": {"function": "blow"}}, "effects.air.wind was the Python function 'blow'"),
        ({"lift": 1.5}, "effects.air.lift must be from 0 to 1"),
        ({"lift": [0.5] * 7 + [1.5] * 5}, "effects.air.lift is 1.5 on triangle 7"),
        ({"drag": -1}, "effects.air.drag must be at least 0"),
        ({"density": -1}, "effects.air.density must be at least 0"),
    ],
)
def test_a_bad_value_is_refused(keys, message):
    with pytest.raises(InputError, match=message):
        air(sheet(), **keys)


@pytest.mark.parametrize("bad", [[1, 2], [[0, 0, np.inf]] * 12, np.zeros((5, 3))])
def test_a_function_that_returns_no_wind_is_refused(bad):
    with pytest.raises(InputError, match=r"effects\.air\.wind returned"):
        force_on(sheet(), wind=lambda points, time: bad)


@pytest.mark.parametrize("keys", [{"density": 0}, {"drag": 0}, {"drag": [0.0] * 12}])
def test_it_is_off_without_density_or_drag(keys):
    assert isinstance(air(sheet(), wind=(1, 0, 0), **keys), Off)


def test_a_run_blown_by_a_function_is_made_but_cannot_be_resumed(tmp_path):
    scene = Scene(
        cloth={"mesh": "rectangle", "cells": [2, 2]},
        effects={"inertia": {}, "membrane": {}, "air": {"wind": lambda points, time: (0, 0, 2.0)}},
        solver={"dt": 0.02, "threads": 1, "linear": "superlu"},
        run={"duration": 0.08},
    )
    run = simulate(scene, tmp_path)
    assert run.status == "completed"
    assert run.positions(-1)[:, 2].min() > 1e-4
    assert run.summary["certificate"]["energy_drift"] == "bodies, pins or wind do work"
    with pytest.raises(InputError, match=r"effects\.air\.wind was the Python function .*lambda"):
        resume(tmp_path)
