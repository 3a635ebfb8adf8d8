"""Rigidity and ties of affine bodies: derivatives, zero for rigid motions, projection."""

import numpy as np
import pytest
from differences import dense_hessian, gradient_error, hessian_error, taylor_slopes

from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.generators.shapes import slab
from clothsim.mesh.rigid_body import Joint, rigid_body
from clothsim.mesh.world import make_world
from clothsim.physics.energies.rigid_bodies import Tied, functions_at, rigid_ties, rigidity
from clothsim.solve.stepping.integrators import angular_velocity
from tests.known_answers.unit_meshes import cloth, grid

TURN = rotation_matrix(np.array([0.4, -1.9, 2.5]))


def unit_world():
    """Three bodies of unit stiffness: free, on a hinge and on a ball joint, beside a sheet."""
    positions, triangles = slab((1.0, 1.4, 0.8))
    joints = (None, Joint(np.zeros(3), np.array([0.0, 0.6, 0.8])), Joint(np.full(3, 0.2), np.zeros(3)))
    bodies = [
        rigid_body(
            f"box{k}", positions + np.array([3.0 * k, 0, 0]), triangles, 1.0, np.zeros(3), np.zeros(3), 1.0, joint
        )
        for k, joint in enumerate(joints)
    ]
    return make_world([cloth(*grid(2, 2))], rigid=bodies)


def bent(world, amount=0.2):
    x = world.start()
    rows = slice(0, world.n_unknowns)
    x[rows] += amount * np.random.default_rng(1).standard_normal(x[rows].shape)
    return x


def ties_of(world):
    return rigid_ties(world, [Tied(0, np.array([0, 3]), 2.0), Tied(1, np.array([5]), 0.7), Tied(2, np.array([8]), 1.3)])


@pytest.mark.parametrize("make", [rigidity, ties_of])
def test_derivatives(make):
    world = unit_world()
    energy, x = make(world), bent(world)
    assert gradient_error(energy, x) < 1e-8
    assert hessian_error(energy, x) < 1e-8
    first, second = taylor_slopes(energy, x)
    assert first > 1.9
    assert second > 2.9


def test_rotations_store_nothing():
    world = unit_world()
    energy, x = rigidity(world), world.start()
    assert energy.value(x) == pytest.approx(0.0, abs=1e-25)
    free = world.coordinate_slices[0]
    x[free] = x[free] @ TURN.T + [1.0, 2.0, 3.0]
    assert energy.value(x) == pytest.approx(0.0, abs=1e-25)
    x[free] *= 1.1
    assert energy.value(x) == pytest.approx(3 * (1.1**2 - 1) ** 2 * world.rigid[0].volume, rel=1e-12)


def test_the_projected_hessian_is_the_nearest_positive_one():
    world = unit_world()
    energy, x = rigidity(world), bent(world)
    projected = dense_hessian(energy, x, project=True)
    exact = dense_hessian(energy, x)
    assert np.linalg.eigvalsh(exact).min() < -0.1
    assert np.linalg.eigvalsh(projected).min() > -1e-12
    values, vectors = np.linalg.eigh(exact)
    nearest = (vectors * np.maximum(values, 0)) @ vectors.T
    assert projected == pytest.approx(nearest, abs=1e-10 * np.abs(exact).max())


def test_ties_follow_the_body():
    world = unit_world()
    energy, x = ties_of(world), world.start()
    assert energy.value(x) == pytest.approx(0.0, abs=1e-25)
    body, free = world.rigid[0], world.coordinate_slices[0]
    x[free] = x[free] @ TURN.T
    x[[0, 3]] = x[[0, 3]] @ TURN.T
    assert energy.value(x) == pytest.approx(0.0, abs=1e-25)
    x[0] += [0.1, 0.0, 0.0]
    assert energy.value(x) == pytest.approx(0.5 * 2.0 * 0.01, rel=1e-10)
    functions, constant = functions_at(body, body.positions)
    assert constant + functions @ body.coordinates == pytest.approx(body.positions, abs=1e-12)


def test_the_angular_velocity_of_coordinates_that_turn_and_fly():
    world, spin = unit_world(), np.array([0.3, -1.2, 0.7])
    body, now = world.rigid[0], world.start()[world.coordinate_slices[0]] @ TURN.T
    rates = np.cross(spin, now - now.mean(axis=0)) + np.array([5.0, 6.0, 7.0])
    assert angular_velocity(body, now, rates) == pytest.approx(spin, rel=1e-9)
