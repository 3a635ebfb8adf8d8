"""A named effect that has nothing to do is not called, and leaves no trace: bit for bit (one thread).

Every entry of THE table is in one of three lists: left out of a step; measured only; or acting whenever it is on. A new
effect is put into one of them.
"""

import importlib

import numpy as np
import pytest
from small_scenes import BALL, EFFECTS, small_scene, without

from clothsim import simulate
from clothsim.build.scene_world import build
from clothsim.scene.effects import EFFECTS as TABLE

SHORT = {"duration": 0.08, "frames_per_second": 25}
FAR = BALL | {"position": [0.0, 0.0, -50.0]}
AT_REST = {"inertia": {}, "damping": {}}
LATER = [[0.0, 0.0], [0.05, 0.0], [0.06, 20.0]]
"""Nothing until .05 s, then 20 [Pa, N/m, degrees]: at the end of the third step of .02 s."""
CREASE = {"through": [[0.0, -0.5, 0.0], [0.0, 0.5, 0.0]]}
TETHER = {"select": "corners"}
SIDES = {"from": {"side": "left"}, "to": {"side": "right"}}

LEFT_OUT = {
    "friction": ({"body": FAR, "effects": EFFECTS}, {"iterations": 3}, {}),
    "pressure": ({"effects": EFFECTS}, {"value": [[0.0, 0.0], [10.0, 0.0], [11.0, 5.0]]}, {"value": LATER}),
    "rest_angle": (
        {"effects": EFFECTS},
        {"crease": [CREASE | {"angle_degrees": [[0.0, 0.0], [10.0, 0.0], [11.0, 30.0]]}]},
        {"crease": [CREASE | {"angle_degrees": LATER}]},
    ),
    "springs": (
        {"effects": EFFECTS},
        {"spring": [TETHER | {"stiffness": [[0.0, 0.0], [10.0, 0.0], [11.0, 30.0]]}]},
        {"spring": [TETHER | {"stiffness": LATER}]},
    ),
    "seams": (
        {"effects": EFFECTS},
        {"seam": [SIDES | {"start": 10, "end": 11}]},
        {"seam": [SIDES | {"start": 0.05, "end": 0.5}]},
    ),
    "plastic_bending": ({"effects": EFFECTS}, {"yield_angle_degrees": 179.0}, {"yield_angle_degrees": 0.02}),
    "air": ({"body": (), "effects": AT_REST}, {}, {}),
}
"""Scene without the effect; its keys, with which it is idle in every step; keys with which, on a falling sheet, it is
idle in some steps and acts in others.
"""

MEASURED = {
    "body_contact": ({"body": FAR, "effects": without("body_contact")}, {}, ["clothsim.contact.barrier_kernels"]),
    "self_contact": ({"effects": EFFECTS}, {}, ["clothsim.contact.barrier_kernels"]),
    "strain_limit": (
        {"effects": EFFECTS},
        {"limit": 2.0},
        ["clothsim.energies.strain_limit_kernels", "clothsim.energies.fibre_kernels"],
    ),
}
"""Effects that may begin to act within a step: they measure distances or stretches, and nothing else. The modules of
their kernels, of which none that makes a value or a derivative is called.
"""

ACTS = {"pins", "inertia", "membrane", "fibres", "bending", "gravity", "damping"}
"""Effects that act in every step where they are on."""


def frames(run):
    assert run.status == "completed", run.reason
    return np.array([run.positions(k) for k in range(len(run.times))])


def run_of(folder, sections, **added):
    sections = {"run": SHORT} | sections
    return simulate(small_scene(**sections | {"effects": sections["effects"] | added}), folder)


def raising(*_, **__):
    raise AssertionError("an idle effect was called")


def test_every_effect_is_in_one_list():
    names = [*LEFT_OUT, *MEASURED, *ACTS]
    assert sorted(names) == sorted(TABLE)
    assert len(names) == len(set(names))


@pytest.mark.parametrize("name", LEFT_OUT)
def test_an_effect_with_nothing_to_do_is_not_called(tmp_path, monkeypatch, name):
    sections, keys, _ = LEFT_OUT[name]
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


@pytest.mark.parametrize("name", LEFT_OUT)
def test_what_is_idle_in_some_steps_has_the_bits_of_what_is_always_called(tmp_path, monkeypatch, name):
    keys = LEFT_OUT[name][2]
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


@pytest.mark.parametrize("name", MEASURED)
def test_an_effect_that_only_measures_calls_no_kernel_of_its_energy(tmp_path, monkeypatch, name):
    sections, keys, modules = MEASURED[name]
    sections = {"body": FAR} | sections
    absent = run_of(tmp_path / "absent", sections)
    for module in map(importlib.import_module, modules):
        for kernel in KERNELS:
            monkeypatch.setattr(module, kernel, raising, raising=False)
    measured = run_of(tmp_path / "measured", sections, **{name: keys})
    assert np.array_equal(frames(measured), frames(absent))
    account = measured.summary["effects"][name]
    assert account["hessians"] > 0
    assert account["hessian_nonzeros"] == account["pairs"] == 0
    assert absent.summary["newton_iterations"] == measured.summary["newton_iterations"]


def test_the_poison_of_what_measures_works(tmp_path, monkeypatch):
    monkeypatch.setattr("clothsim.contact.barrier_kernels.gradient", raising)
    with pytest.raises(AssertionError, match="an idle effect was called"):
        run_of(tmp_path, {"effects": EFFECTS, "run": {"duration": 0.16}})
