"""Pilots: a recipe that yields nothing says what is missing before anything is planned."""

import json

import pytest
from small_scenes import EFFECTS, SHEET, SOLVER, small_scene

from clothsim import InputError
from clothsim.cli import main
from clothsim.study.farm.drape import Pilot, enough, pilot
from clothsim.study.farm.recipe import make_recipe

SETTLING = EFFECTS | {"damping": {"rate": 10.0}, "friction": {"coefficient": 0.5}}


def recipe(duration, **farm):
    run = {"duration": duration, "frames_per_second": 5, "rest_speed": 0.05}
    scene = small_scene(effects=SETTLING, solver=SOLVER | {"dt": 0.05}, run=run)
    return make_recipe(scene, {"count": 1, **farm}, {}, {"cloth.density": {"uniform": [0.1, 0.3]}})


def test_a_duration_that_is_too_short_is_named_with_one_that_does():
    with pytest.raises(InputError) as error:
        pilot(recipe(0.2))
    (proposed,) = [float(word) for word in error.value.remedy.split() if word.replace(".", "").isdigit()]
    assert f"{proposed:g} s would do" in error.value.sentence
    made = pilot(recipe(proposed))
    assert isinstance(made, Pilot)
    assert 0.2 < made.time <= proposed
    assert pilot(recipe(0.2, until="time")).time == pytest.approx(0.2)


def test_a_later_pilot_may_be_the_usable_one():
    vary = {"cloth.position": {"grid": [[0, 0, 0.1], [0, 0, 0.33]]}}
    scene = small_scene(run={"duration": 0.04, "frames_per_second": 25})
    assert pilot(make_recipe(scene, {"until": "time"}, {}, vary)).index == 1
    with pytest.raises(InputError, match="intersects"):
        pilot(make_recipe(small_scene(cloth=SHEET | {"position": [0, 0, 0.1]}), {"count": 1}, {}, {}))


def test_plan_makes_a_pilot_and_writes_nothing_without_a_usable_one(tmp_path, capsys):
    scene = '[cloth]\nmesh = "rectangle"\ncells = [2, 2]\n[effects.gravity]\n[effects.inertia]\n'
    (tmp_path / "scene.toml").write_text(scene)
    text = '[farm]\nscene = "scene.toml"\ncount = 1\n[set]\nrun.duration = 0.04\n'
    (tmp_path / "r.toml").write_text(text)
    words = ["farm", "plan", str(tmp_path / "r.toml"), "-o", str(tmp_path / "farm"), "--json"]
    assert main(words) == 2
    assert not (tmp_path / "farm").exists()
    assert main([*words, "--no-pilot"]) == 0
    (tmp_path / "t.toml").write_text(text.replace("count", 'until = "time"\ncount'))
    capsys.readouterr()
    assert main(["farm", "plan", str(tmp_path / "t.toml"), "-o", str(tmp_path / "time"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["pilot"]["index"] == 0


def test_a_folder_of_another_plan_is_refused_before_a_pilot_is_made(tmp_path, monkeypatch, capsys):
    scene = '[cloth]\nmesh = "rectangle"\ncells = [2, 2]\n[effects.gravity]\n[effects.inertia]\n'
    (tmp_path / "scene.toml").write_text(scene)
    text = '[farm]\nscene = "scene.toml"\nuntil = "time"\ncount = 1\n[set]\nrun.duration = 0.04\n'
    (tmp_path / "r.toml").write_text(text)
    words = ["farm", "plan", str(tmp_path / "r.toml"), "-o", str(tmp_path / "farm")]
    assert main([*words, "--no-pilot"]) == 0
    monkeypatch.setattr("clothsim.cli.on_demand.pilot", lambda recipe: pytest.fail("a pilot was made"))
    (tmp_path / "r.toml").write_text(text.replace("0.04", "0.08"))
    assert main(words) == 2
    assert "another plan" in capsys.readouterr().err


def test_proposed_durations_have_one_digit():
    assert [enough(time) for time in (2.6, 0.31, 11.0, 1.8, 6.0)] == [4.0, 0.5, 20.0, 3.0, 9.0]
