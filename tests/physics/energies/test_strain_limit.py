"""Strain limit: barrier of a single stretch in closed form, zero below its onset, step limit."""

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
from differences import dense_hessian, gradient_error, hessian_error
from effect_builders import membrane, strain_limit
from meshes import cloth, deformed, grid, irregular_grid, random_rotation, small_world
from small_scenes import SHEET, SOLVER
from solving import equilibrium, held

from clothsim import Scene, simulate
from clothsim.base.errors import InputError
from clothsim.keys.fabric import EXTENDED
from clothsim.keys.fabric_table import FABRICS
from clothsim.mesh.cloth import make_cloth
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Off
from clothsim.physics.energies.strain_limit import SLACK, limit_of_extension

STIFFNESS = 2.0
KEYS = {
    "principal": {"limit": 2.5, "begins": 0.0},
    "threads": {"limit": 0, "limit_warp": 2.0, "limit_weft": 2.3, "begins": 0.1, "angle_degrees": 20.0},
    "both": {"limit": 2.2, "limit_weft": 1.9},
}


def stretched(world, *stretches):
    """The sheet stretched along x, y and z, turned in space."""
    return world.start() * np.array([*stretches, 1.0])[:3] @ random_rotation(3).T


def barrier(stretch, limit, begin):
    """-(S - s_hat)^2 y^2 ln(1 - y)."""
    y = max(stretch - begin, 0) / (limit - begin)
    return -((limit - begin) ** 2) * y**2 * np.log(1 - y)


class TestTheBarrier:
    def test_it_is_the_closed_form_of_both_principal_stretches(self):
        world = small_world(0)
        energy = strain_limit(world, limit=1.5, begins=0.4, stiffness=STIFFNESS)
        expected = STIFFNESS * world.rest_areas.sum() * (barrier(1.45, 1.5, 1.2) + barrier(1.3, 1.5, 1.2))
        assert energy.value(stretched(world, 1.45, 1.3)) == pytest.approx(expected, rel=1e-12)
        expected = STIFFNESS * world.rest_areas.sum() * barrier(1.45, 1.5, 1.2)
        assert energy.value(stretched(world, 0.7, 1.45)) == pytest.approx(expected, rel=1e-12)

    def test_equal_stretches_are_no_exception(self):
        world = small_world(0)
        energy = strain_limit(world, limit=1.5, begins=0.4)
        for x in (stretched(world, 1.3, 1.3), stretched(world, 1.3, 1.3 + 1e-7)):
            assert gradient_error(energy, x) < 1e-7
            assert hessian_error(energy, x) < 1e-6

    def test_threads_have_limits_of_their_own(self):
        world = small_world(0)
        along = strain_limit(world, limit=0, limit_warp=1.5, stiffness=STIFFNESS)
        area = STIFFNESS * world.rest_areas.sum()
        assert along.value(stretched(world, 1.4, 2.0)) == pytest.approx(area * barrier(1.4, 1.5, 1.25), rel=1e-12)
        assert along.value(stretched(world, 1.5, 1.0)) == np.inf
        across = strain_limit(world, limit=0, limit_warp=1.5, stiffness=STIFFNESS, angle_degrees=90)
        assert across.value(stretched(world, 2.0, 1.4)) == pytest.approx(area * barrier(1.4, 1.5, 1.25), rel=1e-12)

    @pytest.mark.parametrize("keys", KEYS.values(), ids=KEYS)
    def test_derivatives_and_a_hessian_that_is_semi_definite_as_it_is(self, keys):
        world = small_world(0)
        energy = strain_limit(world, **keys)
        x = deformed(world, 2, 0.1)
        assert 0 < energy.value(x) < np.inf
        assert gradient_error(energy, x) < 1e-7
        assert hessian_error(energy, x) < 1e-6
        dense = dense_hessian(energy, x)
        assert np.linalg.eigvalsh(dense)[0] > -1e-12 * np.abs(dense).max()

    def test_at_the_limit_it_is_infinite(self):
        world = small_world(0)
        energy = strain_limit(world, limit=1.5)
        assert energy.value(stretched(world, 1.499999, 1)) < np.inf
        assert energy.value(stretched(world, 1.500001, 1)) == np.inf

    def test_its_stiffness_is_the_fabrics_where_none_is_given(self):
        world = small_world(0)  # E thickness = 2 N/m
        x = stretched(world, 1.4, 1.0)
        assert strain_limit(world, limit=1.5).value(x) == strain_limit(world, limit=1.5, stiffness=2.0).value(x)


class TestBelowIt:
    def test_there_is_exactly_nothing(self):
        world = small_world(0)
        energy = strain_limit(world, limit=1.5, limit_warp=1.6, begins=0.5)
        x = stretched(world, 1.24, 0.6)
        assert energy.value(x) == 0.0
        assert not energy.gradient(x).any()
        assert energy.hessian(x).blocks.shape == (0, 9, 9)
        assert energy.step_limit(x, 1e-3 * x) == 1.0

    def test_only_the_triangle_that_is_near_has_a_block(self):
        world = small_world(0)
        x = world.start()
        x[world.triangles[4, 0], 2] += 0.2
        energy = strain_limit(world, limit=5.0, begins=0.01)
        touched = (world.triangles == world.triangles[4, 0]).any(axis=1)
        near = energy.hessian(x).elements.tolist()
        assert 0 < len(near) < len(world.triangles)
        assert all(row in world.triangles[touched].tolist() for row in near)

    def test_a_run_that_does_not_come_near_is_the_same_bit_for_bit(self, tmp_path):
        with_it, without = (
            simulate(scene(effects={} if name == "without" else {"strain_limit": {"limit": 3.0}}), tmp_path / name)
            for name in ("with", "without")
        )
        assert with_it.status == without.status == "completed"
        assert np.array_equal(with_it.positions(-1), without.positions(-1))
        account = with_it.summary["effects"]["strain_limit"]
        assert account["hessian_nonzeros"] == 0
        assert account["evaluations"] > 0


class TestNoStepPassesIt:
    @pytest.mark.parametrize("seed", range(5))
    @pytest.mark.parametrize("keys", KEYS.values(), ids=KEYS)
    def test_the_step_ends_short_of_the_limit(self, keys, seed):
        world = small_world(0)
        energy = strain_limit(world, **keys)
        x = deformed(world, 2, 0.1)
        dx = np.random.default_rng(seed).standard_normal(x.shape)
        fraction = energy.step_limit(x, dx)
        assert 0 < fraction < 1
        loads = [energy._loads(x + part * fraction * dx, energy.triangles) for part in np.linspace(0, 1, 50)]
        start = loads[0].max()
        assert max(load.max() for load in loads) < 1
        assert energy.value(x + fraction * dx) < np.inf
        assert loads[-1].max() > start + 0.1 * (1 - start)  # and not much too short
        assert energy.step_limit(x, 50 * dx) == pytest.approx(fraction / 50, rel=0.2)

    def test_along_a_straight_path_it_goes_the_fraction_of_the_way_that_it_may(self):
        world = small_world(0)
        x, flat = world.start(), world.start()
        pull = flat * [1.0, 0.0, 0.0]
        fraction = strain_limit(world, limit=1.2).step_limit(x, pull)
        assert fraction == pytest.approx(0.2 * SLACK, rel=1e-9)

    def test_a_free_step_is_free(self):
        world = small_world(0)
        energy = strain_limit(world, limit=1.2)
        x = world.start()
        assert energy.step_limit(x, np.full_like(x, 100.0)) == 1.0
        assert energy.step_limit(x, 0.15 * x) == 1.0


class TestNewtonsEnd:
    def test_a_step_changes_a_fraction_of_what_is_left_to_the_limit(self):
        """From 1.4 to 1.45 with a limit of 1.5 is half of it; below the begin nothing is kept, so nothing changes."""
        world = small_world(0)
        energy = strain_limit(world, limit=1.5)
        x = stretched(world, 1.4, 1.0)
        assert energy.gap_change(x, stretched(world, 1.45, 1.0) - x) == pytest.approx(0.5)
        assert energy.gap_change(x, stretched(world, 1.39, 1.0) - x) == pytest.approx(0.1)
        rest = stretched(world, 1.0, 1.0)
        assert energy.gap_change(rest, x - rest) == 0.0


class TestBadInput:
    def test_no_limit_is_off(self):
        off = strain_limit(small_world(0), limit=0)
        assert isinstance(off, Off)
        assert "0" in off.reason

    def test_a_start_beyond_the_limit_names_cloth_and_triangle(self):
        positions, triangles = irregular_grid(0)
        far = positions.copy()
        far[triangles[5, 1]] += [0.0, 0.0, 0.3]
        first = int(np.flatnonzero((triangles == triangles[5, 1]).any(axis=1))[0])
        sheets = [
            cloth(positions, triangles, name="front"),
            replace(cloth(positions, triangles, name="back"), positions=far),
        ]
        with pytest.raises(InputError, match=rf"back: triangle {first} starts stretched to 1\.\d+, .* limit is 1\.1 "):
            strain_limit(make_world(sheets))

    @pytest.mark.parametrize(
        ("keys", "output"),
        [
            ({"limit": 0.9}, r"limit is 0\.9"),
            ({"limit_weft": 1.0}, r"limit_weft is 1"),
            ({"begins": 1.0}, "begins"),
            ({"begins": -0.1}, "begins"),
            ({"stiffness": -1.0}, "stiffness"),
        ],
    )
    def test_a_bad_number_is_named(self, keys, output):
        with pytest.raises(InputError, match=output):
            strain_limit(small_world(0), **keys)


def scene(effects, density=0.4, youngs_modulus=3e4):
    """A strip that hangs by its upper end, at rest."""
    strip = SHEET | {
        "size": [0.1, 0.6],
        "cells": [2, 12],
        "density": density,
        "youngs_modulus": youngs_modulus,
        "rotation_degrees": [90, 0, 0],
    }
    held = {"membrane": {}, "bending": {}, "gravity": {}, "pins": {"select": "top"}}
    return Scene(cloth=strip, effects=held | effects, solver=SOLVER | {"dt": 0.1}, run={"duration": 0.2})


class TestAHeavyStrip:
    """Its weight is a quarter of its membrane's stiffness: without a limit it stretches by more than 20 %."""

    @pytest.mark.parametrize("keys", [{"limit": 1.1}, {"limit": 0, "limit_weft": 1.1}])
    def test_it_keeps_below_the_limit_and_converges(self, tmp_path, keys):
        free = simulate(scene({}), tmp_path / "free")
        held = simulate(scene({"strain_limit": keys}), tmp_path / "held")
        assert free.status == held.status == "completed", held.reason
        assert free.summary["certificate"]["stretch_max"] > 1.2
        assert 1.08 < held.summary["certificate"]["stretch_max"] < 1.1
        length = np.ptp(held.positions(-1)[:, 2])
        assert 0.6 < length < 0.6 * 1.1

    def test_ten_times_the_weight_is_held_too(self, tmp_path):
        held = simulate(scene({"strain_limit": {"limit": 1.05}}, density=4.0), tmp_path)
        assert held.status == "completed", held.reason
        assert held.summary["certificate"]["stretch_max"] < 1.05
        assert held.summary["certificate"]["residual"] < 1e-2 * 4.0 * 0.06 * 9.81


def test_a_pin_that_moves_past_the_limit_is_reported(tmp_path):
    groups = [{"select": "left"}, {"select": "right", "motion": {"velocity": [0.5, 0, 0]}}]
    scene = Scene(
        cloth={"mesh": "rectangle", "size": [0.2, 0.2], "cells": [3, 3]},
        effects={"inertia": {}, "membrane": {}, "strain_limit": {"limit": 1.05}, "pins": {"group": groups}},
        solver={"dt": 0.01, "linear": "superlu"},
        run={"duration": 0.1, "frames_per_second": 25},
    )
    run = simulate(scene, tmp_path)
    assert run.status == "failed"
    assert re.search(r"effects\.strain_limit .* 1\.05 of 1\.05", run.reason)


def force_at(extension, fabric, along):
    """Force at the end of a strip of the fabric with free sides, over its width [N/m]."""
    positions, triangles = grid(6, 2)
    world = make_world([cloth(positions * [1.0, 0.2, 1.0], triangles, fabric)])
    angle = 0.0 if along == "warp" else 90.0
    energies = {
        "membrane": membrane(world, material="orthotropic", angle_degrees=angle),
        "strain_limit": strain_limit(world, angle_degrees=angle),
    }
    pulled = world.start() * [1 + extension, 1.0, 1.0]
    ends = np.flatnonzero(np.isin(world.start()[:, 0], [world.start()[:, 0].min(), world.start()[:, 0].max()]))
    middle = 0.5 * (pulled[:, 0].min() + pulled[:, 0].max())
    x = equilibrium(world, energies, pulled, held(pulled, ends))
    right = ends[pulled[ends, 0] > middle]
    return sum(energy.gradient(x)[right, 0].sum() for energy in energies.values()) / 0.2


@pytest.mark.parametrize("name", ["cotton", "denim", "rib_knit", "tablecloth"])
@pytest.mark.parametrize("along", ["warp", "weft"])
def test_a_strip_under_490_newtons_a_metre_has_the_extension_of_its_fabric(name, along):
    """Within a tenth: the force is less at .9 of it and more at 1.1, or just below the limit."""
    fabric = FABRICS[name]
    extension, own = getattr(fabric, f"{along}_extension"), getattr(fabric, f"stiffness_along_{along}")
    stiffness = np.sqrt(fabric.stiffness_along_warp * fabric.stiffness_along_weft)
    limit = limit_of_extension(extension, own, stiffness, 0.5)
    most = min(1.1 * extension, limit - 1 - 1e-3 * extension)
    assert force_at(0.9 * extension, fabric, along) < EXTENDED < force_at(most, fabric, along)


def test_threads_that_bear_the_force_alone_have_no_limit_in_any_direction():
    """Only a fabric whose extensions are not known is limited in every direction."""
    positions, triangles = grid(2, 2)
    stiff = replace(FABRICS["cotton"], youngs_modulus=1e3 * FABRICS["cotton"].youngs_modulus)
    world = make_world(
        [cloth(positions, triangles, stiff), make_cloth("soft", positions, triangles, FABRICS["cotton"])]
    )
    limited = strain_limit(world)
    assert len(limited.triangles) == len(triangles)
    assert np.isinf(limited.limits[:, :2]).all()
    assert np.isfinite(limited.limits[:, 2:]).all()
    assert isinstance(strain_limit(make_world([cloth(positions, triangles, stiff)])), Off)


def test_limits_are_beyond_the_extensions_and_absent_where_these_are_not_known():
    for named in FABRICS.values():
        limit = limit_of_extension(named.warp_extension, named.stiffness_along_warp, named.stiffness_along_warp, 0.5)
        assert 1 + named.warp_extension < limit < 1 + 2 * named.warp_extension
    assert limit_of_extension(0.0, 100.0, 100.0, 0.5) == np.inf
    assert limit_of_extension(0.2, 1e4, 1e4, 0.5) == np.inf


@pytest.mark.parametrize(("extension", "own", "stiffness", "begins"), [(0.05, 20.0, 300.0, 0.5), (0.2, 5.0, 40.0, 0.0)])
def test_at_its_extension_a_thread_and_the_barrier_bear_the_force_of_the_test(extension, own, stiffness, begins):
    """By the slope of the barrier (S - s_hat) -y^2 ln(1 - y), whose y is that of the stretch 1 + e."""
    limit = limit_of_extension(extension, own, stiffness, begins)
    begin = 1 + begins * (limit - 1)
    sides = [barrier(1 + extension + step, limit, begin) for step in (1e-7, -1e-7)]
    slope = stiffness * (sides[0] - sides[1]) / 2e-7
    assert own * extension + slope == pytest.approx(EXTENDED, rel=1e-6)


def test_a_cloth_that_shrinks_past_its_limit_is_reported(tmp_path):
    """A strip between clamps that shrinks by more than its limit allows."""
    cloth = {"mesh": "rectangle", "size": [0.3, 0.3], "cells": [3, 3], "youngs_modulus": 1e4}
    cloth["shrinkage_warp"] = [[0.0, 0.0], [0.02, 0.3]]
    effects = {"inertia": {}, "membrane": {}, "strain_limit": {"limit": 1.05}, "pins": {"select": "left"}}
    scene = Scene(cloth=cloth, effects=effects, solver={"dt": 0.01, "linear": "superlu"}, run={"duration": 0.1})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = simulate(scene, tmp_path)
    assert run.status == "failed"
    assert re.search(r"effects\.strain_limit .* of 1\.05", run.reason)
