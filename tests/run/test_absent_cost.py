"""Cost of absent effects: each is measured, or has a reason."""

import json
import sys
from types import ModuleType

import numpy as np
import pytest
from small_scenes import BALL, EFFECTS, small_scene

from clothsim import InputError
from clothsim.base.process_memory import held_bytes
from clothsim.cli import main
from clothsim.run.receipt import LATE, absent_effects, explain_scene
from clothsim.scene.effects import EFFECTS as TABLE
from clothsim.scene.effects import Effect

SHEET = """
[cloth]
mesh = "rectangle"
cells = [4, 4]
position = [0.0, 0.0, 0.31]
[[body]]
name = "ball"
mesh = "sphere"
radius = 0.3
subdivisions = 1
[effects.inertia]
[effects.membrane]
[effects.damping]
rate = 0.0
[solver]
linear = "superlu"
threads = 1
[run]
duration = 0.08
"""


def needy(world, *, height):
    raise AssertionError("never built: height is not given")


def refusing(world):
    raise InputError("refusing goes with nothing.", "Leave it out.")


@pytest.fixture
def strangers(monkeypatch):
    """Two effects more in the table: one with a mandatory key, one that refuses every scene."""
    module = ModuleType("strangers")
    module.needy, module.refusing = needy, refusing
    monkeypatch.setitem(sys.modules, "strangers", module)
    for name in ("needy", "refusing"):
        monkeypatch.setitem(TABLE, name, Effect(f"strangers:{name}", "nothing"))


def test_each_absent_effect_is_measured_or_has_a_reason(strangers):
    seen = absent_effects(small_scene(), steps=1)
    assert list(seen.effects) == [name for name in TABLE if name not in EFFECTS]
    assert (seen.steps, seen.rounds) == (1, 3)
    assert seen.seconds > 0
    for name in ("strain_limit", "air", "self_contact", "friction"):
        assert seen.effects[name].seconds == pytest.approx(seen.effects[name].ratio * seen.seconds)
        assert seen.effects[name].seconds > 0
        assert not seen.effects[name].why
    assert seen.effects["pressure"].why == "would be off: the pressure is 0"
    assert np.isnan(seen.effects["pressure"].seconds)
    assert seen.effects["needy"].why == "needs keys: height"
    assert seen.effects["refusing"].why == "does not go with the scene: refusing goes with nothing."


def test_what_the_budget_does_not_cover_is_reported():
    seen = absent_effects(small_scene(), steps=1, budget=1e-9)
    assert seen.rounds == 1
    assert {each.why for each in seen.effects.values()} == {LATE}


def test_the_table_lists_what_is_on_off_and_what_the_rest_would_cost(tmp_path, capsys):
    scene = tmp_path / "sheet.toml"
    scene.write_text(SHEET)
    assert main(["explain", str(scene), "--steps", "1", "--absent", "--budget", "30s"]) == 0
    out = capsys.readouterr().out
    head, off, priced, rest = out.replace("\n\nNot", "\n\nOff:Not").split("\n\nOff:")
    assert "kB held" in head
    assert "damping" in off
    assert "\n  membrane" not in off + rest
    assert "\nmembrane" not in priced
    assert "the first 1 step, median of 3" in priced
    assert "\n(as it is)" in priced
    assert "\nbody_contact" in priced
    assert "  pressure" in rest
    named = {"inertia", "membrane", "damping"}
    assert all(name in priced + rest for name in TABLE if name not in named)
    assert max(len(line) for line in out.splitlines()) <= 120
    assert main(["explain", str(scene), "--steps", "1", "--absent", "--json"]) == 0
    reported = json.loads(capsys.readouterr().out)
    assert reported["body_contact"]["adding"]["ratio"] > 0
    assert reported["pressure"]["adding"]["why"]
    assert "adding" not in reported["membrane"]
    assert reported["membrane"]["bytes"] > 0


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["SCENE", "--budget", "5s"], "--absent"),
        (["SCENE", "--absent", "--budget", "soon"], "'soon'"),
        (["DIR", "--absent"], "--absent"),
    ],
)
def test_bad_options_are_refused(tmp_path, capsys, words, sentence):
    scene = tmp_path / "sheet.toml"
    scene.write_text(SHEET)
    places = {"SCENE": str(scene), "DIR": str(tmp_path)}
    assert main(["explain", *(places.get(word, word) for word in words)]) == 2
    assert sentence in capsys.readouterr().err


def test_an_effect_that_was_idle_reports_in_how_many_steps():
    far = small_scene(body=BALL | {"position": [0.0, 0.0, -50.0]}, effects=EFFECTS | {"friction": {}})
    reported = explain_scene(far, steps=2).effects
    assert reported["friction"]["reason"] == "named; had nothing to do in 2 of 2 steps"
    assert reported["membrane"]["reason"] == "named in the scene"


def test_held_bytes_counts_an_array_once_and_what_others_hold_not():
    array, other = np.zeros(10), np.zeros(4)

    class Holder:
        def __init__(self, *things):
            self.things = things

    assert held_bytes(Holder(array, array[2:5], {"again": [array]})) == 80
    assert held_bytes(Holder(array, other), [Holder(other)]) == 80
    itself = Holder(array)
    itself.me = itself
    assert held_bytes(itself) == 80
    assert held_bytes(Holder("text", 1.0, None)) == 0
