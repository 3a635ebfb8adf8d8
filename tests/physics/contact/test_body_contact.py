"""The effect body_contact: defaults, refusals, and the barrier at both ends of its range."""

from dataclasses import replace

import numpy as np
import pytest
from effect_builders import body_contact
from meshes import cloth, grid, small_world
from solving import step_at

import clothsim
from clothsim.base.errors import InputError
from clothsim.mesh.body import make_body
from clothsim.mesh.generators.table import GENERATORS
from clothsim.mesh.world import make_world
from clothsim.physics.contact.stiffness import barrier_stiffness, default_d_hat
from clothsim.physics.energies.base import Off


def world_at(height, cells=4):
    positions, triangles = grid(cells, cells)
    sheet = replace(cloth(positions, triangles), positions=positions + np.array([-0.5, -0.5, height]))
    return make_world([sheet], [make_body("ball", *GENERATORS["sphere"](radius=0.3, subdivisions=2))])


def test_off_without_a_body():
    assert body_contact(small_world()) == Off("the scene has no body")


@pytest.mark.parametrize("height", [0.0, 0.25, -0.2])
def test_start_that_intersects_a_body_is_refused(height):
    with pytest.raises(InputError, match=r"cloth .* ball") as refusal:
        body_contact(world_at(height))
    assert refusal.value.remedy


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"d_hat": 0}, r"body_contact\.d_hat .* 0"),
        ({"d_hat": -1.0}, r"body_contact\.d_hat .* -1"),
        ({"d_hat": "wide"}, r"body_contact\.d_hat .*'wide'"),
        ({"stiffness": 0.0}, r"body_contact\.stiffness .* 0"),
        ({"stiffness": float("nan")}, r"body_contact\.stiffness .*nan"),
    ],
)
def test_bad_numbers_are_refused_by_name(keys, words):
    with pytest.raises(InputError, match=words):
        body_contact(world_at(0.5), **keys)


def test_default_d_hat_and_stiffness():
    contact = body_contact(world_at(0.5))
    assert contact.d_hat == 0.025
    assert "d_hat = 0.025 m" in contact.defaults_used()[0]
    assert contact.adaptive
    fixed = body_contact(world_at(0.5), d_hat=0.01, stiffness=30.0)
    assert (fixed.d_hat, fixed.stiffness) == (0.01, 30.0)
    assert fixed.begin(step_at(world_at(0.5).start())) is fixed
    assert "30 Pa" in fixed.defaults_used()[0]
    assert not fixed.adaptive


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_d_hat_scales_with_the_mesh(scale):
    lengths = np.array([0.9, 1.0, 1.3]) * scale
    assert default_d_hat(lengths) == pytest.approx(0.1 * scale, rel=1e-12)


def test_zero_beyond_d_hat():
    world = world_at(0.3 + 0.026)
    contact = body_contact(world, d_hat=0.025, stiffness=100.0)
    x = world.start()
    assert contact.value(x) == 0.0
    assert not contact.gradient(x).any()
    assert not len(contact.hessian(x).elements)
    assert contact.minimum_gap(x) == np.inf
    assert contact.counts()["pairs"] == 0


def test_repulsion_grows_as_the_gap_shrinks():
    values, gaps = [], []
    for gap in (0.02, 0.01, 0.001, 1e-5):
        world = world_at(0.3 + gap)
        contact = body_contact(world, d_hat=0.025, stiffness=100.0)
        x = world.start()
        values.append(contact.value(x))
        gaps.append(contact.minimum_gap(x))
        force = contact.gradient(x)
        assert force[: world.n_cloth, 2].sum() < 0  # the energy falls as the cloth rises
        assert force.sum(axis=0) == pytest.approx([0, 0, 0], abs=1e-10 * np.abs(force).max())
        assert contact.counts()["pairs"] > 0
    assert (np.diff(values) > 0).all()
    assert gaps == pytest.approx([0.02, 0.01, 0.001, 1e-5], rel=1e-9)


def test_energy_is_infinite_in_contact():
    world = world_at(0.31)
    contact = body_contact(world, d_hat=0.025, stiffness=100.0)
    x = world.start()
    top = x[world.n_cloth :, 2].argmax() + world.n_cloth
    x[12] = x[top]  # the vertex in the middle of the sheet
    assert contact.value(x) == np.inf


def test_the_stiffness_of_a_step_depends_on_that_step_alone():
    world = world_at(0.31)
    contact = body_contact(world, d_hat=0.025)
    x = world.start()
    rng = np.random.default_rng(0)
    step = replace(step_at(x, 0.1 * rng.standard_normal(x.shape), dt=0.01), gradient=rng.standard_normal(x.shape))
    first = contact.begin(step)
    first.value(x)
    first.step_limit(x, 0.01 * rng.standard_normal(x.shape))
    assert first.begin(step).stiffness == contact.begin(step).stiffness == first.stiffness
    assert first.begin(replace(step, dt=0.1)).stiffness < first.stiffness


def test_cache_notices_positions_changed_in_place():
    """x changed in place between two calls: energy, gradient, Hessian and gap are those of new contact."""
    world = world_at(0.31)
    contact = body_contact(world, d_hat=0.025, stiffness=100.0)
    x = world.start()
    contact.hessian(x)
    gap = contact.minimum_gap(x)
    x[: world.n_cloth, 2] += 0.002
    fresh = body_contact(world, d_hat=0.025, stiffness=100.0)
    assert contact.minimum_gap(x) == fresh.minimum_gap(x) > gap + 0.001
    assert contact.value(x) == fresh.value(x) > 0.0
    assert np.array_equal(contact.gradient(x), fresh.gradient(x))
    assert np.array_equal(contact.hessian(x).blocks, fresh.hessian(x).blocks)


def test_pair_list_is_kept_across_steps():
    world = world_at(0.31)
    contact = body_contact(world, d_hat=0.025)
    x = world.start()
    bound = contact.begin(step_at(x, 0.0 * x, dt=0.01))
    assert bound.step_limit(x, 0.0 * x) == 1.0
    bound.begin(step_at(x, 0.0 * x, dt=0.01)).value(x)
    assert contact.candidates.builds == 1


def test_the_stiffness_is_the_largest_of_three_pressures():
    settings = {"pressure": 3.0, "area_density": 0.2, "speed": 1.0, "d_hat": 1e-3, "dt": 0.1, "contact_time_scale": 0.1}
    assert barrier_stiffness(**settings) == 3.0
    assert barrier_stiffness(**settings | {"speed": 50.0}) == pytest.approx(0.2 * 50 / 0.1)
    assert barrier_stiffness(**settings | {"d_hat": 0.5, "dt": 0.01, "contact_time_scale": 0.01}) == pytest.approx(1e3)
    assert barrier_stiffness(**settings | {"pressure": 0.0, "speed": 0.0}) > 0


def test_the_stiffness_stops_growing_as_dt_goes_to_zero():
    """A fast vertex is stopped within d_hat; a slow one within the contact time scale."""
    settings = {"pressure": 0.0, "area_density": 0.2, "d_hat": 1e-3, "contact_time_scale": 0.01}
    fast = [barrier_stiffness(**settings, speed=2.0, dt=dt) for dt in (1e-2, 1e-3, 1e-4, 1e-5)]
    assert fast[0] < fast[1] < fast[2] == fast[3] == pytest.approx(0.2 * 2.0**2 / 1e-3)
    slow = [barrier_stiffness(**settings, speed=0.02, dt=dt) for dt in (1e-2, 1e-5)]
    assert slow[0] == slow[1] == pytest.approx(0.2 * 1e-3 / 0.01**2)


def test_separating_velocities_do_not_raise_the_stiffness():
    world = world_at(0.31)
    contact = body_contact(world, d_hat=0.025)
    x = world.start()
    away = -contact.gradient(x)[: world.n_cloth]
    in_contact = np.linalg.norm(away, axis=1) > 0
    velocities = np.zeros_like(x)
    velocities[: world.n_cloth][in_contact] = (
        50.0 * away[in_contact] / np.linalg.norm(away[in_contact], axis=1)[:, None]
    )
    leaving, still, coming = (contact.begin(step_at(x, k * velocities, dt=0.01)).stiffness for k in (1, 0, -1))
    assert in_contact.any()
    assert leaving == still < coming


def height_of_the_bounce(dt, folder):
    """Rebound height of a sheet that starts at an eighth of d_hat above a slab [m]."""
    scene = clothsim.Scene(
        cloth={"mesh": "rectangle", "size": [0.3, 0.3], "cells": [4, 4], "position": [0, 0, 0.0505]},
        body={"mesh": "slab", "size": [1, 1, 0.1]},
        effects={"inertia": {}, "membrane": {}, "gravity": {}, "body_contact": {"d_hat": 4e-3}},
        solver={"dt": dt, "linear": "superlu"},
        run={"duration": 0.1, "frames_per_second": 50},
    )
    run = clothsim.simulate(scene, folder / str(dt))
    return max(run.positions(k)[:, 2].max() for k in range(6)) - 0.0505


def test_rebound_from_inside_d_hat_is_bounded_as_dt_shrinks(tmp_path):
    """With a stiffness that goes with 1 / dt^2 the rebound would be six times as high at half the dt."""
    coarse, fine = (height_of_the_bounce(dt, tmp_path) for dt in (0.0025, 0.00125))
    assert fine < 2 * coarse


@pytest.mark.parametrize("gap", [1e-3, 1e-4, 1e-6, 1e-9, 1e-12])
def test_start_close_to_contact_converges_to_equilibrium(gap, tmp_path):
    """Near contact Newton's step is as short as the gap: only the residual distinguishes equilibrium from that."""
    scene = clothsim.Scene(
        cloth={"mesh": "rectangle", "size": [0.2, 0.2], "cells": [3, 3], "position": [0, 0, 0.05 + gap]},
        body={"mesh": "slab", "size": [1, 1, 0.1]},
        effects={"inertia": {}, "membrane": {}, "gravity": {}, "body_contact": {"d_hat": 5e-3}},
        solver={"dt": 0.02, "linear": "superlu"},
        run={"duration": 0.02, "frames_per_second": 50},
    )
    run = clothsim.simulate(scene, tmp_path)
    weight = 0.15 * 0.2**2 * 9.81
    assert run.status == "completed", run.reason
    assert run.summary["certificate"]["residual"] < 0.1 * weight


def test_start_in_contact_is_refused(tmp_path):
    scene = clothsim.Scene(
        cloth={"mesh": "rectangle", "size": [0.2, 0.2], "cells": [3, 3], "position": [0, 0, 0.05]},
        body={"mesh": "slab", "size": [1, 1, 0.1]},
        effects={"inertia": {}, "membrane": {}, "gravity": {}, "body_contact": {"d_hat": 5e-3}},
    )
    with pytest.raises(InputError, match=r"cloth .* body"):
        clothsim.simulate(scene, tmp_path)
