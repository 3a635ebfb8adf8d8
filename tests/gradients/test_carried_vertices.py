"""Gradients of runs in which a body carries cloth through a pinch: two plates that close on a sheet and open again."""

from dataclasses import replace

import numpy as np
import pytest
from adjoint_cases import KAPPA, best_error, differentiable, halved_errors

import clothsim
from clothsim.base.errors import ClothsimError
from clothsim.gradients import backward_pass as module
from clothsim.gradients.differentiable_session import replayed
from clothsim.gradients.exact_system import NoMinimumError
from clothsim.gradients.losses import Custom
from clothsim.gradients.parameters import value_at, with_value
from clothsim.gradients.run import traced
from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.generators.shapes import slab
from clothsim.scene.assembly.scene_world import build
from clothsim.solve.pinch.flypaper import HeldChoices
from clothsim.solve.stepping.state import first_state

BAR = 1e-6
FRICTION = {
    "none": {},
    "creeping": {"friction": {"coefficient": 0.3, "eps_v": 2e-2}},
    "with anchors": {"friction": {"coefficient": 0.3, "elastic_slip": 2e-3}},
}


def jaws(frames=7):
    """Positions of two plates that cross by 4 mm, turn, swell and slide meanwhile, and their triangles."""
    plate, triangles = slab((0.12, 0.12, 0.02), (3, 3, 1))
    both = []
    for part in 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(frames) / (frames - 1)):
        height = np.array([0.0, 0.0, 0.015 * (1 - part) - 0.002 * part + 0.01])
        upper = (1 + 0.1 * part) * plate @ rotation_matrix(np.array([0.0, 0.1 * part, 0.0])).T
        slid = part * np.array([0.01, 0.005, 0.0])
        both.append(np.concatenate([upper + height + slid, (1 - 0.1 * part) * plate - height]))
    return np.array(both), np.concatenate([triangles, triangles + len(plate)])


def pinched_scene(friction="none", displaced=0.0):
    """49 vertices, pinned at the corners; displaced: of the vertices of the plates at all times [m]."""
    frames, triangles = jaws()
    frames = frames + displaced
    sheet = {"mesh": "rectangle", "size": [0.2, 0.2], "cells": [6, 6], "rotation_degrees": [1.0, 2.0, 3.0]}
    fabric = {"youngs_modulus": 2e4, "bending_stiffness": 1e-4, "density": 0.2, "velocity": [0.1, 0.05, 0.0]}
    contact = {"d_hat": 4e-3, "stiffness": KAPPA}
    effects = {"inertia": {}, "membrane": {}, "bending": {"model": "hinge"}, "gravity": {}, "damping": {"rate": 2.0}}
    effects |= {"body_contact": contact, "self_contact": contact, "pins": {"select": "corners"}} | FRICTION[friction]
    return clothsim.Scene(
        cloth=sheet | fabric,
        body=clothsim.Body(frames[0], triangles, name="jaws", frames=frames, frames_per_second=25),
        effects=effects,
        contact={"pinch": "carry"},
        solver={"dt": 0.01, "threads": 1, "linear": "superlu", "tolerance": 1e-5},
        run={"duration": 0.28, "frames_per_second": 25},
    )


class Pinched:
    """A run with a random linear loss of its end, its gradient, and runs that repeat its steps."""

    def __init__(self, friction):
        self.scene = pinched_scene(friction)
        self.trace = traced(self.scene)
        self.integrator, self.n = self.trace.session.integrator, self.trace.session.built.world.n_cloth
        self.start, self.random = self.trace.steps[0].start, np.random.default_rng(0)
        self.by = self.random.standard_normal((self.n, 3))
        self.along = np.zeros_like(self.start.positions)
        self.along[: self.n] = self.random.standard_normal((self.n, 3))
        self.along[self.gradient().pinned] = 0.0

    def gradient(self):
        return self.trace.gradient(Custom(lambda x: (float(np.vdot(self.by, x)), self.by)))

    def slope(self):
        """Derivative along the displacement of the start."""
        return float(np.vdot(self.gradient()["start"], self.along[: self.n]))

    def repeated(self, h=0.0, integrator=None, start=None):
        """Loss of the steps repeated with their choices, the start displaced by h."""
        start = start or self.start
        start = replace(start, positions=start.positions + h * self.along)
        end = replayed(integrator or self.integrator, start, self.trace.steps)[-1].end
        return float(np.vdot(self.by, end.positions[: self.n]))

    def of_world(self, h, field):
        """That with the plates' vertices moved by h and a field, the energies held."""
        world = build(pinched_scene(displaced=h * field)).world
        return self.repeated(integrator=replace(self.integrator, world=world), start=first_state(world, 0.01))

    def of_value(self, path, value):
        """Loss of a run of its own with another number."""
        x = traced(with_value(self.scene, path, np.asarray(value))).cloth_positions()
        return float(np.vdot(self.by, x))


@pytest.fixture(scope="module")
def runs():
    return {friction: Pinched(friction) for friction in FRICTION}


def test_vertices_are_held_by_both_parts_raised_and_released(runs):
    carried = [step for step in runs["none"].trace.steps if step.carried is not None]
    choices = [HeldChoices.of(step.start, step.carried) for step in carried]
    assert len(carried) > 8
    assert runs["none"].trace.steps[-1].carried is None
    assert any(one.of_far.any() for one in choices)
    assert any(((one.before < 0) & ~one.of_far).any() for one in choices)
    assert any((one.rises == 1).any() for one in choices)
    assert {step.carried.widening for step in carried} == {1.0, 2.0}


def test_repeated_steps_end_where_they_did(runs):
    for made in runs.values():
        end = made.trace.steps[-1].end.positions[: made.n]
        assert made.repeated() == pytest.approx(float(np.vdot(made.by, end)), abs=1e-11)


@pytest.mark.parametrize("friction", FRICTION)
def test_gradients_by_the_start_are_those_of_differences(runs, friction):
    made = runs[friction]
    assert best_error(made.slope(), made.repeated, (1e-7, 5e-8, 2.5e-8)) < BAR


def test_differences_fall_as_the_square_of_their_step(runs):
    errors = halved_errors(runs["none"].slope(), runs["none"].repeated, 1e-6)
    assert 3.5 < errors[0] / errors[1] < 4.5


@pytest.mark.parametrize("friction", ["none", "creeping"])
@pytest.mark.parametrize("path", ["cloth.youngs_modulus", "cloth.density", "effects.body_contact.d_hat"])
def test_gradients_by_numbers_are_those_of_runs_that_choose_anew(runs, friction, path):
    made = runs[friction]
    value = float(value_at(made.scene, made.trace.session.built.world, path))
    slope = float(made.gradient()[path])
    sizes = [size * value for size in (2e-6, 1e-6, 5e-7)]
    assert best_error(slope, lambda h: made.of_value(path, value + h), sizes) < BAR


def body_field(made):
    return np.random.default_rng(3).standard_normal((len(made.trace.session.built.world.bodies[0].positions), 3))


@pytest.mark.parametrize("friction", ["none", "creeping"])
def test_gradients_by_the_vertices_of_the_body(runs, friction):
    made = runs[friction]
    field = body_field(made)
    slope = float(np.vdot(made.gradient()["body.jaws.vertices"], field))
    assert best_error(slope, lambda h: made.of_world(h, field), (2e-8, 1e-8, 5e-9)) < BAR


def without(part):
    """`carried_back` that drops what it passes on."""
    right = module.carried_back

    def wrong(record, held, memory):
        found, nothing = right(record, held, memory), {"memory": {}}.get(part)
        if part == "prescribed":  # dropped in the rows that follow, not passed on
            nothing = np.where(held == found.prescribed, held, 0.0)
        return replace(found, **{part: np.zeros_like(getattr(found, part)) if nothing is None else nothing})

    return wrong


@pytest.mark.parametrize("part", ["positions", "memory", "prescribed", "limit"])
def test_what_is_not_passed_on_is_missed(runs, part, monkeypatch):
    made = runs["none"]
    field, path = body_field(made), "effects.body_contact.d_hat"

    def slope():
        gradient = made.gradient()
        if part == "prescribed":
            return float(np.vdot(gradient["body.jaws.vertices"], field))
        return float(gradient[path]) if part == "limit" else made.slope()

    right = slope()
    monkeypatch.setattr(module, "carried_back", without(part))
    assert abs(slope() - right) > 1e3 * BAR * abs(right)


def test_with_the_excluded_contact_its_steps_end_at_no_minimum(runs, monkeypatch):
    monkeypatch.setattr("clothsim.solve.pinch.pinch.masked", lambda energies, exclusion: energies)
    with pytest.raises(NoMinimumError):
        runs["creeping"].slope()


def test_of_a_step_that_was_shortened_only_the_body_has_no_derivative(runs):
    made = runs["none"]
    steps = list(made.trace.steps)
    first = next(k for k, step in enumerate(steps) if step.carried is not None)
    held = replace(steps[first].carried, ahead=steps[first].end.time + 0.01)
    steps[first] = replace(steps[first], carried=held)
    gradient = replace(made.trace, steps=tuple(steps)).gradient(Custom(lambda x: (float(np.vdot(made.by, x)), made.by)))
    for name in ("start", "pins", "cloth.youngs_modulus", "effects.body_contact.d_hat"):
        assert np.isfinite(gradient[name]).all()
    for name in ("vertices", "position", "turn"):
        with pytest.raises(ClothsimError):
            gradient[f"body.jaws.{name}"]


@pytest.mark.parametrize("name", ["cloth.youngs_modulus", "positions"])
def test_steps_of_a_layer(name):
    """From a state before the pinch to one in it, by the start and by a number."""
    layer = clothsim.layer(pinched_scene("creeping"))
    before = layer.rollout(layer.start, {}, 6).states[-1]
    random = np.random.default_rng(1)
    by, along = (random.standard_normal(before.x.shape) for _ in range(2))
    along[layer.pinned] = 0.0

    def rollout(h):
        if name == "positions":
            inner = before.inner
            x = inner.positions.copy()
            x[: before.n] += h * along
            return layer.rollout(replace(before, inner=replace(inner, positions=x)), {}, 5)
        return layer.rollout(before, {name: 2e4 * (1 + h)}, 5)

    rolled = rollout(0.0)
    assert any(step.carried is not None for step in rolled.steps)
    by_x = np.zeros_like(rolled.x)
    by_x[-1] = by
    state, numbers = rolled.vjp(by_x)
    slope = np.vdot(state.positions[: before.n], along) if name == "positions" else 2e4 * numbers[name]
    assert best_error(float(slope), lambda h: float(np.vdot(by, rollout(h).x[-1])), (1e-6, 1e-7, 3e-8)) < BAR


def test_a_pilot_run_holds_the_stiffness():
    scene = pinched_scene()
    effects = {
        name: {**keys, "stiffness": "auto"} if name == "body_contact" else keys for name, keys in scene.effects.items()
    }
    held = differentiable(replace(scene, effects=effects)).built.energies["body_contact"]
    assert held.stiffness > 0.0
