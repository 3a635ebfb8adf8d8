"""The winding number of closed, open and overlapping surfaces about a point."""

import numpy as np
import pytest

from clothsim.geometry.held_inside import is_inside, winding_number
from clothsim.mesh.generators.shapes import slab, sphere


def test_a_closed_surface_goes_round_its_inside_once():
    positions, triangles = sphere(radius=1.0)
    assert winding_number(np.array([0.2, -0.1, 0.3]), positions, triangles) == pytest.approx(1.0, abs=1e-12)
    assert winding_number(np.array([1.2, 0.0, 0.0]), positions, triangles) == pytest.approx(0.0, abs=1e-12)


def test_one_face_of_a_cube_is_a_sixth_of_all_directions():
    positions, triangles = slab(size=(2.0, 2.0, 2.0), cells=(1, 1, 1))
    top = triangles[(positions[triangles][:, :, 2] > 0.99).all(axis=1)]
    assert winding_number(np.zeros(3), positions, top) == pytest.approx(1 / 6, abs=1e-12)


def test_overlapping_bodies_are_inside_where_either_is_and_winding_does_not_matter():
    positions, triangles = sphere(radius=1.0)
    both = np.concatenate([positions, positions + np.array([0.5, 0.0, 0.0])])
    faces = np.concatenate([triangles, triangles + len(positions)])
    assert winding_number(np.array([0.25, 0.0, 0.0]), both, faces) == pytest.approx(2.0, abs=1e-12)
    assert is_inside(np.array([1.3, 0.0, 0.0]), both, faces[:, ::-1])
    assert not is_inside(np.array([1.6, 0.0, 0.0]), both, faces)
