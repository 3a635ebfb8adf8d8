"""Smallest d_hat that double precision carries at the coordinates of a scene."""

import pytest
from small_scenes import BALL, EFFECTS, SHEET, small_scene

from clothsim import InputError
from clothsim.physics.contact.setup import LEAST_D_HAT
from clothsim.scene.assembly.scene_world import build


def scene(d_hat, away=0.0, unit=1.0):
    sheet = {"size": [0.5 * unit, 0.5 * unit], "position": [away, away, away + 0.33 * unit]}
    ball = {"radius": 0.3 * unit, "position": [away] * 3}
    return small_scene(SHEET | sheet, BALL | ball, EFFECTS | {"body_contact": {"d_hat": d_hat}})


@pytest.mark.parametrize("effect", ["body_contact", "self_contact"])
def test_a_nanometre_on_half_a_metre_is_refused_by_number(effect):
    given = small_scene(SHEET | {"size": [0.5, 0.5]}, BALL, EFFECTS | {effect: {"d_hat": 1e-9}})
    with pytest.raises(InputError, match=rf"{effect}\.d_hat is 1e-09 m, below .*e-09 m"):
        build(given)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_the_bound_goes_with_the_coordinates(unit):
    largest = float(abs(build(scene(1e-3 * unit, unit=unit)).world.start()).max())
    assert build(scene(1.01 * LEAST_D_HAT * largest, unit=unit)).energies["body_contact"].d_hat < 1e-8 * unit
    with pytest.raises(InputError, match="double precision"):
        build(scene(0.99 * LEAST_D_HAT * largest, unit=unit))


def test_a_scene_far_from_the_origin_is_measured_about_its_own():
    assert build(scene(1e-8, away=1000.0)).energies["body_contact"].d_hat == 1e-8
