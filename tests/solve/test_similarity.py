"""Similarity: a scene in other units of length, time and mass is the same problem, and takes the same iterations.

Powers of two scale every number of a run without rounding, so that the bits stay the same in other units of time and
mass. In other units of length `World.rest_areas` differ by round-off (NumPy's determinant takes logarithms).
"""

import numpy as np
import pytest

from clothsim import Scene
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.solve.stepping.state import first_state
from clothsim.solve.stepping.time_loop import next_step

STEPS = 12
"""The sheet meets the ball in the second step, and forms folds from the tenth on."""


def falling_sheet(length=1.0, time=1.0, mass=1.0, **effects):
    """A sheet of 1 m at 1 m/s on a ball, for a unit of `length`, `time` and `mass` of 1."""
    return Scene(
        cloth={
            "mesh": "rectangle",
            "size": [length, length],
            "cells": [12, 12],
            "position": [0.01 * length, 0.003 * length, 0.33 * length],
            "velocity": [0.0, 0.0, -length / time],
            "density": 0.15 * mass / length**2,
            "thickness": 5e-4 * length,
            "youngs_modulus": 4e5 * mass / (length * time**2),
            "poisson_ratio": 0.3,
            "bending_stiffness": 3e-4 * mass * length**2 / time**2,
        },
        body={"mesh": "sphere", "radius": 0.3 * length},
        effects={
            "inertia": {},
            "membrane": {},
            "bending": {},
            "gravity": {"acceleration": [0.0, 0.0, -9.81 * length / time**2]},
            "damping": {"rate": 0.5 / time},
            "body_contact": {},
            "self_contact": {},
            "friction": {"coefficient": 0.4},
            **effects,
        },
        solver={"dt": 0.01 * time, "threads": 1},
        run={"duration": 0.01 * STEPS * time, "frames_per_second": 50 / time},
    )


def iterations_and_positions(scene):
    """Newton iterations of each step, and the last positions [m]."""
    built = build(scene)
    integrator = prepare(scene, built).integrator
    state, counts = first_state(built.world, integrator.dt), []
    for _ in range(STEPS):
        report = next_step(integrator, state, scene.run_settings.duration, scene.run_settings.frames_per_second)
        assert report.converged
        state = report.state
        counts.append(report.result.iterations)
    return counts, state.positions


@pytest.fixture(scope="module")
def in_metres():
    return iterations_and_positions(falling_sheet())


@pytest.mark.parametrize(("time", "mass"), [(4.0, 1.0), (0.25, 1.0), (1.0, 1024.0), (0.125, 4.0)])
def test_other_units_of_time_and_mass_give_the_same_bits(in_metres, time, mass):
    counts, positions = iterations_and_positions(falling_sheet(time=time, mass=mass))
    assert counts == in_metres[0]
    assert np.array_equal(positions, in_metres[1])


@pytest.mark.parametrize(
    ("length", "time", "mass"), [(10.0, 1.0, 1.0), (10.0, 10**0.5, 1.0), (1.0, 1.0, 1e3), (0.1, 0.3, 1e3)]
)
def test_any_other_units_take_the_same_iterations(in_metres, length, time, mass):
    counts, positions = iterations_and_positions(falling_sheet(length, time, mass))
    assert counts == in_metres[0]
    assert np.abs(positions / length - in_metres[1]).max() < 1e-4


def test_the_motion_depends_on_what_is_no_unit(in_metres):
    _, positions = iterations_and_positions(falling_sheet(damping={"rate": 5.0}))
    assert np.abs(positions - in_metres[1]).max() > 1e-3
