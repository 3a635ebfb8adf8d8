"""Smooth surfaces for pictures: vertices stay, a ball becomes rounder, nothing sinks, folds keep their edge."""

import numpy as np
import pytest
import trimesh

from clothsim.mesh.topology import border_edges
from clothsim.render.surface_look import LEVELS, MOST_TRIANGLES, Surface, smoothed

NONE = np.zeros((0, 2))


def ball(role: str = "cloth", subdivisions: int = 2) -> Surface:
    made = trimesh.creation.icosphere(subdivisions=subdivisions)
    return Surface("ball", np.asarray(made.vertices), np.asarray(made.faces), role, NONE)


def test_vertices_stay_and_each_triangle_becomes_sixteen():
    before = ball()
    after = smoothed(before)
    assert np.array_equal(after.positions[: len(before.positions)], before.positions)
    assert len(after.triangles) == 4**LEVELS * len(before.triangles)
    assert len(border_edges(after.triangles)[0]) == 0


def test_a_ball_is_rounder_and_nothing_sinks_into_it():
    before, after = ball(), smoothed(ball())
    flat = np.linalg.norm(before.positions[before.triangles].mean(axis=1), axis=1).min()
    radii = np.linalg.norm(after.positions, axis=1)
    centres = np.linalg.norm(after.positions[after.triangles].mean(axis=1), axis=1)
    assert radii.min() > 1 - 0.25 * (1 - flat)
    assert radii.max() < 1 + 0.1 * (1 - flat)
    assert centres.min() > flat


def test_a_plane_stays_one_and_its_values_are_interpolated():
    x = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    after = smoothed(Surface("sheet", x, triangles, "cloth", NONE, values=x[:, 0]))
    assert np.abs(after.positions[:, 2]).max() == 0
    assert np.allclose(after.values, after.positions[:, 0])
    assert len(border_edges(after.triangles)[0]) == 4 * 2**LEVELS


def test_a_sharp_fold_is_not_rounded():
    x = np.array([[0, 0, 0], [0, 1, 0], [1, 0.5, 0.05], [1, 0.5, -0.05]])
    triangles = np.array([[0, 1, 2], [1, 0, 3]])
    after = smoothed(Surface("fold", x, triangles, "cloth", NONE))
    assert after.positions[:, 0].min() > -0.3


@pytest.mark.parametrize("surface", [ball("body"), ball(subdivisions=6)])
def test_bodies_and_fine_cloths_are_drawn_as_they_are(surface):
    after = smoothed(surface)
    assert np.array_equal(after.positions, surface.positions)
    assert len(surface.triangles) * 4 > MOST_TRIANGLES or surface.role == "body"
