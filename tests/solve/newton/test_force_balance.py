"""Force balance: residual, scale, and runs whose forces are beyond double precision."""

import numpy as np
import pytest
from effect_builders import gravity, membrane
from meshes import deformed, small_world
from small_scenes import small_scene

from clothsim import simulate
from clothsim.physics.energies.protocols import Grip
from clothsim.solve.linear.dependent_rows import Dependence, DependentRows
from clothsim.solve.newton.convergence import BALANCED, force_balance, slipping_force
from clothsim.solve.newton.potential import Potential
from clothsim.solve.timers import Timers

FREE = np.arange(3, 9)


def balance_at(x, least=0.0, free=FREE):
    world = small_world()
    energies = {"membrane": membrane(world), "gravity": gravity(world)}
    return force_balance(Potential(energies, Timers()), x, free, least), energies


def test_residual_and_scale_are_those_of_the_gradients():
    x = deformed(small_world())
    forces, energies = balance_at(x, least=0.25)
    parts = [energy.gradient(x) for energy in energies.values()]
    assert forces.residual == np.abs(sum(parts)[FREE]).max()
    assert forces.scale == pytest.approx(max(np.abs(part).max() for part in parts) + 0.25)
    assert np.abs(sum(parts)[forces.row]).max() == forces.residual
    assert forces.row in FREE
    assert forces.relative == pytest.approx(forces.residual / forces.scale)
    assert forces.within(forces.relative * (1 + 1e-12))
    assert not forces.within(forces.relative * (1 - 1e-12))


def test_no_free_vertex_is_in_balance():
    forces, _ = balance_at(deformed(small_world()), free=FREE[:0])
    assert forces.relative == 0.0
    assert forces.within(0.0)


def test_what_is_left_tangentially_counts_against_the_friction_of_each_object():
    limits, normals = np.array([2.0, 2.0, 0.0, 8.0]), np.zeros((4, 3, 3))
    normals[:, 2, 2] = 1.0
    left = np.array([[0.3, 0, 9], [0, -0.4, 9], [5, 5, 5], [0.8, 0, -9]])
    grip = Grip(limits, normals, np.array([0, 0, 0, 1]))
    assert slipping_force(grip, left, np.arange(4), 0.0) == pytest.approx(0.7 / 4)
    assert slipping_force(grip, left, np.arange(1, 4), 0.0) == pytest.approx(0.4 / 2)  # a row that is held has no part
    assert slipping_force(grip, left, np.arange(4), 2.0) == pytest.approx(0.7 / 8)
    assert slipping_force(grip, 0 * left, np.arange(4), 0.0) == 0.0


def test_a_rigid_body_slips_by_its_net_force():
    """Rows 0 and 1 are its coordinates, pulled apart by its rigidity; it touches at row 3 of its surface 2, 3."""
    dependent = DependentRows((Dependence(slice(2, 4), slice(0, 2), np.eye(2)),), 4)
    normals = np.zeros((4, 3, 3))
    normals[3, 2, 2] = 1.0
    grip = Grip(np.array([0.0, 0, 0, 5.0]), normals, np.array([-1, -1, 0, 0]))
    left = np.array([[100.0, 0, 3], [-99.0, 0, 4], [0, 0, 0], [0, 0, 0]])
    assert slipping_force(grip, left, np.arange(2), 0.0, dependent) == pytest.approx(1 / 5)


SPHERE = {
    "cloth": {"mesh": "rectangle", "size": [0.5, 0.5], "cells": [6, 6], "density": 0.2},
    "body": {"name": "ball", "mesh": "sphere", "radius": 0.1, "subdivisions": 2},
}
EFFECTS = {"inertia": {}, "membrane": {}, "bending": {"model": "hinge"}, "gravity": {}}


def on_the_ball(folder, d_hat, **cloth):
    scene = small_scene(
        cloth=SPHERE["cloth"] | {"position": [0, 0, 0.102]} | cloth,
        body=SPHERE["body"],
        effects=EFFECTS | {"body_contact": {"d_hat": d_hat}},
        solver={"dt": 0.01, "tolerance": 1e-3, "threads": 1, "integrator": "backward_euler"},
        run={"duration": 0.12},
    )
    return simulate(scene, folder)


@pytest.mark.parametrize("d_hat", [1e-3, 1e-6])
def test_a_step_is_done_when_forces_balance(tmp_path, d_hat):
    """Before, up to 38,000 N were left on a vertex of half a gram at 1e-6 m."""
    run = on_the_ball(tmp_path, d_hat)
    certificate = run.summary["certificate"]
    assert run.status == "completed"
    assert certificate["relative_residual"] <= BALANCED
    assert max(entry["residual"] for entry in run.record()) < 0.3 * 10 * 0.05 * 9.81


@pytest.mark.parametrize("modulus", [1e18, 3e18, 8e18])
def test_a_stiffness_beyond_double_precision_is_a_failure_by_name(tmp_path, modulus):
    run = on_the_ball(tmp_path, 1e-3, youngs_modulus=modulus)
    failure = run.summary["failure"]
    assert run.status == "failed"
    assert failure["cause"] == "force balance"
    assert failure["element"].startswith("vertex ")
    assert "d_hat" in failure["remedy"]
    assert "stiffness" in failure["remedy"]
