"""Table of error against processor time: its rows, and that a run is no distance from itself."""

import numpy as np

from tests.benchmarks.stepping import (
    SETTINGS,
    UNTUNED_STOPS,
    distances,
    measured,
    ratios_at_equal_cost,
    scene_of,
    table,
    untuned_table,
)


def test_a_run_is_no_distance_from_itself_and_some_from_another_dt():
    scene = scene_of("ramp", seconds=0.08)
    one, other = (measured(scene, factor, {}) for factor in (1.0, 0.5))
    assert np.array_equal(distances(one, one), np.zeros(2))
    assert (distances(one, other) > 0.0).all()
    assert other.steps == 2 * one.steps


def test_the_table_has_a_row_for_the_reference_and_each_setting():
    rows = table("landing", starts=1, seconds=0.08)
    assert len(rows) == 4 + len(SETTINGS)
    assert len({row.count("|") for row in rows[1:]}) == 1


def test_errors_at_equal_cost_are_compared_where_both_curves_reach():
    slower, cheaper = [(2.0, 4.0), (4.0, 2.0), (8.0, 1.0)], [(1.0, 4.0), (2.0, 2.0), (4.0, 1.0)]
    assert np.allclose(ratios_at_equal_cost(cheaper, slower), [0.5, 0.5])
    assert np.allclose(ratios_at_equal_cost(slower, cheaper), [2.0, 2.0])
    assert ratios_at_equal_cost([(1.0, 1.0)], [(2.0, 1.0)]).size == 0


def test_pins_that_are_stopped_stay_where_they_were():
    scene = scene_of("fast_pin", seconds=0.08)
    stopped, moving = (measured(scene, 1.0, {}, stop=stop) for stop in (0.04, np.inf))
    fastest = np.linalg.norm(moving.positions[0] - moving.positions[1], axis=1).argmax()
    assert np.array_equal(stopped.positions[:2], moving.positions[:2])
    assert np.array_equal(stopped.positions[2, fastest], stopped.positions[3, fastest])
    assert not np.array_equal(moving.positions[2, fastest], moving.positions[3, fastest])


def test_untuned_scenes_have_a_row_for_each_stop_and_dt():
    rows = untuned_table("drop45", starts=1, seconds=0.04)
    assert len(rows) == 3 + 3 * len(UNTUNED_STOPS) + 2
    assert len({row.count("|") for row in rows[1:-2]}) == 1
