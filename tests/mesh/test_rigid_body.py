"""Affine coordinates of rigid bodies: exact masses, exact joints, refused surfaces.

Volume moments against closed forms and the divergence theorem's invariances.
"""

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.generators.shapes import capsule, ring, slab, sphere
from clothsim.mesh.rigid_body import Joint, rigid_body, volume_moments

RNG = np.random.default_rng(4)
TURN = rotation_matrix(np.array([0.4, 0.9, -0.5]))
SHIFT = np.array([0.3, -0.2, 0.7])
POINT, AXIS = np.array([0.1, 0.4, -0.2]), np.array([0.2, -1.0, 0.4])
JOINTS = {
    "free": None,
    "ball": Joint(POINT, np.zeros(3)),
    "hinge": Joint(POINT, AXIS),
    "wheel": Joint(SHIFT, TURN[:, 2]),
}
COUNTS = {"free": 4, "ball": 3, "hinge": 2, "wheel": 2}


def box(joint=None, velocity=(0, 0, 0), spin=(0, 0, 0)):
    positions, triangles = slab((0.2, 0.3, 0.5), (2, 2, 2))
    placed = positions @ TURN.T + SHIFT
    return rigid_body("box", placed, triangles, 800.0, np.array(velocity), np.array(spin), 1e8, joint)


def positions_of(body, coordinates):
    return body.offset + body.weights @ coordinates


@pytest.mark.parametrize("name", JOINTS)
def test_the_coordinates_at_the_start_give_the_start(name):
    body = box(JOINTS[name])
    assert body.coordinates.shape == (COUNTS[name], 3)
    assert positions_of(body, body.coordinates) == pytest.approx(body.positions, abs=1e-13)
    assert body.deformation(body.coordinates) == pytest.approx(np.eye(3), abs=1e-13)


@pytest.mark.parametrize("name", JOINTS)
def test_the_masses_give_kinetic_energy_and_weight_of_every_affine_motion(name):
    body = box(JOINTS[name])
    moments = volume_moments(body.positions, body.triangles)
    velocities = RNG.standard_normal(body.coordinates.shape)
    rate = velocities.T @ body.gradients  # of A
    centre = np.linalg.lstsq(
        np.column_stack([body.positions, np.ones(len(body.positions))]), body.weights @ velocities, rcond=None
    )[0].T @ np.append(moments.centroid, 1.0)
    kinetic = 0.5 * body.mass * (centre @ centre + np.trace(rate @ moments.covariance @ rate.T))
    assert 0.5 * body.masses @ (velocities**2).sum(axis=1) == pytest.approx(kinetic, rel=1e-12)
    assert body.weighing @ velocities == pytest.approx(body.mass * centre, rel=1e-12)


@pytest.mark.parametrize("name", ["ball", "hinge", "wheel"])
def test_a_joint_holds_whatever_the_coordinates_are(name):
    joint = JOINTS[name]
    body = box(joint)
    coordinates = RNG.standard_normal(body.coordinates.shape)
    held = [joint.point, joint.point + joint.axis]
    first = body.positions[0]
    for point in held:
        functions = body.weights[0] + (point - first) @ body.gradients.T
        offset = body.offset[0] + (point - first) @ body.constant.T
        assert offset + functions @ coordinates == pytest.approx(point, abs=1e-12)


@pytest.mark.parametrize("name", ["free", "ball", "hinge"])
def test_the_velocities_are_those_of_a_rigid_motion(name):
    spin = np.array([1.0, 2.0, -0.5])
    velocity = np.array([0.3, 0.1, 0.2]) if name == "free" else np.zeros(3)
    joint = JOINTS[name]
    body = box(joint, velocity, spin)
    centre = volume_moments(body.positions, body.triangles).centroid if joint is None else joint.point
    if name == "hinge":
        unit = AXIS / np.linalg.norm(AXIS)
        spin = (spin @ unit) * unit
    expected = velocity + np.cross(spin, body.positions - centre)
    assert body.weights @ body.velocities == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("name", JOINTS)
def test_an_origin_moves_all_positions_alike(name):
    body, origin = box(JOINTS[name]), np.array([10.0, -7.0, 3.0])
    moved = body.relative_to(origin)
    assert positions_of(moved, moved.coordinates) == pytest.approx(body.positions - origin, abs=1e-12)
    assert moved.deformation(moved.coordinates) == pytest.approx(np.eye(3), abs=1e-13)


def test_triangles_that_face_inwards_are_turned():
    positions, triangles = slab((1.0, 1.0, 1.0))
    body = rigid_body("box", positions, triangles[:, ::-1], 5.0, np.zeros(3), np.zeros(3), 1e8)
    assert body.mass == pytest.approx(5.0)


def test_what_is_no_solid_is_refused():
    positions, triangles = capsule(0.1, 0.5, 8)
    with pytest.raises(InputError, match="open: 3 edges"):
        rigid_body("pot", positions, triangles[1:], 1.0, np.zeros(3), np.zeros(3), 1e8)
    flat = positions * [1.0, 1.0, 1e-6]
    with pytest.raises(InputError, match="almost no volume"):
        rigid_body("leaf", flat, triangles, 1.0, np.zeros(3), np.zeros(3), 1e8)
    with pytest.raises(InputError, match="joint and a velocity"):
        rigid_body("door", positions, triangles, 1.0, np.ones(3), np.zeros(3), 1e8, JOINTS["hinge"])


OTHER_TURN = rotation_matrix(np.array([0.3, -1.1, 0.7]))
OTHER_SHIFT = np.array([5.0, -3.0, 2.0])


def test_a_box_has_the_moments_of_a_box():
    size = np.array([0.2, 0.5, 0.9])
    positions, triangles = slab(size, (2, 1, 3))
    moments = volume_moments(positions @ OTHER_TURN.T + OTHER_SHIFT, triangles)
    assert moments.volume == pytest.approx(size.prod(), rel=1e-13)
    assert moments.centroid == pytest.approx(OTHER_SHIFT, abs=1e-13)
    assert moments.covariance == pytest.approx(OTHER_TURN @ np.diag(size**2 / 12) @ OTHER_TURN.T, abs=1e-13)


def test_a_ball_converges_to_the_moments_of_a_ball():
    off = []
    for subdivisions in (3, 4):
        moments = volume_moments(*sphere(1.0, subdivisions))
        off.append([moments.volume / (4 * np.pi / 3) - 1, moments.covariance[0, 0] / 0.2 - 1])
    assert np.allclose(np.divide(*off), 4.0, rtol=0.05)
    assert np.abs(off[1]).max() < 0.01


def test_a_ring_converges_to_the_moments_of_a_torus():
    radius, half = 0.05, 0.01
    moments = volume_moments(*ring(radius, 2 * half, 96, 48))
    assert moments.volume == pytest.approx(2 * np.pi**2 * radius * half**2, rel=0.01)
    assert moments.covariance[2, 2] == pytest.approx(half**2 / 4, rel=0.01)
    assert moments.covariance[0, 0] == pytest.approx(0.5 * radius**2 + 3 * half**2 / 8, rel=0.01)


def test_a_surface_that_faces_inwards_has_a_negative_volume():
    positions, triangles = slab((1.0, 1.0, 1.0))
    assert volume_moments(positions, triangles[:, ::-1]).volume == pytest.approx(-1.0)
