"""The walking shirt of the benchmark of authored clips: what its edits change."""

import numpy as np
import pytest

from clothsim.engine import build
from tests.benchmarks import author_walk
from tests.benchmarks.author_walk import HEM, SHOULDERS, WalkingShirt


@pytest.fixture(scope="module")
def clip():
    """The shirt that begins at its rest shape: no drape is simulated."""
    clip = WalkingShirt()
    start = build(clip.scene(draped=False)).world.cloths[0].positions
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(author_walk, "_draped", lambda _: start)
        yield clip


@pytest.fixture(scope="module")
def plain(clip):
    return clip.scene()


def test_the_hem_is_longer_and_the_rest_is_not(clip, plain):
    rest, longer = (scene.cloths[0].mesh.rest for scene in (plain, clip.longer_hem()))
    lowest = rest[:, 2] < HEM + 1e-3
    np.testing.assert_allclose(longer[lowest, :2], 1.05 * rest[lowest, :2], rtol=1e-3)
    above = rest[:, 2] > HEM + (SHOULDERS - HEM) / 4
    np.testing.assert_array_equal(longer[above], rest[above])
    assert rest[:, 2].max() == pytest.approx(SHOULDERS, abs=1e-3)


def test_the_pleat_has_two_creases_and_the_fabric_is_stiffer(clip, plain):
    pleat = clip.pleat()
    assert build(pleat).world.n_cloth == build(plain).world.n_cloth  # no crease is refused
    assert len(pleat.effects["rest_angle"].crease) == 2
    one, four = plain.cloths[0], clip.scene(4.0).cloths[0]
    assert four.youngs_modulus == 4 * one.youngs_modulus
    assert four.bending_stiffness == 4 * one.bending_stiffness
