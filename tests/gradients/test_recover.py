"""Recovery of numbers from a drape with noise (G-6)."""

from types import SimpleNamespace

import numpy as np
import pytest
from small_skirt import hanging_skirt, skirt_mesh

from clothsim import InputError, Scene, recover
from clothsim.files.meshes.readers.obj import write_obj
from clothsim.gradients.loss_of_numbers import problem_of
from clothsim.gradients.losses import Custom, Distance, Height, Scan, target_loss
from clothsim.gradients.parameters import with_value
from clothsim.gradients.recover import _hessian, bending_prior, identifiability
from clothsim.gradients.run import traced
from clothsim.gradients.scene_of_pattern import shaped_scene
from clothsim.scene.assembly.scene_world import build

YOUNG, BENDING, DENSITY = "cloth.youngs_modulus", "cloth.bending_stiffness", "cloth.density"
TRUE = {YOUNG: 3e4, BENDING: 1e-5, DENSITY: 0.15}
NOISE = 1e-4


def hanging(youngs_modulus, bending_stiffness, cells=6, **effects):
    """A sheet that hangs from two neighbouring corners, quasi-static."""
    cloth = {
        "mesh": "rectangle",
        "size": [0.3, 0.3],
        "cells": [cells, cells],
        "rotation_degrees": [3.0, 2.0, 0.0],
        "youngs_modulus": youngs_modulus,
        "bending_stiffness": bending_stiffness,
        "poisson_ratio": 0.3,
        "density": 0.15,
        "thickness": 3e-4,
    }
    effects = {"membrane": {}, "bending": {"model": "hinge"}, "gravity": {}, "pins": {"select": [0, cells]}} | effects
    solver = {"dt": 0.05, "threads": 1, "linear": "superlu"}
    return Scene(cloth=cloth, effects=effects, solver=solver, run={"duration": 0.1, "frames_per_second": 20})


@pytest.fixture(scope="module")
def drape():
    x = traced(hanging(3e4, 1e-5)).cloth_positions()
    return x + NOISE * np.random.default_rng(4).standard_normal(x.shape)


def test_stiffness_from_a_drape_with_noise(drape):
    runs = []
    found = recover(
        hanging(6e4, 4e-5), Distance(drape), ["youngs_modulus", BENDING], 1, lambda start, each: runs.append(each)
    )
    for path in (YOUNG, BENDING):
        error = abs(found.values[path] / TRUE[path] - 1)
        assert error < 0.02
        assert 1e-5 < found.errors[path] < 0.02
        assert error < 4 * found.errors[path]
    assert found.undetermined == found.ratios == found.at_limit == ()
    assert found.best.loss == pytest.approx(3 * NOISE**2, rel=0.2)
    assert abs(found.best.newton_error) < 1e-9 * found.best.loss
    assert found.runs == 1 + len(runs) + 4 < 30
    assert all(each.intersecting_pairs == 0 for each in runs)


def test_density_is_not_known_but_the_ratios_are(drape):
    found = recover(hanging(6e4, 4e-5), Distance(drape), [YOUNG, BENDING, DENSITY], 1)
    assert all(np.isinf(error) for error in found.errors.values())
    (weights,) = found.undetermined
    np.testing.assert_allclose(list(weights.values()), 1 / np.sqrt(3), rtol=1e-4)
    ratios = {(each.first, each.second): each for each in found.ratios}
    for path in (YOUNG, BENDING):
        each = ratios[path, DENSITY]
        assert each.value == pytest.approx(TRUE[path] / TRUE[DENSITY], rel=0.02)
        assert each.error < 0.02


def test_a_prior_moves_what_the_target_hardly_tells_and_is_said():
    still = traced(hanging(3e4, 1e-5, cells=2)).cloth_positions()
    target = Distance(still + 3e-3 * np.random.default_rng(1).standard_normal(still.shape))
    plain, other = (recover(hanging(3e4, 1e-5, cells=2), target, [BENDING], 1, prior=prior) for prior in (False, True))
    before = bending_prior(("bending_stiffness",), 0.15)
    sd, own = plain.errors[BENDING], np.sqrt(before.covariance[0, 0])
    assert other.errors[BENDING] == pytest.approx(1 / np.hypot(1 / sd, 1 / own), rel=0.01)
    weighed = (np.log(plain.values[BENDING]) / sd**2 + before.mean[0] / own**2) / (1 / sd**2 + 1 / own**2)
    assert np.log(other.values[BENDING]) == pytest.approx(weighed, abs=0.01)
    assert "618" in other.prior
    assert plain.prior == ""


@pytest.mark.parametrize("free", [[YOUNG], [BENDING, DENSITY]])
def test_a_prior_of_nothing_or_without_a_weight_is_refused(drape, free):
    with pytest.raises(InputError, match="prior"):
        recover(hanging(3e4, 1e-5), Distance(drape), free, 1, prior=True)


def test_points_without_correspondence(drape):
    rng = np.random.default_rng(1)
    world = build(hanging(3e4, 1e-5)).world
    x, weights = traced(hanging(3e4, 1e-5)).cloth_positions(), rng.dirichlet([1, 1, 1], 200)
    corners = world.triangles[rng.integers(len(world.triangles), size=200)]
    points = np.einsum("kp,kpc->kc", weights, x[corners])
    found = recover(hanging(4e4, 2e-5), Scan(points), [YOUNG, BENDING], 1)
    for path in (YOUNG, BENDING):
        assert found.values[path] == pytest.approx(TRUE[path], rel=1e-3)


def test_a_run_that_cannot_be_taken_is_no_end(drape, monkeypatch):
    """Numbers at which a run fails are left again."""
    from clothsim.base.errors import ClothsimError
    from clothsim.gradients import loss_of_numbers as module

    fails = []

    def traced_or_not(scene, stiffness=None):
        if scene.cloths[0]["youngs_modulus"] < 2e4 and stiffness is not None:
            fails.append(scene)
            raise ClothsimError("A run that cannot be taken.")
        return traced(scene, stiffness)

    monkeypatch.setattr(module, "traced", traced_or_not)
    found = recover(hanging(6e4, 1e-5), Distance(drape), [YOUNG], 1)
    assert fails
    assert found.values[YOUNG] == pytest.approx(TRUE[YOUNG], rel=0.02)


def test_other_losses_have_no_standard_errors(drape):
    away = Custom(lambda x: (float(((x - drape) ** 2).sum()), 2 * (x - drape)))
    found = recover(hanging(4e4, 1e-5), away, [YOUNG], 1)
    assert found.values[YOUNG] == pytest.approx(TRUE[YOUNG], rel=0.02)
    assert np.isnan(found.errors[YOUNG])


@pytest.mark.parametrize("make", [Distance, Scan])
def test_a_target_a_thousand_kilometres_away_is_refused(drape, make):
    with pytest.raises(InputError, match=r"1e\+06 m"):
        recover(hanging(4e4, 1e-5), make(np.add(drape, [1e6, 0, 0])), [YOUNG], 1)


def test_a_number_at_the_end_of_its_range(drape):
    found = recover(hanging(4e4, 1e-5), Height(), [YOUNG], 1)  # the softer, the lower
    assert found.at_limit == (YOUNG,)
    assert found.errors[YOUNG] == np.inf


def test_the_panels_of_a_skirt():
    """Width and length of sewn panels in contact, 5 and 2 % off, to 1 mm of a drape with noise (G-7)."""
    mesh = skirt_mesh(spacing=0.07)
    scene = hanging_skirt(mesh, steps=4)
    true = {"pattern.front.width": 0.315, "pattern.front+back.height": 0.2448}
    drape = traced(shaped_scene(scene, mesh).with_numbers(true)).cloth_positions()
    drape = drape + NOISE * np.random.default_rng(0).standard_normal(drape.shape)
    found = recover(scene, Distance(drape), list(true), 1, pattern=mesh)
    for path, value in true.items():
        assert found.values[path] == pytest.approx(value, abs=2e-4)
        assert 1e-6 < found.errors[path] < 1e-3
    assert found.best.intersecting_pairs == 0


def test_targets(tmp_path, drape):
    scene = hanging(3e4, 1e-5)
    world = build(scene).world
    write_obj(tmp_path / "same.obj", 1e3 * drape, world.triangles)
    write_obj(tmp_path / "other.obj", drape, world.triangles[::-1])
    np.savetxt(tmp_path / "points.xyz", drape[:9])
    assert isinstance(target_loss(tmp_path / "same.obj", world, 1e-3), Distance)
    assert isinstance(target_loss(tmp_path / "other.obj", world), Scan)
    points = target_loss(tmp_path / "points.xyz", world)
    assert isinstance(points, Scan)
    assert points.points.shape == (9, 3)
    np.savetxt(tmp_path / "normals.xyz", np.hstack([1e3 * drape[:9], np.ones((9, 3))]))
    with_normals = target_loss(tmp_path / "normals.xyz", world, 1e-3)
    np.testing.assert_allclose(with_normals.points, drape[:9])
    np.testing.assert_allclose(with_normals.normals, 1.0)
    (tmp_path / "words.xyz").write_text("a b c\n")
    for name in ("words.xyz", "missing.obj"):
        with pytest.raises(InputError):
            target_loss(tmp_path / name, world)


@pytest.mark.parametrize("free", [["cells"], ["effects.gravity.acceleration"], ["effects.air.drag"], []])
def test_what_cannot_be_recovered(drape, free):
    with pytest.raises(InputError):
        recover(hanging(3e4, 1e-5), Distance(drape), free)


def test_numbers_that_a_fixed_key_refuses_are_a_rejected_trial():
    """A bending_bias that no twisting stiffness gives with a trial's bending_warp: the search goes on."""
    scene = hanging(3e4, 1e-5, cells=2)
    for key, value in {"bending_warp": 1e-5, "bending_weft": 1e-5, "bending_bias": 1.2e-5}.items():
        scene = with_value(scene, f"cloth.{key}", np.array(value))
    problem = problem_of(scene, Height(), ["cloth.bending_warp"])
    refused = problem.evaluated(problem.origin - np.log(50.0))
    assert refused.loss == np.inf
    assert "bending_bias" in refused.failure
    known = identifiability(problem, problem.origin - np.log(50.0), 1.0)
    assert np.isnan(known.errors["cloth.bending_warp"])


def test_the_hessian_is_the_symmetric_part_of_differences_of_slopes():
    slopes = np.array([[2.0, 0.3, 0.0], [0.1, 1.0, -0.5], [0.0, -0.5, 4.0]])
    problem = SimpleNamespace(evaluated=lambda at: SimpleNamespace(loss=at @ slopes @ at / 2, slope=slopes @ at))
    expected = [[2.0, 0.2, 0.0], [0.2, 1.0, -0.5], [0.0, -0.5, 4.0]]
    np.testing.assert_allclose(_hessian(problem, np.array([1.0, -2.0, 0.5])), expected, rtol=1e-9, atol=1e-9)
    fails = SimpleNamespace(evaluated=lambda at: SimpleNamespace(loss=np.inf, slope=at))
    assert np.isnan(_hessian(fails, np.ones(3))).all()
