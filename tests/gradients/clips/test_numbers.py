"""Numbers of clips: which a scene has, what they do to it, and their derivatives against differences of runs."""

import numpy as np
import pytest
from small_scenes import EFFECTS, small_scene

from clothsim import Cloth, InputError, Scene
from clothsim.garments.floor import scene_of_arrays
from clothsim.gradients.clips.numbers import RestShape, clip_numbers
from clothsim.gradients.losses import Distance
from clothsim.gradients.run import traced
from clothsim.mesh.generators.shapes import rectangle
from clothsim.scene.assembly.scene_world import build

ON = EFFECTS | {"friction": {"coefficient": 0.2}}


def sheet(**sections):
    return scene_of_arrays(small_scene(effects=ON | {"pins": {"select": "top"}}, **sections))


def test_the_numbers_of_a_scene():
    assert clip_numbers(sheet()).names == ("stretch", "bending", "friction", "damping", "width", "height", "hem")
    assert clip_numbers(small_scene(effects=ON)).names == ("stretch", "bending", "friction", "damping")
    assert clip_numbers(sheet(), ["hem", "bending"]).names == ("bending", "hem")
    with pytest.raises(InputError, match="colour"):
        clip_numbers(sheet(), ["colour"])


def test_a_fabric_of_threads_is_scaled_as_a_whole():
    threads = {"warp_stiffness": 500.0, "weft_stiffness": 300.0, "shear_stiffness": 50.0}
    cloth = {"mesh": "rectangle", "size": [1.0, 1.0], "cells": [2, 2], **threads}
    numbers = clip_numbers(small_scene(cloth=cloth, effects={"membrane": {}}), ["stretch"])
    scaled = numbers.scene_at(np.array([np.log(2.0)])).cloths[0]
    assert [scaled[key] / value for key, value in threads.items()] == pytest.approx([2.0, 2.0, 2.0])


def test_lengths_scale_the_rest_shape_and_hold_the_start():
    numbers = clip_numbers(sheet(), ["width", "height", "hem"])
    before = numbers.scene.cloths[0].mesh
    after = numbers.scene_at(np.log([1.1, 0.9, 1.05])).cloths[0].mesh
    np.testing.assert_array_equal(after.vertices, before.vertices)
    x, y = before.rest[:, 0], before.rest[:, 1]
    low, high = y < y.min() + 1e-9, y > y.max() - 1e-9
    assert np.ptp(after.rest[high, 0]) == pytest.approx(1.1 * np.ptp(x))
    assert np.ptp(after.rest[low, 0]) == pytest.approx(1.1 * 1.05 * np.ptp(x))
    assert np.ptp(after.rest[:, 1]) == pytest.approx(0.9 * np.ptp(y))


def test_panels_of_a_flat_pattern_have_lengths_of_their_own():
    own = sheet()
    arrays = own.cloths[0].mesh
    halves = {"left": np.arange(16), "right": np.arange(16, 32)}
    cloth = Cloth(arrays.vertices, arrays.triangles, rest=arrays.rest[:, :2], groups=halves)
    numbers = clip_numbers(Scene(cloth, effects={"membrane": {}}), ["width:right"])
    after = numbers.scene_at(np.array([np.log(1.2)])).cloths[0].mesh.rest
    before = numbers.scene.cloths[0].mesh.rest
    np.testing.assert_array_equal(after[:16], before[:16])
    assert np.ptp(after[16:, :, 0]) == pytest.approx(1.2 * np.ptp(before[16:, :, 0]))


@pytest.mark.parametrize(("count", "panels"), [(4, 4), (5, 1)])
def test_a_flat_cloth_of_more_than_four_panels_is_one(count, panels):
    points, triangles = rectangle((1.0, 1.0), (5, 2))
    groups = {str(k): np.flatnonzero(np.arange(len(triangles)) % count == k) for k in range(count)}
    shape = RestShape.of(Cloth(points, triangles, groups=groups), points[:, :2])
    assert len(shape.panels) == panels
    assert not shape.alike


def test_pins_by_a_side_stay_where_the_rest_shape_bends():
    pins = clip_numbers(sheet()).scene.effects["pins"]
    assert list(pins.select) == [4, 9, 14, 19, 24]


def test_lines_by_a_side_are_those_of_the_scene_where_the_rest_shape_bends():
    """A zip, a seam, springs, boning and elastic at sides: each acts on the vertices that it had, with the same sum."""
    line = {"from": {"side": "left"}, "to": {"side": "right"}, "stiffness": 20.0}
    effects = {
        "membrane": {},
        "closures": {"zip": [line]},
        "seams": {"seam": [line]},
        "springs": {"spring": [{"select": "top", "stiffness": 5.0}]},
        "stiffeners": {"stiffener": [{"select": "boundary", "bending_stiffness": 1e-3}]},
        "elastic_bands": {"band": [{"select": "bottom", "stiffness": 2.0}]},
    }
    given = scene_of_arrays(small_scene(effects=effects))
    numbers = clip_numbers(given, ["hem"])
    before, bent = build(given).energies, build(numbers.scene_at(np.array([0.1]))).energies
    x = build(given).world.start() * [1.0, 1.1, 1.0]
    for name in ("closures", "seams", "springs"):
        assert bent[name].value(x) == pytest.approx(before[name].value(x), rel=1e-12)
    rows = [np.sort(each["stiffeners"].bending.rows[:, 1]) for each in (before, bent)]
    np.testing.assert_array_equal(*rows)
    assert [list(each.select) for each in numbers.scene.effects["elastic_bands"].band] == [[0, 5, 10, 15, 20]]


def test_derivatives_are_those_of_runs():
    numbers = clip_numbers(sheet(run={"duration": 0.08, "frames_per_second": 25}), ["bending", "hem"])
    first = traced(numbers.scene)
    loss = Distance(first.cloth_positions() + np.array([0.0, 0.05, 0.02]))
    at = np.zeros(2)
    found = numbers.derivatives(traced(numbers.scene_at(at), first.stiffness).gradient(loss), at)
    for k, step in enumerate((1e-3, 1e-4)):
        values = [
            traced(numbers.scene_at(at + sign * step * np.eye(2)[k]), first.stiffness).gradient(loss).value
            for sign in (1, -1)
        ]
        assert found[k] == pytest.approx((values[0] - values[1]) / (2 * step), rel=1e-2)
