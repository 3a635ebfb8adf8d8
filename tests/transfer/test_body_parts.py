"""Corresponding landmarks of bodies of different shapes, poses and meshes."""

import numpy as np
import pytest
from capsule_bodies import person

from clothsim.mesh.generators.table import GENERATORS
from transfer.body_parts import derive_markers
from transfer.errors import TransferError

SLIM = person(0.045)
STOUT = person(0.036, leg_spread=0.35, arm_drop=0.55, girth=1.25)
SPREAD = person(0.045, arm_drop=0.0)


@pytest.mark.parametrize(("source", "target"), [(SLIM, STOUT), (STOUT, SLIM), (SLIM, SPREAD), (SPREAD, STOUT)])
def test_tips_and_bends_mean_the_same(source, target):
    markers = derive_markers(source, target)
    assert markers.shape == (8, 2)
    a, b = source[0][markers[:, 0]], target[0][markers[:, 1]]
    sides = [np.where(np.abs(points[:, 0]) < 0.08, 0, np.sign(points[:, 0])) for points in (a, b)]
    np.testing.assert_array_equal(*sides)
    assert sorted(sides[0]) == [-1, -1, -1, 0, 0, 1, 1, 1]  # hand, foot, armpit; head and crotch
    assert np.linalg.norm(a - b, axis=1)[sides[0] == 0].max() < 0.25
    assert (a[:, 1] < 0.1).sum() == (b[:, 1] < 0.1).sum() == 2
    assert ((a[:, 1] < 0.1) == (b[:, 1] < 0.1)).all()
    assert ((a[:, 1] > 1.55) == (b[:, 1] > 1.55)).all()


def test_place_and_unit_change_nothing():
    moved = SLIM[0] * 100 + [5, 6, 7], SLIM[1]
    np.testing.assert_array_equal(derive_markers(SLIM, STOUT), derive_markers(moved, STOUT))


@pytest.mark.parametrize("shape", ["sphere", "slab"])
def test_what_has_no_limbs_is_refused(shape):
    with pytest.raises(TransferError, match=r"\b5\b"):
        derive_markers(GENERATORS[shape](), SLIM)
