"""Soft targets: places between frames, the deviation of a load, contact that the targets do not keep."""

import numpy as np
import pytest
from small_scenes import SHEET, small_scene, without

from clothsim import InputError, simulate
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Step
from clothsim.scene.assembly.scene_world import build
from tests.support.effect_builders import targets


def sheet() -> World:
    return build(small_scene()).world


def test_targets_lie_between_frames_and_are_held_beyond_them():
    world = sheet()
    x = world.start()
    velocity = np.random.default_rng(0).standard_normal((world.n_cloth, 3))
    moves = np.arange(3.0)[:, None, None] * velocity
    energy = targets(world, displacements=moves, frames_per_second=10.0, rate=2.0)
    for time, part in ((0.05, 0.5), (0.2, 2.0), (7.0, 2.0)):
        bound = energy.begin(Step(time - 0.01, 0.01, x, 0 * x, 1.0, 0 * x))
        np.testing.assert_allclose(bound.targets(), x[: world.n_cloth] + part * velocity, atol=1e-12)


def test_a_weight_stands_g_over_the_squared_rate_below_its_target(tmp_path):
    world = sheet()
    keys = {"displacements": np.zeros((1, 25, 3)), "rate": 100.0}
    scene = small_scene(effects=without("body_contact", "damping", "inertia") | {"targets": keys}, body=())
    run = simulate(scene, tmp_path / "run")
    assert run.status == "completed"
    wanted = world.start()[: world.n_cloth] + world.origin - [0, 0, 9.81e-4]
    np.testing.assert_allclose(run[-1].positions["cloth"], wanted, atol=1e-7)


def test_contact_keeps_what_the_targets_do_not(tmp_path):
    keys = {"displacements": np.array([[[0.0, 0, 0]], [[0, 0, -0.2]]]), "rate": 100.0}
    run = simulate(small_scene(effects=without("gravity") | {"targets": keys}), tmp_path / "run")
    assert run.status == "completed"
    assert run.intersection_free
    assert np.linalg.norm(run[-1].positions["cloth"], axis=1).min() > 0.28


@pytest.mark.parametrize("moves", [np.zeros((2, 5, 3)), np.zeros((25, 3)), np.full((2, 25, 3), np.nan)])
def test_displacements_of_another_shape_are_refused(moves):
    with pytest.raises(InputError, match="displacements"):
        build(small_scene(cloth=SHEET, effects=without() | {"targets": {"displacements": moves}}))
