"""Creases: their hinges, equilibrium angles, and refused input."""

from dataclasses import replace

import numpy as np
import pytest
from differences import dense_hessian
from effect_builders import bending, membrane, rest_angle
from meshes import UNIT, cloth, grid, irregular_grid
from small_scenes import SHEET, small_scene
from solving import equilibrium, held, step_at, those_on

from clothsim import simulate
from clothsim.base.errors import InputError
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Off
from clothsim.physics.energies.hinge_kernels import angles

MIDDLE = {"through": [[0.5, 0.0, 0.0], [0.5, 1.0, 0.0]]}


def sheet(nx=4, ny=3, **changes):
    return make_world([cloth(*grid(nx, ny), replace(UNIT, **changes))])


def creased(world, *creases, **keys):
    return rest_angle(world, crease=creases, built={"bending": bending(world, **keys)})


def at_middle(world):
    """Mask of the hinges of the world along x = 1/2."""
    edges = world.hinges.vertices[:, :2]
    return (np.abs(world.start()[edges][:, :, 0] - 0.5) < 1e-9).all(axis=1)


@pytest.mark.parametrize("degrees", [90.0, -60.0, 150.0])
@pytest.mark.parametrize("stiffness", [1e-3, 10.0])
@pytest.mark.parametrize("model", ["hinge", "midedge"])
def test_two_panels_come_to_rest_at_the_angle_of_their_crease_and_are_flat(degrees, stiffness, model):
    """Nothing else is strained there: E = 0, whatever the stiffness."""
    world = sheet(bending_stiffness=stiffness)
    energies = those_on(membrane=membrane(world), bending=bending(world, model=model))
    energies["rest_angle"] = creased(world, MIDDLE | {"angle_degrees": degrees}, model=model)
    start = world.start()
    panel = held(start, np.flatnonzero(start[:, 0] < 0.4))
    start[:, 2] -= 0.1 * np.sign(degrees) * np.maximum(start[:, 0] - 0.5, 0)
    x = equilibrium(world, energies, start, held(world.start(), panel.vertices))
    found = np.degrees(angles(world.hinges.vertices, x))
    crease = at_middle(world)
    assert crease.sum() == 3
    assert np.abs(found[crease] - degrees).max() < 1e-6
    assert np.abs(found[~crease]).max() < 1e-6
    bound = [energy.begin(step_at(x)) for energy in energies.values()]
    assert abs(sum(energy.value(x) for energy in bound)) < 1e-12


@pytest.mark.parametrize("degrees", [90.0, -60.0])
def test_a_shifted_hinge_without_an_angle_is_refused_and_nothing_is_nan(degrees):
    world = sheet()
    energy = creased(world, MIDDLE | {"angle_degrees": degrees}).begin(step_at(world.start()))
    x = world.start()
    x[:, 0] = 0.0
    assert energy.value(x) == np.inf
    assert np.isfinite(energy.gradient(x)).all()
    assert np.isfinite(energy.hessian(x, project=False).blocks).all()


@pytest.mark.parametrize(
    "keys", [{"model": "hinge"}, {}, {"short_waves": 1.0}], ids=["hinge", "midedge", "short waves"]
)
def test_a_shifted_hinge_is_a_hinge_of_that_rest_angle(keys):
    """The sum of bending and crease is the bending energy with another rest angle, in value and derivatives."""
    world = make_world([cloth(*irregular_grid(2))])
    own = bending(world, **keys)
    edge = own.vertices[0, :2].tolist()
    crease = {"vertices": edge, "angle_degrees": 50.0}
    energy = creased(world, crease, **keys).begin(step_at(world.start()))
    rest = own.rest_angles.copy()
    rest[0] = np.radians(50)
    folded = replace(own, rest_angles=rest)
    x = world.start() + 0.1 * np.random.default_rng(0).standard_normal(world.start().shape)
    assert own.value(x) + energy.value(x) == pytest.approx(folded.value(x), rel=1e-13)
    np.testing.assert_allclose(own.gradient(x) + energy.gradient(x), folded.gradient(x), atol=1e-13)
    both = dense_hessian(own, x) + dense_hessian(energy, x)
    np.testing.assert_allclose(both, dense_hessian(folded, x), atol=1e-12)


def test_an_angle_over_time_is_that_at_the_end_of_the_step():
    energy = creased(sheet(), MIDDLE | {"angle_degrees": [[1.0, 10.0], [2.0, 30.0]]})
    assert energy.drives
    later = replace(step_at(sheet().start(), dt=0.5, load=0.1), time=1.0)
    assert np.allclose(np.degrees(energy.begin(later).shifts), 20.0)


def test_a_quasi_static_ramp_folds_along_a_constant_angle():
    energy = creased(sheet(), MIDDLE | {"angle_degrees": 40.0})
    assert not energy.drives
    assert np.allclose(np.degrees(energy.begin(step_at(sheet().start(), load=0.25)).shifts), 10.0)


def test_a_bent_rest_shape_is_shifted_to_the_angle_and_not_by_it():
    positions, triangles = grid(4, 3)
    positions[:, 2] = 0.3 * positions[:, 0] ** 2
    world = make_world([cloth(positions, triangles)])
    line = positions[(positions[:, 0] == 0.5)]
    energy = creased(world, {"through": line[[0, -1]], "angle_degrees": 20.0}).begin(step_at(positions))
    references = energy.references[: len(energy.shifts)]
    assert np.allclose(np.degrees(energy.shifts + references), 20.0)
    assert np.abs(references).min() > 0.05


def test_a_line_is_snapped_to_the_nearest_edges():
    world = sheet(6, 6)
    near = creased(world, {"through": [[0.52, 0.03, 0.0], [0.47, 0.95, 0.01]], "angle_degrees": 5.0})
    assert len(near.numbers) == 6
    assert np.allclose(world.start()[near.vertices[:6, :2]][:, :, 0], 0.5)


def test_a_folding_sheet_folds_in_a_run(tmp_path):
    crease = {"through": [[0.0, -0.5, 0.0], [0.0, 0.5, 0.0]], "angle_degrees": [[0.0, 0.0], [0.2, 60.0]]}
    effects = {
        "inertia": {},
        "membrane": {},
        "bending": {},
        "damping": {"rate": 8.0},
        "rest_angle": {"crease": [crease]},
    }
    stiff = SHEET | {"bending_stiffness": 0.05}
    run = simulate(small_scene(cloth=stiff, body=(), effects=effects, run={"duration": 1.2}), tmp_path)
    assert run.status == "completed", run.reason
    world = make_world([cloth(run.positions(0), run.triangles)])
    found = np.degrees(angles(world.hinges.vertices, run.positions(-1)))
    folded = np.abs(run.positions(0)[world.hinges.vertices[:, :2]][:, :, 0]).max(axis=1) < 1e-9
    assert np.abs(found[folded] - 60).max() < 1
    assert np.abs(found[~folded]).max() < 1


def test_nothing_to_fold_is_off():
    world = sheet()
    assert rest_angle(world) == Off("there is no crease")
    assert rest_angle(world, crease=[MIDDLE | {"angle_degrees": 5}], built={}) == Off("the scene has no bending")
    assert isinstance(creased(world, MIDDLE | {"angle_degrees": 0}), Off)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"through": [[0.5, 0, 0], [0.5, 1, 0]]}, r"crease\[0\] has no angle_degrees"),
        (MIDDLE | {"angle_degrees": 180.0}, "is 180 at 0 s"),
        (MIDDLE | {"angle_degrees": [[0, 0], [1, -200]]}, "is -200 at 1 s"),
        (MIDDLE | {"angle_degrees": 20.0, "angel": 3}, "no key 'angel'"),
        (MIDDLE | {"angle_degrees": 20.0, "vertices": [1, 2]}, r"crease\[0\] .*through.*vertices"),
        (MIDDLE | {"angle_degrees": 20.0, "cloth": "skirt"}, "names 'skirt', which is not a cloth"),
        ({"angle_degrees": 20.0}, r"crease\[0\] .*through.*vertices"),
        ({"angle_degrees": 20.0, "vertices": [0, 99]}, r"vertices\[1\] = 99"),
        ({"angle_degrees": 20.0, "vertices": [0, 1]}, r"crease\[0\] .*edge"),
        ({"angle_degrees": 20.0, "through": [[0, 0, 0], [0, 0.4, 0]]}, r"crease\[0\].* edge 0-1"),
        ({"angle_degrees": 20.0, "through": [[0, 0, 0], [0.01, 0, 0]]}, "begins and ends at the vertex 0"),
        ({"angle_degrees": 20.0, "through": [[0.5, 0, 0]]}, "has 1 points"),
        ({"angle_degrees": 20.0, "through": [[0.5, 0, 0], [0.5, 9, 0]]}, r"through\[1\] is 8 m from the mesh"),
    ],
)
def test_bad_creases_are_refused_in_one_sentence(keys, words):
    with pytest.raises(InputError, match=words):
        creased(sheet(), keys)


def test_two_creases_do_not_share_an_edge():
    with pytest.raises(InputError, match="twice"):
        creased(sheet(), MIDDLE | {"angle_degrees": 20}, MIDDLE | {"angle_degrees": 30})


def test_models_without_changing_rest_angles_are_refused_by_name():
    with pytest.raises(InputError, match=r"rest_angle.*QuadraticBending"):
        creased(sheet(), MIDDLE | {"angle_degrees": 20}, model="quadratic")
