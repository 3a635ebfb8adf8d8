"""Table of error against processor time: its rows, and that a run is no distance from itself."""

import numpy as np

from tests.benchmarks.stepping import SETTINGS, distances, measured, scene_of, table


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
