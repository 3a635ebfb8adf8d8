import numpy as np
import pytest

from clothsim.render.colour_scale import VIRIDIS, Quantity, sequential_scale, stretch_scale


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
