"""Only the effects that a scene calls for: absent is the same as a coefficient of zero, and nothing absent is run.

Bit for bit in positions, with one thread (VALIDATION D.2, D.4, D.5).
"""

import functools
import importlib
import inspect
import pkgutil
import subprocess
import sys

import numpy as np
import pytest
from import_graph import home, own
from small_scenes import BALL, EFFECTS, SHEET, SOLVER, small_scene, without

import clothsim.contact
from clothsim import simulate
from clothsim.scene.effects import EFFECTS as TABLE

SHORT = {"duration": 0.08, "frames_per_second": 25}
PINS = {"pins": {"select": "corners"}}
SHEET_TOO = {"fibres": {"warp": 20.0}, "strain_limit": {"limit": 2.0}}
CREASE = {"through": [[0.0, -0.5, 0.0], [0.0, 0.5, 0.0]], "angle_degrees": 20.0}
SEAM = {"from": {"side": "left"}, "to": {"side": "right"}}
TETHER = {"select": "corners", "stiffness": 5.0}
CREASED = {"rest_angle": {"crease": [CREASE]}, "springs": {"spring": [TETHER]}, "seams": {"seam": [SEAM]}}
CREASED |= {"plastic_bending": {"yield_angle_degrees": 1.0}}
ALL = EFFECTS | PINS | SHEET_TOO | CREASED | {"pressure": {"value": 0.1}, "air": {}, "self_contact": {}, "friction": {}}


def frames(run):
    assert run.status == "completed", run.reason
    return np.array([run.positions(k) for k in range(len(run.times))])


def run_of(folder, **sections):
    return simulate(small_scene(**{"run": SHORT} | sections), folder)


# --- a coefficient of zero ------------------------------------------------------------------------------------------


ZERO = {
    "gravity": ({"effects": EFFECTS | {"gravity": {"acceleration": [0, 0, 0]}}}, {"effects": without("gravity")}),
    "pressure": ({"effects": EFFECTS | {"pressure": {"value": 0}}}, {}),
    "strain_limit": ({"effects": EFFECTS | {"strain_limit": {"limit": 0, "begins": 0.1}}}, {}),
    "rest_angle": ({"effects": EFFECTS | {"rest_angle": {"crease": [CREASE | {"angle_degrees": 0}]}}}, {}),
    "springs": ({"effects": EFFECTS | {"springs": {"spring": [TETHER | {"stiffness": 0}]}}}, {}),
    "seams": ({"effects": EFFECTS | {"seams": {"seam": []}}}, {}),
    "plastic_bending": ({"effects": EFFECTS | {"plastic_bending": {"hardening": 0.5}}}, {}),
    "fibres": ({"effects": EFFECTS | {"fibres": {"warp": 0, "angle_degrees": 30}}}, {}),
    "air": ({"effects": EFFECTS | {"air": {"drag": 0, "wind": [5, 0, 0]}}}, {}),
    "damping": ({"effects": EFFECTS | {"damping": {"rate": 0}}}, {"effects": without("damping")}),
    "bending": ({"cloth": SHEET | {"bending_stiffness": 0}}, {"effects": without("bending")}),
    "membrane": ({"cloth": SHEET | {"youngs_modulus": 0}}, {"effects": without("membrane")}),
    "pins": ({"effects": EFFECTS | {"pins": {"select": []}}}, {}),
    "body_contact": ({"body": ()}, {"body": (), "effects": without("body_contact")}),
    "self_contact": ({"effects": EFFECTS | {"self_contact": {"exclude": [["cloth", "cloth"]]}}}, {}),
    "friction": ({"effects": EFFECTS | {"friction": {"coefficient": 0}}}, {}),
}


@pytest.mark.parametrize("name", ZERO)
def test_a_coefficient_of_zero_is_absent_bit_for_bit(tmp_path, name):
    zero, absent = (run_of(tmp_path / str(k), **sections) for k, sections in enumerate(ZERO[name]))
    assert np.array_equal(frames(zero), frames(absent))
    assert list(zero.summary["off"]) == [name]
    assert zero.summary["off"][name]
    assert name not in zero.summary["effects"]
    assert absent.summary["off"] == {}
    assert zero.summary["newton_iterations"] == absent.summary["newton_iterations"]


def test_every_effect_has_its_zero():
    assert set(ZERO) == set(TABLE) - {"inertia"}


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


# --- nothing absent is imported or run ------------------------------------------------------------------------------


HEAVY = ("ipctk", "pyvista", "vtkmodules", "trimesh", "meshio", "transfer", "torch")


def modules_after(code):
    script = f"{code}\nimport sys\nprint([n for n in {HEAVY!r} if n in sys.modules], 'clothsim.contact' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_a_membrane_scene_imports_nothing_heavy(tmp_path):
    code = f"""
import clothsim
scene = clothsim.Scene(
    cloth={SHEET!r}, effects={{"inertia": {{}}, "membrane": {{}}}}, solver={SOLVER!r}, run={{"duration": 0.02}}
)
assert clothsim.simulate(scene, {str(tmp_path)!r}).status == "completed"
"""
    assert modules_after(code) == "[] False"


@pytest.mark.parametrize(("backend", "heavy"), [("auto", "[]"), ("ipctk", "['ipctk']")])
def test_only_the_backend_that_is_called_ipctk_imports_it(tmp_path, backend, heavy):
    code = f"""
import clothsim
scene = clothsim.Scene(
    cloth={SHEET!r}, body={BALL!r}, effects={{"inertia": {{}}, "body_contact": {{}}}}, solver={SOLVER!r},
    run={{"duration": 0.02}}, contact={{"backend": {backend!r}}},
)
assert clothsim.simulate(scene, {str(tmp_path)!r}).status == "completed"
"""
    assert modules_after(code) == f"{heavy} True"


SHARED = {
    "bending": ["clothsim.energies.hinge_bending"],
    "body_contact": [f"clothsim.contact.{module.name}" for module in pkgutil.iter_modules(clothsim.contact.__path__)],
}
"""Modules that others import too, but that nobody calls in a scene without the effect (`scene_without`)."""


def raising(name):
    def call(*_, **__):
        raise AssertionError(f"{name} is absent, and was called")

    return call


def poison(monkeypatch, name):
    """Every function and method in the modules of an effect raises; returns how many do."""

    count = 0
    for module_name in {home(name), *own(name), *SHARED.get(name, [])}:
        module = importlib.import_module(module_name)
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
    """All effects but one; where that is contact, no body either: the frames would be judged."""
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


# --- what is not zero in the matrix ---------------------------------------------------------------------------------


def test_hessians_hold_what_their_effect_needs_and_no_more(tmp_path):
    accounts = run_of(tmp_path, body=BALL | {"position": [0.0, 0.0, -50.0]}).summary["effects"]
    triangles, vertices, hinges = 32, 25, 32 + 8
    assert accounts["membrane"]["hessian_nonzeros"] == 81 * triangles
    assert accounts["bending"]["hessian_nonzeros"] == 144 * hinges
    assert accounts["inertia"]["hessian_nonzeros"] == accounts["damping"]["hessian_nonzeros"] == 9 * vertices
    assert accounts["gravity"]["hessian_nonzeros"] == 0
