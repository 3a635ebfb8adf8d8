"""Fields of homogeneous deformations against closed forms, for every entry of the table."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.keys.settings import FieldName
from clothsim.physics.energies.neo_hookean_membrane import NeoHookeanMembrane
from clothsim.run.fields import FIELDS, Configuration, field
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene

SHEAR = np.array([[1.1, 0.2], [0.0, 0.9], [0.3, 0.0]])
MATERIALS = {
    "neo_hookean": {"material": "neo_hookean"},
    "orthotropic": {"material": "orthotropic", "angle_degrees": 20.0},
    "measured": {
        "material": "measured",
        "warp": [[0, 0], [0.2, 40.0]],
        "weft": [[0, 0], [0.2, 20.0]],
        "shear": [[0, 0], [0.2, 5.0]],
    },
}


def sheet(material="neo_hookean", **given):
    keys = {key: value for key, value in given.items() if key in ("elements",)}
    shape = {"mesh": "rectangle"} | {key: value for key, value in given.items() if key not in keys}
    if shape["mesh"] == "rectangle":
        shape = {"size": [0.4, 0.3], "cells": [4, 3]} | shape
    scene = Scene(
        cloth={"fabric": "denim", **shape},
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


@pytest.mark.parametrize("name", [name for name in FIELDS if not FIELDS[name].in_step])
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


IRREGULAR = {"mesh": "rectangle", "cells": [5, 3], "diagonals": "delaunay"}


def test_pairs_in_a_homogeneous_state_have_the_stress_and_density_of_triangles():
    single = 0
    for built in (sheet(elements="pairs"), sheet(elements="pairs", **IRREGULAR), sheet(elements="pairs", mesh="disk")):
        at, membrane = stretched(built, SHEAR), built.energies["membrane"]
        single += (membrane.elements[:, 2] == membrane.elements[:, 3]).sum()
        alone = replace(at, energies={"membrane": NeoHookeanMembrane.of(built.world)})
        for name in ("stress", "energy_density"):
            np.testing.assert_allclose(field(name, at), field(name, alone), rtol=1e-9, atol=1e-9)
    assert single > 0


@pytest.mark.parametrize("mesh", [IRREGULAR, {"mesh": "disk", "radius": 0.2}])
def test_pairs_in_any_state_have_the_work_of_their_mean_stress(mesh):
    """dE = sum of A P : dF for a homogeneous dF, of a rough state; the density integrates to the energy."""
    built = sheet(elements="pairs", **mesh)
    rng, membrane, world = np.random.default_rng(2), built.energies["membrane"], built.world
    rest = world.cloths[0].rest_positions
    x = stretched(built, SHEAR).x + 0.002 * rng.standard_normal((len(rest), 3))
    at, direction, h = Configuration(world, x, built.energies), rng.standard_normal((3, 2)), 1e-6
    there, back = (membrane.value(x + s * h * rest[:, :2] @ direction.T) for s in (1, -1))
    power = (field("stress", at) * direction).sum(axis=(1, 2)) @ world.rest_areas
    assert power == pytest.approx((there - back) / (2 * h), rel=1e-6)
    assert field("energy_density", at) @ world.rest_areas == pytest.approx(membrane.value(x), rel=1e-12)


def test_pairs_at_rest_on_a_curved_cloth_have_no_stress():
    built = sheet(elements="pairs", mesh="tube", radius=0.1, height=0.3, cells=[12, 4])
    at = Configuration(built.world, built.world.start(), built.energies)
    turned_about = replace(at, x=np.roll(at.x, 1, axis=1))
    for state in (at, turned_about):
        assert np.abs(field("stress", state)).max() < 1e-9
        assert np.abs(field("energy_density", state)).max() < 1e-12
    grown = field("stress", replace(at, x=1.01 * at.x))
    alone = replace(at, x=1.01 * at.x, energies={"membrane": NeoHookeanMembrane.of(built.world)})
    np.testing.assert_allclose(grown, field("stress", alone), rtol=0.05, atol=0.02 * np.abs(grown).max())


def test_a_field_that_cannot_be_is_refused_by_name():
    at = stretched(sheet(), SHEAR)
    with pytest.raises(InputError, match="thickness"):
        field("thikness", at)
    for name in [name for name in FIELDS if FIELDS[name].in_step]:
        with pytest.raises(InputError, match=name):
            field(name, at)


def test_a_scene_can_ask_for_every_field():
    assert get_args(FieldName) == tuple(FIELDS)
