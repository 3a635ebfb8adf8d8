"""Rules of a recipe: what a usable drape must be besides certified."""

import pytest
from small_scenes import SHEET, small_scene

from clothsim import InputError
from clothsim.study.farm.drape import drape
from clothsim.study.farm.recipe import RULES, broken_rule, checked_rules, load_recipe, make_recipe


def test_bounds_are_kept_or_named():
    rules = {"at_rest": False, "stretch_min": 0.9, "drop_max": 0.1}
    assert broken_rule(rules, False, {"stretch_min": 0.9, "drop": 0.1}) == ("", "")
    for measured, key in (({"stretch_min": 0.89, "drop": 0.0}, "stretch_min"), ({"stretch_min": 1.0}, "drop_max")):
        assert broken_rule(rules, False, measured)[0] == key
    assert broken_rule({"at_rest": True}, False, {}) == ("not at rest", "")
    assert checked_rules({}, "time") == {"at_rest": False}


@pytest.mark.parametrize(
    "given", [{"stretch": 1.0}, {"at_rest": 1}, {"drop_max": 0}, {"floor_max": "1mm"}, {"stretch_max": float("nan")}]
)
def test_other_rules_are_refused(given):
    with pytest.raises(InputError, match="usable"):
        make_recipe(small_scene(), {"count": 1}, {}, {}, usable=given)


def test_a_recipe_states_rules(tmp_path):
    (tmp_path / "scene.toml").write_text('[cloth]\nmesh = "rectangle"\n[effects.gravity]\n')
    (tmp_path / "r.toml").write_text('[farm]\nscene = "scene.toml"\ncount = 1\n[usable]\nstretch_max = 1.1\n')
    assert load_recipe(tmp_path / "r.toml").rules == {"at_rest": True, "stretch_max": 1.1}


def test_a_sheet_that_falls_past_the_ball_is_not_worn_and_has_a_floor(tmp_path):
    run = {"duration": 0.2, "frames_per_second": 25}
    scene = small_scene(cloth=SHEET | {"size": [0.2, 0.2], "position": [0.6, 0.0, 0.3]}, run=run)
    for rules, cause in (({"drop_max": 0.5, "floor_max": 1e-3}, ""), ({"drop_max": 0.05}, "drop_max")):
        done = drape(scene, tmp_path, rules=checked_rules(rules, "time")).summary
        assert (done["cause"], done["usable"]) == (cause, not cause)
        assert done["measured"]["drop"] == pytest.approx(9.81 * 0.2**2 / 2, rel=0.2)
        assert (0 < done["measured"].get("floor", 1e-9) < 1e-5) is True
    assert list(tmp_path.glob("run")) == list(tmp_path.glob("second")) == []
    assert set(RULES) == {"stretch_min", "stretch_max", "drop_max", "floor_max"}
