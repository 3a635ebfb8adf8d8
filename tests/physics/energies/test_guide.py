"""The pull of frames: targets between them, the deviation of a load, contact that the frames do not keep."""

import numpy as np
import pytest
from small_scenes import SHEET, small_scene, without

from clothsim import InputError, simulate
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Step
from clothsim.scene.assembly.scene_world import build
from tests.support.effect_builders import guide


def sheet() -> World:
    return build(small_scene()).world


def test_targets_lie_between_frames_and_are_held_beyond_them():
    world = sheet()
    place, velocity = np.random.default_rng(0).standard_normal((2, world.n_cloth, 3))
    at = place + np.arange(3.0)[:, None, None] * velocity
    energy = guide(world, frames=at, frames_per_second=10.0, strength=2.0)
    x = world.start()
    for time, wanted in ((0.05, (at[0] + at[1]) / 2), (0.2, at[2]), (7.0, at[2])):
        bound = energy.begin(Step(time - 0.01, 0.01, x, 0 * x, 1.0, 0 * x))
        np.testing.assert_allclose(bound.target + world.origin, wanted, atol=1e-12)


def test_a_weight_stands_g_over_k_below_its_target(tmp_path):
    world = sheet()
    frames = np.array([world.start()[: world.n_cloth] + world.origin])
    keys = {"frames": frames, "strength": 1e4}
    scene = small_scene(effects=without("body_contact", "damping", "inertia") | {"guide": keys}, body=())
    run = simulate(scene, tmp_path / "run")
    assert run.status == "completed"
    np.testing.assert_allclose(run[-1].positions["cloth"], frames[0] - [0, 0, 9.81e-4], atol=1e-7)


def test_contact_keeps_what_the_frames_do_not(tmp_path):
    world = sheet()
    low = np.array([world.start()[: world.n_cloth] + world.origin - [0, 0, z] for z in (0.0, 0.2)])
    keys = {"frames": low, "strength": 1e4}
    run = simulate(small_scene(effects=without("gravity") | {"guide": keys}), tmp_path / "run")
    assert run.status == "completed"
    assert run.intersection_free
    assert np.linalg.norm(run[-1].positions["cloth"], axis=1).min() > 0.28


@pytest.mark.parametrize("frames", [np.zeros((2, 5, 3)), np.zeros((25, 3)), [[["a", "b", "c"]] * 25]])
def test_frames_of_another_shape_are_refused(frames):
    with pytest.raises(InputError):
        build(small_scene(cloth=SHEET, effects=without() | {"guide": {"frames": frames}}))


def test_a_frame_that_is_not_finite_is_refused():
    frames = np.zeros((2, 25, 3))
    frames[1, 3, 0] = np.nan
    with pytest.raises(InputError, match=r"frames\[1, 3\]"):
        build(small_scene(effects=without() | {"guide": {"frames": frames}}))
