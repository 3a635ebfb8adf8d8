"""Friction of bending: the loop of the moment, derivatives, convexity, independence of the steps, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from differences import dense_hessian, gradient_error, hessian_error
from effect_builders import bending, plastic_bending
from meshes import UNIT, cloth, deformed, grid, small_world
from small_scenes import EFFECTS, SHEET, frames, small_scene
from solving import step_at

from clothsim import resume, simulate
from clothsim.base.errors import InputError
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint
from clothsim.mesh.world import make_world
from clothsim.physics.energies.midedge_bending import MidedgeBending
from clothsim.physics.energies.midedge_hysteresis import HystereticBending

WIDTH, RANGE = 0.4, 0.2
LOOPED = replace(
    UNIT, poisson_ratio=0.0, bending_stiffness=1.0, bending_hysteresis=WIDTH, hysteresis_curvature=RANGE
)  # fmt: skip


def rolled(world, k):
    x, y = world.start()[:, 0], world.start()[:, 1]
    if k == 0:
        return world.start()
    return np.column_stack([np.sin(k * x) / k, y, (1 - np.cos(k * x)) / k])


def moments(fabric, curvatures, degrees=0.0, short_waves=0.0):
    """Of the inside of a cylinder that is bent through curvatures, a step each."""
    total = np.zeros(len(curvatures))
    for length, sign in ((2, 1), (1, -1)):
        points, triangles = grid(length * 6, 3)
        world = make_world([cloth(points * [length, 1, 1], triangles, fabric)])
        energy, x, memory = bending(world, angle_degrees=degrees, short_waves=short_waves), world.start(), {}
        for number, k in enumerate(curvatures):
            bound = energy.begin(replace(step_at(x), memory=memory))
            high, low = (bound.value(rolled(world, k + step)) for step in (1e-5, -1e-5))
            total[number] += sign * (high - low) / 2e-5
            x, memory = rolled(world, k), {"bending": bound.carry_over}
    return total


def test_the_loop_of_moment_over_curvature_closes_with_its_width():
    """As a KES test: to 2.5 and -2.5 and back."""
    up, down = np.linspace(-2.5, 2.5, 21), np.linspace(2.5, -2.5, 21)
    found = moments(LOOPED, np.concatenate([np.linspace(0.25, 2.5, 10), down[1:], up[1:], down[1:]]))
    falling, rising, again = found[9:30], found[29:50], found[49:70]
    assert np.abs(falling - again).max() < 1e-6
    inside = slice(3, -3)
    assert np.abs(rising[inside] - falling[::-1][inside] - WIDTH).max() < 1e-4
    assert found[9] == pytest.approx(2.5 + WIDTH / 2, rel=1e-4)


def test_the_number_of_steps_does_not_matter():
    ends = [moments(LOOPED, np.concatenate([np.linspace(0, 2, n + 1)[1:], np.linspace(2, 1.9, n + 1)[1:]]))[-1]
            for n in (1, 5)]  # fmt: skip
    assert ends[0] == pytest.approx(ends[1], rel=1e-6)
    assert ends[0] == pytest.approx(1.9 + WIDTH / 2 * (1 - 0.1 / RANGE), rel=1e-4)


@pytest.mark.parametrize("short_waves", [0.0, 1.0])
@pytest.mark.parametrize(("degrees", "half"), [(0.0, 0.3), (90.0, 0.1)])
def test_warp_and_weft_have_their_own(degrees, half, short_waves):
    fabric = replace(LOOPED, bending_hysteresis_warp=0.6, bending_hysteresis_weft=0.2)
    assert moments(fabric, [2.0], degrees, short_waves)[0] == pytest.approx(2.0 + half, rel=1e-4)


@pytest.mark.parametrize("short_waves", [0.0, 1.0])
@pytest.mark.parametrize("slope", [0.0, -0.5])
def test_derivatives_and_bounds_in_the_middle_of_a_loop(slope, short_waves):
    fabric = replace(LOOPED, poisson_ratio=0.2, bending_hysteresis_weft=0.1, bending_slope=slope)
    world = small_world(0, fabric)
    energy = bending(world, short_waves=short_waves).begin(step_at(deformed(world, 1, 0.05)))
    assert isinstance(energy, HystereticBending)
    assert energy.carry_over.any()
    x = deformed(world, 2, 0.06)
    assert gradient_error(energy, x) < 1e-7
    assert hessian_error(energy, x) < 1e-5
    for y in (x, world.start()):
        squares = energy._squares(y).explicit().to_sparse(len(y)).toarray()
        springs = dense_hessian(energy, y, project=True)
        assert np.linalg.eigvalsh(squares)[0] > -1e-12 * np.abs(squares).max()
        assert np.linalg.eigvalsh(springs - squares)[0] > -1e-10 * np.abs(springs).max()


def test_the_bounds_are_those_of_the_plate_and_in_proportion_to_the_width():
    fabrics = [replace(LOOPED, poisson_ratio=0.2, bending_hysteresis=width) for width in (0.0, 0.3, 0.6)]
    plate, once, twice = (bending(small_world(0, fabric)).bounds for fabric in fabrics)
    assert (once > plate).all()
    assert twice - once == pytest.approx(once - plate, rel=1e-9)


def test_without_hysteresis_it_is_the_plate():
    assert type(bending(small_world())) is MidedgeBending


OWN = {"bending_stiffness": 3e-3, "bending_hysteresis": 0.05, "hysteresis_curvature": 0.1}
MIDEDGE = EFFECTS | {"bending": {"model": "midedge"}}


class StoppedError(Exception):
    """Raised by a listener, to stop a run."""


def test_a_resumed_run_restores_its_slips_bit_for_bit(tmp_path):
    scene = small_scene(cloth=SHEET | OWN, effects=MIDEDGE)
    whole = frames(simulate(scene, tmp_path / "whole"))
    plain = small_scene(cloth=SHEET | {"bending_stiffness": 3e-3}, effects=MIDEDGE)
    assert np.abs(whole[-1] - frames(simulate(plain, tmp_path / "plain"))[-1]).max() > 1e-3

    def stop(progress):
        if progress.step == 6:
            raise StoppedError

    with pytest.raises(StoppedError):
        simulate(scene, tmp_path / "part", progress=stop)
    assert np.abs(read_checkpoint(tmp_path / "part" / CHECKPOINT_NAME).state.memory["bending"]).max() > 1e-3
    assert np.array_equal(frames(resume(tmp_path / "part")), whole)


def test_zeros_keep_every_bit(tmp_path):
    zeros = dict.fromkeys(("bending_slope", "rest_curvature_warp", "rest_curvature_weft", "bending_hysteresis"), 0.0)
    one, other = (
        frames(simulate(small_scene(cloth=SHEET | own, effects=MIDEDGE), tmp_path / str(len(own))))
        for own in ({"bending_slope_warp": 0.0}, zeros)
    )
    assert np.array_equal(one, frames(simulate(small_scene(effects=MIDEDGE), tmp_path / "none")))
    assert np.array_equal(one, other)


@pytest.mark.parametrize("model", ["hinge", "quadratic"])
def test_other_models_refuse_it(model):
    with pytest.raises(InputError, match=r"bending_hysteresis.*midedge"):
        bending(make_world([cloth(*grid(2, 2), LOOPED)]), model=model)


def test_plastic_folds_refuse_it():
    world = make_world([cloth(*grid(2, 2), LOOPED)])
    with pytest.raises(InputError, match=r"plastic_bending.*hysteresis"):
        plastic_bending(world, yield_curvature=1.0, built={"bending": bending(world)})
