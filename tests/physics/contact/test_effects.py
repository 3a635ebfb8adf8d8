"""Contact effects of a scene: keys, refusals, defaults, and the offset."""

from dataclasses import replace

import numpy as np
import pytest
from contacts import ball, sheet, sheet_on_ball, two_sheets
from effect_builders import body_contact, friction, gravity, inertia, membrane, pins, self_contact
from meshes import cloth, grid
from solving import integrator_of, run_of, step_at

import clothsim
from clothsim.base.errors import InputError
from clothsim.mesh.world import make_world
from clothsim.physics.contact import barrier
from clothsim.physics.contact.barrier import MAX_PREDICTED_PAIRS
from clothsim.physics.energies.base import Off


@pytest.mark.parametrize("builder", [body_contact, self_contact])
@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"d_hat": -1.0}, r"contact\.d_hat .*-1"),
        ({"offset": -1.0}, r"contact\.offset .*-1"),
        ({"stiffness": 0.0}, r"contact\.stiffness .* 0"),
        ({"exclude": "sheet"}, r"contact\.exclude .*'sheet'"),
        ({"exclude": [["sheet"]]}, r"contact\.exclude\[0\] .*'sheet'"),
        ({"exclude": [["sheet", "moon"]]}, r"exclude\[0\].*'moon'.*sheet, ball"),
    ],
)
def test_bad_keys_are_refused_by_name(builder, keys, words):
    with pytest.raises(InputError, match=words):
        builder(sheet_on_ball(), **keys)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"coefficient": -0.1}, r"friction\.coefficient .*-0\.1"),
        ({"eps_v": 0}, r"friction\.eps_v .* 0"),
        ({"elastic_slip": 0}, r"friction\.elastic_slip .* 0"),
        ({"eps_v": 1e-3, "elastic_slip": 1e-6}, r"eps_v and elastic_slip"),
        ({"eps_v": 1e-3, "mu_static": 0.4}, r"eps_v and .* mu_static"),
        ({"mu_static": -0.1}, r"friction\.mu_static .*-0\.1"),
        ({"mu_static": 0.1, "mu_kinetic": 0.2}, r"mu_kinetic is 0\.2, .*mu_static, 0\.1"),
        ({"pairs": [["sheet", "ball", 0.1, 0.2]]}, r"pairs\[0\].*0\.2, .*0\.1"),
        ({"iterations": 0}, r"friction\.iterations .* 0"),
        ({"pairs": [["sheet", "moon", 0.1]]}, r"pairs\[0\].*'moon'.*sheet, ball"),
        ({"pairs": [["sheet", "ball"]]}, r"pairs\[0\] .*'sheet', 'ball'"),
    ],
)
def test_bad_keys_of_friction_are_refused_by_name(keys, words):
    with pytest.raises(InputError, match=words):
        friction(sheet_on_ball(), contacts=("body_contact",), **keys)


def test_effects_without_a_pair_are_off_with_a_reason():
    world = sheet_on_ball()
    assert friction(world) == Off("the scene has no contact")
    assert friction(world, coefficient=0.0, contacts=("body_contact",)) == Off("every coefficient is 0")
    assert body_contact(world, exclude=[["sheet", "ball"]]) == Off("every pair is excluded")
    assert self_contact(world, exclude=[["sheet", "sheet"]]) == Off("every pair is excluded")


def test_a_coefficient_for_each_pair_of_names():
    world = make_world([sheet(0.5), sheet(0.8, "other")], [ball()])
    made = friction(world, coefficient=0.3, pairs=[["sheet", "ball", 0.1], ["other", "sheet", 0]], contacts=("x",))
    expected = np.full((3, 3), 0.3)
    expected[0, 2] = expected[2, 0] = 0.1
    expected[0, 1] = expected[1, 0] = 0.0
    assert np.array_equal(made.static, expected)
    assert np.array_equal(made.kinetic, expected)


def test_intersecting_cloths_are_refused_by_name():
    crossed = make_world([sheet(0.0), sheet(0.0, "other")])
    with pytest.raises(InputError, match=r"^sheet .* other"):
        self_contact(crossed)
    assert self_contact(crossed, exclude=[["sheet", "other"]]).value(crossed.start()) >= 0.0


def test_start_within_the_offset_is_refused():
    world = two_sheets(gap=0.01)
    with pytest.raises(InputError, match=r"0\.01 m .*0\.02 m"):
        self_contact(world, d_hat=0.01, offset=0.02)


@pytest.mark.parametrize("offset", [0.0, 0.02])
def test_falling_sheet_stays_above_the_offset_of_a_pinned_one(offset):
    """Between sheets: the gap is the distance less the offset, and never negative."""
    world = two_sheets(gap=0.06, cells=3)
    low = np.arange(world.cloth_slices[0].start, world.cloth_slices[0].stop)
    world, held = pins(world, select=low.tolist())
    energies = {
        "inertia": inertia(world),
        "membrane": membrane(world),
        "gravity": gravity(world),
        "self_contact": self_contact(world, d_hat=0.01, offset=offset),
    }
    reports = run_of(integrator_of(world, energies, 0.02, {"pins": held}), 0.6, 10)
    high = reports[-1].state.positions[world.cloth_slices[1], 2]
    assert offset < high.min() < high.max() < offset + 0.011
    assert min(report.minimum_gap for report in reports) > 0


def test_couplings_predict_the_active_pairs():
    world = two_sheets(gap=0.06, cells=3)
    energy, x = self_contact(world, d_hat=0.01), world.start()
    down, high = np.zeros_like(x), world.cloth_slices[1]
    assert not len(energy.couplings(x, down))
    down[high, 2] = -0.055
    expected = energy.couplings(x, down)
    assert np.array_equal(expected, energy.candidates.active(x + down).elements)
    assert len(expected)
    down[high, 2] = -0.12  # through the other sheet: active on the path
    assert len(energy.couplings(x, down)) >= len(expected)
    world = sheet_on_ball()
    assert not len(body_contact(world).couplings(world.start(), -world.start()))  # a body's vertices are no unknowns


def test_couplings_ignore_common_and_long_displacements():
    world = two_sheets(gap=0.06, cells=3)
    energy, x = self_contact(world, d_hat=0.01), world.start()
    down, high = np.zeros_like(x), world.cloth_slices[1]
    down[high, 2] = -0.055
    expected, common = energy.couplings(x, down), np.array([5.0, 0.0, 0.0])
    assert len(expected)
    assert np.array_equal(energy.couplings(x, down + common), expected)
    world = two_sheets(gap=10.0, cells=3)
    energy, x = self_contact(world, d_hat=0.01), world.start()
    assert not len(energy.couplings(x, 400.0 * down))


def test_couplings_of_many_closing_layers_are_bounded(monkeypatch):
    world = make_world([sheet(0.05 * k, f"sheet {k}", 8) for k in range(12)], [])
    energy, x = self_contact(world, d_hat=0.01), world.start()
    down = -x * np.array([0.0, 0.0, 0.9])
    few = energy.couplings(x, down)
    assert len(few) <= MAX_PREDICTED_PAIRS * len(x)
    monkeypatch.setattr(barrier, "MAX_PREDICTED_PAIRS", np.inf)
    assert len(energy.couplings(x, down)) > 2 * MAX_PREDICTED_PAIRS * len(x)


def test_default_d_hat_is_below_the_rest_gaps_of_slivers():
    """200 x 10 mm cells: a tenth of the median edge is more than the slivers' height."""
    positions, triangles = grid(2, 40, 0.4, 0.4)
    world = make_world([cloth(positions, triangles)])
    contact = self_contact(world)
    assert contact.value(world.start()) == 0.0
    assert contact.d_hat < 0.01


def test_friction_uses_the_stiffness_of_the_previous_step():
    world = sheet_on_ball()
    contact = body_contact(world, d_hat=0.06, stiffness=7.0)
    made = friction(world, contacts=("body_contact",))
    step = replace(step_at(world.start()), time=1.0, bound={"body_contact": contact})
    own = made.begin(step).limits
    before = made.begin(replace(step, memory={"body_contact": 2.0})).limits
    assert len(own)
    assert before == pytest.approx(own * 2.0 / 7.0, rel=1e-12)


def test_pairs_of_friction_are_counted_in_the_summary(tmp_path):
    scene = clothsim.Scene(
        cloth={"mesh": "rectangle", "size": [0.2, 0.2], "cells": [3, 3], "position": [0, 0, 0.0525]},
        body={"mesh": "slab", "size": [1, 1, 0.1]},
        effects={"inertia": {}, "membrane": {}, "gravity": {}, "body_contact": {"d_hat": 5e-3}, "friction": {}},
        solver={"dt": 0.02, "linear": "superlu"},
        run={"duration": 0.06, "frames_per_second": 50},
    )
    effects = clothsim.simulate(scene, tmp_path).summary["effects"]
    assert effects["body_contact"]["pairs"] >= effects["friction"]["pairs"] > 0
