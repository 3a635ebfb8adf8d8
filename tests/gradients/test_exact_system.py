"""Polishing of steps: to round-off, and down from beside a saddle."""

from dataclasses import replace

import numpy as np
import pytest
from adjoint_cases import ELASTIC, FALLING, Chain, falling_scene, stepped

from clothsim.gradients import exact_system
from clothsim.gradients.differentiable_session import bound_to, free_rows
from clothsim.gradients.exact_system import NoMinimumError


def pressed(amplitude):
    """A nearly flat strip, pressed by 3 % along its plane in three steps: Newton's method ends beside a saddle."""
    strip = FALLING | {"size": [0.6, 0.1], "cells": [12, 2], "position": [0, 0, 0], "velocity": [0, 0, 0]}
    strip |= {"rotation_degrees": [0.0, 0.0, 0.0], "youngs_modulus": 1e6}
    group = [{"select": "left", "motion": {"velocity": [0.3, 0, 0]}}, {"select": "right"}]
    effects = {name: keys for name, keys in ELASTIC.items() if name != "gravity"} | {"pins": {"group": group}}
    scene = falling_scene(effects, strip, body=(), tolerance=1e-3)
    made = Chain(scene, (0.02,))
    rng = np.random.default_rng(0)
    n = made.n
    start = made.start.positions.copy()
    start[:n, 2] += amplitude * rng.standard_normal(n)
    return made, start


def left(made):
    record = made.records[-1]
    gradient = bound_to(made.integrator, record)[1].gradient(record.solution)
    return np.abs(gradient[free_rows(made.integrator, record)]).max()


@pytest.mark.parametrize(("amplitude", "descents"), [(1e-9, 0), (1e-9, exact_system.MOST_DESCENTS), (0.0, 1)])
def test_a_step_beside_a_saddle_goes_on_to_a_minimum(amplitude, descents, monkeypatch):
    """Beside it, and on it: a flat strip, of which no force leads away."""
    monkeypatch.setattr(exact_system, "MOST_DESCENTS", descents)
    made, start = pressed(amplitude)
    made.start, made.lengths = replace(made.start, positions=start), (0.02,) * 3
    made.records = stepped(made.integrator, made.start, made.lengths)
    if not descents:
        with pytest.raises(NoMinimumError):
            made.adjoints()
        return
    assert left(made) < 1e-9
    assert np.abs(made.records[-1].end.positions[: made.n, 2]).max() > 1e-3
    assert np.isfinite(made.adjoints().start).all()
