"""Checks of a scene at its start: warnings, sizes."""

import re
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import SHEET, small_scene

from clothsim import Body, Cloth, InputError, Scene
from clothsim.run.session import prepare
from clothsim.scene.assembly import checks
from clothsim.scene.assembly.checks import FLAT, LARGEST, LYING, SMALLEST
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


def test_hanging_cloth_without_a_membrane():
    hanging = {"inertia": {}, "gravity": {}, "pins": {"select": "left"}}
    assert "membrane" in notes(effects=hanging)
    assert "Nothing resists" not in notes(effects={**hanging, "membrane": {}})
    assert "Nothing resists" not in notes(effects={name: keys for name, keys in hanging.items() if name != "pins"})


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
        cloth=cloth,
        body=body,
        effects={"membrane": {}, "inertia": {}, **effects},
        solver={"linear": "superlu"},
        run={"allow_inside": True},
    )
    return " ".join(prepare(scene, build(scene)).notes)


BALL = {"name": "ball", "mesh": "sphere", "radius": 0.5}
SMALL = {**CLOTH, "size": [0.1, 0.1]}


def test_cloth_wholly_inside_a_body_is_reported():
    inside = contact_notes(SMALL, {"body_contact": {}}, BALL)
    assert "cloth starts inside ball, all of it, such as vertex 0: contact keeps it in" in inside
    above = {**SMALL, "position": [0, 0, 0.6]}
    assert "starts inside" not in contact_notes(above, {"body_contact": {}}, BALL)
    without = contact_notes(SMALL, {}, BALL)
    assert "starts inside ball, all of it" in without
    assert "without [effects.body_contact]" in without
    assert "keeps it in" not in without
    through = {**SMALL, "size": [0.1, 2.0], "position": [0, 0.9, 0]}  # its first vertex is inside
    assert "starts inside" not in contact_notes(through, {}, BALL)


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


def test_a_rod_inside_a_rigid_body_is_not_advised_a_contact_that_rods_do_not_have():
    rod = {"name": "wire", "points": [[-0.05, 0, 0], [0.05, 0, 0]], "edge": 0.02}
    rod |= {"radius": 1e-3, "density": 1e3, "youngs_modulus": 1e6}
    box = {"name": "box", "mesh": "sphere", "radius": 0.3, "subdivisions": 1}
    solver = {"linear": "superlu"}
    scene = Scene(rod=rod, rigid=box, effects={"inertia": {}}, solver=solver)
    notes = " ".join(prepare(scene, build(scene)).notes)
    assert "wire starts inside box" in notes
    assert "body_contact" not in notes
    held = Scene(rod=rod, body=box, effects={"inertia": {}}, solver=solver)
    assert "body_contact" in " ".join(prepare(held, build(held)).notes)


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
    assert "m/s" in contact_notes(near, {"body_contact": {}, "gravity": {}}, BALL)
    light = {**SMALL, "position": [0, 0, 0.5042]}  # as a sheet that is laid on a ball: it moves by less than d_hat
    assert "inside d_hat" not in contact_notes(light, {"body_contact": {}, "gravity": {}}, BALL)
    far = {**SMALL, "position": [0, 0, 0.6]}
    assert "inside d_hat" not in contact_notes(far, {"body_contact": {}}, BALL)


FALL = {"inertia": {}, "gravity": {}}
TOP = {"inertia": {}, "gravity": {"acceleration": [0, -9.81, 0]}}


def box(extent):
    """A closed box of that extent."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [[a, b, c] for q in quads for a, b, c in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))]
    return corners * extent, triangles


def size_notes(word, **sections):
    return [note for note in build(small_scene(**sections)).warnings if word in note]


def body_notes(extent, effects=FALL, **keys):
    body = Body(*box(extent), name="figure", **{"position": [0, 0, -5], **keys})
    scene = Scene(cloth=SHEET, body=body, effects=effects)
    return [note for note in build(scene).warnings if note.startswith("figure")]


@pytest.mark.parametrize(
    ("size", "factor"),
    [(60.0, "0.01"), (LARGEST * 1.01, "0.1"), (1700.0, "0.001"), (SMALLEST * 0.99, "100"), (0.001, "100")],
)
def test_a_sheet_in_another_unit_is_named_with_the_factor_that_mends_it(size, factor):
    found = size_notes(" long;", cloth=SHEET | {"size": [size, size / 2]}, effects=FALL, body=())
    assert len(found) == 1
    assert found[0].startswith("cloth")
    assert f"{size:.3g} m" in found[0]
    if factor not in ("0.1",):
        assert f"scale = {factor} " in found[0]


@pytest.mark.parametrize("size", [LARGEST, SMALLEST, 1.0])
def test_a_sheet_of_usual_size_is_not(size):
    assert size_notes(" long;", cloth=SHEET | {"size": [size, size]}, effects=FALL, body=()) == []


def test_a_body_of_172_m_is_named_and_a_floor_is_not():
    assert len(body_notes([172, 50, 172])) == 1
    floor = {"name": "floor", "mesh": "slab", "size": [40, 40, 0.1], "position": [0, 0, -1]}
    assert size_notes(" long;", body=floor, effects=FALL) == []


@pytest.mark.parametrize("extent", [[1.2, 1.7, 0.3], [1.7, 0.4, 0.5], [1.7, 1.7, 0.3]])
def test_a_body_that_lies_across_gravity_is_named_with_the_key(extent):
    found = body_notes(extent)
    assert len(found) == 1
    assert 'up = "y"' in found[0]
    assert body_notes(extent, effects={"inertia": {}}) == []


@pytest.mark.parametrize(
    ("extent", "effects"),
    [
        ([1.2, 0.3, 1.7], FALL),
        ([1.2, 1.7, 0.3], TOP),
        ([1, 1, LYING], FALL),
        ([2, 2, 0.99 * FLAT * 2], FALL),
        ([0.3, 0.3, 0.3], FALL),
    ],
)
def test_a_body_that_stands_and_a_floor_are_not(extent, effects):
    assert body_notes(extent, effects) == []


def test_with_y_up_a_body_stands():
    assert body_notes([1.2, 1.7, 0.3], up="y") == []
    world = build(Scene(cloth=SHEET, body=Body(*box([1.2, 1.7, 0.3]), up="y", position=[0, 0, -5]), effects=FALL)).world
    assert np.ptp(world.bodies[0].positions, axis=0) == pytest.approx([1.2, 0.3, 1.7])
    top = box([1.2, 1.7, 0.3])[0][:, 1] == 1.7
    assert (world.bodies[0].positions[top, 2] + world.origin[2]) == pytest.approx(1.7 - 5)


def test_y_up_comes_before_the_rotation_and_is_a_rotation():
    vertices = np.random.default_rng(0).normal(size=(3, 3))
    scenes = [
        Scene(cloth=Cloth(vertices, [[0, 1, 2]], position=[1, 2, 3], **keys), effects=FALL)
        for keys in ({"up": "y", "rotation_degrees": [0, 0, 30]}, {"rotation_degrees": [90, 0, 30]}, {})
    ]
    turned, same, _ = (build(scene).world for scene in scenes)
    assert turned.cloths[0].positions + turned.origin == pytest.approx(
        same.cloths[0].positions + same.origin, abs=1e-15
    )


def test_another_axis_is_refused():
    with pytest.raises(InputError, match="up"):
        small_scene(body=BALL | {"up": "w"})


@pytest.mark.parametrize(
    ("key", "value"), [("density", 150), ("thickness", 0.5), ("youngs_modulus", 1e12), ("bending_stiffness", 9.0)]
)
def test_a_number_in_another_unit_is_asked_about(key, value):
    effects = {"membrane": {}, "inertia": {}}
    (note,) = [each for each in build(Scene(cloth={**CLOTH, key: value}, effects=effects)).warnings if "unit?" in each]
    assert f"{key} is {value:g}" in note
    assert not [each for each in build(Scene(cloth=CLOTH, effects=effects)).warnings if "unit?" in each]


@pytest.mark.parametrize(("acceleration", "asked"), [(-981.0, True), (-9810.0, True), (-9.81, False), (-1.62, False)])
def test_gravity_in_centimetres_is_asked_about(acceleration, asked):
    scene = Scene(cloth=CLOTH, effects={"inertia": {}, "gravity": {"acceleration": [0, 0, acceleration]}})
    assert any("unit?" in each for each in build(scene).warnings) == asked


def test_an_error_of_metres_is_asked_about():
    scene = Scene(cloth=CLOTH, effects={"membrane": {}, "inertia": {}}, solver={"error": 0.3})
    assert [each for each in build(scene).warnings if each.startswith("solver.error is 0.3 m")]
    with pytest.raises(InputError, match=r"solver\.error is 5 m"):
        build(replace(scene, solver={"error": 5.0}))


def test_a_body_in_centimetres_is_scaled_by_a_hundredth():
    (note,) = checks.size_doubts("body", np.array([[0.0, 0, 0], [30, 20, 170]]))
    assert "scale = 0.01 makes it 1.7 m" in note
