"""Colour scales: of stretches and of other quantities."""

import numpy as np
import pytest

from clothsim.render.colour_scale import (
    VIRIDIS,
    Quantity,
    colour_range,
    log_stretch,
    per_vertex,
    sequential_scale,
    stretch_colours,
    stretch_scale,
    ticks,
)


def test_the_stretch_farthest_from_one_in_log_counts():
    logs = log_stretch(np.array([[1.1, 1.0], [1.1, 0.8], [1.25, 0.81], [1.0, 0.0]]))
    np.testing.assert_allclose(np.exp(logs), [1.1, 0.8, 1.25, 1e-6])


def test_one_is_a_light_neutral_grey():
    middle = stretch_colours(np.zeros(1), 0.1)[0]
    assert middle.min() > 0.8
    assert np.ptp(middle) < 0.05


def test_colours_are_monotone_and_diverge():
    colours = stretch_colours(np.linspace(-0.1, 0.1, 41), 0.1)
    assert (np.diff(colours[:, 0] - colours[:, 2]) > -1e-12)[8:33].all()  # from blue to red around the centre
    brightness = colours @ [0.3, 0.6, 0.1]
    assert (np.diff(brightness[:21]) > 0).all()
    assert (np.diff(brightness[20:]) < 0).all()


def test_values_outside_the_range_take_the_end_colours():
    np.testing.assert_array_equal(
        stretch_colours(np.array([-9.0, 9.0]), 0.1), stretch_colours(np.array([-0.1, 0.1]), 0.1)
    )


@pytest.mark.parametrize(
    ("reach", "low"), [(0.0, 0.99), (0.004, 0.99), (0.04, 0.95), (0.09, 0.9), (0.6, 0.5), (9, 0.1)]
)
def test_the_range_ends_at_a_round_stretch_that_holds_the_data(reach, low):
    half_range = colour_range([np.linspace(-reach, reach, 1001)])
    assert np.exp(-half_range) == pytest.approx(low)
    labels = ticks(half_range)
    assert 1.0 in labels
    assert np.abs(np.log(labels)).max() <= half_range + 1e-12
    assert labels[0] == pytest.approx(low)


def test_one_wild_triangle_does_not_set_the_range():
    values = np.concatenate([np.full(999, 0.02), [3.0]])
    assert colour_range([values]) == pytest.approx(-np.log(0.98))


def test_vertex_values_are_means_weighted_by_area():
    positions = np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0], [0, -3, 0], [9, 9, 9]], float)
    triangles = np.array([[0, 1, 2], [0, 3, 1]])
    values = per_vertex(np.array([4.0, 8.0]), positions, triangles)
    np.testing.assert_allclose(values, [7.0, 7.0, 4.0, 8.0, 0.0])


def test_the_ends_and_beyond_take_the_end_colours():
    scale = sequential_scale(Quantity("x"), [np.linspace(-4.0, 6.0, 1001)])
    colours = scale.colours(np.array([-9.0, scale.low, scale.high, 99.0]))
    np.testing.assert_allclose(colours * 255, VIRIDIS[[0, 0, -1, -1]])


def test_the_sequential_colours_grow_lighter_evenly():
    steps = np.diff((VIRIDIS / 255) ** 2.2 @ [0.2126, 0.7152, 0.0722])
    assert (steps > 0).all()


def test_one_wild_vertex_does_not_set_the_range():
    scale = sequential_scale(Quantity("x"), [np.linspace(10.0, 11.0, 500), np.array([1e6])])
    assert 10.0 <= scale.low < 10.1
    assert 10.9 < scale.high <= 11.0


def test_a_range_that_nearly_begins_at_zero_begins_there():
    assert sequential_scale(Quantity("x"), [np.linspace(0.1, 5.0, 500)]).low == 0.0


def test_a_few_vertices_in_contact_are_seen():
    assert sequential_scale(Quantity("x"), [np.zeros(999), np.array([7.0])]).high == 7.0


@pytest.mark.parametrize("value", [0.0, 3e-4, -2.0, 5e7])
def test_equal_values_have_a_range_too(value):
    scale = sequential_scale(Quantity("x", "m"), [np.full(50, value)])
    assert scale.low <= value <= scale.high
    assert scale.low < scale.high
    assert np.isfinite(scale.colours(np.array([value]))).all()


@pytest.mark.parametrize(
    ("low", "high", "unit", "bracket", "labels"),
    [
        (0.0, 4.05e-4, "m", "[mm]", ["0.0", "0.1", "0.2", "0.3", "0.4"]),
        (0.0, 26_000.0, "Pa", "[kPa]", ["0", "10", "20"]),
        (0.0, 0.0122, "", None, ["0.000", "0.005", "0.010"]),
        (-1.1, 1.1, "N/m", "[N/m]", ["-1.0", "-0.5", "0.0", "0.5", "1.0"]),
    ],
)
def test_ticks_are_round_numbers_in_a_unit_with_a_prefix(low, high, unit, bracket, labels):
    scale = sequential_scale(Quantity("energy density", unit), [np.linspace(low, high, 10_001)])
    assert [text for _, text in scale.ticks] == labels
    assert all(scale.low - 1e-12 <= value <= scale.high + 1e-12 for value, _ in scale.ticks)
    assert scale.heading == ("energy", "density", *([bracket] if bracket else []))


@pytest.mark.parametrize("width", 10.0 ** np.arange(-9, 9, 0.37))
def test_there_are_always_a_few_ticks(width):
    scale = sequential_scale(Quantity("x", "m"), [np.linspace(2.0, 2.0 + width, 1000)])
    assert 2 <= len(scale.ticks) <= 6
    assert len({text for _, text in scale.ticks}) == len(scale.ticks)


def test_a_stretch_is_labelled_by_itself_and_centred_at_one():
    scale = stretch_scale([np.log([0.95, 1.05])], "mean stretch")
    assert (scale.low, scale.heading) == (-scale.high, ("mean stretch",))
    assert {text: value for value, text in scale.ticks}["1"] == 0.0
