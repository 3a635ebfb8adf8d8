"""Shape of an outline: closed forms, and the coefficients that were measured with the scanned borders."""

from pathlib import Path

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.study.standard_tests.cusick import PLATE, RADIUS, outline_radii, outline_shape

BORDERS = Path(__file__).parents[4] / "shared" / "data" / "real" / "cusick_borders.npz"
THETA = 2 * np.pi * np.arange(360) / 360


@pytest.mark.parametrize(("radius", "coefficient"), [(RADIUS, 1.0), (PLATE, 0.0)])
def test_a_circle_has_no_folds(radius, coefficient):
    shape = outline_shape(np.full(360, radius))
    assert (shape.coefficient, shape.folds, shape.depth) == pytest.approx((coefficient, 0.0, 0.0), abs=1e-12)


def test_two_waves_have_the_root_of_the_mean_square_of_their_numbers():
    shape = outline_shape(0.12 + 0.006 * np.cos(5 * THETA) + 0.008 * np.sin(9 * THETA))
    assert shape.folds == pytest.approx(np.sqrt((25 * 36 + 81 * 64) / 100))
    assert shape.depth == pytest.approx(0.01 / np.sqrt(2))
    square = 0.12**2 + 0.01**2 / 2
    assert shape.coefficient == pytest.approx((square - PLATE**2) / (RADIUS**2 - PLATE**2))


def test_a_shifted_circle_has_hardly_a_fold_amplitude():
    shift = 0.003
    r = shift * np.cos(THETA) + np.sqrt(0.12**2 - (shift * np.sin(THETA)) ** 2)
    assert outline_shape(r).coefficient == pytest.approx(outline_shape(np.full(360, 0.12)).coefficient, rel=1e-12)
    assert outline_shape(r).folds == pytest.approx(2.0, abs=1e-2)  # 2 is all that is left


def test_the_radii_of_a_border_are_those_of_its_curve():
    turn = 2 * np.pi * np.arange(157) / 157
    r = 0.12 + 0.01 * np.cos(6 * turn)
    positions = np.column_stack([r * np.cos(turn), r * np.sin(turn), np.zeros(157)])
    border = np.column_stack([np.arange(157), (np.arange(157) + 1) % 157])
    assert outline_radii(positions, border) == pytest.approx(0.12 + 0.01 * np.cos(6 * THETA), abs=5e-4)


def test_too_few_angles_are_refused():
    with pytest.raises(InputError, match="radii"):
        outline_shape(np.full(20, 0.1))


@pytest.mark.skipif(not BORDERS.is_file(), reason="the scanned drapes are not here")
def test_the_coefficients_of_scanned_borders_are_those_that_came_with_them():
    data = np.load(BORDERS)
    xy = 0.05e-3 * data["border_50um"][:, :, :2].astype(float)
    rows = np.column_stack([np.arange(360), (np.arange(360) + 1) % 360])
    found = [outline_shape(outline_radii(points, rows)) for points in xy]
    away = np.array([each.coefficient for each in found]) - data["drape_coefficient"]
    assert np.median(np.abs(away)) < 2e-3
    cloth = np.array([[each.folds, each.depth] for each in found])
    assert np.median(cloth[:, 0]) == pytest.approx(6.9, abs=0.3)
    assert np.median(1e3 * cloth[:, 1]) == pytest.approx(8.0, abs=1.0)
