"""Gradients of runs whose steps remember the ones before: anchors of friction, plastic folds, seams that close."""

from dataclasses import replace

import numpy as np
import pytest
from adjoint_cases import CONTACT, ELASTIC, FALLING, KAPPA, Case, Chain, falling_scene, stacked_scene
from bound_effects import unbound
from differences import _relative
from small_scenes import BALL

from clothsim import Scene
from clothsim.gradients import backward_pass as module
from clothsim.physics.energies.protocols import HistorySensitivity

BAR = 1e-6
SLOW = FALLING | {"velocity": [0.05, 0.02, -0.3]}
HELD = {"friction": {"mu_static": 1.2, "mu_kinetic": 0.9, "elastic_slip": 2e-3}}
TURNING = BALL | {"motion": {"velocity": [0.1, 0.0, 0.0], "rotate_degrees_per_second": [10.0, 30.0, 90.0]}}
FOLDING = {"plastic_bending": {"yield_angle_degrees": 1.0, "hardening": 0.3}}
LENGTHS = (0.02,) * 3 + (0.013,) * 3


def sewn_scene(effects=(), **solver):
    """Two squares that a seam draws together in four steps, one of them pinned."""
    square = {key: FALLING[key] for key in ("mesh", "fabric", "youngs_modulus", "bending_stiffness")}
    square |= {"size": [0.2, 0.2], "cells": [3, 3]}
    other = {"name": "b", "position": [0.25, 0.0, 0.03], "rotation_degrees": [0.0, 20.0, 0.0]}
    seam = {"from": {"cloth": "a", "side": "right"}, "to": {"cloth": "b", "side": "left"}, "start": 0.01, "end": 0.05}
    effects = ELASTIC | dict(effects) | {"seams": {"seam": [seam]}, "pins": {"select": [0, 3]}}
    solver = {"dt": 0.01, "threads": 1, "tolerance": 1e-5, "unstable_equilibrium": "keep"} | solver
    return Scene(cloth=[square | {"name": "a"}, square | other], effects=effects, solver=solver, run={"duration": 0.1})


def friction_scene(body=BALL, **solver):
    return falling_scene(ELASTIC | CONTACT | HELD, SLOW, body, integrator="bdf2", **solver)


def folding_scene(**bending):
    return falling_scene(ELASTIC | CONTACT | {"bending": bending} | FOLDING, integrator="bdf2")


CHAINS = {
    "anchors that hold and slide": (friction_scene, LENGTHS),
    "anchors on a body that turns": (lambda: friction_scene(TURNING), LENGTHS),
    "anchors of cloth on cloth": (lambda: stacked_scene(ELASTIC | CONTACT | HELD, turn=20.0), (0.01, 0.007, 0.01)),
    "folds of hinges": (lambda: folding_scene(model="hinge"), LENGTHS[:6]),
    "folds of triangles": (lambda: folding_scene(short_waves=0.0), LENGTHS[:3]),
    "folds of triangles at three points": (lambda: folding_scene(short_waves=1.0), LENGTHS[:4]),
    "a seam that closes": (lambda: sewn_scene({"self_contact": {"stiffness": KAPPA}}), (0.01, 0.007) * 3 + (0.01,)),
}


@pytest.fixture(scope="module")
def chains():
    return {name: Chain(make(), lengths) for name, (make, lengths) in CHAINS.items()}


@pytest.mark.parametrize("name", CHAINS)
def test_gradients_by_the_start_are_those_of_differences(chains, name):
    made = chains[name]
    adjoints = made.adjoints()
    for values, how in (("positions", "random"), ("velocities", "gradient")):
        assert made.start_error(adjoints, values, how, (1e-7 if values == "velocities" else 2e-8,)) < BAR


def test_anchors_hold_and_slide(chains):
    slides = [np.asarray(each.end.memory["friction"])[:, -1] for each in chains["anchors that hold and slide"].records]
    assert min(np.concatenate(slides)) == 0
    assert max(np.concatenate(slides)) == 1


def test_differences_fall_as_the_square_of_their_step(chains):
    made = chains["anchors that hold and slide"]
    gradient = made.adjoints().velocities
    d = made.along(gradient, "gradient")

    def loss(h):
        return made.loss(replace(made.start, velocities=made.start.velocities + h * d))

    errors = [abs((loss(h) - loss(-h)) / (2 * h) - np.vdot(gradient, d)) for h in (8e-5, 4e-5)]
    assert 3.5 < errors[0] / errors[1] < 4.5


@pytest.mark.parametrize("name", ["anchors that hold and slide", "folds of hinges"])
def test_without_their_memory_they_are_wrong(chains, name, monkeypatch):
    made, right = chains[name], module.seen_past
    monkeypatch.setattr(module, "seen_past", lambda *given: (right(*given)[0], {}))
    assert made.start_error(made.adjoints(), "positions", "random", (1e-8,)) > 10 * BAR


def test_numbers_that_histories_depend_on():
    of_friction, of_folds = (
        Case(friction_scene(), lengths=LENGTHS[:3]),
        Case(folding_scene(model="hinge"), lengths=(0.02,) * 5),
    )
    for key in ("mu_kinetic", "elastic_slip"):
        assert of_friction.error(f"effects.friction.{key}", (1e-5,)) < BAR
    # A loss of 1 with a derivative of -9e-6: its round-off, 1e-15, is 1e-6 of a difference over 1e-4.
    assert of_folds.error("effects.plastic_bending.yield_angle_degrees", (1e-3, 4e-4)) < BAR


@pytest.mark.parametrize(
    ("name", "short_waves"), [("friction", 0.0), ("plastic_bending", 0.0), ("plastic_bending", 1.0)]
)
def test_closed_forms(name, short_waves):
    """By each slot of the step and by the memory, of the force and of what is carried over."""
    keys = {"coefficient": 0.7, "elastic_slip": 0.02} if name == "friction" else None
    energy, step, x = unbound(name, keys, short_waves=short_waves)
    before = energy.begin(step)
    memory = np.asarray(before.carry_over)
    step = replace(step, memory={name: memory}, positions=step.positions + 0.003 * np.sin(7 * step.positions[:, ::-1]))
    rng = np.random.default_rng(1)
    bound = energy.begin(step)
    assert isinstance(bound, HistorySensitivity)
    assert np.asarray(bound.carry_over).size > 10
    a, memory_adjoint = rng.standard_normal(x.shape), rng.standard_normal(np.asarray(bound.carry_over).shape)
    found = bound.history_sensitivity(step, x, a, memory_adjoint)
    for slot in ("positions", "velocities", "memory"):
        part = getattr(found, slot)
        if part is None:
            continue
        part = np.asarray(part)
        directions = rng.standard_normal((3, *part.shape))
        if slot == "memory" and name == "friction":
            directions[:, :, :4] = directions[:, :, -1] = 0.0  # rows, and whether a contact slides
            directions[:, :, 4:8] *= np.abs(memory[:, 4:8]) % 1.0 > 0.0  # a corner that touches stays one

        def power(d, h, slot=slot):
            moved = replace(step, memory={name: memory + h * d}) if slot == "memory" else None
            moved = moved or replace(step, **{slot: getattr(step, slot) + h * d})
            again = energy.begin(moved)
            return np.vdot(a, again.gradient(x)) - np.vdot(memory_adjoint, again.carry_over)

        numeric = np.array([(power(d, 1e-7) - power(d, -1e-7)) / 2e-7 for d in directions])
        assert _relative(slot, np.array([np.vdot(part, d) for d in directions]), numeric) < BAR
