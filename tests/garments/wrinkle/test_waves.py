"""Length and height of wrinkles: the three limits of the foundation, and the length of a sine."""

import math

import numpy as np
import pytest

from clothsim.garments.wrinkle.compression import EDGES, Waves, amplitude

SHEET = Waves(bending=1.0, stretching=1.0)


def test_tension_alone_is_cerda_and_mahadevan():
    for tension, length in ((1.0, 1.0), (16.0, 2.0)):
        expected = 2 * math.sqrt(math.pi) * (1.0 / tension) ** 0.25 * math.sqrt(length)
        assert SHEET.wavelength(tension, length) == pytest.approx(expected, rel=1e-14)


def test_curvature_alone_is_that_of_a_sleeve():
    for radius in (1.0, 4.0):
        expected = 2 * math.pi * (radius**2) ** 0.25
        assert SHEET.wavelength(0.0, 1.0, radius) == pytest.approx(expected, rel=1e-14)
        assert SHEET.wavelength(-5.0, 1.0, radius) == pytest.approx(expected, rel=1e-14)


def test_without_foundation_it_is_the_longest_that_fits():
    assert SHEET.wavelength(0.0, 1.0, longest=3.5) == 3.5
    assert SHEET.wavelength(1e-12, 1.0, longest=3.5) == 3.5


def test_both_are_stiffer_than_each():
    both = SHEET.wavelength(1.0, 1.0, 1.0)
    assert both == pytest.approx(2 * math.pi / (math.pi**2 + 1) ** 0.25, rel=1e-14)


def test_never_below_four_fine_edges():
    fine = Waves(1e-9, 1.0, fine_edge=0.25)
    assert fine.wavelength(1.0, 1.0) == EDGES * 0.25 == 1.0
    assert fine.wavelength(0.0, 1.0, longest=0.1) == 1.0


def test_a_least_radius_is_that_of_the_crests():
    sheet, stretch = Waves(1.0, 1.0, least_radius=0.01), 0.9
    wavelength = sheet.wavelength(0.0, 1.0, stretch=stretch)
    curvature = amplitude(wavelength, stretch) * (2 * math.pi / wavelength) ** 2
    assert 1 / curvature == pytest.approx(0.01, rel=1e-14)


def test_a_wave_of_that_amplitude_has_the_length_at_rest():
    for stretch in (0.999, 0.99):
        x = np.linspace(0, 2.0, 20001)
        wave = amplitude(2.0, stretch) * np.sin(math.pi * x)
        arc = np.hypot(np.diff(x), np.diff(wave)).sum()
        assert 2.0 / arc == pytest.approx(stretch, abs=2 * (1 - stretch) ** 2)
    assert amplitude(1.0, 1.2) == 0
