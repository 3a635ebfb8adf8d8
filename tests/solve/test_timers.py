"""Timers: every call is counted once, and every second is charged once."""

import numpy as np
import pytest
from effect_builders import gravity, membrane
from meshes import small_world

from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.hessians import LanesHessian
from clothsim.solve import timers as module
from clothsim.solve.linear.sparsity import make_pattern
from clothsim.solve.newton.potential import Potential
from clothsim.solve.timers import Timers


def test_calls_are_counted_by_effect_and_kind():
    world = small_world()
    x = world.start()
    potential = Potential({"membrane": membrane(world), "gravity": gravity(world)}, Timers())
    for place in (x, 1.1 * x, x):  # the third asks for what is known
        potential.value(place)
    potential.gradient(x)
    potential.hessians(x)
    account = potential.effect_counters()["membrane"]
    assert (account["evaluations"], account["gradients"], account["hessians"]) == (2, 1, 1)
    assert account["hessian_nonzeros"] == 81 * len(world.triangles)
    assert potential.effect_counters()["gravity"]["hessian_nonzeros"] == 0
    assert account["seconds"] > 0


def test_seconds_inside_a_phase_are_booked_once(monkeypatch):
    clock, timers = [0.0], Timers()
    monkeypatch.setattr(module, "thread_time", lambda: clock[0])
    with timers.phase("outer"):
        clock[0] += 1.0
        with timers.effect("inner", "evaluations"):
            clock[0] += 2.0
        with timers.phase("other"):
            clock[0] += 4.0
        clock[0] += 8.0
    assert timers.phases == {"outer": 9.0, "other": 4.0}
    assert timers.effects["inner"].seconds == 2.0


def test_effects_in_turn_are_charged_from_one_border_to_the_next(monkeypatch):
    clock, timers = [0.0], Timers()
    monkeypatch.setattr(module, "thread_time", lambda: clock[0])
    with timers.phase("outer"):
        clock[0] += 1.0
        with timers.effects_in_turn() as effects:
            clock[0] += 2.0
            effects.done("first", "gradients")
            clock[0] += 4.0
            with timers.phase("inner"):
                clock[0] += 8.0
            effects.done("second", "gradients")
            clock[0] += 16.0  # after the last one: of nobody within
        clock[0] += 32.0
    assert {name: one.seconds for name, one in timers.effects.items()} == {"first": 2.0, "second": 4.0}
    assert timers.effects["second"].gradients == 1
    assert timers.phases == {"outer": 49.0, "inner": 8.0}


class Slow(Energy):
    """Takes a second of `clock` where its Hessian is added."""

    def __init__(self, clock):
        self.clock = clock

    def value(self, x):
        return 0.0

    def gradient(self, x):
        return np.zeros_like(x)

    def hessian(self, x, project=True):
        def fill(lanes, first):
            self.clock[0] += 1.0
            lanes[:] = 0.0

        return LanesHessian(np.array([[0, 1, 2]]), fill)


def test_what_is_computed_where_it_is_added_is_on_its_energy_s_account(monkeypatch):
    clock, world = [0.0], small_world()
    monkeypatch.setattr(module, "thread_time", lambda: clock[0])
    potential = Potential({"slow": Slow(clock)}, Timers())
    hessians = potential.hessians(world.start())
    pattern = make_pattern(world.n_cloth, world.triangles, hessians)
    with potential.timers.phase("assembly"):
        pattern.assemble(hessians)
    assert potential.effect_counters()["slow"]["seconds"] == 1.0
    assert potential.effect_counters()["slow"]["hessians"] == 1
    assert potential.timers.phases["assembly"] == 0.0


def test_an_error_inside_is_booked_and_passed_on():
    timers = Timers()
    with pytest.raises(ZeroDivisionError), timers.phase("outer"), timers.effect("inner", "gradients"):
        1 / 0  # noqa: B018
    assert timers.effects["inner"].gradients == 1
    with timers.phase("after"):
        pass
    assert set(timers.phases) == {"outer", "after"}
