"""Keys that no effect of the scene listens to are told, not passed over."""

from clothsim import Scene
from clothsim.drape import prepare
from clothsim.scene.build import build

CLOTH = {"mesh": "rectangle", "cells": [2, 2]}
HELD = {"membrane": {}, "pins": {"select": "left"}}


def notes(cloth=CLOTH, effects=HELD, solver=None):
    scene = Scene(cloth=cloth, effects=effects, solver={"linear": "superlu", **(solver or {})})
    return " ".join(prepare(scene, build(scene)).notes)


def test_velocity_without_inertia():
    fast = {**CLOTH, "velocity": [1, 0, 0]}
    assert "velocity does nothing" in notes(fast)
    assert "velocity does nothing" not in notes(fast, {**HELD, "inertia": {}})


def test_a_clamp_without_bending():
    clamped = {"membrane": {}, "pins": {"select": "left", "clamp": True}}
    assert "clamp does nothing" in notes(effects=clamped)
    assert "clamp does nothing" not in notes(effects={**clamped, "bending": {}})


def test_steps_longer_than_a_frame():
    assert "Steps are 0.04 s, not 0.1 s" in notes(solver={"dt": 0.1})
    assert "Steps are" not in notes(solver={"dt": 0.04})
