"""A named effect that has nothing to do is not called, and leaves no trace: bit for bit (one thread).

The `EXAMPLE` of an effect of THE table has the keys: skipped in a step; searching without finding; or acting always.
"""

import importlib

import numpy as np
import pytest
from small_scenes import EFFECTS, changed, frames, small_scene, without

from clothsim import simulate
from clothsim.physics.energies.protocols import Idling
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.effects import EFFECTS as TABLE

SHORT = {"duration": 0.08, "frames_per_second": 25}
IDLE = {name: effect.example().idle for name, effect in TABLE.items()}
SKIPPED = [name for name, idle in IDLE.items() if idle and not idle.searches]
SEARCHING = [name for name, idle in IDLE.items() if idle and idle.searches]


def run_of(folder, sections, **added):
    sections = {"run": SHORT} | sections
    return simulate(small_scene(**sections | {"effects": sections["effects"] | added}), folder)


def raising(*_, **__):
    raise AssertionError("an idle effect was called")


def idle_sections(name):
    """The small scene without the effect, changed so that it would idle."""
    return {"effects": without(name)} | changed(IDLE[name].scene)


@pytest.mark.parametrize("name", TABLE)
def test_an_effect_that_can_be_skipped_has_an_idle_example(name):
    example = TABLE[name].example()
    made = build(small_scene(effects=EFFECTS | {name: example.scene_keys})).energies.get(name)
    assert isinstance(made, Idling) == (name in SKIPPED)


@pytest.mark.parametrize("name", SKIPPED)
def test_an_effect_with_nothing_to_do_is_not_called(tmp_path, monkeypatch, name):
    sections, keys = idle_sections(name), IDLE[name].always
    absent = run_of(tmp_path / "absent", sections)
    kind = type(build(small_scene(**sections | {"effects": sections["effects"] | {name: keys}})).energies[name])
    monkeypatch.setattr(kind, "hessian", _only_before_the_first_step(kind.hessian))
    for method in {"value", "gradient", "step_limit", "couplings", "minimum_gap", "gap_change"} & set(vars(kind)):
        monkeypatch.setattr(kind, method, raising)
    idle = run_of(tmp_path / "idle", sections, **{name: keys})
    assert np.array_equal(frames(idle), frames(absent))
    assert idle.summary["newton_iterations"] == absent.summary["newton_iterations"]
    assert idle.summary["linear_solves"] == absent.summary["linear_solves"]
    account = idle.summary["effects"][name]
    assert account["steps"] == account["idle_steps"] == idle.summary["steps"] > 0
    assert account["evaluations"] == account["gradients"] == account["hessians"] == account["hessian_nonzeros"] == 0


def _only_before_the_first_step(true):
    """The Hessian that tells the matrix's pattern, of the unbound energy, once; any other call raises."""
    calls = []

    def hessian(self, x, project=True):
        calls.append(1)
        return true(self, x, project) if len(calls) == 1 else raising()

    return hessian


@pytest.mark.parametrize("name", SKIPPED)
def test_what_is_idle_in_some_steps_has_the_bits_of_what_is_always_called(tmp_path, monkeypatch, name):
    keys = IDLE[name].sometimes
    spared = run_of(tmp_path / "spared", {"effects": EFFECTS, "run": {"duration": 0.16}}, **{name: keys})
    kind = type(build(small_scene(effects=EFFECTS | {name: keys})).energies[name])
    monkeypatch.setattr(kind, "idle", False)
    called = run_of(tmp_path / "called", {"effects": EFFECTS, "run": {"duration": 0.16}}, **{name: keys})
    assert np.array_equal(frames(spared), frames(called))
    accounts = [run.summary["effects"][name] for run in (spared, called)]
    assert 0 < accounts[0]["idle_steps"] < accounts[0]["steps"]
    assert accounts[1]["idle_steps"] == 0
    for counter in ("evaluations", "gradients", "hessians"):
        assert 0 < accounts[0][counter] < accounts[1][counter]


KERNELS = ("measure", "value", "gradient", "hessian", "pull", "principal_gradient", "principal_hessian")


@pytest.mark.parametrize("name", SEARCHING)
def test_an_effect_that_only_measures_calls_no_kernel_of_its_energy(tmp_path, monkeypatch, name):
    sections, keys = idle_sections(name), IDLE[name].always
    absent = run_of(tmp_path / "absent", sections)
    for module in map(importlib.import_module, IDLE[name].kernels):
        for kernel in KERNELS:
            monkeypatch.setattr(module, kernel, raising, raising=False)
    measured = run_of(tmp_path / "measured", sections, **{name: keys})
    assert np.array_equal(frames(measured), frames(absent))
    account = measured.summary["effects"][name]
    assert account["hessians"] > 0
    assert account["hessian_nonzeros"] == account["pairs"] == 0
    assert absent.summary["newton_iterations"] == measured.summary["newton_iterations"]


def test_the_poison_of_what_measures_works(tmp_path, monkeypatch):
    monkeypatch.setattr("clothsim.physics.contact.barrier_kernels.gradient", raising)
    with pytest.raises(AssertionError, match="an idle effect was called"):
        run_of(tmp_path, {"effects": EFFECTS, "run": {"duration": 0.16}})
