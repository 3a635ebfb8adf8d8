"""Derivatives of each energy of THE table by the start of a step, against differences along directions."""

from dataclasses import replace

import numpy as np
import pytest
from bound_effects import table_world, unbound
from effect_builders import built

from clothsim.gradients.backward_pass import SLOTS, _replace_slot, _values, past_by_differences
from clothsim.physics.contact.friction import FrictionEnergy
from clothsim.physics.energies.protocols import HistorySensitivity, PastSensitivity
from clothsim.scene.effects import EFFECTS

NAMES = [name for name in EFFECTS if unbound(name) is not None]


def _sensitivity(energy, step, x, a):
    bound = energy.begin(step)
    if isinstance(bound, HistorySensitivity):
        return bound.history_sensitivity(step, x, a, np.zeros_like(np.asarray(bound.carry_over)))
    if isinstance(bound, PastSensitivity):
        return bound.past_sensitivity(step, x, a)
    return past_by_differences(energy.begin, step, x, a)


@pytest.mark.parametrize("name", NAMES)
def test_the_start_of_a_step(name):
    _compare(*unbound(name))


def test_friction_of_a_contact_with_an_offset():
    energy, step, x = unbound("friction")
    keys = EFFECTS["body_contact"].example().keys | {"offset": 0.1}
    contact = built("body_contact", table_world(), **keys)
    assert len(energy.begin(replace(step, bound={"body_contact": contact})).elements) > 2
    _compare(energy, replace(step, bound={"body_contact": contact}), x)


def _compare(energy, step, x):
    """Derivatives by each slot of the start with differences along two directions."""
    a = np.random.default_rng(1).standard_normal(x.shape)
    found = _sensitivity(energy, step, x, a)
    scale = np.linalg.norm(energy.begin(step).gradient(x)) * np.linalg.norm(a)
    for slot in SLOTS:
        values, part = _values(step, slot), getattr(found, slot)
        for seed in range(2):
            d = np.random.default_rng(seed).standard_normal(x.shape)
            wanted = _along(energy, step, slot, values, d, x, a)
            derivative = 0.0 if part is None else np.vdot(part, d)
            size = np.linalg.norm(part) * np.linalg.norm(d) if part is not None else scale
            assert abs(derivative - wanted) <= 1e-6 * max(size, 1e-3 * scale), slot


def _along(energy, step, slot, values, d, x, a):
    h = 1e-6
    forces = [energy.begin(_replace_slot(step, slot, values + sign * h * d)).gradient(x) for sign in (1, -1)]
    return np.vdot(a, forces[0] - forces[1]) / (2 * h)


@pytest.mark.parametrize("name", ["inertia", "friction", "gravity", "springs", "seams"])
def test_closed_forms_are_the_default(name):
    energy, step, x = unbound(name)
    bound = energy.begin(step)
    assert isinstance(bound, PastSensitivity)
    assert name != "friction" or (isinstance(bound, FrictionEnergy) and len(bound.elements) > 2)
    a = np.random.default_rng(1).standard_normal(x.shape)
    closed, default = bound.past_sensitivity(step, x, a), past_by_differences(energy.begin, step, x, a)
    for slot in SLOTS:
        one, other = getattr(closed, slot), getattr(default, slot)
        if other is None:
            assert one is None or not one.any()
        else:
            assert np.abs(one - other).max() < 1e-7 * np.abs(other).max()


def test_an_energy_that_reaches_further_than_its_stencils():
    """Its force at each vertex depends on the mean of all at the start: rows are then varied one by one."""
    energy, step, x = unbound("pressure")
    a = np.random.default_rng(1).standard_normal(x.shape)
    found = past_by_differences(energy.begin, step, x, a).positions
    rows = [int(energy.border[0]), int(energy.border[-1])]
    for row in rows:
        d = np.zeros_like(x)
        d[row] = [0.2, 0.4, -1.0]
        assert (
            abs(np.vdot(found, d) - _along(energy, step, "positions", step.positions, d, x, a))
            < 1e-6 * np.abs(found).max()
        )
