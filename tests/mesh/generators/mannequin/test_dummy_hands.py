"""Hands of the mannequin in pictures."""

import numpy as np
import pytest

from clothsim.mesh.generators.mannequin import dummy_hands
from clothsim.mesh.generators.mannequin.dummy_hands import with_dummy_hands
from clothsim.mesh.generators.mannequin.generator import TEMPLATE_HEIGHT, joint, mannequin, template
from clothsim.mesh.generators.shapes import sphere

NOTHING = np.zeros((0, 3))
HEIGHT = 1.85


@pytest.fixture(scope="module")
def walking():
    return mannequin(pose="walk", height=HEIGHT)


def test_hands_are_blades_and_the_rest_stays(walking):
    x, triangles = walking
    drawn = with_dummy_hands(x, triangles, NOTHING)
    moved = np.linalg.norm(drawn - x, axis=1)
    for side in ("left", "right"):
        weight = template().weights[:, joint(f"{side}_wrist")]
        moved[weight > 0] -= HEIGHT / TEMPLATE_HEIGHT * np.linalg.norm(dummy_hands._moves(side)[1], axis=1)
        hands = [points[weight > dummy_hands.RIGID] for points in (x, drawn)]
        lengths, thicknesses = np.array([np.linalg.svd(each - each.mean(axis=0))[1] for each in hands]).T[[0, 2]]
        assert lengths[1] > 1.1 * lengths[0]
        assert thicknesses[1] < 0.65 * thicknesses[0]
    assert np.abs(moved).max() < 1e-9


def test_hands_in_a_sleeve_and_other_bodies_stay(walking):
    x, triangles = walking
    assert np.array_equal(with_dummy_hands(x, triangles, x), x)
    half = with_dummy_hands(x, triangles, x[x[:, 0] > 0])
    assert np.array_equal(half[x[:, 0] > 0.2], x[x[:, 0] > 0.2])
    assert not np.array_equal(half, x)
    ball, faces = sphere(radius=0.2)
    assert with_dummy_hands(ball, faces, NOTHING) is ball
