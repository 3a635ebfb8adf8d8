"""Bending with a slope and with a curl: moments of cylinders, derivatives, convexity, a strip that rolls up."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from differences import dense_hessian, gradient_error, hessian_error
from effect_builders import bending, membrane, plastic_bending
from meshes import UNIT, cloth, deformed, grid, irregular_grid, small_world
from small_scenes import EFFECTS, SHEET, frames, small_scene
from solving import equilibrium, held, step_at, those_on

from clothsim import Scene, resume, simulate
from clothsim.base.errors import InputError
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint
from clothsim.mesh.world import make_world
from clothsim.physics.energies.midedge_bending import MidedgeBending
from clothsim.physics.energies.midedge_softening import LEAST_TANGENT, HystereticBending
from clothsim.scene.assembly.scene_world import build

FLAT = replace(UNIT, poisson_ratio=0.0, bending_stiffness=1.0)
WOVEN = replace(
    UNIT, poisson_ratio=0.2, bending_warp=1.5, bending_weft=0.8, bending_slope_warp=-0.5, bending_slope_weft=-0.2,
    bending_slope_bias=-0.4,
)  # fmt: skip


def world_of(fabric, mesh=None):
    return make_world([cloth(*(irregular_grid(0) if mesh is None else mesh), fabric)])


def rolled(positions, k):
    """The plane rolled along x to a cylinder of curvature k towards +z."""
    x, y = positions[:, 0], positions[:, 1]
    return np.column_stack([np.sin(k * x) / k, y, (1 - np.cos(k * x)) / k])


def energy_per_area(fabric, n, k, degrees=0.0, short_waves=0.0):
    """Of the inside of a cylinder of curvature k: of four sheets, so that free borders, without moment, drop out."""
    sheets = flat_sheets(fabric, n, degrees, short_waves)
    return sum(sign * energy.value(rolled(start, k)) for sign, energy, start in sheets)


@cache
def flat_sheets(fabric, n, degrees, short_waves):
    """Sign, bending energy and flat positions of each of the four."""
    sheets = []
    for length, width, sign in ((2, 2, 1), (2, 1, -1), (1, 2, -1), (1, 1, 1)):
        points, triangles = grid(length * n, width * n)
        points = points * [length, width, 1]
        wave = 0.05 * np.sin(2 * np.pi * points[:, 0]) * np.sin(2 * np.pi * points[:, 1])
        points[:, 0] += wave  # on rows along the axis a cylinder's moment would be exact
        points[:, 1] -= 2 * wave
        world = world_of(fabric, (points, triangles))
        sheets.append((sign, bending(world, angle_degrees=degrees, short_waves=short_waves), world.start()))
    return sheets


# --- softening ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("short_waves", [0.0, 1.0])
@pytest.mark.parametrize("slope", [-0.3, 0.3])
@pytest.mark.parametrize("k", [0.8, 3.0])
def test_moment_of_a_cylinder_converges_with_order_two(slope, k, short_waves):
    fabric = replace(FLAT, bending_slope=slope)
    cap = (1 - LEAST_TANGENT) / (2 * abs(slope))
    below, beyond = min(k, cap), max(k - cap, 0.0)
    exact = below + slope * below**2 + (1 + 2 * slope * below) * beyond
    errors = []
    for n in (8, 16, 32):
        high, low = (energy_per_area(fabric, n, k + step, 0.0, short_waves) for step in (1e-4, -1e-4))
        errors.append(abs((high - low) / 2e-4 / exact - 1))
    assert errors[-1] < 2e-3
    assert np.log2(errors[1] / errors[2]) > 1.85


@pytest.mark.parametrize(("degrees", "stiffness", "slope"), [(0, 1.5, -0.5), (90, 0.8, -0.2)])
def test_each_direction_has_its_slope(degrees, stiffness, slope):
    fabric, k = replace(WOVEN, poisson_ratio=0.0), 0.5
    found = energy_per_area(fabric, 16, k, degrees)
    assert found == pytest.approx(stiffness * k**2 / 2 + slope * k**3 / 3, rel=2e-3)


def test_the_bias_has_its_own():
    k, woven = 0.4, replace(WOVEN, poisson_ratio=0.0)
    soft, stiff = (energy_per_area(replace(woven, bending_slope_bias=s), 16, k, 45.0) for s in (-0.4, -0.2))
    assert soft - stiff == pytest.approx(-0.2 * k**3 / 3, rel=5e-3)


@pytest.mark.parametrize("fabric", [WOVEN, replace(UNIT, bending_slope=-2.0), replace(UNIT, bending_slope=2.0)])
@pytest.mark.parametrize("short_waves", [0.0, 1.0])
def test_derivatives(fabric, short_waves):
    world = world_of(fabric)
    energy = bending(world, short_waves=short_waves)
    for amplitude in (0.02, 0.2):  # below and beyond the cap
        x = deformed(world, 1, amplitude)
        assert gradient_error(energy, x) < 1e-7
        assert hessian_error(energy, x) < 1e-5


@pytest.mark.parametrize("fabric", [WOVEN, replace(UNIT, bending_slope=-2.0), replace(UNIT, bending_slope=2.0)])
@pytest.mark.parametrize("short_waves", [0.0, 1.0])
def test_it_is_convex_over_the_angles_and_newton_s_springs_bound_it(fabric, short_waves):
    world = world_of(fabric)
    energy = bending(world, short_waves=short_waves)
    x = deformed(world, 1, 0.2)
    tangents = np.einsum("mqj,mpj->mqp", energy._tangents(x), energy._tangents(x))
    plates = np.einsum("mqj,mpj->mqp", energy.weights, energy.weights)
    assert np.abs(np.trace(tangents, axis1=1, axis2=2) / np.trace(plates, axis1=1, axis2=2) - 1).max() > 0.1
    squares = energy._squares(x).explicit().to_sparse(len(x)).toarray()
    assert np.linalg.eigvalsh(squares)[0] > -1e-12 * np.abs(squares).max()
    springs = dense_hessian(energy, x, project=True)
    assert np.linalg.eigvalsh(springs - squares)[0] > -1e-10 * np.abs(springs).max()


def test_short_waves_take_the_moment_that_is_left_at_three_points_of_a_triangle():
    """Waves of 8 cells whose curvature softens: the energy over the exact one, without and with."""
    n = 64
    points, triangles = grid(n, n)
    q, depth, slope = 2 * np.pi * 8, 1.0, -0.2
    points[:, 2] = -depth / q**2 * np.sin(q * points[:, 0])
    phase = np.linspace(0, 2 * np.pi, 4001)[:-1]
    k = np.abs(depth * np.cos(phase))
    exact = (k**2 / 2 + slope * k**3 / 3).mean()
    inside = np.ptp(points[:, 0]) * np.ptp(points[:, 1])
    world = world_of(replace(FLAT, bending_slope=slope), (points * [1, 1, 0], triangles))
    plain, restored = (bending(world, short_waves=f).value(points) / (inside * exact) - 1 for f in (0.0, 1.0))
    assert plain < -0.06
    assert abs(restored) < 0.3 * abs(plain)
    assert len(bending(world, short_waves=1.0).amounts) == 3 * len(triangles)


def test_least_tangent_is_left():
    fabric = replace(FLAT, bending_slope=-1.0)
    values = [energy_per_area(fabric, 8, k) for k in (2.0, 2.1, 2.2)]
    assert np.diff(values, 2)[0] / 0.01 == pytest.approx(LEAST_TANGENT, rel=0.05)


def test_without_a_slope_it_is_the_plate():
    assert type(bending(world_of(UNIT))) is MidedgeBending


def test_restricted_to_a_vertex_it_has_its_gradient():
    world = world_of(WOVEN)
    energy, x = bending(world), deformed(world, 1, 0.1)
    moving = np.arange(len(x)) == 7
    part = energy.restricted_to(moving, x)
    assert len(part.elements) < len(energy.elements)
    assert np.abs((part.gradient(x) - energy.gradient(x))[7]).max() < 1e-12


@pytest.mark.parametrize("model", ["hinge", "quadratic"])
def test_other_models_refuse_a_slope(model):
    with pytest.raises(InputError, match=r"bending_slope.*midedge"):
        bending(world_of(replace(UNIT, bending_slope=-0.1)), model=model)


def test_slopes_of_both_signs_are_refused():
    with pytest.raises(InputError, match="bending_slope"):
        replace(UNIT, bending_slope_warp=1.0, bending_slope_weft=-1.0)


# --- curl -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", ["midedge", "hinge", "quadratic"])
@pytest.mark.parametrize("way", ["warp", "weft"])
def test_a_curled_sheet_is_at_rest_on_its_cylinder(model, way):
    k, left = 1.3, []
    for n in (8, 16):
        world = world_of(replace(FLAT, **{f"rest_curvature_{way}": k}), grid(n, n))
        energy = bending(world, model=model)

        def rolled_up(k, world=world):
            start = world.start()
            return rolled(start, k) if way == "warp" else rolled(start[:, [1, 0, 2]], k)[:, [1, 0, 2]]

        flat, there, opposite = (
            energy.begin(step_at(x)).value(x) for x in (world.start(), rolled_up(k), rolled_up(-k))
        )
        left.append(there / flat)
        assert opposite > 3 * flat
    assert left[1] < 1e-3


@pytest.mark.parametrize("model", ["midedge", "hinge"])
def test_a_free_strip_rolls_to_its_radius(model):
    k, radii = 1.5, []
    for n in (8, 16):
        points, triangles = grid(n, 2)
        points[:, 1] *= 0.25
        world = world_of(replace(FLAT, youngs_modulus=1e4, rest_curvature_warp=k), (points, triangles))
        energies = those_on(membrane=membrane(world), bending=bending(world, model=model))
        end = equilibrium(
            world, energies, world.start(), held(world.start(), np.flatnonzero(points[:, 0] < 1e-9)), tolerance=1e-7
        )
        middle = end[np.abs(points[:, 1] - points[:, 1].mean()) < 1e-9]
        centre = np.linalg.lstsq(
            np.column_stack([2 * middle[:, [0, 2]], np.ones(len(middle))]), (middle[:, [0, 2]] ** 2).sum(axis=1)
        )[0]
        radii.append(float(np.sqrt(centre[2] + centre[:2] @ centre[:2])))
    assert radii[1] * k == pytest.approx(1.0, abs=0.02)


def test_derivatives_with_curl_and_slope():
    world = world_of(replace(WOVEN, rest_curvature_warp=2.0, rest_curvature_weft=-1.0))
    energy, x = bending(world), deformed(world, 1, 0.1)
    assert gradient_error(energy, x) < 1e-7
    assert hessian_error(energy, x) < 1e-5


def test_a_curl_that_the_mesh_cannot_have_is_refused():
    cloth = {"mesh": "rectangle", "size": [0.2, 0.2], "cells": [4, 4], "rest_curvature_warp": 1e4}
    with pytest.raises(InputError, match="rest curvature"):
        build(Scene(cloth=cloth, effects={"membrane": {}, "bending": {}}))


WIDTH, RANGE = 0.4, 0.2
LOOPED = replace(
    UNIT, poisson_ratio=0.0, bending_stiffness=1.0, bending_hysteresis=WIDTH, hysteresis_curvature=RANGE
)  # fmt: skip


def rolled_by_curvature(world, k):
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
            high, low = (bound.value(rolled_by_curvature(world, k + step)) for step in (1e-5, -1e-5))
            total[number] += sign * (high - low) / 2e-5
            x, memory = rolled_by_curvature(world, k), {"bending": bound.carry_over}
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
