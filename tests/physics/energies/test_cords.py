"""Cords against closed forms: one tension everywhere, sliding without work, the pulley, and refused input."""

import numpy as np
import pytest
from effect_builders import cords, gravity
from meshes import cloth, grid
from solving import equilibrium, held, step_at, those_on

from clothsim.base.errors import InputError
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Off


def sheet(n=2):
    return make_world([cloth(*grid(n, n))])


def one(**keys):
    return cords(sheet(), cord=[{"select": "left", "stiffness": 20.0, **keys}])


def test_the_tension_of_a_loop_presses_on_each_corner():
    world, n, k, ratio = sheet(), 8, 20.0, 0.9
    energy = cords(world, cord=[{"select": "boundary", "stiffness": k, "length_ratio": ratio}])
    x, loop = world.start(), energy.rows[0, :-1]
    angles = 2 * np.pi * np.arange(n) / n
    x[loop] = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(n)])
    tension = k * (2 * n * np.sin(np.pi / n) / (ratio * 4.0) - 1)
    np.testing.assert_allclose(energy.gradient(x)[loop], 2 * tension * np.sin(np.pi / n) * x[loop], atol=1e-12)
    assert f"pulls with {tension:.3g} N" in energy.final_notes(x, 0.0)[0]


def test_what_slides_along_a_straight_cord_does_no_work():
    energy, x = one(length_ratio=0.5), sheet().start()
    moved = x + np.array([0, 0.3, 0]) * (np.arange(len(x)) == 1)[:, None]
    assert energy.value(moved) == pytest.approx(energy.value(x), rel=1e-14)
    assert energy.value(x) == pytest.approx(0.5 * 20.0 * 0.5**2 / 0.5)
    np.testing.assert_allclose(energy.gradient(x)[:3, 1], [-20.0, 0.0, 20.0], atol=1e-12)


def test_a_slack_cord_is_nothing():
    energy, x = one(length_ratio=1.1), sheet().start()
    assert energy.value(x) == 0.0
    assert not energy.gradient(x).any()
    assert not len(energy.hessian(x).elements)


def test_a_pulley_rests_where_both_sides_are_as_steep():
    """Fixed ends d apart at unlike heights, length l: the angle to the vertical is asin(d / l), T = m g / (2 cos)."""
    world = make_world([cloth(np.array([[0.0, 0, 0], [0.4, 0, -0.6], [1, 0, 0.2]]), np.array([[0, 1, 2]]))])
    length = np.linalg.norm(np.diff(world.start(), axis=0), axis=1).sum()
    energy = cords(world, cord=[{"select": [0, 1, 2], "stiffness": 500.0}])
    target = held(world.start(), [0, 2])
    x = equilibrium(world, those_on(cords=energy, gravity=gravity(world)), world.start() - [0, 0, 0.001], target)
    left, right = x[1] - x[0], x[1] - x[2]
    sines = np.array([abs(left[0]) / np.linalg.norm(left), abs(right[0]) / np.linalg.norm(right)])
    now = np.linalg.norm(left) + np.linalg.norm(right)
    np.testing.assert_allclose(sines, 1.0 / now, rtol=1e-7)
    tension = 500.0 * (now / length - 1)
    assert tension == pytest.approx(world.masses[1] * 9.81 / (2 * np.sqrt(1 - 1 / now**2)), rel=1e-7)


def test_cords_of_unlike_lengths_are_each_their_own():
    world = sheet()
    both = cords(world, cord=[{"select": s, "stiffness": 3.0, "length_ratio": 0.5} for s in ("boundary", [0, 1, 2])])
    parts = [cords(world, cord=[{"select": s, "stiffness": 3.0, "length_ratio": 0.5}]) for s in ("boundary", [0, 1, 2])]
    x = world.start() + 0.05 * np.random.default_rng(3).standard_normal((9, 3))
    assert both.value(x) == pytest.approx(sum(part.value(x) for part in parts))
    np.testing.assert_allclose(both.gradient(x), sum(part.gradient(x) for part in parts), atol=1e-12)
    matrices = [each.hessian(x).to_sparse(9).toarray() for each in (both, *parts)]
    np.testing.assert_allclose(matrices[0], matrices[1] + matrices[2], atol=1e-10)


def test_a_cord_is_pulled_over_time():
    energy = one(length_ratio=[[0.0, 1.0], [2.0, 0.5]])
    assert energy.drives
    np.testing.assert_allclose(energy.begin(step_at(sheet().start(), dt=1.0)).lengths, 0.75)


def test_what_does_nothing_is_off_and_what_is_too_long_is_refused():
    assert isinstance(cords(sheet(), cord=[]), Off)
    assert isinstance(one(stiffness=0), Off)
    with pytest.raises(InputError, match="runs through 405"):
        cords(sheet(101), cord=[{"select": "boundary", "stiffness": 1.0}])
