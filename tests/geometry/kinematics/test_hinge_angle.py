"""Hinge angle against `mesh.cloth.dihedral_angles`, its derivatives against differences, and degenerate hinges."""

import numpy as np
import pytest
from differences import dense_hessian, gradient_error, hessian_error, taylor_slopes
from meshes import random_rotation

from clothsim.base.jit import kernel
from clothsim.geometry.kinematics import hinge_angle
from clothsim.mesh.cloth import dihedral_angles
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.physics.energies.hinge_kernels import angles

hinge_angle_gradient, hinge_blocks = kernel(hinge_angle.hinge_angle_gradient), hinge_angle.hinge_blocks
hinge_squares = hinge_angle.hinge_squares

HINGE = np.array([[0, 1, 2, 3]])


class Angle:
    """theta with the methods of an energy, for the difference checker."""

    def value(self, x):
        return float(angles(HINGE, x)[0])

    def gradient(self, x):
        return np.array(hinge_angle_gradient(*map(tuple, x)))

    def hessian(self, x, project):
        block = np.full((4, 3, 4, 3), np.nan)
        pairs = zip(*np.triu_indices(4), strict=True)
        for (p, q), own in zip(pairs, hinge_blocks(*map(tuple, x), 1.0, 0.0), strict=True):
            block[p, :, q], block[q, :, p] = np.array(own), np.array(own).T
        return ElementHessian(HINGE, block.reshape(1, 12, 12))


def fold(angle, seed=0):
    """A hinge of unequal triangles, folded by `angle` and rotated at random in space."""
    corners = np.array([[0, 0, 0], [1.1, 0, 0], [0.3, 0.8, 0], [0.6, -0.9, 0]])
    c, s = np.cos(angle), np.sin(angle)
    corners[3] = [0.6, -0.9 * c, -0.9 * s]
    return corners @ random_rotation(seed).T + np.random.default_rng(seed).standard_normal(3)


@pytest.mark.parametrize("angle", [0.0, 1e-9, -1e-5, 0.4, -1.7, 3.0, np.pi - 1e-9, -np.pi + 1e-6])
def test_angle_of_a_fold_and_of_dihedral_angles(angle):
    x = fold(angle)
    assert abs(Angle().value(x) - angle) < 1e-15 + 1e-14 * abs(angle)
    assert abs(dihedral_angles(x, HINGE)[0] - angle) < 1e-14


@pytest.mark.parametrize("angle", [0.0, 1e-6, 0.4, -1.7, 3.1, -3.1])
@pytest.mark.parametrize("seed", [0, 1])
def test_derivatives(angle, seed):
    x = fold(angle, seed)
    assert gradient_error(Angle(), x) < 1e-8
    assert hessian_error(Angle(), x) < 1e-8


@pytest.mark.parametrize("angle", [0.0, 0.4, -1.7, 3.1])
def test_squares_are_the_blocks_without_a_moment(angle):
    x = fold(angle)
    squares = np.array(hinge_squares(*map(tuple, x), 0.7))
    assert squares.any()
    assert np.array_equal(squares, np.array(hinge_blocks(*map(tuple, x), 0.0, 0.7)))
    x[2] = 0.5 * (x[0] + x[1])  # a triangle without area
    assert not np.array(hinge_squares(*map(tuple, x), 0.7)).any()


@pytest.mark.parametrize("angle", [0.2, 2.0, -2.8])
def test_taylor_slopes(angle):
    first, second = taylor_slopes(Angle(), fold(angle))
    assert abs(first - 2) < 0.1
    assert abs(second - 3) < 0.1


@pytest.mark.parametrize("angle", [0.0, 1.3, -3.0])
def test_rigid_motion_invariance_and_symmetry(angle):
    x = fold(angle)
    gradient, hessian = Angle().gradient(x), dense_hessian(Angle(), x)
    assert np.abs(gradient.sum(axis=0)).max() < 1e-14 * np.abs(gradient).max()
    assert np.abs(np.cross(x, gradient).sum(axis=0)).max() < 1e-14 * np.abs(gradient).max() * np.abs(x).max() * 4
    assert np.abs(hessian - hessian.T).max() < 1e-14 * np.abs(hessian).max()
    assert np.abs(hessian @ np.tile(np.eye(3), (4, 1))).max() < 1e-13 * np.abs(hessian).max()
    for axis in np.eye(3):
        spin = np.cross(axis, x).ravel()
        turned = np.cross(axis, gradient).ravel()
        assert np.abs(hessian @ spin - turned).max() < 1e-13 * np.abs(hessian).max()


@pytest.mark.parametrize("height", [1e-3, 1e-5, 1e-8])
def test_slivers_are_exact_to_their_condition(height):
    x = fold(0.7)
    foot = x[0] + 0.3 / 1.1 * (x[1] - x[0])
    x[2] = foot + height * (x[2] - foot)
    gradient = Angle().gradient(x)
    assert abs(Angle().value(x) - 0.7) < 1e-15 / height * 10
    assert abs(np.linalg.norm(gradient[2]) * height * 0.8 - 1) < 1e-15 / height * 10
    assert np.isfinite(dense_hessian(Angle(), x)).all()


@pytest.mark.parametrize("scale", [1e-60, 1e-3, 1.0, 1e60])
def test_degenerate_triangles_have_no_angle_and_zero_derivatives(scale):
    folded_away, point_edge, point = fold(0.7), fold(0.7), np.zeros((4, 3))
    folded_away[2] = 0.3 * folded_away[0] + 0.7 * folded_away[1]
    point_edge[1] = point_edge[0]
    for x in (folded_away, point_edge, point):
        assert Angle().value(scale * x) == np.inf
        assert not Angle().gradient(scale * x).any()
        assert not dense_hessian(Angle(), scale * x).any()
    assert np.isfinite(Angle().value(scale * fold(0.7)))
