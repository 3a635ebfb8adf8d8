import numpy as np
import pytest

from clothsim.render.colormap import colour_range, log_stretch, per_vertex, stretch_colours, ticks


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
