"""The receipt counts every call once and books every second once."""

import numpy as np
import pytest
from meshes import small_world

from clothsim.energies.base import Energy, LanesHessian
from clothsim.energies.gravity import gravity
from clothsim.energies.membrane import membrane
from clothsim.solve import ledger as module
from clothsim.solve.ledger import Ledger
from clothsim.solve.pattern import make_pattern
from clothsim.solve.potential import Potential


def test_calls_are_counted_by_effect_and_kind():
    world = small_world()
    x = world.start()
    potential = Potential({"membrane": membrane(world), "gravity": gravity(world)}, Ledger())
    for place in (x, 1.1 * x, x):  # the third asks for what is known
        potential.value(place)
    potential.gradient(x)
    potential.hessians(x)
    account = potential.accounts()["membrane"]
    assert (account["evaluations"], account["gradients"], account["hessians"]) == (2, 1, 1)
    assert account["hessian_nonzeros"] == 81 * len(world.triangles)
    assert potential.accounts()["gravity"]["hessian_nonzeros"] == 0
    assert account["seconds"] > 0


def test_seconds_inside_a_phase_are_booked_once(monkeypatch):
    clock, ledger = [0.0], Ledger()
    monkeypatch.setattr(module, "perf_counter", lambda: clock[0])
    with ledger.phase("outer"):
        clock[0] += 1.0
        with ledger.effect("inner", "evaluations"):
            clock[0] += 2.0
        with ledger.phase("other"):
            clock[0] += 4.0
        clock[0] += 8.0
    assert ledger.phases == {"outer": 9.0, "other": 4.0}
    assert ledger.effects["inner"].seconds == 2.0


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
    monkeypatch.setattr(module, "perf_counter", lambda: clock[0])
    potential = Potential({"slow": Slow(clock)}, Ledger())
    hessians = potential.hessians(world.start())
    pattern = make_pattern(world.n_cloth, world.triangles, hessians)
    with potential.ledger.phase("assembly"):
        pattern.assemble(hessians)
    assert potential.accounts()["slow"]["seconds"] == 1.0
    assert potential.accounts()["slow"]["hessians"] == 1
    assert potential.ledger.phases["assembly"] == 0.0


def test_an_error_inside_is_booked_and_passed_on():
    ledger = Ledger()
    with pytest.raises(ZeroDivisionError), ledger.phase("outer"), ledger.effect("inner", "gradients"):
        1 / 0  # noqa: B018
    assert ledger.effects["inner"].gradients == 1
    with ledger.phase("after"):
        pass
    assert set(ledger.phases) == {"outer", "after"}
