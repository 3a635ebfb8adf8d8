"""A state at rest of a scene far from the origin: its rows, what the solve left, and its adjoint."""

import numpy as np
import pytest
from differences import dense_hessian

from clothsim import Scene, simulate
from clothsim.gradients import StateAtRest


@pytest.fixture(scope="module")
def hung():
    """A sheet that hangs from a side, and its state where the run ended."""
    cloth = {"mesh": "rectangle", "size": [0.3, 0.3], "cells": [3, 3], "position": [800.0, -300.0, 50.0]}
    effects = {"membrane": {}, "bending": {"model": "hinge"}, "gravity": {}, "pins": {"select": "left"}}
    scene = Scene(cloth=cloth, effects=effects, run={"duration": 1.0, "frames_per_second": 2}, solver={"dt": 0.5})
    positions = simulate(scene).positions(-1)
    return positions, StateAtRest.of_scene(scene, positions)


def test_rows_are_relative_to_the_origin_and_pins_where_they_are_held(hung):
    positions, state = hung
    assert np.abs(state.world.origin).max() > 100
    free = np.setdiff1d(np.arange(len(positions)), state.fixed)
    assert len(free) < len(positions)
    assert np.abs(state.x[free] + state.world.origin - positions[free]).max() < 1e-12
    moved = state.with_cloth(positions + np.array([0.0, 0.01, 0.02]))
    assert np.abs(moved[free] - state.x[free] - [0.0, 0.01, 0.02]).max() < 1e-12
    assert np.array_equal(moved[state.fixed], state.x[state.fixed])


def test_what_the_solve_left_and_the_adjoint(hung):
    positions, state = hung
    velocities, forces = np.random.default_rng(2).standard_normal((2, *state.x.shape))
    left = state.unfinished(velocities)
    assert left == pytest.approx((state.potential.gradient(state.x) * velocities).sum(axis=1)[: len(positions)])
    forces[state.fixed] = 0.0
    adjoint = state.adjoint([state.x], forces)
    hessian = sum(dense_hessian(energy, state.x) for energy in state.potential.acting.values())
    found = (hessian @ adjoint.ravel()).reshape(-1, 3)
    free = np.setdiff1d(np.arange(len(positions)), state.fixed)
    assert np.abs(found[free] - forces[free]).max() < 1e-6 * np.abs(forces).max()
    assert not adjoint[state.fixed].any()
