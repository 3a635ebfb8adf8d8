"""Table of error against processor time: its rows, and that a run is no distance from itself."""

from types import SimpleNamespace

import numpy as np

from tests.benchmarks import stepping
from tests.benchmarks.stepping import (
    SETTINGS,
    SHEETS,
    SHIPPED,
    UNTUNED_STOPS,
    compared,
    distances,
    main,
    measured,
    page_of,
    ratios_at_equal_cost,
    scene_of,
    table,
    untuned_table,
)
from tests.benchmarks.untuned_scenes import UNTUNED_SCENES
from tests.known_answers.error_scenes import ERROR_SCENES


def test_a_run_is_no_distance_from_itself_and_some_from_another_dt():
    scene = scene_of("ramp", seconds=0.08)
    one, other = (measured(scene, factor, {}) for factor in (1.0, 0.5))
    assert np.array_equal(distances(one, one), np.zeros(2))
    assert (distances(one, other) > 0.0).all()
    assert other.steps == 2 * one.steps


def test_the_table_has_a_row_for_the_reference_and_each_setting():
    comparison = compared("landing", starts=1, seconds=0.08)
    rows = table(comparison)
    assert len(rows) == 4 + len(SETTINGS)
    assert len({row.count("|") for row in rows[1:]}) == 1
    summary = comparison.summary()
    assert (summary["seconds"], list(summary["settings"])) == (0.08, list(SETTINGS))
    runs, errors = comparison.settings["default"]
    assert summary["settings"]["default"] == [runs[0].cpu[-1], errors[0].mean()]
    assert 0.0 < summary["doubt"] < errors[0].mean()


def test_the_page_has_a_row_for_each_scene_in_the_order_of_the_command():
    pairs = {label: [1.0, 2.0] for label in SETTINGS} | {"converge": [4.0, 3.0]}
    seen = {"date": "2026-01-02", "seconds": 0.4, "doubt": 0.5, "settings": pairs}
    text = page_of({"twist": seen, "sheet40": seen, "flag": {**seen, "date": "2026-01-01"}})
    rows = text.splitlines()
    assert rows[0].startswith("Measured on 2026-01-01 to 2026-01-02. The default takes 0.25 to 0.25 of")
    assert [row.split()[1] for row in rows[4:]] == ["sheet40", "flag", "twist"]
    assert rows[5].endswith("| 1, 2 | 1, 2 | 1, 2 | 4, 3 | 1, 2 | 0.5 | 3.3, 33.6; 4.6, 18.6 |")


def test_all_runs_every_scene_and_writes_the_page(tmp_path, monkeypatch):
    page, ran = tmp_path / "page.md", []
    page.write_text("<!-- stepping -->\n<!-- /stepping -->\n")
    summary = {"date": "2026-01-02", "seconds": 0.4, "doubt": 0.5, "settings": {key: [1.0, 2.0] for key in SETTINGS}}
    monkeypatch.setattr(stepping, "DOCS", page)
    monkeypatch.setattr(stepping, "table", lambda comparison: [])
    monkeypatch.setattr(
        stepping, "compared", lambda name, *_: ran.append(name) or SimpleNamespace(summary=lambda: summary)
    )
    monkeypatch.setattr(stepping, "untuned_table", lambda name, *_: ran.append(name) or [])
    assert main(["--all", "--docs", "--record", str(tmp_path / "record.json")]) == 0
    assert ran == [*SHEETS, *SHIPPED, *ERROR_SCENES, *UNTUNED_SCENES]
    assert page.read_text().count("\n| ") == 2 + len(SHEETS) + len(SHIPPED) + len(ERROR_SCENES)


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
