"""Wrinkle curves: direction, distance, height, and what becomes of them from frame to frame."""

import numpy as np
import pytest

from clothsim.garments.wrinkle.compression import Compression, Waves, amplitude
from clothsim.garments.wrinkle.curves import FADE, LEAST, CompressionField, FineSheet, followed_curves, heights
from clothsim.mesh.generators.shapes import rectangle

POINTS, TRIANGLES = rectangle(size=(1.0, 1.0), cells=(40, 40))
UP = np.tile([0.0, 0.0, 1.0], (len(POINTS), 1))
WAVES = Waves(1e-4, 0.0, fine_edge=1 / 40)
"""Without tension and curvature waves are as long as they fit; here a least radius gives their length."""


def field_of(amount, least_radius=0.03):
    """A sheet compressed along y by `amount`, a number or one at each vertex."""
    sheet = FineSheet(POINTS, UP, 1 / 40, Waves(1e-4, 1.0, 1 / 40, least_radius))
    s2 = 1 - np.broadcast_to(amount, len(POINTS))
    along, across = np.tile([1.0, 0, 0], (len(POINTS), 1)), np.tile([0, 1.0, 0], (len(POINTS), 1))
    return CompressionField(sheet, Compression(np.column_stack([np.ones(len(POINTS)), s2]), along, across), POINTS)


def test_crests_run_across_the_compression_a_wave_apart():
    field = field_of(0.1)
    curves = followed_curves([], field, 1e3)
    wavelength = field.sheet.waves.wavelength(0.0, 1.0, stretch=0.9)
    levels = np.sort([each.points[:, 1].mean() for each in curves])
    assert len(curves) == pytest.approx(1 / wavelength, abs=1.5)
    for each in curves:
        assert np.ptp(each.points[:, 1]) < 0.026
        assert np.ptp(each.points[:, 0]) > 0.95
        assert each.wavelength == pytest.approx(wavelength, rel=1e-12)
    np.testing.assert_allclose(np.diff(levels), wavelength, atol=0.026)


def test_waves_between_crests_have_the_amplitude_of_the_compression():
    field = field_of(0.1)
    curves = followed_curves([], field, 1e3)
    lifts = heights(curves, field)
    wavelength = curves[0].wavelength
    inner = np.abs(POINTS[:, 1]) < 0.3
    assert lifts[inner].max() == pytest.approx(amplitude(wavelength, 0.9), rel=0.2)
    assert lifts[inner].min() == pytest.approx(-amplitude(wavelength, 0.9), rel=0.25)
    assert heights([], field).tolist() == [0.0] * len(POINTS)


def test_nothing_grows_where_nothing_is_compressed():
    assert followed_curves([], field_of(0.5 * LEAST), 1.0) == []
    half = field_of(np.where(POINTS[:, 0] < 0, 0.1, 0.0))
    curves = followed_curves([], half, 1e3)
    assert curves
    assert max(each.points[:, 0].max() for each in curves) < 0.03
    assert not heights(curves, half)[POINTS[:, 0] > 0.03].any()


def test_curves_keep_their_seeds_grow_in_and_fade_out():
    field, step = field_of(0.1), FADE / 4
    first = followed_curves([], field, step)
    second = followed_curves(first, field, step)
    assert {tuple(each.seed) for each in second} == {tuple(each.seed) for each in first}
    assert 0 < first[0].strength < second[0].strength < 1
    assert np.abs(heights(first, field)).max() < np.abs(heights(second, field)).max()
    later = second
    for _ in range(20):
        faded = followed_curves(later, field_of(0.0), step)
        assert all(each.strength < other.strength for each, other in zip(faded, later, strict=False))
        later = faded
    assert later == []


def test_a_crest_through_a_direction_that_turns_is_followed():
    field = field_of(0.1)
    angle = POINTS[:, 0]
    along = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    sign = np.where(np.arange(len(POINTS)) % 2, 1, -1)[:, None]  # axes have no sign
    across = np.cross([0.0, 0, 1], along)
    turning = CompressionField(field.sheet, Compression(field.compression.stretches, sign * along, across), POINTS)
    points, rows = turning.trace(np.zeros(3))
    np.testing.assert_allclose(points[:, 1], -np.log(np.cos(points[:, 0])), atol=0.02)
    assert len(rows) == len(points) > 35
