"""Fields of homogeneous deformations against closed forms, for every entry of the table."""

from typing import get_args

import numpy as np
import pytest

from clothsim.build.scene_world import build
from clothsim.errors import InputError
from clothsim.run.fields import FIELDS, Configuration, field
from clothsim.scene.scene import Scene
from clothsim.scene.settings import FieldName

SHEAR = np.array([[1.1, 0.2], [0.0, 0.9], [0.3, 0.0]])
MATERIALS = {
    "neo_hookean": {},
    "orthotropic": {"material": "orthotropic", "angle_degrees": 20.0},
    "measured": {
        "material": "measured",
        "warp": [[0, 0], [0.2, 40.0]],
        "weft": [[0, 0], [0.2, 20.0]],
        "shear": [[0, 0], [0.2, 5.0]],
    },
}


def sheet(material="neo_hookean", **keys):
    scene = Scene(
        cloth={"mesh": "rectangle", "size": [0.4, 0.3], "cells": [4, 3], "fabric": "denim"},
        effects={"membrane": {**MATERIALS[material], **keys}},
        run={"duration": 0.1},
    )
    try:
        return build(scene)
    except InputError as error:
        pytest.fail(str(error))


def stretched(built, F):
    """The sheet under the homogeneous deformation F (3x2) of its plane."""
    rest = built.world.cloths[0].rest_positions
    return Configuration(built.world, rest[:, :2] @ np.asarray(F).T, built.energies)


def turned(built):
    """The sheet turned rigidly by a third of a turn about (1, 1, 1)."""
    return Configuration(built.world, np.roll(built.world.cloths[0].rest_positions, 1, axis=1), built.energies)


@pytest.mark.parametrize("name", [name for name in FIELDS if name != "contact_pressure"])
def test_a_field_has_a_row_per_triangle_or_vertex_and_a_scalar_each(name):
    built = sheet()
    values = field(name, stretched(built, SHEAR))
    count = {"triangle": len(built.world.triangles), "vertex": built.world.n_cloth}[FIELDS[name].location]
    assert len(values) == count
    assert FIELDS[name].scalar(values).shape == (count,)
    assert np.isfinite(values).all()


def test_deformation_gradient_and_its_polar_factors():
    at = stretched(sheet(), SHEAR)
    F = field("deformation_gradient", at)
    assert pytest.approx(np.broadcast_to(SHEAR, F.shape), abs=1e-13) == F
    product = field("rotation", at)[:, :, :2] @ field("right_stretch", at)
    assert product == pytest.approx(F, abs=1e-13)
    values = np.linalg.svd(SHEAR)[1]
    assert field("principal_stretches", at) == pytest.approx(np.broadcast_to(values, (len(F), 2)), abs=1e-13)
    assert field("compression", at) == pytest.approx(np.full(len(F), max(0.0, 1 - values[1])), abs=1e-13)


def test_principal_directions_are_those_of_the_left_stretch():
    at = stretched(sheet(), SHEAR)
    W = field("principal_directions", at)
    left = SHEAR @ SHEAR.T
    stretches = np.linalg.svd(SHEAR)[1]
    assert left @ W == pytest.approx(W * stretches**2, abs=1e-13)


def test_vertex_frames_of_a_rigid_turn():
    at = turned(sheet())
    turn = np.roll(np.eye(3), 1, axis=0)
    frames = field("vertex_frames", at)
    assert frames == pytest.approx(np.broadcast_to(turn, frames.shape), abs=1e-12)
    assert FIELDS["vertex_frames"].scalar(frames) == pytest.approx(np.full(len(frames), 2 * np.pi / 3), abs=1e-7)


def test_thickness_of_a_small_strain():
    built = sheet()
    fabric = built.world.cloths[0].fabric
    strain = 1e-6
    at = stretched(built, [[1 + strain, 0], [0, 1], [0, 0]])
    thinning = 1 - field("thickness", at) / fabric.thickness
    nu = fabric.poisson_ratio
    assert thinning == pytest.approx(np.full(len(thinning), nu / (1 - nu) * strain), rel=1e-4)


@pytest.mark.parametrize("material", MATERIALS)
def test_stress_is_the_derivative_of_the_energy_density(material):
    built = sheet(material)
    direction = np.array([[0.3, -0.2], [0.1, 0.4], [-0.5, 0.2]])
    h = 1e-6
    there, back = (field("energy_density", stretched(built, SHEAR + s * h * direction)) for s in (1, -1))
    P = field("stress", stretched(built, SHEAR))
    assert (P * direction).sum(axis=(1, 2)) == pytest.approx((there - back) / (2 * h), rel=1e-6)


def test_the_density_integrates_to_the_energy():
    built = sheet()
    at = stretched(built, SHEAR)
    total = (field("energy_density", at) * built.world.rest_areas).sum()
    assert total == pytest.approx(built.energies["membrane"].value(at.x), rel=1e-12)


def test_a_field_that_cannot_be_is_refused_by_name():
    at = stretched(sheet(), SHEAR)
    with pytest.raises(InputError, match="thickness"):
        field("thikness", at)
    with pytest.raises(InputError, match="contact_pressure"):
        field("contact_pressure", at)
    with pytest.raises(InputError, match="pairs"):
        field("stress", stretched(sheet(elements="pairs"), SHEAR))


def test_a_scene_can_ask_for_every_field():
    assert get_args(FieldName) == tuple(FIELDS)
