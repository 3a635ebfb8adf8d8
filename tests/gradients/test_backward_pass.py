"""Gradients by the start of chains of steps, against central differences of the chains (G-1, G-3)."""

from dataclasses import replace

import numpy as np
import pytest
from adjoint_cases import (
    CONTACT,
    ELASTIC,
    FALLING,
    FRICTION,
    STEADY,
    VARYING,
    Chain,
    best_error,
    falling_scene,
    mollified_pairs,
    stacked_scene,
    stepped,
)

from clothsim.gradients import backward_pass as module
from clothsim.gradients import parameters
from clothsim.gradients.exact_system import ExactSystem, NoMinimumError
from clothsim.physics.contact import friction

BAR, WITH_FRICTION = 1e-6, 1e-5


def chain(friction, formula, lengths=STEADY):
    effects = ELASTIC | CONTACT | (FRICTION if friction else {})
    return Chain(falling_scene(effects, integrator=formula), lengths)


@pytest.fixture(scope="module")
def with_friction():
    return chain(True, "bdf2", VARYING)


@pytest.mark.parametrize("friction", [False, True])
@pytest.mark.parametrize(("formula", "lengths"), [("backward_euler", STEADY), ("bdf2", VARYING)])
def test_gradients_by_the_start_are_those_of_differences(friction, formula, lengths):
    made = chain(friction, formula, lengths)
    contact = made.session.built.energies["body_contact"]
    assert contact.distinct(made.records[-1].solution).n_points > 3
    adjoints = made.adjoints()
    bar = WITH_FRICTION if friction else BAR
    assert made.start_error(adjoints, "positions", "random") < bar
    assert made.start_error(adjoints, "positions", "gradient") < bar
    assert made.start_error(adjoints, "velocities", "gradient") < bar


def test_remainder_is_of_second_order(with_friction):
    made = with_friction
    gradient = made.adjoints().velocities
    d = made.along(gradient, "random")
    base, slope = made.loss(), float(np.vdot(gradient, d))
    sizes = (4e-5, 2e-5, 1e-5)
    left = [
        abs(made.loss(replace(made.start, velocities=made.start.velocities + h * d)) - base - h * slope) for h in sizes
    ]
    assert 1.8 < np.log2(left[0] / left[2]) / 2 < 2.2


def test_one_step_and_more_steps():
    for lengths in ((0.02,), (0.01,) * 12):
        made = chain(True, "backward_euler", lengths)
        made.start = replace(made.start, positions=made.records[-1].end.positions)  # in contact from the start
        made.records = stepped(made.integrator, made.start, lengths)
        assert made.start_error(made.adjoints(), "positions", "gradient") < WITH_FRICTION


STACKS = {
    "nearly parallel edges": {"turn": 0.3, "shift": (0.0005, 0.0003)},
    "closest features that change nearby": {"turn": 5.0},
    "at an angle": {"turn": 40.0},
}


@pytest.mark.parametrize("friction", [False, True])
@pytest.mark.parametrize("stack", STACKS)
def test_cloth_on_cloth(stack, friction):
    effects = ELASTIC | CONTACT | (FRICTION if friction else {})
    made = Chain(stacked_scene(effects, **STACKS[stack], integrator="bdf2"), (0.01, 0.007, 0.01, 0.006, 0.008))
    if stack == "nearly parallel edges":
        assert mollified_pairs(made) > 40
    adjoints, bar = made.adjoints(), WITH_FRICTION if friction else BAR
    for name, how in (("positions", "random"), ("positions", "gradient"), ("velocities", "gradient")):
        assert made.start_error(adjoints, name, how) < bar


def test_twenty_steps():
    made = Chain(stacked_scene(turn=5.0, integrator="bdf2"), (0.01,) * 20)
    assert made.start_error(made.adjoints(), "positions", "gradient") < WITH_FRICTION


def without_inverse(self, forces):
    out = np.zeros_like(forces)
    out[: len(self.free)] = np.where(self.free[:, None], forces[: len(self.free)], 0.0)
    return out


def of_the_past(self, forces):
    """Solve with dG/dx_n = -M/h^2 in place of H."""
    inertia = self.hessians[0]
    return -without_inverse(self, forces) / inertia.blocks[0, 0, 0]


def equal_weights(record, integrator):
    return (1.0, 0.0) if record.formula(integrator).order == 1 else (4 / 3, 1 / 3)


MUTATIONS = {
    "no inverse": (ExactSystem, "solve", without_inverse),
    "dG/dx_n for the Hessian": (ExactSystem, "solve", of_the_past),
    "no lag": (friction, "by_lag", lambda at, *others: np.zeros_like(at)),
    "no -lv/dt": (module, "velocity_part", lambda v, dt: 0 * v),
    "BDF2 of equal steps": (module, "past_weights", equal_weights),
}


@pytest.mark.parametrize("mutation", MUTATIONS)
def test_wrong_formulas_fail(with_friction, mutation, monkeypatch):
    monkeypatch.setattr(*MUTATIONS[mutation])
    adjoints = with_friction.adjoints()
    errors = [with_friction.start_error(adjoints, name, "random", (3e-8,)) for name in ("positions", "velocities")]
    assert max(errors) > 10 * WITH_FRICTION


def test_the_projected_hessian_fails(with_friction, monkeypatch):
    made = with_friction
    energies = made.integrator.potential.energies
    for kind in {type(energy) for energy in energies.values()}:
        exact = kind.hessian
        monkeypatch.setattr(kind, "hessian", lambda self, x, project=True, exact=exact: exact(self, x, True))
    assert made.start_error(made.adjoints(), "positions", "random", (3e-8,)) > 10 * WITH_FRICTION


def test_an_adaptive_stiffness_held_in_the_adjoint_only_fails():
    made = chain(False, "backward_euler")
    energies = dict(made.integrator.potential.energies)
    energies |= {name: replace(energies[name], adaptive=True) for name in CONTACT}
    adaptive = replace(made.integrator, potential=replace(made.integrator.potential, energies=energies))
    made.records = stepped(adaptive, made.start, made.lengths)
    held = [record.end.memory["body_contact"] for record in made.records]
    assert len(set(held)) > 1
    largest = {name: replace(energies[name], adaptive=False, stiffness=max(held)) for name in CONTACT}
    made.integrator = replace(
        made.integrator, potential=replace(made.integrator.potential, energies=energies | largest)
    )
    assert made.start_error(made.adjoints(), "positions", "random", (3e-8,), integrator=adaptive) > 10 * BAR


def test_a_free_sheet_at_rest_has_no_derivative():
    effects = {"membrane": {}, "bending": {"model": "hinge"}}
    exact = {
        "size": [0.5, 0.5],
        "cells": [4, 4],
        "position": [0.0] * 3,
        "rotation_degrees": [0.0] * 3,
        "velocity": [0.0] * 3,
    }
    made = Chain(
        falling_scene(effects, FALLING | exact, body=()), (0.02,)
    )  # halves and quarters: no force of round-off
    with pytest.raises(NoMinimumError):
        made.adjoints()


def test_differences_have_orders():
    assert sum(weight * offset for offset, weight in parameters.SECOND_ORDER) == pytest.approx(1)
    assert sum(weight * offset**3 for offset, weight in parameters.FOURTH_ORDER) == pytest.approx(0)


@pytest.mark.parametrize("friction", [False, True])
def test_quasi_static_steps(friction):
    """A sheet that hangs from two corners in contact with a ball: by pins and loads, and by the start with friction."""
    effects = {name: keys for name, keys in (ELASTIC | CONTACT).items() if name != "inertia"}
    effects |= {"pins": {"select": [0, 5]}} | (FRICTION if friction else {})
    cloth = FALLING | {"velocity": [0.0, 0.0, 0.0], "position": [0.0, 0.0, 0.31], "rotation_degrees": [2.0, 1.0, 5.0]}
    made = Chain(falling_scene(effects, cloth), (0.04,) * 3)
    adjoints = made.adjoints()
    if friction:
        assert made.start_error(adjoints, "positions", "gradient") < WITH_FRICTION
    else:
        assert np.abs(adjoints.start[: made.n]).max() < 1e-12 * np.abs(adjoints.forces).max()
    gravity = made.integrator.potential.energies["gravity"]
    direction = np.array([0.4, -0.3, 1.0])
    loads = np.array([record.step(made.integrator).load for record in made.records])
    slope = float(np.einsum("k,knc,n,c->", loads, adjoints.forces, gravity.masses, direction))

    def loss(h):
        energies = dict(made.integrator.potential.energies)
        energies["gravity"] = replace(gravity, acceleration=gravity.acceleration + h * direction)
        return made.loss(
            integrator=replace(made.integrator, potential=replace(made.integrator.potential, energies=energies))
        )

    assert best_error(slope, loss, (1e-3, 1e-4, 1e-5)) < WITH_FRICTION
