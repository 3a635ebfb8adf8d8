"""Strip tests of a fabric against closed forms: Peirce's bending length, the stiffnesses of small strains."""

import numpy as np
import pytest

from clothsim import engine
from clothsim.study.standard_tests.strips import DIRECTIONS, bending_length, pull, shear

DENIM = engine.FABRICS["denim"].fabric


def test_the_bending_length_is_that_of_a_cantilever():
    cloth = {"fabric": "cotton", "density": 0.2, "bending_stiffness": 1.6e-5}
    nu = engine.FABRICS["cotton"].fabric.poisson_ratio
    assert bending_length(cloth, 0.0) == pytest.approx((1.6e-5 * (1 - nu**2) / (0.2 * 9.81)) ** (1 / 3), rel=0.02)


def test_warp_and_weft_bend_with_their_own_stiffness():
    cloth = {"fabric": "denim"}
    warp, weft = (bending_length(cloth, DIRECTIONS[name]) for name in ("warp", "weft"))
    assert (warp / weft) ** 3 == pytest.approx(DENIM.bending_along_warp / DENIM.bending_along_weft, rel=0.02)


@pytest.mark.parametrize("name", ["warp", "weft"])
def test_a_small_pull_has_the_stiffness_of_the_threads(name):
    strains, forces = pull({"fabric": "denim"}, DIRECTIONS[name], 1e-3)
    assert forces / strains == pytest.approx(getattr(DENIM, f"stiffness_along_{name}"), rel=0.02)


@pytest.mark.parametrize("seed", [0, 1])
def test_on_the_bias_the_flexibilities_add(seed):
    strains, forces = pull({"fabric": "denim"}, DIRECTIONS["bias"], 1e-3, seed)
    warp, weft, nu = DENIM.stiffness_along_warp, DENIM.stiffness_along_weft, DENIM.poisson_ratio_of_threads
    flexibility = (1 / warp + 1 / weft - 2 * nu / np.sqrt(warp * weft) + 1 / DENIM.stiffness_in_shear) / 4
    assert forces / strains == pytest.approx(1 / flexibility, rel=0.05)


def test_shear_has_the_stiffness_in_shear_less_the_ends():
    angles, forces = shear({"fabric": "denim"}, DIRECTIONS["warp"], 0.01)
    assert forces / angles == pytest.approx(0.95 * DENIM.stiffness_in_shear, rel=0.03)
