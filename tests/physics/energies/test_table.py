"""Every entry of THE table of effects: derivatives, types, definiteness and balance, so that none is left out.

A new effect is tested by being in the table; keys with which it acts and the properties it has are its `EXAMPLE`.
"""

from dataclasses import replace

import numpy as np
import pytest
from bound_effects import table_world
from differences import dense_hessian, gradient_error, hessian_error, numeric_hessian, taylor_slopes
from effect_builders import built
from meshes import deformed, random_rotation
from scipy import sparse

from clothsim.physics.energies.base import Constraint, Energy, Step
from clothsim.physics.energies.hessians import ByElement, ElementHessian, LanesHessian, explicit
from clothsim.physics.energies.protocols import ContactGap, restricted
from clothsim.scene.effects import CONTACTS, EFFECTS
from clothsim.solve.linear.sparsity import make_pattern

EXAMPLES = {name: effect.example() for name, effect in EFFECTS.items()}


def made(name):
    """The effect on the table world: the energy bound to a step of order one or the constraint, and the world."""
    world = table_world()
    filled = {"contacts": ("body_contact",), "built": {"bending": built("bending", world)}}
    thing = built(name, world, **EXAMPLES[name].keys, **filled)
    if isinstance(thing, tuple):
        return thing[1], thing[0]
    assert isinstance(thing, Energy), f"{name} is {thing}: give it an EXAMPLE with which it acts"
    contact = built("body_contact", world, **EXAMPLES["body_contact"].keys)
    crease = built("rest_angle", world, **EXAMPLES["rest_angle"].keys, **filled)
    start = step(world, world.start())
    return thing.begin(replace(start, bound={"body_contact": contact, "rest_angle": crease.begin(start)})), world


def step(world, x, load=0.6):
    rng = np.random.default_rng(7)
    velocities, gradient = rng.standard_normal((2, *x.shape))
    return Step(time=0.3, dt=0.7, positions=x, velocities=velocities, load=load, gradient=gradient)


def position(world):
    return deformed(world, seed=3, amplitude=0.04)


def is_constraint(name):
    return isinstance(made(name)[0], Constraint)


ENERGIES = [name for name in EFFECTS if not is_constraint(name)]
CONSTRAINTS = [name for name in EFFECTS if is_constraint(name)]

every_energy = pytest.mark.parametrize("name", ENERGIES)


def test_the_table_holds_energies_and_constraints():
    assert len(ENERGIES) >= 6
    assert CONSTRAINTS


@every_energy
def test_gradient_is_the_derivative_of_the_value(name):
    energy, world = made(name)
    assert gradient_error(energy, position(world)) < 1e-7


@every_energy
def test_hessian_is_the_derivative_of_the_gradient(name):
    """An energy whose gradient does not change is linear: then its Hessian must be zero, and that is a test too."""
    energy, world = made(name)
    x = position(world)
    if np.abs(numeric_hessian(energy, x, 1e-3)).max() < 1e-10 * np.abs(energy.gradient(x)).max():
        assert not dense_hessian(energy, x).any()
        assert taylor_slopes(energy, x)[0] == np.inf
    else:
        assert hessian_error(energy, x) < 1e-6


@every_energy
def test_only_a_linear_energy_has_a_zero_hessian(name):
    energy, world = made(name)
    assert dense_hessian(energy, position(world)).any() != EXAMPLES[name].linear


@every_energy
def test_taylor_remainders_fall_with_their_order(name):
    energy, world = made(name)
    first, second = taylor_slopes(energy, position(world))
    assert first == np.inf or abs(first - 2) < 0.2
    assert second > 2.8


@every_energy
def test_types_and_shapes(name):
    energy, world = made(name)
    x = position(world)
    assert type(energy.value(x)) is float
    gradient = energy.gradient(x)
    assert gradient.dtype == np.float64
    assert gradient.shape == x.shape
    for project in (True, False):
        for hessian in explicit([energy.hessian(x, project)]):
            if isinstance(hessian, ByElement):
                m, k = hessian.elements.shape
                assert hessian.elements.dtype == np.int64
                assert hessian.blocks.dtype == np.float64
                assert hessian.blocks.shape == (m, 3 * k, 3 * k)
            else:
                assert isinstance(hessian, sparse.csr_array)
                assert hessian.dtype == np.float64
                assert hessian.shape == (x.size, x.size)
        dense = dense_hessian(energy, x, project)
        assert np.abs(dense - dense.T).max() <= 1e-12 * np.abs(dense).max()


@every_energy
@pytest.mark.parametrize("project", [True, False])
def test_what_a_kernel_adds_to_a_matrix_has_the_bits_of_its_blocks(name, project):
    energy, world = made(name)
    every = explicit([energy.hessian(position(world), project)])
    added = [hessian for hessian in every if getattr(hessian, "add", None)]
    pattern = make_pattern(world.n_unknowns, world.triangles, added)
    for hessian in added:
        lanes = isinstance(hessian, LanesHessian)
        apart = replace(hessian, add=None) if lanes else ElementHessian(hessian.elements, hessian.blocks)
        (data, outside), (expected, _) = pattern.assemble([hessian]), pattern.assemble([apart])
        assert outside == 0
        assert data.any() or not expected.any()
        assert np.array_equal(data, expected)
        smaller = make_pattern(world.n_unknowns, world.triangles[:0], [])
        assert smaller.assemble([hessian])[1] == smaller.assemble([apart])[1]


@every_energy
@pytest.mark.parametrize("seed", range(4))
def test_projected_hessian_is_positive_semi_definite(name, seed):
    energy, world = made(name)
    dense = dense_hessian(energy, deformed(world, seed, amplitude=0.08), project=True)
    assert np.linalg.eigvalsh(dense)[0] >= -1e-12 * np.abs(dense).max()


@every_energy
def test_around_what_moves_is_the_same_but_for_a_constant(name):
    energy, world = made(name)
    x = position(world)
    moving = np.zeros(len(x), bool)
    moving[[1, 2, 5]] = True
    y = x + 0.02 * moving[:, None] * np.random.default_rng(5).standard_normal(x.shape)
    part = restricted(energy, moving, x)
    scale = abs(energy.value(x)) + abs(energy.value(y))
    assert abs((part.value(y) - part.value(x)) - (energy.value(y) - energy.value(x))) <= 1e-13 * scale
    entries = np.flatnonzero(np.repeat(moving, 3))
    wanted, found = energy.gradient(y)[moving], part.gradient(y)[moving]
    np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-13 * np.abs(energy.gradient(y)).max())
    for project in (True, False):
        whole, own = (dense_hessian(each, y, project)[np.ix_(entries, entries)] for each in (energy, part))
        np.testing.assert_allclose(own, whole, rtol=0, atol=1e-12 * np.abs(whole).max(initial=1e-300))


def test_most_energies_leave_out_what_stands():
    moving = np.arange(table_world().n_vertices) == 1
    smaller = [
        name
        for name, (energy, world) in ((name, made(name)) for name in ENERGIES)
        if np.count_nonzero(restricted(energy, moving, position(world)).gradient(position(world)))
        < np.count_nonzero(energy.gradient(position(world)))
    ]
    assert {"inertia", "membrane", "bending", "gravity", "fibres", "damping", "body_contact"} <= set(smaller)


@every_energy
def test_value_and_derivatives_leave_their_input_alone(name):
    energy, world = made(name)
    x = position(world)
    before = x.copy()
    first = energy.value(x), energy.gradient(x), dense_hessian(energy, x)
    again = energy.value(x), energy.gradient(x), dense_hessian(energy, x)
    assert np.array_equal(x, before)
    for a, b in zip(first, again, strict=True):  # several threads may add in another order
        assert np.abs(np.subtract(a, b)).max() <= 1e-13 * np.abs(a).max()


@pytest.mark.parametrize("name", [name for name in ENERGIES if not EXAMPLES[name].external])
class TestRigidMotion:
    """Cloth, bodies and everything moved as one."""

    @pytest.mark.parametrize("seed", range(3))
    def test_value_stays_and_force_turns_along(self, name, seed):
        energy, world = made(name)
        x, turn = position(world), random_rotation(seed)
        moved = x @ turn.T + [3.0, -2.0, 1.0]
        here, there = energy.begin(step(world, x)), energy.begin(step(world, moved))
        assert abs(here.value(x)) > 1e-4
        assert there.value(moved) == pytest.approx(here.value(x), rel=1e-11)
        force = here.gradient(x)
        assert np.abs(there.gradient(moved) - force @ turn.T).max() < 1e-11 * np.abs(force).max()

    def test_force_and_torque_balance(self, name):
        energy, world = made(name)
        x = position(world)
        force = energy.begin(step(world, x)).gradient(x)
        largest = np.abs(force).max()
        assert largest > 1e-3
        assert np.abs(force.sum(axis=0)).max() < 1e-12 * largest
        assert np.abs(np.cross(x, force).sum(axis=0)).max() < 1e-12 * largest


@every_energy
def test_body_rows_of_the_gradient_are_there_where_the_body_matters_and_only_there(name):
    energy, world = made(name)
    x = position(world)
    moved = x.copy()
    moved[world.n_cloth :] += [0.01, 0.02, 0.05]
    matters = energy.value(moved) != energy.value(x)
    assert matters == EXAMPLES[name].with_bodies
    assert energy.gradient(x)[world.n_cloth :].any() == matters
    assert isinstance(energy, ContactGap) == (name in CONTACTS)
    assert not isinstance(energy, ContactGap) or np.isfinite(energy.minimum_gap(x))


@every_energy
def test_only_an_energy_that_needs_bodies_reads_beyond_the_cloth(name):
    energy, world = made(name)
    x, n = position(world), world.n_cloth
    if EXAMPLES[name].with_bodies:
        assert energy.reads_beyond(n)
    elif not energy.reads_beyond(n):
        assert energy.value(x[:n]) == energy.value(x)
        assert np.array_equal(energy.gradient(x[:n]), energy.gradient(x)[:n])
        assert np.array_equal(dense_hessian(energy, x[:n]), dense_hessian(energy, x)[: 3 * n, : 3 * n])
        acts = np.flatnonzero(energy.gradient(x).any(axis=1))
        assert not len(acts) or energy.reads_beyond(acts[-1])  # the last row of an element counts


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_constraints_prescribe_rows_of_x(name):
    constraint, world = made(name)
    start = world.start()
    for time in (0.0, 0.5, 2.0):
        prescribed = constraint.at(time)
        assert prescribed.vertices.dtype == np.int64
        assert prescribed.positions.dtype == np.float64
        assert prescribed.positions.shape == (len(prescribed.vertices), 3)
        assert len(prescribed.vertices) == len(np.unique(prescribed.vertices)) > 0
        assert prescribed.vertices.max() < len(start)
        assert np.isfinite(prescribed.positions).all()
        moved = np.abs(prescribed.positions - start[prescribed.vertices]).max()
        assert moved < 1e-14 if time == 0 else moved > 0.1


@pytest.mark.parametrize("name", EFFECTS)
def test_each_entry_has_a_summary_and_has_defaults(name):
    assert EFFECTS[name].summary
    assert all(default is not None or name == "pins" for default in EFFECTS[name].keys().values())
