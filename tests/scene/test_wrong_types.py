"""Values of the wrong type, or too large for a float: an InputError that names the key."""

import pytest

from clothsim import InputError, Scene
from clothsim.scene.assembly.scene_world import build

HUGE = 10**400
CLOTH = {"mesh": "rectangle", "cells": [2, 2], "position": [0, 0, 1]}


def built(cloth=None, effects=None, solver=None):
    scene = Scene(cloth={**CLOTH, **(cloth or {})}, effects={"inertia": {}, **(effects or {})}, solver=solver or {})
    return build(scene)


@pytest.mark.parametrize("value", [[], {}, [1, 2]])
@pytest.mark.parametrize("key", ["diagonals", "fabric", "rest", "name"])
def test_a_name_is_a_text(key, value):
    with pytest.raises(InputError, match=key):
        built({key: value})


@pytest.mark.parametrize("value", [HUGE, "0.2", True, None, [1]])
@pytest.mark.parametrize("key", ["density", "thickness", "scale", "weld", "poisson_ratio"])
def test_a_number_is_a_number(key, value):
    with pytest.raises(InputError, match=rf"cloth\.{key}"):
        built({key: value})


@pytest.mark.parametrize("key", ["position", "rotation_degrees", "velocity"])
def test_a_vector_is_of_numbers_that_a_float_holds(key):
    with pytest.raises(InputError, match=rf"cloth\.{key}"):
        built({key: [0, 0, HUGE]})


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e308, -1, 0.5])
@pytest.mark.parametrize("key", ["threads", "max_iterations"])
def test_a_count_is_a_whole_number(key, value):
    with pytest.raises(InputError, match=rf"solver\.{key}"):
        built(solver={key: value})


@pytest.mark.parametrize(
    ("effect", "key", "value"),
    [
        ("bending", "model", []),
        ("membrane", "material", {}),
        ("pins", "clamp", "false"),
        ("pins", "motion", []),
        ("pins", "group", [1]),
    ],
)
def test_the_keys_of_an_effect(effect, key, value):
    select = {"select": "left"} if effect == "pins" else {}
    with pytest.raises(InputError, match=key):
        built(effects={effect: {**select, key: value}})


def test_poisson_s_ratio_may_be_negative():
    world = built({"poisson_ratio": -0.5}).world
    assert world.cloths[0].fabric.poisson_ratio == -0.5


@pytest.mark.parametrize(
    ("fields", "where"),
    [
        ("thickness", "run.fields"),
        (["stress", 3], r"run\.fields\[1\]"),
        ({"stress": True}, "run.fields"),
        (5, "run.fields"),
    ],
)
def test_the_fields_of_a_run_are_a_list_of_names(fields, where):
    with pytest.raises(InputError, match=where):
        Scene(cloth=CLOTH, run={"fields": fields})


def test_an_unknown_field_is_answered_with_the_nearest():
    with pytest.raises(InputError, match=r"run\.fields\[0\]") as caught:
        Scene(cloth=CLOTH, run={"fields": ["thikness"]})
    assert "'thickness'" in caught.value.remedy
