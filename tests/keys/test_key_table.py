"""Scenes that cannot be changed, and that hash by content."""

import copy
import pickle

import numpy as np
import pytest

from clothsim import Cloth, Gravity, Inertia, Pins, Scene, Solver
from clothsim.keys.key_table import FrozenTable, frozen

POINTS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]


def scene(**changes):
    given = {
        "cloth": Cloth(POINTS, [[0, 1, 2]]),
        "body": [{"name": "ball", "mesh": "sphere", "position": np.array([0.0, 0.0, -2.0])}],
        "effects": [Inertia(), Gravity(acceleration=[0.0, 0.0, -9.81]), Pins(select=[0, 1])],
        "solver": Solver(dt=0.02),
    }
    return Scene(**{**given, **changes})


@pytest.mark.parametrize(
    "change",
    [
        lambda made: made.effects.__setitem__("air", {}),
        lambda made: made.effects["gravity"].__setitem__("acceleration", (0, 0, 0)),
        lambda made: made.effects["gravity"]["acceleration"].__setitem__(2, 0),
        lambda made: made.effects.pop("gravity"),
        lambda made: made.effects.update(air={}),
        lambda made: made.solver.clear(),
        lambda made: made.cloth.setdefault("density", 1.0),
        lambda made: made.body[0].__delitem__("name"),
        lambda made: setattr(made, "effects", {}),
        lambda made: made.cloth["mesh"].vertices.__setitem__(0, 1.0),
    ],
)
def test_a_scene_refuses_changes(change):
    made = scene()
    before = made.to_text()
    with pytest.raises((TypeError, AttributeError, ValueError)):
        change(made)
    assert made.to_text() == before


def test_what_was_given_may_be_changed_and_the_scene_stays():
    given = {"gravity": {"acceleration": [0.0, 0.0, -9.81]}}
    made = scene(effects=given)
    given["gravity"]["acceleration"][2] = 0.0
    given["air"] = {}
    assert made.effects == {"gravity": {"acceleration": (0.0, 0.0, -9.81)}}


def test_equal_scenes_hash_alike():
    one, other = scene(), scene()
    assert one == other
    assert hash(one) == hash(other)
    assert {one: "same"}[other] == "same"


@pytest.mark.parametrize(
    "changes",
    [
        {"cloth": Cloth([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.1, 0.0]], [[0, 1, 2]])},
        {"effects": [Inertia()]},
        {"solver": Solver(dt=0.01)},
        {"body": ()},
    ],
)
def test_other_scenes_are_other_keys(changes):
    assert scene(**changes) != scene()
    assert len({scene(**changes), scene()}) == 2


def test_a_function_hashes_by_identity():
    def wind(points, time):
        return 0 * points

    tables = [frozen({"wind": wind}), frozen({"wind": wind}), frozen({"wind": lambda points, time: 0 * points})]
    assert hash(tables[0]) == hash(tables[1])
    assert tables[0] != tables[2]


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda table: pickle.loads(pickle.dumps(table))])
def test_a_copy_is_frozen_too(copied):
    table = frozen({"a": [1, {"b": 2.0}]})
    other = copied(table)
    assert other == table
    assert isinstance(other, FrozenTable)
    assert isinstance(other["a"][1], FrozenTable)
    assert {**table, "c": 3} == {"a": (1, {"b": 2.0}), "c": 3}


def test_the_arrays_of_a_pickled_scene_stay_locked():
    made = scene(effects={"pins": {"select": np.array([0, 1])}})
    other = pickle.loads(pickle.dumps(made))
    before = hash(other)
    with pytest.raises(ValueError, match="read-only"):
        other.effects["pins"]["select"][0] = 2
    assert hash(other) == before == hash(made)
    assert other == made
