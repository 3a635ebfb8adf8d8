"""Derivatives of each energy of THE table by the start of a step, against differences along directions."""

from dataclasses import replace

import numpy as np
import pytest
from effect_builders import built
from meshes import cloth, deformed, irregular_grid

from clothsim.gradients.backward_pass import SLOTS, _replace_slot, _values, past_by_differences
from clothsim.mesh.body import make_body
from clothsim.mesh.world import make_world
from clothsim.physics.contact.friction import FrictionEnergy
from clothsim.physics.energies.base import Constraint, Energy, Past, Step
from clothsim.physics.energies.protocols import SeesPast
from clothsim.scene.effects import EFFECTS

REFUSED = {"plastic_bending", "seams"}
KEYS = {"friction": {"coefficient": 0.7, "eps_v": 0.3}}


def table_world():
    positions, triangles = irregular_grid(0)
    positions[:, 2] = 0.2 * np.sin(2 * positions[:, 0]) + 0.1 * positions[:, 1] ** 2
    sheet = cloth(positions, triangles)
    sheet = replace(sheet, positions=positions + np.array([0.0, 0.0, 0.25]))
    floor = make_body("floor", np.array([[-1.0, -1, 0], [3, -1, 0], [-1, 3, 0]]), np.array([[0, 1, 2]]))
    return make_world([sheet], [floor])


def unbound(name):
    """The effect on the table world, a step to bind it to, and positions at its end; None for a constraint."""
    world = table_world()
    filled = {"contacts": ("body_contact",), "built": {"bending": built("bending", world)}}
    keys = KEYS.get(name, EFFECTS[name].example().keys)
    energy = built(name, world, **keys, **filled)
    if isinstance(energy, tuple):
        assert isinstance(energy[1], Constraint)
        return None
    assert isinstance(energy, Energy)
    rng = np.random.default_rng(7)
    x = world.start()
    velocities, before = rng.standard_normal((2, *x.shape))
    contact = built("body_contact", world, **EFFECTS["body_contact"].example().keys)
    past = Past(x + 0.05 * before, velocities + 0.3 * before, 0.7 * 0.8)  # BDF2 with r = 1/3, b = .8
    bound = {"body_contact": contact}
    step = Step(0.3, 0.7, x, velocities, 0.6, np.zeros_like(x), bound=bound, weighed=past)
    return energy, step, deformed(world, seed=3, amplitude=0.04)


NAMES = [name for name in EFFECTS if name not in REFUSED and unbound(name) is not None]


def _sensitivity(energy, step, x, a):
    bound = energy.begin(step)
    return (
        bound.past_sensitivity(step, x, a)
        if isinstance(bound, SeesPast)
        else past_by_differences(energy.begin, step, x, a)
    )


@pytest.mark.parametrize("name", NAMES)
def test_the_start_of_a_step(name):
    energy, step, x = unbound(name)
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


@pytest.mark.parametrize("name", ["inertia", "friction", "gravity", "springs"])
def test_closed_forms_are_the_default(name):
    energy, step, x = unbound(name)
    bound = energy.begin(step)
    assert isinstance(bound, SeesPast)
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
