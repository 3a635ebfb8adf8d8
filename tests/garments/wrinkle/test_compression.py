"""Compression at vertices: a known stretch, turned and bent sheets, memory over the frames."""

import numpy as np
import pytest

from clothsim.garments.wrinkle.compression import MEMORY, Rings, blended_in_time, compression_of, ring_tensors
from clothsim.geometry.kinematics.deformation_gradient import deformation_gradients
from clothsim.geometry.kinematics.kabsch_frames import vertex_frames
from clothsim.geometry.kinematics.stretch import polar_decomposition
from clothsim.mesh.cloth import triangle_planes
from clothsim.mesh.generators.shapes import rectangle
from clothsim.mesh.topology import vertex_rings

REST, TRIANGLES = rectangle(size=(1.0, 1.0), cells=(6, 6))
UP = np.tile([0.0, 0.0, 1.0], (len(REST), 1))


class Deformed:
    """What `ring_tensors` asks of a run: one frame of the sheet at `positions`."""

    def __init__(self, positions):
        shapes = triangle_planes(REST, TRIANGLES)
        edges = np.stack([shapes[:, 1] - shapes[:, 0], shapes[:, 2] - shapes[:, 0]], axis=2)
        polar = polar_decomposition(deformation_gradients(positions, TRIANGLES, np.linalg.inv(edges)))
        frames = vertex_frames(REST, positions, *vertex_rings(TRIANGLES, len(REST))).rotations
        self.fields = {
            "principal_stretches": polar.principal_stretches,
            "principal_directions": polar.spatial_directions,
            "vertex_frames": frames,
        }

    def field(self, name, frame):
        return self.fields[name]


def tensors_at(positions):
    rings = Rings.of(TRIANGLES, np.full(len(TRIANGLES), 1 / 72), len(REST))
    return ring_tensors(Deformed(positions), 0, rings)


def turned(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


@pytest.mark.parametrize("angle", [0.0, 1.0, 2.5])
def test_a_uniform_stretch_is_found_in_material_axes_whatever_the_turn(angle):
    found = compression_of(tensors_at((REST * [1.1, 0.9, 1]) @ turned(angle).T), UP)
    np.testing.assert_allclose(found.stretches, [[1.1, 0.9]] * len(REST), atol=1e-12)
    np.testing.assert_allclose(np.abs(found.across), [[0, 1, 0]] * len(REST), atol=1e-9)
    np.testing.assert_allclose(found.amount, 0.1, atol=1e-12)


def test_a_rolled_sheet_is_not_compressed():
    """Its rings are bent: the means of what turns from triangle to triangle must not count as shortening."""
    angle = REST[:, 0] / 0.3
    chord = 2 * np.sin(1 / 12 / 0.3) * 0.3  # flat cells as long as at rest
    radius = 0.3 * (1 / 6) / chord
    rolled = np.column_stack([radius * np.sin(angle), REST[:, 1], radius * np.cos(angle)])
    assert compression_of(tensors_at(rolled), UP).amount.max() < 1e-3


def test_memory_forgets():
    first, second = np.eye(3)[None], 2 * np.eye(3)[None]
    assert blended_in_time(None, first, 0.0) is first
    np.testing.assert_allclose(blended_in_time(first, second, MEMORY), (2 - np.exp(-1)) * np.eye(3)[None])


def test_a_vertex_has_half_of_the_weight_and_its_ring_the_other():
    rings = Rings.of(np.array([[0, 1, 2], [2, 1, 3]]), np.array([1.0, 3.0]), 4)
    sixth = 1 / 6
    expected = [[0.5, 0.25, 0.25, 0], [sixth, 0.5, sixth, sixth], [sixth, sixth, 0.5, sixth], [0, 0.25, 0.25, 0.5]]
    assert np.allclose(rings.of_vertices.toarray(), expected, rtol=1e-15)
    assert np.allclose(rings.of_triangles.toarray(), [[1, 0], [0.25, 0.75], [0.25, 0.75], [0, 1]], rtol=1e-15)
