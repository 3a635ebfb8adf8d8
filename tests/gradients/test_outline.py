"""Outline of a shadow: its loss against differences, and outlines out of pictures against circles and ellipses."""

import numpy as np
import pytest

from clothsim import InputError
from clothsim.gradients.outline import Outline, outline_of
from clothsim.mesh.generators.shapes import disk

ANGLES = 2 * np.pi * np.arange(90) / 90


def wavy(angle):
    return 0.12 + 0.01 * np.cos(5 * angle)


def test_a_border_on_its_outline():
    positions, triangles = disk(0.15, 6)
    angle, r = np.arctan2(positions[:, 1], positions[:, 0]), np.linalg.norm(positions, axis=1)
    positions = positions * (wavy(angle) / 0.15)[:, None]
    value, derivative = Outline(wavy(ANGLES)).evaluate(positions, triangles)
    assert value < 1e-12
    assert np.abs(derivative).max() < 1e-6
    further = positions + np.outer(r > 0.15 - 1e-9, [0, 0, 1])  # heights do not count
    assert Outline(wavy(ANGLES)).evaluate(further, triangles)[0] == value


def test_its_derivative():
    rng = np.random.default_rng(0)
    positions, triangles = disk(0.15, 4)
    positions = positions + 5e-3 * rng.standard_normal(positions.shape)
    loss, direction = Outline(wavy(ANGLES), (0.01, -0.02)), rng.standard_normal(positions.shape)
    derivative = loss.evaluate(positions, triangles)[1]
    sides = [loss.evaluate(positions + sign * 1e-7 * direction, triangles)[0] for sign in (1, -1)]
    assert float(np.vdot(derivative, direction)) == pytest.approx((sides[0] - sides[1]) / 2e-7, rel=1e-6)


def test_an_outline_from_a_picture():
    pixel, middle = 1e-3, 149.5
    row, column = np.indices((300, 300))
    x, y = pixel * (column - middle), pixel * (middle - row)
    angle = np.arctan2(y, x) % (2 * np.pi)
    found = outline_of((np.hypot(x, y) < wavy(angle)).astype(float), pixel, (middle, middle), 90)
    assert np.abs(found - wavy(ANGLES)).max() < 0.6 * pixel
    assert np.sqrt(((found - wavy(ANGLES)) ** 2).mean()) < 0.3 * pixel
    half = np.where(x > 0.01, 1.0, 0.0)
    with pytest.raises(InputError):
        outline_of(half, pixel, (middle, middle), 90)
    with pytest.raises(InputError):
        Outline(np.ones((3, 2))).evaluate(*disk(0.1, 2))
