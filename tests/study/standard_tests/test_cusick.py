"""Cusick drape test: the mesh of the ring of cloth, one lay."""

import numpy as np
import pytest

from clothsim.study.standard_tests import cusick
from clothsim.study.standard_tests.cusick import PLATE, RADIUS, lay, lays, ring_mesh, shadow_radii


@pytest.mark.parametrize("size", [0.005, 0.012])
def test_the_mesh_is_the_ring_beyond_the_plate(size):
    points, triangles, held = ring_mesh(size, np.random.default_rng(3))
    first, second = (points[triangles[:, k]] - points[triangles[:, 0]] for k in (1, 2))
    areas = 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    assert (areas > 0.02 * size**2).all()
    assert areas.sum() == pytest.approx(np.pi * (RADIUS**2 - PLATE**2), rel=2e-3)
    assert np.hypot(*points[:held].T) == pytest.approx(PLATE)
    assert len(np.unique(triangles)) == len(points)


def test_a_lay_repeats_and_lays_differ():
    stiff = {"fabric": "cotton", "bending_stiffness": 5e-5}
    one, two = lays(stiff, 2, 0.015)
    assert np.array_equal(lay(stiff, 0.015, 0).radii, one.radii)
    assert not np.array_equal(one.radii, two.radii)
    assert one.at_rest


def test_what_is_stiffer_or_lighter_covers_more():
    soft, stiff, board = (
        lay({"fabric": "cotton", "bending_stiffness": each}, 0.015, 1).shape.coefficient for each in (5e-6, 5e-5, 1e-2)
    )
    assert soft < stiff < board
    assert board == pytest.approx(1.0, abs=5e-3)


def test_a_slow_ring_leaves_fewer_and_deeper_folds():
    slow, fast = (lay({"fabric": "cotton", "bending_stiffness": 5e-6}, 0.012, 2, fall).shape for fall in (0.03, 1.0))
    assert slow.folds < fast.folds - 1
    assert slow.depth > fast.depth + 1e-3


@pytest.mark.parametrize("rim", [0.06, 0.08])
def test_the_shadow_is_no_smaller_than_the_plate_where_the_rim_hangs_under_it(rim):
    flat, triangles, _ = ring_mesh(0.006, np.random.default_rng(1))
    r, along = np.hypot(*flat.T), np.arctan2(flat[:, 1], flat[:, 0])
    middle = (PLATE + RADIUS) / 2
    wide = 0.1 + 0.008 * np.cos(6 * along)
    under = np.where(r < middle, PLATE + (wide - PLATE) * (r - PLATE) / (middle - PLATE), rim)
    hanging = np.column_stack([under * np.cos(along), under * np.sin(along), PLATE - r])
    shadow = shadow_radii(hanging, triangles)
    assert shadow.min() > 0.99 * PLATE
    assert shadow.max() == pytest.approx(0.108, abs=0.004)


def test_the_radii_of_a_lay_are_those_of_its_shadow(monkeypatch):
    monkeypatch.setattr(cusick, "shadow_radii", lambda positions, triangles: np.full(360, 0.12))
    done = cusick.lay({"fabric": "cotton", "bending_stiffness": 1e-2}, 0.02, 0)
    assert done.shape.coefficient == pytest.approx((0.12**2 - PLATE**2) / (RADIUS**2 - PLATE**2))
