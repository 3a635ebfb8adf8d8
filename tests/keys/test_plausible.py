"""Plausible ranges: one for every key that has a unit, and none that a usual scene is asked about."""

from pathlib import Path

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.keys.plausible import ABSURD, ANY, OF_KEY, UNITS_OF_ANY, doubts, plausible_range
from clothsim.keys.settings import RunSettings
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.reference import sections
from clothsim.scene.scene import Scene
from clothsim.scene.toml_file import load_scene

ROOT = Path(__file__).parents[2]
KEYS = [(name, key) for name, section in sections().items() for key in section.keys.values()]
SHEET = {"mesh": "rectangle", "cells": [2, 2]}


@pytest.mark.parametrize(("section", "key"), KEYS, ids=lambda part: getattr(part, "name", part))
def test_every_key_with_a_unit_has_a_range_or_is_named_as_one_without(section, key):
    if key.key.unit not in UNITS_OF_ANY and key.name not in ANY:
        found = plausible_range(section.rpartition(".")[2], key)
        assert found is not None
        low, high, usual = found
        assert 0 <= low < high
        assert usual


def test_every_named_range_is_of_a_key():
    there = {(name.partition(" ")[0].rpartition(".")[2].strip('"'), key.name) for name, key in KEYS}
    there |= {(name.rpartition('"')[0].rpartition('"')[2], key.name) for name, key in KEYS}
    assert {tuple(name.split(".")) for name in OF_KEY} <= there
    assert set(ANY) <= {key for _, key in there}


@pytest.mark.parametrize("file", sorted((ROOT / "scenes").glob("*.toml")), ids=lambda file: file.stem)
def test_no_example_is_asked_about(file):
    assert asked(load_scene(file)) == []


@pytest.mark.parametrize(
    ("board", "doubted"),
    [
        ({"density": 50, "thickness": 0.02, "youngs_modulus": 1e7, "bending_stiffness": 1}, []),
        ({"density": 50, "thickness": 0.02, "youngs_modulus": 1e7, "bending_stiffness": 100}, ["bending_stiffness"]),
        ({"density": 50, "thickness": 3e-4}, ["density"]),
        ({"density": 150, "thickness": 0.3}, ["density", "thickness"]),
        ({"density": 50}, ["density"]),
    ],
)
def test_the_thickness_of_a_board_explains_its_density_and_its_bending(board, doubted):
    found = asked(Scene(cloth=SHEET | board, effects={"membrane": {}}))
    assert [text.split(" ")[0] for text in found] == [f"cloth.{key}" for key in doubted]


@pytest.mark.parametrize(
    ("key", "value", "most"),
    [("youngs_modulus", 1e30, 1e19), ("density", 1e12, 5e9), ("bending_stiffness", 1e8, 1e7)],
)
def test_a_number_that_no_unit_explains_is_refused(key, value, most):
    assert OF_KEY[f"cloth.{key}"][1] * ABSURD == most
    with pytest.raises(InputError, match=key):
        build(Scene(cloth={**SHEET, key: value}, effects={"membrane": {}}))
    build(Scene(cloth={**SHEET, key: 0.9 * most}, effects={"membrane": {}}))  # asked about


def test_an_array_is_looked_at_as_a_list_is():
    """Of key frames the values, not the times."""
    for acceleration in ([0, 0, -1e13], np.array([0, 0, -1e13])):
        with pytest.raises(InputError, match=r"gravity\.acceleration"):
            build(Scene(cloth=SHEET, effects={"gravity": {"acceleration": acceleration}}))
    for rows, named in (
        (np.array([[0, 1.0], [1, 1e9]]), ["effects.pressure.value"]),
        (np.array([[0, 1], [1e9, 2]]), []),
    ):
        found = asked(Scene(cloth=SHEET, effects={"pressure": {"value": rows}}))
        assert [text.split(" ")[0] for text in found] == named


@pytest.mark.parametrize(
    "given",
    [
        {"density": 390, "thickness": 0.05, "youngs_modulus": 2e11, "bending_stiffness": 2.3e6},  # 5 cm of steel
        {"density": 150, "youngs_modulus": 8e8, "bending_stiffness": 9e6},  # cotton in a scene 1000 times as large
        {"density": 1.5e-4, "youngs_modulus": 8e5, "bending_stiffness": 9e3},  # cotton in g, mm, s
    ],
)
def test_numbers_of_a_thick_plate_a_large_model_and_other_units_are_asked_about_only(given):
    scene = Scene(cloth=SHEET | given, effects={"membrane": {}})
    build(scene)
    assert asked(scene)


def test_a_number_without_a_unit_is_named_without_one():
    (text,) = asked(Scene(cloth=SHEET, effects={"friction": {"coefficient": 30}}))
    assert text.startswith("effects.friction.coefficient is 30, where")


def test_a_time_is_asked_about_however_long():
    build(Scene(cloth=SHEET, effects={"membrane": {}}, solver={"dt": 1e9}))


def asked(scene):
    parts = [("cloth", each) for each in scene.cloths] + [("body", each) for each in scene.bodies]
    parts += [("rigid", each) for each in scene.rigid_bodies]
    parts += [(f"effects.{name}", each) for name, each in scene.effects.items()]
    parts += [("solver", scene.solver), ("run", scene.run)]
    return [text for where, keys in parts for text in doubts(where, keys)]


@pytest.mark.parametrize(
    ("sections", "named"),
    [
        ({"cloth": SHEET | {"density": 150}}, "cloth.density"),
        ({"cloth": SHEET | {"position": [0, 0, 1500]}}, "cloth.position"),
        ({"rigid": {"mesh": "slab", "density": 1}}, "rigid.density"),
        ({"effects": {"gravity": {"acceleration": [0, 0, -9810]}}}, "effects.gravity.acceleration"),
        ({"effects": {"body_contact": {"d_hat": 1}}}, "effects.body_contact.d_hat"),
        ({"effects": {"friction": {"coefficient": 30}}}, "effects.friction.coefficient"),
        ({"effects": {"springs": {"spring": [{"select": [0], "stiffness": 1e9}]}}}, "effects.springs.spring[0]."),
        ({"solver": {"dt": 10}}, "solver.dt"),
        ({"run": {"duration": 2000}}, "run.duration"),
    ],
)
def test_a_number_in_another_unit_is_asked_about(sections, named):
    (text,) = asked(Scene(**{"cloth": SHEET} | sections))
    assert text.startswith(named)


def test_zero_and_what_is_not_given_are_plausible():
    assert list(doubts("run", RunSettings())) == []
    assert asked(Scene(cloth=SHEET | {"bending_stiffness": 0})) == []
