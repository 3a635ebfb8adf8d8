"""Scenes of the table of known answers that no physics test shares: drapes and wrinkles."""

import numpy as np
import pytest

from tests.known_answers.a7_drape import drape_coefficient
from tests.known_answers.a8_wrinkles import Sheared, half_wavelength, thickness_of


def test_a_disc_too_stiff_to_hang_stops_all_light():
    """But for the corners that the polygon of its border lacks."""
    corners = int(np.ceil(2 * np.pi * 3 / 0.4))
    border = np.sin(2 * np.pi / corners) * corners / 2
    assert drape_coefficient(1e-3, cells=3) == pytest.approx((border - np.pi * 0.36) / (np.pi * 0.64), abs=1e-6)


def test_a_limper_disc_hangs_down():
    assert drape_coefficient(400, cells=3) < 0.8 < drape_coefficient(20, cells=3)


def test_the_thickness_gives_the_wavelength_that_it_was_asked_for():
    assert half_wavelength(thickness_of(0.2, 0.02), 0.02) == pytest.approx(0.2, rel=1e-12)
    assert half_wavelength(1e-3, 0.04) == pytest.approx(half_wavelength(1e-3, 0.01) / np.sqrt(2), rel=1e-12)


def test_waves_are_read_as_long_and_as_steep_as_they_are():
    """z = .01 sin(pi (x - y)/.3): half a wave every .3 along x, .3 sin 45 across, at 45 degrees."""
    x, y = np.meshgrid(np.linspace(0, 2, 201), np.linspace(0, 1, 101), indexing="ij")
    rest = np.column_stack([x.ravel(), y.ravel()])
    corner = (np.arange(200)[:, None] * 101 + np.arange(100)).ravel()
    triangles = np.concatenate(
        [np.column_stack([corner, corner + 101, corner + 102]), np.column_stack([corner, corner + 102, corner + 1])]
    )
    z = 0.01 * np.sin(np.pi * (rest[:, 0] - rest[:, 1]) / 0.3 + 0.1)
    seen = Sheared(rest, np.column_stack([rest, z]), triangles, 0.0)
    assert seen.half_wavelength == pytest.approx(0.3 * np.sin(np.pi / 4), rel=1e-3)
    assert seen.degrees == pytest.approx(45, abs=0.1)
    assert seen.amplitude == pytest.approx(0.01, rel=1e-2)
