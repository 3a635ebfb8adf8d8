"""Typed effects and settings: the builders' keys and defaults, the tables of a scene file, and no import."""

import pickle
import subprocess
import sys
from dataclasses import FrozenInstanceError

import pytest

import clothsim
from clothsim import InputError, Scene
from clothsim.keys.effect_tables import Gust
from clothsim.keys.key_table import frozen
from clothsim.keys.typed_effects import TYPED_EFFECTS, takes_keys
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.effects import EFFECTS

CLOTH = {"mesh": "rectangle", "cells": [2, 2]}


def test_the_table_of_effects_names_the_classes():
    ours = {name: effect for name, effect in EFFECTS.items() if name in TYPED_EFFECTS}
    assert {name: effect.keys_class for name, effect in ours.items()} == TYPED_EFFECTS
    for name, effect in ours.items():
        assert isinstance(effect.section, str)
        assert takes_keys(effect.load()) == bool(effect.keys()), name


def test_a_list_of_effects_is_their_tables():
    effects = [
        clothsim.Gravity(),
        clothsim.Bending(model="hinge"),
        clothsim.Pins(group=[clothsim.PinGroup(select=[0, 1], motion=clothsim.Motion(velocity=[0, 0, 1]))]),
        clothsim.Air(wind=clothsim.Gust(velocity=[3, 0, 0])),
        clothsim.Seams(seam=[clothsim.Seam(from_=clothsim.SeamLine(side="left"), to=clothsim.SeamLine(side="right"))]),
    ]
    expected = {
        "gravity": {},
        "bending": {"model": "hinge"},
        "pins": {"group": [{"select": [0, 1], "motion": {"velocity": [0, 0, 1]}}]},
        "air": {"wind": {"kind": "gust", "velocity": [3, 0, 0]}},
        "seams": {"seam": [{"from": {"side": "left"}, "to": {"side": "right"}}]},
    }
    assert Scene(cloth=CLOTH, effects=effects).effects == frozen(expected)


def test_they_may_stand_in_a_dictionary_too():
    scene = Scene(cloth=CLOTH, effects={"damping": clothsim.Damping(rate=2)})
    assert scene.effects == {"damping": {"rate": 2.0}}


def test_typed_settings_are_their_tables():
    scene = Scene(
        cloth=CLOTH,
        effects=[clothsim.Inertia()],
        solver=clothsim.Solver(dt=0.02, threads=1),
        run=clothsim.RunSettings(duration=1),
        seed=clothsim.Seed(),
        contact=clothsim.Contact(backend="numba"),
    )
    assert (scene.solver, scene.run, scene.seed) == ({"dt": 0.02, "threads": 1}, {"duration": 1.0}, {})
    assert scene.solver_settings == clothsim.Solver(dt=0.02, threads=1)
    assert scene.contact_settings.backend == "numba"


def test_ipctk_is_deprecated_and_its_scenes_still_build():
    with pytest.warns(DeprecationWarning, match=r"contact\.backend"):
        scene = Scene(cloth=CLOTH, effects=[clothsim.Inertia()], contact={"backend": "ipctk"})
    assert set(build(scene).energies) == {"inertia"}


def test_settings_are_parsed_once():
    scene = Scene(cloth=CLOTH, solver={"dt": 1})
    assert scene.solver_settings is scene.solver_settings
    assert isinstance(scene.solver_settings.dt, float)


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: clothsim.Gravity(acceleration=9.81), r"effects\.gravity\.acceleration must be 3 numbers \[m/s2\]"),
        (lambda: clothsim.Bending(model="hinges"), r"effects\.bending\.model is 'hinges'.*'hinge'"),
        (lambda: clothsim.Solver(dt=-1), r"solver\.dt must be above 0 \[s\]"),
        (lambda: clothsim.RunSettings(duration="long"), r"run\.duration must be a number"),
        (lambda: Scene(cloth=CLOTH, effects=[clothsim.Gravity(), clothsim.Gravity()]), r"effects\[1\].*gravity again"),
        (lambda: Scene(cloth=CLOTH, effects=[clothsim.Gravity]), r"effects\[0\].*Gravity\(\)"),
        (lambda: Scene(cloth=CLOTH, effects=["gravity"]), r"effects\[0\] is 'gravity'"),
        (lambda: Scene(cloth=CLOTH, effects="gravity"), "effects must be a table"),
    ],
)
def test_what_is_wrong_is_named(make, names):
    with pytest.raises(InputError, match=names):
        make()


def test_a_section_knows_the_keys_that_were_given():
    seam = clothsim.Seam(from_={"side": "left"}, to=clothsim.SeamLine(side="right"), end=1.0)
    assert seam.given == ("from", "to", "end")
    assert seam.from_ == clothsim.SeamLine(side="left")
    assert seam.as_table() == {"from": {"side": "left"}, "to": {"side": "right"}, "end": 1.0}
    later = seam.with_keys(end=2)
    assert (later.end, later.given, seam.end) == (2.0, seam.given, 1.0)
    assert pickle.loads(pickle.dumps(seam)).given == seam.given
    gust = clothsim.Air.parsed("effects.air", {"wind": {"kind": "gust", "velocity": [1, 0, 0]}}).wind
    assert (type(gust), gust.given, gust.period) == (Gust, ("velocity",), 1.0)


def test_they_are_frozen():
    with pytest.raises(FrozenInstanceError):
        clothsim.Gravity().acceleration = (0, 0, 0)


def test_a_scene_of_typed_effects_imports_no_effect():
    code = (
        "import sys, clothsim\n"
        "names = [n for n in clothsim.__all__ if n in "
        f"{[kind.__name__ for kind in TYPED_EFFECTS.values()]!r}]\n"
        "effects = [getattr(clothsim, n)() for n in names]\n"
        "clothsim.Scene(cloth={'mesh': 'rectangle'}, effects=effects)\n"
        "print(len(effects), [m for m in sys.modules if m.startswith(('numba', 'clothsim.en', 'clothsim.co'))])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == f"{len(TYPED_EFFECTS)} []"
