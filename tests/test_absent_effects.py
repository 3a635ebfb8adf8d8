"""Only the effects that a scene calls for: absent is the same as a coefficient of zero, and nothing absent is run.

Bit for bit in positions, with one thread (docs/contributing.md).
"""

import functools
import importlib
import inspect
import json
import pkgutil
import subprocess
import sys

import numpy as np
import pytest
from import_graph import home, own
from small_scenes import BALL, EFFECTS, SHEET, SOLVER, changed, frames, small_scene, without

from clothsim import simulate
from clothsim.physics import contact
from clothsim.scene.effects import EFFECTS as TABLE

SHORT = {"duration": 0.08, "frames_per_second": 25}
SELF = {"self_contact": {}}
PINS = {"pins": {"select": "corners"}}
EXAMPLES = {name: effect.example() for name, effect in TABLE.items()}
ALL = EFFECTS | {name: example.scene_keys for name, example in EXAMPLES.items() if name not in EFFECTS}


def run_of(folder, **sections):
    return simulate(small_scene(**{"run": SHORT} | sections), folder)


# --- a coefficient of zero ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [name for name, example in EXAMPLES.items() if example.zero is not None])
def test_a_coefficient_of_zero_is_absent_bit_for_bit(tmp_path, name):
    scene = changed(EXAMPLES[name].zero_scene)
    effects = {"effects": without(name) | {name: EXAMPLES[name].zero}}, {"effects": without(name)}
    zero, absent = (run_of(tmp_path / str(k), **scene | each) for k, each in enumerate(effects))
    assert np.array_equal(frames(zero), frames(absent))
    assert list(zero.summary["off"]) == [name]
    assert zero.summary["off"][name]
    assert name not in zero.summary["effects"]
    assert absent.summary["off"] == {}
    assert zero.summary["newton_iterations"] == absent.summary["newton_iterations"]


@pytest.mark.parametrize("name", [name for name, effect in TABLE.items() if effect.keys()])
def test_an_effect_with_keys_has_an_example_in_which_it_is_off(name):
    assert EXAMPLES[name].zero is not None


def test_an_effect_that_acts_changes_the_bits(tmp_path):
    """The comparison above can fail."""
    with_all = frames(run_of(tmp_path / "all"))
    for name in EFFECTS:
        if name not in {"body_contact", "inertia"}:
            assert not np.array_equal(frames(run_of(tmp_path / name, effects=without(name))), with_all), name


def test_a_body_out_of_reach_is_absent_bit_for_bit(tmp_path):
    far = run_of(tmp_path / "far", body=BALL | {"position": [0.0, 0.0, -50.0]})
    none = run_of(tmp_path / "none", body=(), effects=without("body_contact"))
    assert np.array_equal(frames(far), frames(none))
    assert far.summary["effects"]["body_contact"]["pairs"] == 0
    assert far.summary["effects"]["body_contact"]["hessian_nonzeros"] == 0


@pytest.mark.parametrize(("integrator", "above"), [("backward_euler", 0.053), ("bdf2", 0.06)])
def test_self_contact_without_a_pair_is_absent_bit_for_bit(tmp_path, integrator, above):
    """The upper sheet is damped above the lower one: pairs are predicted in both steps, and none is active.

    In two steps it falls by 30 mm with backward Euler, and by 37 mm with BDF2.
    """
    low = SHEET | {"name": "low", "cells": [6, 6]}
    high = low | {"name": "high", "position": [0.1, 0.07, SHEET["position"][2] + above], "velocity": [0, 0, -2.0]}
    effects = without("body_contact") | {"damping": {"rate": 50.0}, "pins": {"select": [0, 6, 42, 48]}}
    sections = {"cloth": (low, high), "body": (), "solver": SOLVER | {"linear": "auto", "integrator": integrator}}
    sections["run"] = {"duration": 0.04, "frames_per_second": 50}
    runs = [run_of(tmp_path / str(k), effects=effects | more, **sections) for k, more in enumerate(({}, SELF))]
    assert np.array_equal(frames(runs[0]), frames(runs[1]))
    contact = runs[1].summary["effects"]["self_contact"]
    assert contact["pairs"] == contact["hessian_nonzeros"] == 0
    assert contact["hessians"] > 0


# --- nothing absent is imported or run ------------------------------------------------------------------------------


HEAVY = ("ipctk", "pyvista", "vtkmodules", "trimesh", "meshio", "transfer", "torch", "jax", "clothsim.gradients")
RUNS = """
import sys
import clothsim

def run(folder, **sections):
    scene = clothsim.Scene(cloth={cloth!r}, solver={solver!r}, run={{"duration": 0.02}}, **sections)
    assert clothsim.simulate(scene, folder).status == "completed"
    print([n for n in {heavy!r} if n in sys.modules], "clothsim.physics.contact" in sys.modules)

run({folder!r} + "/membrane", effects={{"inertia": {{}}, "membrane": {{}}}})
run({folder!r} + "/all", body={body!r}, effects={effects!r})
"""


def test_runs_import_nothing_heavy_and_a_membrane_no_contact(tmp_path):
    """Two runs of an interpreter: a membrane alone, then all usual effects with contact."""
    code = RUNS.format(cloth=SHEET, solver=SOLVER, body=BALL, effects=EFFECTS, heavy=HEAVY, folder=str(tmp_path))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["[] False", "[] True"]


SHARED = {
    "bending": ["clothsim.physics.energies.hinge_bending"],
    "body_contact": [f"{contact.__name__}.{module.name}" for module in pkgutil.iter_modules(contact.__path__)],
}
"""Modules that others import too, but that nobody calls in a scene without the effect (`scene_without`)."""


def raising(name):
    def call(*_, **__):
        raise AssertionError(f"{name} is absent, and was called")

    return call


def poison(monkeypatch, name):
    """Every function and method in the modules of an effect raises; returns how many do."""

    count = 0
    names = {home(name), *own(name), *SHARED.get(name, [])}
    modules = {each: importlib.import_module(each) for each in names}  # all before one is poisoned: they import others'
    for module_name, module in modules.items():
        for key, thing in list(vars(module).items()):
            if getattr(thing, "__module__", None) != module_name:
                continue
            if inspect.isclass(thing):
                for method in ("value", "gradient", "hessian", "begin", "step_limit", "at"):
                    if method in vars(thing):
                        monkeypatch.setattr(thing, method, raising(name))
                        count += 1
            elif callable(thing):
                # a builder keeps its signature: the scene is checked against it
                monkeypatch.setattr(module, key, functools.wraps(thing)(raising(name)))
                count += 1
    return count


def scene_without(name):
    """All effects but one; where that is contact, no body either: the frames would intersect."""
    effects = {key: keys for key, keys in (ALL if name != "body_contact" else EFFECTS | PINS).items() if key != name}
    return {"effects": effects} | ({"body": ()} if name == "body_contact" else {})


@pytest.mark.parametrize("name", TABLE)
def test_no_kernel_of_an_absent_effect_is_called(tmp_path, monkeypatch, name):
    assert poison(monkeypatch, name) >= 1
    run = run_of(tmp_path, **scene_without(name))
    assert run.status == "completed", run.reason
    assert name not in run.summary["effects"]


@pytest.mark.parametrize("name", TABLE)
def test_the_poison_works(tmp_path, monkeypatch, name):
    poison(monkeypatch, name)
    with pytest.raises(AssertionError, match=f"{name} is absent"):
        run_of(tmp_path, effects=ALL)


ZERO_SCENES = """
import json, sys
import clothsim
from clothsim.scene.assembly.scene_world import build

def compiled():
    # the kernels of the package that are compiled, or were read from the cache
    modules = {name: thing for name, thing in sys.modules.items() if name.startswith("clothsim.")}
    things = ((name, key, thing) for name, module in modules.items() for key, thing in vars(module).items())
    return {f"{name}.{key}" for name, key, thing in things if getattr(thing, "signatures", None)}

base, *scenes = json.loads(sys.stdin.read())
build(clothsim.Scene(**base))
more = {}
for name, scene in scenes:
    before = compiled()
    assert list(build(clothsim.Scene(**scene)).off) == [name]
    more[name] = sorted(compiled() - before)
build(clothsim.Scene(**base | {"effects": {"self_contact": {}}}))
print(json.dumps([more, sorted(compiled())]))
"""


def test_no_kernel_is_compiled_for_a_coefficient_of_zero():
    """In one interpreter, nor read from the cache; the contact at the end shows that one that is would be seen."""
    zeros = {name: example for name, example in EXAMPLES.items() if example.zero is not None}
    base = {"cloth": SHEET, "body": BALL, "effects": {"inertia": {}}, "solver": SOLVER}
    scenes = []
    for name, example in zeros.items():
        changes = {key: base[key] | keys if keys else keys for key, keys in example.zero_scene.items()}
        scenes.append((name, base | changes | {"effects": {"inertia": {}, name: example.zero}}))
    words = [sys.executable, "-c", ZERO_SCENES]
    done = subprocess.run(words, input=json.dumps([base, *scenes]), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    more, at_the_end = json.loads(done.stdout)
    assert more == {name: [] for name in zeros}
    assert any(kernel.startswith("clothsim.physics.contact.") for kernel in at_the_end)


# --- what is not zero in the matrix ---------------------------------------------------------------------------------


def test_hessians_hold_what_their_effect_needs_and_no_more(tmp_path):
    accounts = run_of(tmp_path, body=BALL | {"position": [0.0, 0.0, -50.0]}).summary["effects"]
    triangles, vertices, hinges = 32, 25, 32 + 8
    assert accounts["membrane"]["hessian_nonzeros"] == 81 * triangles
    assert accounts["bending"]["hessian_nonzeros"] == 144 * hinges
    assert accounts["inertia"]["hessian_nonzeros"] == accounts["damping"]["hessian_nonzeros"] == 9 * vertices
    assert accounts["gravity"]["hessian_nonzeros"] == 0
