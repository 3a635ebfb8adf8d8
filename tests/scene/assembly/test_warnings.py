"""Warnings about a scene: keys without effect, bodies that move too fast, starts inside bodies and d_hat."""

import re

import pytest

from clothsim import InputError, Scene
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build

CLOTH = {"mesh": "rectangle", "cells": [2, 2]}
HELD = {"membrane": {}, "pins": {"select": "left"}}


def notes(cloth=CLOTH, effects=HELD, solver=None):
    scene = Scene(cloth=cloth, effects=effects, solver={"linear": "superlu", **(solver or {})})
    return " ".join(prepare(scene, build(scene)).notes)


def test_velocity_without_inertia():
    fast = {**CLOTH, "velocity": [1, 0, 0]}
    assert "velocity" in notes(fast)
    assert "velocity" not in notes(fast, {**HELD, "inertia": {}})


def test_a_clamp_without_bending():
    clamped = {"membrane": {}, "pins": {"select": "left", "clamp": True}}
    assert "clamp" in notes(effects=clamped)
    assert "clamp" not in notes(effects={**clamped, "bending": {}})


def test_steps_longer_than_a_frame():
    assert re.search(r"0\.04 s.*0\.1 s", notes(solver={"dt": 0.1}))
    assert "Steps are" not in notes(solver={"dt": 0.04})


def test_a_body_that_leaps_through_the_cloth_is_refused():
    """Half a turn in a step: on straight ways a blade would pass through its own axis, and never meet the cloth."""
    cloth = {**CLOTH, "size": [0.1, 0.1], "position": [0, 0, 0.3]}
    blade = {"name": "blade", "mesh": "slab", "size": [0.02, 0.3, 0.1], "position": [0, 0.3, 0]}
    blade["motion"] = {"rotate_degrees_per_second": [9000, 0, 0], "centre": [0, 0, 0]}
    solver = {"dt": 0.02, "linear": "superlu"}
    scene = Scene(cloth=cloth, body=blade, effects={"inertia": {}, "body_contact": {}}, solver=solver)
    with pytest.raises(InputError, match=r"blade.* 180 degrees") as refusal:
        prepare(scene, build(scene))
    assert "below 0.005 s" in refusal.value.remedy


def contact_notes(cloth, effects, body):
    scene = Scene(
        cloth=cloth, body=body, effects={"membrane": {}, "inertia": {}, **effects}, solver={"linear": "superlu"}
    )
    return " ".join(prepare(scene, build(scene)).notes)


BALL = {"name": "ball", "mesh": "sphere", "radius": 0.5}
SMALL = {**CLOTH, "size": [0.1, 0.1]}


def test_cloth_wholly_inside_a_body_is_reported():
    inside = contact_notes(SMALL, {"body_contact": {}}, BALL)
    assert "cloth starts inside ball, all of it, such as vertex 0: contact keeps it in" in inside
    above = {**SMALL, "position": [0, 0, 0.6]}
    assert "starts inside" not in contact_notes(above, {"body_contact": {}}, BALL)
    assert "starts inside" not in contact_notes(SMALL, {}, BALL)


def nested(rigid, body=()):
    above = {**SMALL, "position": [0, 0, 2.0]}
    effects = {"membrane": {}, "inertia": {}, "body_contact": {}}
    scene = Scene(cloth=above, body=body, rigid=rigid, effects=effects, solver={"linear": "superlu"})
    return " ".join(prepare(scene, build(scene)).notes)


def test_a_rigid_body_inside_another_body_is_reported():
    outer = {"name": "outer", "mesh": "sphere", "radius": 0.5}
    inner = {"name": "inner", "mesh": "sphere", "radius": 0.1, "subdivisions": 1}
    assert "inner starts inside outer" in nested([outer, inner])
    assert "inner starts inside outer" in nested([inner], [outer])
    assert "outer starts inside" not in nested([outer, inner])
    assert "starts inside" not in nested([outer, {**inner, "position": [0, 0, 0.7]}])
    ring = {"name": "ring", "mesh": "ring", "radius": 0.5, "position": [0, 0, 0]}
    assert "starts inside" not in nested([ring, inner])  # in its hole


def test_a_d_hat_wider_than_the_edges_is_reported_and_one_wider_than_the_cloth_refused():
    above = {**SMALL, "position": [0, 0, 0.7]}
    assert "more than the median edge" in contact_notes(above, {"body_contact": {"d_hat": 0.06}}, BALL)
    assert "median edge" not in contact_notes(above, {"body_contact": {"d_hat": 0.01}}, BALL)
    with pytest.raises(InputError, match=r"effects\.body_contact\.d_hat.* 0\.2 m.* 0\.1 m"):
        contact_notes(above, {"body_contact": {"d_hat": 0.2}}, BALL)


def test_two_coefficients_for_one_pair_are_refused():
    above = {**SMALL, "position": [0, 0, 0.7]}
    effects = {"body_contact": {}, "friction": {"pairs": [["cloth", "ball", 0.2], ["ball", "cloth", 0.4]]}}
    with pytest.raises(InputError, match=r"pairs\[1\] .*ball and cloth"):
        contact_notes(above, effects, BALL)


def test_a_start_inside_d_hat_is_reported():
    near = {**SMALL, "position": [0, 0, 0.501]}
    assert "inside d_hat of 0.005 m" in contact_notes(near, {"body_contact": {}}, BALL)
    far = {**SMALL, "position": [0, 0, 0.6]}
    assert "inside d_hat" not in contact_notes(far, {"body_contact": {}}, BALL)
