"""Scenes as text: what cannot be written says so."""

import json
from pathlib import Path

import numpy as np
import pytest

from clothsim import Air, Pressure, Scene, examples, load_scene
from clothsim.base.errors import InputError
from clothsim.keys.mesh_arrays import MeshArrays
from clothsim.scene.scene import scene_from_text
from clothsim.study.farm.plan import plan
from clothsim.study.farm.publication import content_id
from clothsim.study.farm.recipe import Recipe

CLOTH = {"mesh": "rectangle", "cells": [2, 2]}


def breath(time):
    return 5.0 * time


@pytest.mark.parametrize(
    ("effects", "key"),
    [
        ([Pressure(value=breath)], r"effects\.pressure\.value"),
        ([Air(wind=lambda points, time: 0 * points)], r"effects\.air\.wind"),
        (
            {"springs": {"spring": [{"select": "left", "stiffness": breath}]}},
            r"effects\.springs\.spring\[0\]\.stiffness",
        ),
    ],
)
def test_a_scene_with_a_function_is_neither_printed_nor_farmed(tmp_path, effects, key):
    scene = Scene(cloth=CLOTH, effects=effects)
    with pytest.raises(InputError, match=key):
        scene.to_text()
    with pytest.raises(InputError, match=key):
        content_id(scene, 1)
    with pytest.raises(InputError, match=key):
        plan(Recipe(scene, 1), tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_record_of_a_run_has_the_name_of_the_function():
    text = Scene(cloth=CLOTH, effects=[Pressure(value=breath)]).to_text(names_of_functions=True)
    assert json.loads(text)["effects"]["pressure"]["value"] == {"function": "breath"}
    assert json.loads(scene_from_text(text).to_text()) == json.loads(text)


def test_a_scene_of_a_relative_directory_is_the_one_that_its_text_gives():
    scene = Scene(cloth=CLOTH, effects={"membrane": {}}, directory=Path("here"))
    assert Scene.from_text(scene.to_text()) == scene
    assert hash(Scene.from_text(scene.to_text())) == hash(scene)
    assert Scene(cloth=CLOTH, effects={"membrane": {}}, directory=Path("there")) != scene


@pytest.mark.parametrize("name", sorted(examples()))
def test_a_scene_as_toml_is_the_same_scene(tmp_path, name):
    scene = load_scene(name).starting_at(tmp_path)
    (tmp_path / "again.toml").write_text(scene.to_toml(), encoding="utf-8")
    assert load_scene(tmp_path / "again.toml") == scene


def test_a_mesh_in_memory_is_in_the_toml(tmp_path):
    triangle = MeshArrays(np.eye(3), np.array([[0, 1, 2]]))
    scene = Scene(cloth={"mesh": triangle}, effects={"gravity": {}})
    (tmp_path / "again.toml").write_text(scene.to_toml(), encoding="utf-8")
    again = load_scene(tmp_path / "again.toml")
    assert again.cloths[0]["mesh"] == scene.cloths[0]["mesh"]
