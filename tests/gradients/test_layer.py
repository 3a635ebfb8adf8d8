"""The layer: steps as functions of a state and of parameters, against central differences with h halved."""

from pathlib import Path

import numpy as np
import pytest
from adjoint_cases import CONTACT, ELASTIC, FALLING, falling_scene, halved_errors

import clothsim
from clothsim.base.errors import InputError
from clothsim.gradients.layer import LayerState

FRICTION = {"friction": {"coefficient": 0.5}}
STRIP = FALLING | {"size": [0.3, 0.1], "cells": [3, 1], "position": [0.0, 0.0, 0.0], "velocity": [0.1, 0.0, 0.3]}
HUNG = ELASTIC | {"pins": {"select": [0, 4]}, "fibres": {"warp": 20.0}}


@pytest.fixture(scope="module")
def strip():
    return clothsim.layer(falling_scene(HUNG, STRIP, body=(), integrator="bdf2", dt=0.01))


@pytest.fixture(scope="module")
def landing():
    """A sheet that has met a ball: in contact with friction by anchors."""
    return clothsim.layer(falling_scene(ELASTIC | CONTACT | FRICTION, integrator="bdf2"))


def weights(shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


def test_a_step_without_a_past_in_contact_with_friction(landing):
    state = landing.rollout(landing.start, None, 4).states[-1]
    x, v = state.x, state.v
    assert isinstance(state, LayerState)
    by_x, by_v = weights(x.shape), 0.02 * weights(x.shape, 1)
    found = landing.vjp(x, v, by_x, by_v)
    assert found[2] == {}

    def loss(x, v):
        end = landing(x, v)
        return np.vdot(by_x, end[0]) + np.vdot(by_v, end[1])

    d = weights(x.shape, 2)
    assert halved_errors(np.vdot(found[0], d), lambda h: loss(x + h * d, v), 1e-7)[1] < 1e-6
    coarse, fine = halved_errors(np.vdot(found[1], d), lambda h: loss(x, v + h * d), 2e-4)
    assert fine < 1e-4
    assert 3.0 < coarse / fine < 5.0


def test_a_rollout_of_16_steps(strip):
    n, start = len(strip.start.x), strip.start
    pins = start.x[strip.pinned] + [0.0, 0.01, 0.005]
    at = {
        "cloth.youngs_modulus": np.array(8e4),
        "effects.fibres.warp": 10.0 + np.arange(6.0),  # a number for each triangle
        "pins": pins,
        "force": 1e-3 * weights((n, 3), 3),
    }
    rollout = strip.rollout(start, at, 16)
    by_x, by_v = weights(rollout.x.shape), 0.02 * weights(rollout.x.shape, 1)
    by_start, by = rollout.vjp(by_x, by_v)

    given = at | {"x": start.x, "v": start.v}
    by = by | {"x": by_start.positions[:n], "v": by_start.velocities[:n]}
    directions = {name: weights(np.shape(value), 4) for name, value in given.items()}
    # each part of the loss's change is 1, so that none hides another
    directions = {name: d / np.vdot(by[name], d) for name, d in directions.items()}

    def loss(h):
        moved = {name: value + h * directions[name] for name, value in given.items()}
        again = strip.rollout(strip.state(moved.pop("x"), moved.pop("v")), moved, 16)
        return np.vdot(by_x, again.x) + np.vdot(by_v, again.v)

    assert halved_errors(float(len(given)), loss, 1e-5)[1] < 1e-6


def test_rest_positions(strip):
    start, d = strip.start, weights(strip.start.x.shape, 1)
    d[:, 2] = 0.0
    by_x = weights((4, *d.shape))
    rest = strip.session.built.world.cloths[0].rest_positions

    def rollout(h):
        return strip.rollout(start, {"cloth.rest": rest + h * d}, 3)

    found = rollout(0.0).vjp(by_x)[1]["cloth.rest"]
    assert halved_errors(np.vdot(found, d), lambda h: np.vdot(by_x, rollout(h).x), 1e-6)[1] < 1e-6


def test_steps_with_parameters_of_their_own_and_steps_one_by_one(landing):
    """What remembers (the step before, anchors) is taken over: two rollouts of two steps are one of four."""
    forces = 1e-3 * weights((4, *landing.start.x.shape))
    given = [{"force": force} for force in forces]
    state = landing.rollout(landing.start, None, 3).states[-1]
    whole, first = landing.rollout(state, given, 4), landing.rollout(state, given[:2], 2)
    second = landing.rollout(first.states[-1], given[2:], 2)
    assert np.array_equal(whole.x[-1], second.x[-1])
    by_x, by_v = weights(whole.x.shape), 0.02 * weights(whole.x.shape, 1)
    by_start, by = whole.vjp(by_x, by_v)
    by_middle, by_second = second.vjp(by_x[2:], by_v[2:])
    none = np.zeros_like(by_x[:1])
    again, by_first = first.vjp(*(np.concatenate([each[:2], none]) for each in (by_x, by_v)), by_end=by_middle)
    assert "friction" in by_middle.memory
    np.testing.assert_allclose(again.positions, by_start.positions, rtol=1e-9, atol=1e-9 * abs(by_x).max())
    for one, other in zip(by, [*by_first, *by_second], strict=True):
        np.testing.assert_allclose(one["force"], other["force"], rtol=1e-9, atol=1e-9 * np.abs(one["force"]).max())

    def loss(h):
        pushed = landing.rollout(state, [given[0], {"force": forces[1] + h * forces[0]}, *given[2:]], 4)
        return float(np.vdot(by_x, pushed.x) + np.vdot(by_v, pushed.v))

    assert halved_errors(np.vdot(by[1]["force"], forces[0]), loss, 1e-3)[1] < 1e-6


def test_what_is_no_parameter(strip):
    start = strip.start
    for wrong in (
        {"cloth.mesh": 1.0},
        {"pins": np.zeros((3, 3))},
        {"force": np.zeros((3, 3))},
        {"solver.dt": 0.1},
        [{}] * 3,
    ):
        with pytest.raises(InputError):
            strip.rollout(start, wrong, 2)
    for x in (start.x[:3], np.full_like(start.x, np.nan)):
        with pytest.raises(InputError):
            strip.state(x, start.v)
    with pytest.raises(InputError):
        strip.rollout(start, None, 2).vjp(np.zeros((2, 8, 3)))
    with pytest.raises(InputError, match="adjoint_v"):
        strip.vjp(start.x, start.v, start.x, start.v[:3])


def test_the_training_loop_of_the_docs_in_small(capsys):
    page = (Path(__file__).parents[2] / "docs" / "howto" / "layer.md").read_text(encoding="utf-8")
    program = next(block for block in page.split("```python") if "minimize(" in block).split("```")[0]
    small = program.replace('"maxiter": 12', '"maxiter": 1').replace('"cells": [4, 4]', '"cells": [3, 3]')
    small = small.replace('"select": [4, 24]', '"select": [3, 15]').replace(
        "steps, drop, held = 16", "steps, drop, held = 8"
    )
    assert small.count("\n") < 30
    exec(compile(small, "layer.md", "exec"), made := {})
    off = [float(line.split()[0]) for line in capsys.readouterr().out.splitlines()]
    assert len(off) > 1
    assert off[-1] < 0.7 * off[0]
    assert made["learned"].fun < 0.5 * made["loss"](np.zeros(8))[0]


@pytest.mark.parametrize(
    ("state", "parameters", "k"),
    [
        ("text", None, 1),
        (None, None, 1),
        (..., None, -1),
        (..., None, 1.5),
        (..., None, "two"),
        (..., "text", 1),
        (..., 3.0, 1),
        (..., [None], 1),
        (..., {"cloth.youngs_modulus": "soft"}, 1),
        (..., {"cloth.youngs_modulus": np.nan}, 1),
        (..., {3: 1.0}, 1),
    ],
)
def test_bad_input_of_a_rollout(strip, state, parameters, k):
    with pytest.raises(InputError):
        strip.rollout(strip.start if state is ... else state, parameters, k)


def test_a_layer_is_of_a_scene(strip):
    for wrong in ("scene.toml", None, {"cloth": {}}):
        with pytest.raises(InputError):
            clothsim.layer(wrong)
    with pytest.raises(InputError, match="by_x"):
        strip.rollout(strip.start, None, 1).vjp("text")
    with pytest.raises(InputError, match="time"):
        strip.state(strip.start.x, strip.start.v, "now")


def test_far_from_the_origin_a_position_is_a_parameter_as_well():
    """Pins and cloth that move along: what the layer finds 300 m away is what it finds at home."""

    def found(far):
        place = np.array([far, 0.0, 0.0])
        made = clothsim.layer(falling_scene(HUNG, STRIP | {"position": place.tolist()}, body=(), integrator="bdf2"))
        moved = {"cloth.position": place + np.array([0.0, 0.0, 0.01])}
        rollout = made.rollout(made.start, moved, 3)
        rollout = made.rollout(rollout.states[-1], None, 2)
        by_x = weights(rollout.x.shape)
        return rollout.x - place, made.rollout(made.start, moved, 3).vjp(weights((4, *by_x.shape[1:])))[1]

    (near, by_near), (far, by_far) = found(0.0), found(300.0)
    assert np.abs(far - near).max() < 1e-9
    np.testing.assert_allclose(by_far["cloth.position"], by_near["cloth.position"], rtol=1e-4, atol=1e-4)
