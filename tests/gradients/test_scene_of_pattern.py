"""Cloths with four triangles for one."""

import numpy as np
import pytest

import clothsim
from clothsim import Cloth, Scene
from clothsim.base.errors import InputError
from clothsim.gradients.scene_of_pattern import halved, quartered
from tests.benchmarks import views


def flat(effects, groups=None, **keys):
    """A scene of a flat square of two by two cells."""
    x, y = (each.ravel() for each in np.meshgrid([0.0, 0.1, 0.2], [0.0, 0.1, 0.2]))
    corners = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [3, 4, 7], [3, 7, 6], [4, 5, 8], [4, 8, 7]])
    rest = np.column_stack([x, y])
    cloth = Cloth(np.column_stack([x, y, 0 * x]), corners, rest=rest, groups=groups or {}, **keys)
    return Scene(cloth, effects=effects)


def test_a_finer_mesh_is_the_same_cloth():
    scene = flat([clothsim.Membrane(), clothsim.Pins(select=[0, 1, 2])], {"left": [0, 1]})
    finer, weights, triangles = halved(scene)
    mesh = finer.cloths[0].mesh
    assert weights.shape == (25, 9)
    np.testing.assert_array_equal(mesh.triangles, triangles)
    np.testing.assert_allclose(mesh.vertices[triangles][:, :, :2], mesh.rest, atol=1e-12)
    np.testing.assert_array_equal(mesh.groups["left"], np.arange(8))
    held = mesh.vertices[list(finer.effects["pins"].select)]
    np.testing.assert_allclose(sorted(held[:, 0]), [0.0, 0.05, 0.1, 0.15, 0.2], atol=1e-12)
    assert not held[:, 1].any()


def test_a_sewn_skirt_keeps_its_area():
    scene = views.skirt(views.meshed(0.1), views.BENDING)
    finer, _, _ = halved(scene)
    areas = [np.abs(np.linalg.det(np.diff(each.cloths[0].mesh.rest, axis=1))).sum() for each in (scene, finer)]
    assert areas[1] == pytest.approx(areas[0], rel=1e-12)
    assert len(finer.effects["pins"].select) == 2 * len(scene.effects["pins"].select)


@pytest.mark.parametrize(
    ("scene", "named"),
    [
        (lambda: flat([clothsim.Membrane(), clothsim.Pins(group=[{"select": [0, 1]}])]), "groups"),
        (lambda: flat({"membrane": {}, "springs": {"spring": [{"ends": [0, 8]}]}}), "springs"),
        (
            lambda: Scene({"mesh": "rectangle", "size": [0.1, 0.1], "cells": [1, 1]}, effects=[clothsim.Membrane()]),
            "arrays",
        ),
    ],
)
def test_what_is_meshed_no_more_finely(scene, named):
    with pytest.raises(InputError, match=named):
        halved(scene())


def test_what_is_linear_over_triangles_is_so_over_their_quarters():
    scene = flat([clothsim.Membrane()])
    rest = scene.cloths[0].mesh.rest
    slope, at = np.array([[2.0, 3.0], [-1.0, 0.5]]), np.array([0.1, 0.2])
    np.testing.assert_allclose(quartered(rest @ slope + at), quartered(rest) @ slope + at, atol=1e-15)
    np.testing.assert_allclose(quartered(rest), halved(scene)[0].cloths[0].mesh.rest, atol=1e-15)
