"""What kinds of cloth look like."""

import numpy as np
import pytest

from clothsim.base.srgb import linear_rgb
from clothsim.keys.fabric_table import FABRICS
from clothsim.render.cloth_kinds import (
    BOARD,
    DARKEST,
    FILM,
    HEAVY,
    KIND_OF,
    KINDS,
    LIGHT,
    RIBS,
    WEAVES,
    fuzz_of,
    kind_of,
    threads_of,
    tile_of,
)


def test_each_named_fabric_has_a_kind_and_each_kind_a_weave():
    assert set(KIND_OF) == set(FABRICS)
    assert set(KIND_OF.values()) <= set(KINDS)
    assert {kind.weave for kind in KINDS.values()} == set(WEAVES)


def test_a_fabric_without_a_name_has_the_kind_of_its_numbers():
    usual = {"density": 0.15, "thickness": 3e-4, "bending_stiffness": 1e-5}
    assert kind_of("", **usual) == "plain"
    for number, value, kind in (
        ("thickness", 0.9 * FILM, "foil"),
        ("bending_stiffness", 1.1 * BOARD, "board"),
        ("density", 0.9 * LIGHT, "satin"),
        ("density", 1.1 * HEAVY, "felt"),
    ):
        assert kind_of("", **{**usual, number: value}) == kind
        assert kind_of("denim", **{**usual, number: value}) == "denim"


@pytest.mark.parametrize("name", KINDS)
def test_a_weave_has_the_mean_colour_of_its_dyes_and_no_plaid(name):
    dyes = linear_rgb(np.array([[0.56, 0.16, 0.14], [0.75, 0.7, 0.6]]))
    height, tile = tile_of(KINDS[name], dyes)
    assert height.min() >= 0
    assert height.max() <= 1
    assert tile.mean(axis=(0, 1)) == pytest.approx(dyes.mean(axis=0), rel=0.02)
    _, threads, _ = threads_of(KINDS[name])
    of_ribs = threads.mean(axis=0).reshape(RIBS, -1).mean(axis=1)
    assert of_ribs.std() < 0.02


def test_the_weft_of_a_denim_is_lighter_and_its_warp_no_darker_than_allowed():
    navy = linear_rgb(np.array([[0.2, 0.3, 0.5]] * 2))
    _, tile = tile_of(KINDS["denim"], navy)
    _, _, weft = threads_of(KINDS["denim"])
    light, dark = tile[weft == 1.0].mean(axis=0), tile[weft == 0.0].mean(axis=0)
    assert (light > 1.1 * dark).all()
    assert (dark > DARKEST * navy[0]).all()


def test_fuzz_is_at_the_outline():
    jersey = KINDS["jersey"]
    assert fuzz_of(jersey, np.array([1.0, -1.0])) == pytest.approx([0, 0])
    assert fuzz_of(jersey, np.array([0.0])) == pytest.approx([jersey.fuzz])
    assert (np.diff(fuzz_of(jersey, np.linspace(0, 1, 9))) < 0).all()
