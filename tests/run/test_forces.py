"""Forces of contact and of pins: sums against weights, Newton's third law and the momentum of the cloth."""

import json

import numpy as np
import pytest
from small_scenes import small_scene

from clothsim import InputError, simulate
from clothsim.cli import main

G = 9.81
EFFECTS = {"inertia": {}, "membrane": {}, "gravity": {}, "damping": {"rate": 20.0}}
TABLE = {"name": "table", "mesh": "slab", "size": [0.6, 0.6, 0.1], "position": [0.0, 0.0, -0.05]}
SHEET = {"mesh": "rectangle", "size": [0.3, 0.2], "cells": [4, 3], "density": 0.2, "position": [0.02, 0.01, 2e-3]}
WEIGHT = 0.2 * 0.3 * 0.2 * G
"""Of the sheet [N]."""


@pytest.fixture(scope="module")
def rested(tmp_path_factory):
    """A sheet at rest on a table that tilts the load by friction."""
    gravity = {"acceleration": [0.1 * G, 0.0, -G]}
    effects = EFFECTS | {"gravity": gravity, "body_contact": {}, "friction": {"coefficient": 0.5}}
    run = {"duration": 0.6, "forces": True, "fields": ["contact_force", "body_force", "body_pressure"]}
    scene = small_scene(cloth=SHEET, body=TABLE, effects=effects, run=run)
    return simulate(scene, tmp_path_factory.mktemp("rested"))


def test_a_body_bears_the_weight_and_by_friction_the_slope(rested):
    forces = rested.forces()
    assert list(forces.bodies) == ["table"]
    assert forces.pins == {}
    assert forces.times.shape == (rested.summary["steps"],)
    assert forces.bodies["table"].shape == (len(forces.times), 3)
    np.testing.assert_allclose(forces.bodies["table"][-1], [0.1 * WEIGHT, 0.0, -WEIGHT], atol=0.01 * WEIGHT)


def test_force_fields_are_equal_and_opposite_and_sum_to_the_record(rested):
    on_cloth, on_body = (rested.field(name).sum(axis=0) for name in ("contact_force", "body_force"))
    np.testing.assert_allclose(on_cloth, -on_body, atol=1e-6 * WEIGHT)
    np.testing.assert_allclose(on_body, rested.forces().bodies["table"][-1], rtol=1e-5, atol=1e-6 * WEIGHT)
    assert rested.field("body_force").shape == rested.bodies(-1)[0][1].shape
    assert not rested.field("body_pressure", 0).any()


def test_pressure_over_the_areas_of_the_body_is_the_weight(rested):
    _, points, triangles = rested.bodies(-1)[0]
    corners = points[triangles]
    doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    areas = np.bincount(triangles.ravel(), np.repeat(doubled / 6, 3), minlength=len(points))
    pressure = rested.field("body_pressure").astype(float)
    assert pressure.min() >= 0
    assert pressure @ areas == pytest.approx(WEIGHT, rel=0.01)


def test_paraview_and_pyvista_see_the_pressure_on_the_body(rested):
    import pyvista

    reader = pyvista.get_reader(rested.directory / "trajectory.vtkhdf")
    reader.reader.SetStep(len(rested) - 1)
    blocks = reader.read()
    assert "body_pressure" not in blocks["cloth"].point_data
    np.testing.assert_array_equal(blocks["table"].point_data["body_pressure"], rested.field("body_pressure"))
    np.testing.assert_array_equal(blocks["cloth"].point_data["contact_force"], rested.field("contact_force"))


def test_a_picture_of_a_body_field_shows_the_bodies_alone(rested):
    from clothsim.run.pictures import field_settings

    (table,) = field_settings(rested, "body_pressure")["surfaces_of"](rested.trajectory, -1)
    np.testing.assert_array_equal(table.values, rested.field("body_pressure"))


def test_impulse_of_two_groups_of_pins_and_of_gravity_is_the_momentum(tmp_path):
    pins = {"select": "left", "group": [{"select": "right", "motion": {"velocity": [0.0, 0.0, 0.3]}, "clamp": True}]}
    scene = small_scene(
        cloth=SHEET,
        body=(),
        effects={"inertia": {}, "membrane": {}, "bending": {}, "gravity": {}, "pins": pins},
        solver={"dt": 0.01, "threads": 1, "linear": "superlu", "integrator": "backward_euler", "tolerance": 1e-9},
        run={"duration": 0.1, "forces": True, "frames_per_second": 100},
    )
    run = simulate(scene, tmp_path / "run")
    forces = run.forces()
    assert list(forces.pins) == ["pins", "pins.group[0]"]
    total = sum(forces.pins.values())
    momentum = lumped(run) @ (run.positions(-1) - run.positions(-2)) / 0.01  # it starts at rest
    impulse = 0.01 * (total + np.array([0.0, 0.0, -WEIGHT])).sum(axis=0)
    assert np.linalg.norm(impulse) > 0.01 * WEIGHT
    np.testing.assert_allclose(momentum, impulse, atol=1e-6 * WEIGHT)


def lumped(run):
    rest = run.positions(0)[run.triangles]
    areas = np.linalg.norm(np.cross(rest[:, 1] - rest[:, 0], rest[:, 2] - rest[:, 0]), axis=1) / 2
    return 0.2 * np.bincount(run.triangles.ravel(), np.repeat(areas / 3, 3))


def test_a_hanging_sheet_at_rest_hangs_by_its_weight(tmp_path):
    effects = EFFECTS | {"pins": {"select": "left"}, "bending": {}}
    cloth = SHEET | {"rotation_degrees": [0, 90, 0]}
    scene = small_scene(cloth=cloth, body=(), effects=effects, run={"duration": 1.0, "forces": True})
    run = simulate(scene, tmp_path / "run")
    np.testing.assert_allclose(run.forces().pins["pins"][-1], [0, 0, WEIGHT], atol=0.01 * WEIGHT)


def test_without_the_key_the_record_is_as_it_was_and_the_refusal_names_it(tmp_path):
    plain = simulate(small_scene(), tmp_path / "plain")
    asked = simulate(small_scene(run={"duration": 0.16, "frames_per_second": 25, "forces": True}), tmp_path / "asked")
    with pytest.raises(InputError, match="forces = true"):
        plain.forces()
    without = [{key: value for key, value in entry.items() if key != "forces"} for entry in asked.record()]
    assert [json.dumps(entry) for entry in without] == [json.dumps(entry) for entry in plain.record()]
    assert np.array_equal(plain.positions(-1), asked.positions(-1))


def test_an_unknown_kind_of_value_is_refused(tmp_path, capsys):
    with pytest.raises(InputError, match="forces"):
        small_scene(run={"duration": 0.1, "forces": "yes"})
    assert main(["keys", "run"]) == 0
    assert "forces" in capsys.readouterr().out
