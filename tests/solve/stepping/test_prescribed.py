"""Prescribed positions of bodies, pins and ghosts at a time."""

import numpy as np
from effect_builders import pins
from meshes import cloth, grid

from clothsim.mesh.body import make_body, rigid_motion
from clothsim.mesh.world import make_world
from clothsim.solve.stepping.prescribed import prescribed

TRIANGLE = np.array([[0.0, 0, -1], [1, 0, -1], [0, 1, -1]]), np.array([[0, 1, 2]])


def world_of(**motions):
    bodies = [make_body(name, *TRIANGLE, rigid_motion(**motion)) for name, motion in motions.items()]
    return make_world([cloth(*grid(2, 2))], bodies)


def test_still_bodies_prescribe_nothing():
    where = prescribed(world_of(a={}, b={}), [], 1.0)
    assert len(where.vertices) == 0
    assert where.positions.shape == (0, 3)


def test_moving_bodies_and_pins_are_joined():
    world = world_of(still={}, rising={"velocity": (0.0, 0.0, 2.0)})
    world, constraint = pins(world, select=[4])
    where = prescribed(world, [constraint], 0.5)
    rows = world.body_slices[1]
    assert where.vertices.tolist() == [*range(rows.start, rows.stop), 4]
    assert np.array_equal(where.positions[:3], TRIANGLE[0] + [0, 0, 1.0])
    assert np.array_equal(where.positions[3], world.start()[4])


def test_a_body_turns_about_its_centre():
    turning = {"rotate_degrees_per_second": (0.0, 0.0, 90.0), "centre": (1.0, 0.0, 0.0)}
    where = prescribed(world_of(turning=turning), [], 1.0)
    assert np.allclose(where.positions, [[1, -1, -1], [1, 0, -1], [0, -1, -1]], atol=1e-15)
