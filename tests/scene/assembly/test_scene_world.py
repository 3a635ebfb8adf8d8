"""World and energies of a scene: placement, fabrics, seeds, inactive effects, and conversion to text."""

import json
from pathlib import Path

import numpy as np
import pytest
from meshes import grid
from scipy.spatial.transform import Rotation
from small_scenes import BALL, SHEET, small_scene

from clothsim import InputError, Scene, load_scene
from clothsim.keys.fabric_table import FABRICS
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.effects import EFFECTS
from clothsim.scene.scene import scene_from_text

ONLY = {"membrane": {}}


def cloth_of(**keys):
    return build(Scene(cloth={"mesh": "rectangle", "cells": [2, 2]} | keys, effects=ONLY)).world.cloths[0]


def test_placement_turns_about_x_then_y_then_z_and_then_moves():
    angles, place = [30.0, -40.0, 70.0], [1.0, 2.0, 3.0]
    flat, placed = cloth_of(), cloth_of(rotation_degrees=angles, position=place)
    turn = Rotation.from_euler("xyz", angles, degrees=True)
    assert np.abs(placed.positions - turn.apply(flat.positions) - place).max() < 1e-14
    assert np.array_equal(placed.rest_positions, flat.rest_positions)


def test_scale_and_velocity():
    assert np.allclose(cloth_of(scale=2.5).rest_positions, 2.5 * cloth_of().rest_positions)
    world = build(Scene(cloth=SHEET | {"velocity": [1, 2, 3]}, effects=ONLY)).world
    assert np.array_equal(world.start_velocities(), np.tile([1.0, 2, 3], (25, 1)))


def test_a_fabric_is_named_and_its_numbers_can_be_overridden():
    assert cloth_of().fabric == FABRICS["cotton"]
    own = cloth_of(fabric="cotton", youngs_modulus=5e4, density=0.3).fabric
    assert (own.youngs_modulus, own.density) == (5e4, 0.3)
    assert own.bending_stiffness == FABRICS["cotton"].bending_stiffness
    notes = build(Scene(cloth=SHEET | {"density": 0.3}, effects=ONLY)).notes
    assert any("cotton" in note and "density" in note for note in notes)


@pytest.mark.parametrize("fabric", FABRICS.values(), ids=FABRICS)
def test_every_fabric_has_a_source(fabric):
    assert len(fabric.source) > 40


@pytest.mark.parametrize(
    ("effects", "cloth", "name", "reason"),
    [
        ({"bending": {}}, {"bending_stiffness": 0.0}, "bending", "bending stiffness is zero"),
        ({"gravity": {"acceleration": [0, 0, 0]}}, {}, "gravity", "acceleration is zero"),
        ({"damping": {"rate": 0}}, {}, "damping", "rate is 0"),
        ({"pins": {}}, {}, "pins", "no vertex is selected"),
        ({"body_contact": {}}, {}, "body_contact", "the scene has no body"),
    ],
)
def test_an_effect_that_can_do_nothing_is_off_with_the_reason(effects, cloth, name, reason):
    built = build(Scene(cloth=SHEET | cloth, effects=ONLY | effects))
    assert built.off == {name: reason}
    assert set(built.energies) == {"membrane"}
    assert not built.constraints


def test_a_scene_whose_effects_are_all_off_is_refused():
    with pytest.raises(InputError):
        build(Scene(cloth=SHEET, effects={"gravity": {"acceleration": [0, 0, 0]}}))


def test_only_what_is_named_is_built_in_the_order_of_the_table():
    named = ["body_contact", "gravity", "membrane", "inertia"]
    built = build(small_scene(effects={name: {} for name in named}))
    assert list(built.energies) == [name for name in EFFECTS if name in named]


def test_several_cloths_and_bodies_are_named_by_their_place():
    cloths = [SHEET, SHEET | {"position": [0, 0, 2]}]
    bodies = [BALL, {"mesh": "slab", "position": [5, 0, 0]}]
    world = build(small_scene(cloth=cloths, body=bodies)).world
    assert [cloth.name for cloth in world.cloths] == ["cloth[0]", "cloth[1]"]
    assert [body.name for body in world.bodies] == ["ball", "body[1]"]
    assert build(small_scene()).world.cloths[0].name == "cloth"


def write_obj(path, positions, triangles):
    lines = [f"v {x} {y} {z}" for x, y, z in positions] + [f"f {a} {b} {c}" for a, b, c in triangles + 1]
    path.write_text("\n".join(lines))


def test_files_are_found_beside_the_scene_and_a_seed_moves_the_start_only(tmp_path):
    positions, triangles = grid(2, 2)
    write_obj(tmp_path / "sheet.obj", positions, triangles)
    write_obj(tmp_path / "start.obj", positions * [1, 1, 0] + [0, 0, 0.7], triangles)
    (tmp_path / "scene.toml").write_text(
        '[cloth]\nmesh = "sheet.obj"\n[effects.membrane]\n[seed]\nfrom = "file"\nfile = "start.obj"\n'
    )
    cloth = build(load_scene(tmp_path / "scene.toml")).world.cloths[0]
    assert np.array_equal(cloth.rest_positions, positions)
    assert np.array_equal(cloth.positions, positions + np.array([0, 0, 0.7]))


def test_a_seed_of_another_mesh_is_refused(tmp_path):
    write_obj(tmp_path / "start.obj", *grid(1, 1))
    scene = Scene(cloth=SHEET, effects=ONLY, seed={"from": "file", "file": "start.obj"}, directory=tmp_path)
    with pytest.raises(InputError, match=r"\b4\b.*\b25\b"):
        build(scene)


def test_a_scene_goes_through_text_and_back():
    scene = small_scene(cloth=SHEET | {"position": np.array([0.0, 0.0, 0.4])}, directory=Path("somewhere"))
    again = scene_from_text(scene.to_text())
    assert json.loads(again.to_text()) == json.loads(scene.to_text())
    assert again.directory == Path("somewhere").resolve()
    assert np.array_equal(build(again).world.start(), build(scene).world.start())


def test_defaults_are_those_of_the_settings():
    scene = Scene(cloth=SHEET)
    assert scene.solver_settings.dt == 0.01
    assert scene.run_settings.frames_per_second == 25
    assert scene.seed_settings.from_ == "rest"
    assert scene.bodies == ()
