"""Sum of energies: values, gradients, step limits, and the order in which energies are bound to a step."""

from dataclasses import dataclass

import numpy as np
import pytest
from differences import gradient_error
from effect_builders import bending, gravity, membrane
from meshes import deformed, small_world
from solving import step_at

from clothsim.physics.energies.base import Energy, Step
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.physics.energies.inertia import InertiaEnergy
from clothsim.physics.energies.protocols import ContactGap, Coupling, Elementwise, Idling, Lagged
from clothsim.solve.newton.potential import Potential
from clothsim.solve.timers import Timers


def energies_of(world):
    return {"membrane": membrane(world), "bending": bending(world), "gravity": gravity(world)}


def test_value_gradient_and_hessian_are_sums():
    world = small_world()
    x = deformed(world)
    energies = energies_of(world)
    potential = Potential(energies, Timers())
    assert potential.value(x) == pytest.approx(sum(e.value(x) for e in energies.values()), rel=1e-14)
    assert np.allclose(potential.gradient(x), sum(e.gradient(x) for e in energies.values()), atol=1e-14)
    assert len(potential.hessians(x)) == 3
    assert gradient_error(potential, x) < 1e-7


@dataclass(frozen=True)
class Pull(Energy):
    """A force that is written for one vertex, or for some."""

    forces: np.ndarray

    def value(self, x):
        return float((x * self.forces[:1]).sum())

    def gradient(self, x):
        return self.forces

    def hessian(self, x, project=True):
        raise AssertionError


@pytest.mark.parametrize("forces", [np.array([1.0, 2.0, 3.0]), np.array([[1, 2, 3]])])
def test_a_force_of_one_row_is_that_of_each_vertex(forces):
    x = np.zeros((300, 3))
    assert np.array_equal(Potential({"pull": Pull(forces)}, Timers()).gradient(x), np.tile([1.0, 2.0, 3.0], (300, 1)))


@pytest.mark.parametrize("rows", [2, 301])
def test_forces_of_too_few_or_too_many_rows_are_no_gradient(rows):
    potential = Potential({"pull": Pull(np.ones((rows, 3)))}, Timers())
    with pytest.raises(ValueError, match="broadcast"):
        potential.gradient(np.zeros((300, 3)))


def test_what_reads_no_bodies_is_called_without_them():
    """A force on the cloth alone and one on all: the sum is that of both over all rows."""
    x, n = np.random.default_rng(3).normal(size=(9, 3)), 4
    rows = np.arange(n)[:, None]
    inertia = InertiaEnergy(rows, np.arange(1.0, n + 1), np.zeros((n, 3)), 0.5)
    energies = {"inertia": inertia, "pull": Pull(np.arange(27.0).reshape(9, 3))}
    alone, beside = Potential(energies, Timers()), Potential(energies, Timers(), n)
    seen = []
    gradient = InertiaEnergy.gradient
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(InertiaEnergy, "gradient", lambda energy, x: seen.append(len(x)) or gradient(energy, x))
        assert np.array_equal(beside.gradient(x), alone.gradient(x))
    assert seen == [n, 9]
    assert beside.value(x) == alone.value(x)
    assert beside.largest_force(x) == alone.largest_force(x)


def test_rows_of_bodies_in_any_array_of_the_elements_count():
    """An effect of a user may name the row of a cloth and that of a body in two arrays."""

    @dataclass(frozen=True, eq=False)
    class Tether(Elementwise):
        rows: np.ndarray
        ends: np.ndarray
        per_element = ("rows", "ends")

    tether = Tether(np.array([[0], [1]]), np.array([5, 4]))
    assert tether.reads_beyond(5)
    assert not tether.reads_beyond(6)


def test_a_value_that_is_refused_ends_the_sum():
    world = small_world()
    x = np.zeros_like(world.start())
    potential = Potential(energies_of(world), Timers())
    assert potential.value(x) == np.inf
    assert "gravity" not in potential.timers.effects


@dataclass(frozen=True)
class Limited(Energy, ContactGap):
    """Keeps a gap and limits steps; `received_gradient` is the gradient that it was given at `begin`."""

    limit: float
    gap: float
    received_gradient: np.ndarray | None = None

    depends_on_other_energies = True

    def begin(self, step: Step):
        return Limited(self.limit, self.gap, step.gradient)

    def value(self, x):
        return 0.0

    def gradient(self, x):
        return np.ones_like(x)

    def hessian(self, x, project=True):
        return ElementHessian(np.zeros((0, 1), np.int64), np.zeros((0, 3, 3)))

    def step_limit(self, x, dx, most=1.0):
        return min(most, self.limit)

    def minimum_gap(self, x):
        return self.gap

    def gap_change(self, x, dx):
        return 0.0


def test_no_energy_is_asked_beyond_what_those_before_it_allow(monkeypatch):
    world = small_world()
    x, received = world.start(), []
    monkeypatch.setattr(
        Limited, "step_limit", lambda self, x, dx, most=1.0: received.append(most) or min(most, self.limit)
    )
    limits = {str(k): Limited(limit, np.inf) for k, limit in enumerate((0.9, 0.4, 0.7))}
    potential = Potential(energies_of(world) | limits, Timers())
    assert potential.step_limit(x, x) == 0.4
    assert received == [1.0, 0.9, 0.4]


def test_the_smallest_limit_and_gap_count():
    world = small_world()
    x = world.start()
    alone = Potential(energies_of(world), Timers())
    assert alone.step_limit(x, x) == 1.0
    assert alone.minimum_gap(x) == np.inf
    both = Potential({"a": Limited(0.5, 0.2), **energies_of(world), "b": Limited(0.25, 0.3)}, Timers())
    assert both.step_limit(x, x) == 0.25
    assert both.minimum_gap(x) == 0.2


class Coupled(Limited, Coupling):
    """A contact that predicts one pair."""

    def couplings(self, x, dx):
        return np.array([[0, 1]])


@pytest.mark.parametrize(("gap", "pairs"), [(np.inf, []), (0.2, [[[0, 1]]])])
def test_contact_without_an_active_pair_predicts_none(gap, pairs):
    world = small_world()
    potential = Potential({"contact": Coupled(1.0, gap), **energies_of(world)}, Timers())
    found = potential.couplings(world.start(), np.zeros_like(world.start()))
    assert [each.tolist() for each in found] == pairs


def test_what_begins_last_receives_the_gradient_of_the_others_and_the_order_stays():
    world = small_world()
    x = deformed(world)
    energies = energies_of(world)
    potential = Potential({"first": Limited(1.0, 1.0), **energies}, Timers()).begin(step_at(x, load=0.5))
    assert list(potential.energies) == ["first", *energies]
    forces = [energy.begin(step_at(x, load=0.5)).gradient(x) for energy in energies.values()]
    assert np.allclose(potential.energies["first"].received_gradient, sum(forces), atol=1e-14)


@dataclass(frozen=True)
class Sleeper(Limited, Idling, Lagged):
    """Idle until it is bound for another pass; of two passes, it acts in the second."""

    awake: bool = False

    @property
    def idle(self):
        return not self.awake

    @property
    def lag_iterations(self):
        return 2

    def begin(self, step: Step):
        return Sleeper(self.limit, self.gap)

    def relag(self, x):
        return Sleeper(self.limit, self.gap, awake=True)


def test_what_is_idle_is_left_out_until_another_pass_wakes_it():
    world = small_world()
    x = deformed(world)
    timers = Timers()
    bound = Potential({"sleeper": Sleeper(0.5, 0.2), **energies_of(world)}, timers).begin(step_at(x))
    assert list(bound.energies) == ["sleeper", *bound.acting]
    assert (bound.step_limit(x, x), bound.minimum_gap(x), len(bound.hessians(x))) == (1.0, np.inf, 3)
    assert not bound.lagging
    assert bound.lag_iterations == 2
    account = timers.effects["sleeper"]
    assert (account.steps, account.idle_steps, account.hessians) == (1, 1, 0)
    woken = bound.relag(x)
    assert list(woken.lagging) == ["sleeper"]
    assert (woken.step_limit(x, x), woken.minimum_gap(x), len(woken.hessians(x))) == (0.5, 0.2, 4)
    assert np.allclose(woken.gradient(x), bound.gradient(x) + 1, atol=1e-14)
