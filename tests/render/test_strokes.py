import numpy as np
import pytest
from render_scenes import sheet

from clothsim.render.strokes import HALF_LENGTH, LIFT, WIDTHS, crosses, evenly_spaced, ribbons, spacing_of


def test_strokes_lie_along_the_directions_and_are_as_long_as_the_stretches():
    directions = np.array([[[0.6, -0.8], [0.8, 0.6], [0.0, 0.0]]])
    strokes = crosses(np.array([[1.0, 2.0, 3.0]]), directions, np.array([[1.2, 0.7]]), 0.1)
    along = strokes[0, :, 1] - strokes[0, :, 0]
    assert along == pytest.approx(2 * HALF_LENGTH * 0.1 * np.array([[1.2], [0.7]]) * directions[0].T)
    assert strokes.mean(axis=2)[0] == pytest.approx(np.tile([1.0, 2.0, 3.0], (2, 1)))


def test_ribbons_lie_on_both_sides_of_the_cloth():
    strokes = crosses(np.zeros((1, 3)), np.eye(3)[None, :, :2], np.ones((1, 2)), 1.0)
    corners, normals = ribbons(strokes, 1.0)
    assert corners.shape == normals.shape == (8, 3, 3)
    assert corners[..., 2] == pytest.approx(LIFT * normals[..., 2])
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.linalg.norm(facing, axis=1).sum() / 2 == pytest.approx(2 * 2 * HALF_LENGTH * sum(WIDTHS))


def test_chosen_triangles_are_about_as_far_apart_as_asked():
    surface = sheet(n=60)
    centres = surface.positions[surface.triangles].mean(axis=1)
    spacing = spacing_of(surface.positions, surface.triangles)
    chosen = evenly_spaced(centres, spacing)
    assert 0.5 / spacing**2 < len(chosen) < 3 / spacing**2  # of a bent sheet of side 1
    assert (np.diff(chosen) > 0).all()


def test_crosses_are_no_closer_than_the_triangles_are_large():
    surface = sheet(n=3)
    assert spacing_of(surface.positions, surface.triangles) >= np.sqrt(0.5) / 3
    centres = surface.positions[surface.triangles].mean(axis=1)
    assert len(evenly_spaced(centres, 1e-3)) == len(surface.triangles)
