"""Deformation gradients, area ratios and material frames."""

import numpy as np
import pytest
from meshes import deformed, random_rotation, small_world

from clothsim.base.errors import InputError
from clothsim.geometry.kinematics.deformation_gradient import area_ratios, deformation_gradients, reference_frames


def gradients(world, x):
    return deformation_gradients(x, world.triangles, world.rest_shape_inverses)


def test_maps_rest_edges_to_deformed_edges():
    world = small_world(curved=True)
    x = deformed(world)
    F = gradients(world, x)
    corners = x[world.triangles]
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
    assert F.shape == (len(world.triangles), 3, 2)
    np.testing.assert_allclose(F @ world.rest_shapes, edges, rtol=0, atol=1e-15)


def test_an_affine_map_of_a_flat_sheet_gives_its_matrix_everywhere():
    world = small_world()
    A = np.random.default_rng(0).standard_normal((3, 3))
    F = gradients(world, world.start() @ A.T + [1.0, 2.0, 3.0])
    frames = reference_frames(world.start(), world.triangles)
    np.testing.assert_allclose(F, A @ frames[:, :, :2], rtol=0, atol=1e-14)


def test_uniform_scaling_by_two():
    world = small_world(curved=True)
    F = gradients(world, 2 * world.start())
    np.testing.assert_allclose(np.swapaxes(F, 1, 2) @ F, np.broadcast_to(4 * np.eye(2), (len(F), 2, 2)), atol=1e-13)
    np.testing.assert_allclose(area_ratios(F), 4, rtol=1e-13)


def test_area_ratio_is_the_ratio_of_the_areas():
    world = small_world(curved=True)
    x = deformed(world)
    corners = x[world.triangles]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    np.testing.assert_allclose(area_ratios(gradients(world, x)), areas / world.rest_areas, rtol=1e-13)


def test_float32_stays_float32():
    world = small_world()
    F = deformation_gradients(
        world.start().astype(np.float32), world.triangles, world.rest_shape_inverses.astype(np.float32)
    )
    assert F.dtype == area_ratios(F).dtype == np.float32


def test_frames_are_rotations_with_the_edges_of_the_material_plane():
    world = small_world(curved=True)
    frames = reference_frames(world.start(), world.triangles)
    np.testing.assert_allclose(np.linalg.det(frames), 1, rtol=1e-14)
    np.testing.assert_allclose(
        frames @ np.swapaxes(frames, 1, 2), np.broadcast_to(np.eye(3), frames.shape), rtol=0, atol=1e-14
    )
    np.testing.assert_allclose(gradients(world, world.start()), frames[:, :, :2], rtol=0, atol=1e-14)


def test_frames_rotate_with_the_mesh():
    world = small_world(curved=True)
    R = random_rotation(2)
    before = reference_frames(world.start(), world.triangles)
    after = reference_frames(world.start() @ R.T, world.triangles)
    np.testing.assert_allclose(after, R @ before, rtol=0, atol=1e-13)


def test_a_triangle_without_area_has_no_frame():
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0.0]])
    with pytest.raises(InputError, match=r"triangle 1 .*2 such"):
        reference_frames(positions, np.array([[0, 1, 2], [0, 1, 3], [0, 0, 1]]))
