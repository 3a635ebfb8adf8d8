"""Plates, strips and the ribbon of the table of known answers: one sound coarse mesh each, and a wrong material."""

import numpy as np
import pytest

from tests.known_answers.a9_plates import (
    BEAM_MODES,
    CANTILEVER,
    DRUM_MODES,
    FREE,
    beam_modes,
    buckled_height,
    drum_modes,
    euler_load,
    plate_modes,
    twisted,
)
from tests.known_answers.elastica import elastica_height
from tests.known_answers.twisted_ribbon import (
    THIN,
    TWIST,
    buckling_stretch,
    critical_stretch,
    helicoid_torque,
    ribbon_torque,
)


@pytest.mark.parametrize("diagonals", ["right", "delaunay"])
def test_a_twisted_plate_has_its_energy_and_hinges_have_more(diagonals):
    assert twisted(6, diagonals, "midedge") == pytest.approx(1, abs=1e-5)
    assert twisted(6, diagonals, "hinge") > 2


def test_modes_of_plates_come_near_their_series_and_hinges_do_not():
    assert plate_modes("left", 12, "midedge") == pytest.approx(CANTILEVER, rel=0.04)
    assert plate_modes("free", 12, "midedge")[:3] == pytest.approx(FREE, rel=0.04)
    assert plate_modes("left", 12, "hinge")[1] > 1.3 * CANTILEVER[1]
    assert plate_modes("free", 12, "hinge")[0] > 1.3 * FREE[0]


def test_a_beam_and_a_drum_sound_as_the_roots_of_their_equations():
    for root in np.sqrt(BEAM_MODES):
        assert np.cos(root) * np.cosh(root) == pytest.approx(-1, abs=1e-4)
    assert beam_modes(20, "midedge") == pytest.approx(BEAM_MODES, rel=0.03)
    assert drum_modes(8) == pytest.approx(DRUM_MODES, rel=0.02)


@pytest.mark.parametrize(("ends", "load"), [("hinged", np.pi**2), ("clamped", 4 * np.pi**2)])
def test_euler_loads(ends, load):
    assert euler_load(20, ends, "midedge") == pytest.approx(load, rel=0.01)
    assert euler_load(40, ends, "hinge") < 0.85 * load  # square cells; -4 % on cells twice as long as wide


def test_a_pressed_strip_rises_to_the_elastica():
    assert elastica_height(0.8) == pytest.approx(0.26631859, abs=1e-8)
    assert elastica_height(1 - 1e-6) == pytest.approx(2 / np.pi * 1e-3, rel=1e-3)
    assert buckled_height(12, "midedge") == pytest.approx(elastica_height(0.8), rel=0.01)


def test_a_twisted_ribbon_is_stiffer_by_its_stretch_and_by_hinges():
    exact = helicoid_torque()
    coarse, fine = (ribbon_torque(cells, "midedge") for cells in (6, 12))
    assert exact < fine < coarse
    assert (coarse - exact) / (fine - exact) == pytest.approx(4, rel=0.2)
    assert ribbon_torque(12, "hinge") > 1.4 * fine


def test_a_twisted_ribbon_buckles_where_the_equations_say():
    stretch, k = critical_stretch(THIN, TWIST)
    thinner, same_k = critical_stretch(10 * THIN, TWIST / np.sqrt(10))
    assert (10 * thinner, same_k) == pytest.approx((stretch, k), rel=1e-4)
    assert -(TWIST**2) / 24 < stretch < 0  # the whole is in tension, the middle is compressed
    assert critical_stretch(THIN, 1e-9)[0] == pytest.approx(-(0.9**2) / THIN, rel=1e-3)  # a flat strip, k = .9
    assert 2 * np.pi / k == pytest.approx(1.93, abs=0.01)
    assert buckling_stretch(10, "midedge") == pytest.approx(stretch, rel=0.03)
