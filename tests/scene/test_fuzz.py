"""Scenes of any content: built, or refused in one sentence; never another end. What `wrong types` names one by one."""

import contextlib
import copy
import datetime
import io

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from clothsim import load_scene
from clothsim.base.errors import LONGEST, InputError
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.paths import override
from clothsim.scene.scene import make_scene, scene_from_text

pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")  # 1e308 m overflows somewhere, and is refused

FEW = settings(
    max_examples=100,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
SHEET = {
    "name": "cloth",
    "mesh": "rectangle",
    "size": [1.0, 1.0],
    "cells": [2, 2],
    "diagonals": "right",
    "position": [0, 0, 0.5],
    "rotation_degrees": [0, 0, 0],
    "velocity": [0, 0, 0],
    "scale": 1.0,
    "weld": 0.0,
    "rest": "file",
    "fabric": "cotton",
    "density": 0.1,
    "poisson_ratio": 0.2,
}
BALL = {
    "name": "ball",
    "mesh": "sphere",
    "radius": 0.3,
    "subdivisions": 0,
    "motion": {"velocity": [0, 0, 0], "rotate_degrees_per_second": [0, 0, 0], "centre": [0, 0, 0]},
}
CONTACT = {"d_hat": 1e-2, "offset": 0.0, "stiffness": "auto", "exclude": []}
WHOLE = {
    "cloth": SHEET,
    "body": [BALL],
    "effects": {
        "inertia": {},
        "membrane": {"material": "neo_hookean"},
        "bending": {"model": "hinge"},
        "gravity": {"acceleration": [0, 0, -9.81]},
        "damping": {"rate": 1.0},
        "pins": {"select": [0], "clamp": False, "group": [{"select": [1], "motion": {"velocity": [0, 0, 1]}}]},
        "body_contact": CONTACT,
        "self_contact": CONTACT,
        "friction": {
            "coefficient": 0.3,
            "mu_static": "auto",
            "mu_kinetic": "auto",
            "pairs": [],
            "elastic_slip": "auto",
            "eps_v": "auto",
            "iterations": 1,
        },
    },
    "solver": {"dt": 0.01, "tolerance": 1e-3, "linear": "auto", "threads": 1, "max_iterations": 10},
    "contact": {"backend": "auto"},
    "run": {"duration": 0.1, "frames_per_second": 25.0},
    "seed": {"from": "rest"},
}


def paths(table, here=()):
    entries = table.items() if isinstance(table, dict) else enumerate(table)
    for key, value in entries:
        yield (*here, key)
        if isinstance(value, dict) or (isinstance(value, list) and value and isinstance(value[0], dict)):
            yield from paths(value, (*here, key))


NUMBERS = [0, -1, 3, 10**12, 10**400, 0.5, 1e308, 5e-324, float("nan"), float("inf"), True, None]
TEXTS = [
    "",
    "x",
    "rectangle",
    "sphere",
    "auto",
    "left",
    "a.obj",
    "a*.obj",
    "/",
    "..",
    "\0",
    "a\nb.obj",
    "\x1b[2J.obj",
    "[",
]
OTHERS = [
    datetime.time(1),
    b"x",
    object(),
    np.array([1.0, 2.0, 3.0]),
    {1: 2},
    {"box": 1},
    [[0, "ball"]],
    [["a", [], 1]],
]
ANY = st.recursive(
    st.one_of(st.sampled_from(NUMBERS), st.sampled_from(TEXTS), st.floats(), st.text(max_size=4)),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(["select", "velocity", "x"]), inner),
    max_leaves=5,
)


def end(make):
    """Parsed result; None where it is refused in readable sentences of bounded length."""
    try:
        return make()
    except InputError as error:
        refusal = error
    output = str(refusal)
    assert output.replace("\n", "").isprintable(), output
    assert all(len(line) < 2 * LONGEST + 20 for line in output.splitlines())
    return None


def with_value(path, value):
    scene = copy.deepcopy(WHOLE)
    table = scene
    for key in path[:-1]:
        table = table[key]
    table[path[-1]] = value
    return scene


def test_the_scene_that_is_spoilt_is_good(tmp_path):
    assert set(build(make_scene(WHOLE, tmp_path)).energies) == set(WHOLE["effects"]) - {"pins"}


@FEW
@given(path=st.sampled_from(list(paths(WHOLE))), value=st.one_of(ANY, st.sampled_from(OTHERS)))
def test_any_value_at_any_key(tmp_path, path, value):
    end(lambda: build(make_scene(with_value(path, value), tmp_path)))


@pytest.mark.parametrize("value", [np.array([1.0, 2.0, 3.0]), [["a", [], 1]]], ids=["array", "ragged"])
@pytest.mark.parametrize(
    "path", [("cloth", "rest"), *(("effects", name, "d_hat") for name in ("body_contact", "self_contact")),
             ("effects", "friction", "eps_v"), ("effects", "pins", "select"), ("effects", "body_contact", "stiffness")],
    ids=".".join,
)  # fmt: skip
def test_arrays_where_one_value_belongs(tmp_path, path, value):
    if path[-1] == "select" and isinstance(value, np.ndarray):
        value = value + 0.5
    assert end(lambda: build(make_scene(with_value(path, value), tmp_path))) is None


HEAD = 'cloth.mesh = "rectangle"\n'
DEEP = {
    "dotted keys": HEAD + "solver.dt" + ".a" * 3000 + " = 1",
    "dotted keys of the cloth": HEAD + "cloth.position" + ".a" * 3000 + " = 1",
    "lists": HEAD + "solver.dt = " + "[" * 100_000 + "]" * 100_000,
    "a hundred lists": HEAD + "solver.dt = " + "[" * 100 + "]" * 100,
    "digits": HEAD + "solver.dt = " + "9" * 100_000,
    "fewer digits": HEAD + "solver.dt = " + "9" * 4200,
    "a long list": HEAD + "solver.dt = [" + "1, " * 100_000 + "]",
    "a long text": HEAD + 'solver.linear = "' + "a" * 10**6 + '"',
    "a long key": HEAD + "solver." + "a" * 10**5 + " = 1",
    "a terminal's commands": 'cloth.mesh = "\\u001b[2Jx.obj"',
    "a line break": 'cloth.mesh = "a\\nb.obj"',
    "a key that is none": '"\\u0000" = 1\n' + HEAD,
}


@pytest.mark.parametrize("text", DEEP.values(), ids=DEEP)
def test_deep_and_long_files_are_refused_in_a_sentence(tmp_path, text):
    file = tmp_path / "scene.toml"
    file.write_text(text)
    assert end(lambda: build(load_scene(file))) is None
    assert end(lambda: build(override(make_scene({"cloth": SHEET}, tmp_path), text.replace("\n", " ")))) is None


@pytest.mark.parametrize("code", ["utf-16", "utf-32", "utf-8-sig", "latin-1", "utf-7"])
def test_other_encodings_are_refused_or_read(tmp_path, code):
    file = tmp_path / "scene.toml"
    file.write_bytes(("# Röckchen\n" + HEAD + "[effects.inertia]\n").encode(code))
    end(lambda: build(load_scene(file)))


def test_the_mark_that_editors_of_windows_write_is_read(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_bytes((HEAD + "[effects.inertia]\n").replace("\n", "\r\n").encode("utf-8-sig"))
    assert load_scene(file).effects == {"inertia": {}}


TEXT = (HEAD + '[[body]]\nmesh = "sphere"\n[effects.inertia]\n[solver]\ndt = 0.02 # s\n').encode()


@FEW
@given(place=st.integers(0, len(TEXT)), width=st.integers(0, 9), put=st.one_of(st.binary(max_size=6), st.just(b"[[")))
def test_any_change_of_a_file(tmp_path, place, width, put):
    file = tmp_path / "scene.toml"
    file.write_bytes(TEXT[:place] + put + TEXT[place + width :])
    end(lambda: load_scene(file))


@FEW
@given(assignment=st.one_of(st.text(max_size=30), st.text(max_size=20).map("solver.dt={}".format)))
def test_any_assignment(tmp_path, assignment):
    scene = make_scene({"cloth": SHEET}, tmp_path)
    end(lambda: override(scene, assignment))
    assert end(lambda: override(scene, "solver.dt=" + "[" * 100_000)) is None


@FEW
@given(text=st.one_of(st.text(max_size=20), st.sampled_from(["[]", "3", "{}", '{"directory": 3}', "[" * 100_000])))
def test_any_text_of_a_checkpoint(text):
    with contextlib.redirect_stderr(io.StringIO()) as printed:
        assert end(lambda: scene_from_text(text)) is None
    assert printed.getvalue() == ""
