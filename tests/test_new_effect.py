"""Steps of docs/extending.md, followed in a copy of the package: one file and one line."""

import os
import re
import shutil
import subprocess
import sys
from importlib import util
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest
from import_graph import PACKAGE
from small_scenes import SHEET, SOLVER, small_scene

from clothsim import InputError, simulate
from clothsim.cli import main
from clothsim.physics.energies.base import Off
from clothsim.run.receipt import explain_scene
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.effects import EFFECTS, Effect, register_effect

CLONE = Path(__file__).parent.parent
PAGE = (CLONE / "docs" / "extending.md").read_text(encoding="utf-8")
FILE, LINE = (dedent(block) for block in re.findall(r"^   ```python\n(.*?)^   ```$", PAGE, re.DOTALL | re.MULTILINE))
WHERE = re.search(r"`(clothsim/physics/energies/\w+\.py)`", PAGE).group(1)
THROUGH_THE_TABLE = (
    "tests/physics/energies/test_table.py",
    "tests/test_absent_effects.py",
    "tests/test_idle_effects.py",
)
SCENE = """
[cloth]
mesh = "rectangle"
cells = [4, 4]
position = [0.0, 0.0, 0.33]

[effects.inertia]
[effects.trampoline]
strength = 40.0

[solver]
linear = "superlu"
threads = 1

[run]
duration = 0.04
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy of package and tests after the two steps."""
    root = tmp_path_factory.mktemp("copy")
    shutil.copytree(PACKAGE, root / "clothsim")  # with kernels compiled beside their files, if any
    shutil.copytree(CLONE / "tests", root / "tests", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(CLONE / "pyproject.toml", root)
    (root / WHERE).write_text(FILE, encoding="utf-8")
    table = root / "clothsim" / "scene" / "effects.py"
    head, last, tail = table.read_text(encoding="utf-8").partition('\n}\n\nCONTACTS = ("body_contact"')
    assert last
    table.write_text(f"{head}\n    {LINE.strip()}{last}{tail}", encoding="utf-8")
    return root


def test_the_tests_of_the_table_pass_with_it(copy):
    words = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-k", "trampoline", "-vv", *THROUGH_THE_TABLE]
    environment = os.environ | {"PYTHONPATH": str(copy), "PYTHONSAFEPATH": "1"}
    done = subprocess.run(words, cwd=copy, env=environment, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    passed = re.findall(r"^(tests/\S+?)::(\S+)\[.*trampoline.*\] PASSED", done.stdout, re.MULTILINE)
    assert {file for file, _ in passed} == set(THROUGH_THE_TABLE)
    assert {
        "test_gradient_is_the_derivative_of_the_value",
        "test_hessian_is_the_derivative_of_the_gradient",
        "test_a_coefficient_of_zero_is_absent_bit_for_bit",
        "test_no_kernel_of_an_absent_effect_is_called",
        "test_the_poison_works",
        "test_an_effect_that_can_be_skipped_has_an_idle_example",
    } <= {test for _, test in passed}


# --- the same energy, registered from outside of the package ---------------------------------------------------------


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a scene that names the effect, which is registered."""
    file = tmp_path / "trampoline.py"
    file.write_text(FILE, encoding="utf-8")
    spec = util.spec_from_file_location("trampoline", file)
    module = util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "trampoline", module)
    spec.loader.exec_module(module)
    (tmp_path / "scene.toml").write_text(SCENE)
    monkeypatch.delitem(EFFECTS, "trampoline", raising=False)  # of a tree in which the two steps were taken
    register_effect("trampoline", module.trampoline)
    yield tmp_path
    del EFFECTS["trampoline"]


@pytest.mark.parametrize("integrator", ["backward_euler", "bdf2"])
def test_it_runs_in_a_scene_and_oscillates_as_it_should(folder, integrator):
    """Alone with inertia each vertex is an oscillator: (1 + (b h)^2 k) z = z~ + b h v~, v = (z - z~) / (b h).

    Backward Euler: b = 1 and the values before; BDF2 after its first step: b = 2/3 and (4 before - the one before) / 3.
    """
    effects = {"inertia": {}, "trampoline": {"strength": 40.0}}
    solver = SOLVER | {"integrator": integrator, "tolerance": 1e-9}
    scene = small_scene(body=(), effects=effects, solver=solver, run={"duration": 0.2, "frames_per_second": 50})
    run = simulate(scene, folder / "run")
    assert run.status == "completed", run.reason
    h, states = SOLVER["dt"], [np.array([SHEET["position"][2], 0.0])]
    for frame in range(1, len(run.times)):
        second = integrator == "bdf2" and frame > 1
        bh = (2 / 3 if second else 1) * h
        z, v = (4 * states[-1] - states[-2]) / 3 if second else states[-1]
        end = (z + bh * v) / (1 + 40.0 * bh**2)
        states.append(np.array([end, (end - z) / bh]))
        assert np.abs(run.positions(frame)[:, 2] - end).max() < 1e-12
    assert end < 0.2


def test_it_is_explained_with_its_price(folder, capsys):
    reported = explain_scene(small_scene(body=(), effects={"inertia": {}, "trampoline": {}}), steps=2).effects[
        "trampoline"
    ]
    assert reported["on"]
    assert reported["evaluations"] > 0
    assert reported["hessian_nonzeros"] == 9 * 25
    assert main(["explain", str(folder / "scene.toml"), "--steps", "2"]) == 0
    assert "\ntrampoline " in capsys.readouterr().out


def test_a_zero_is_off_and_an_unknown_key_is_refused(folder):
    off = explain_scene(small_scene(effects={"inertia": {}, "trampoline": {"strength": 0}}), steps=1).effects
    assert (off["trampoline"]["on"], off["trampoline"]["reason"]) == (False, "strength is 0")
    with pytest.raises(InputError, match="strenght"):
        small_scene(effects={"trampoline": {"strenght": 2.0}})
    absent = explain_scene(small_scene(effects={"inertia": {}}), steps=1).effects["trampoline"]
    assert absent["reason"] == "not named in the scene"


def test_a_registered_effect_has_its_example_and_its_headline(folder):
    effect = EFFECTS["trampoline"]
    assert effect.keys() == {"strength": 1.0, "level": 0.0}
    assert effect.example().external
    assert "strength" in effect.summary


def test_the_keywords_of_a_builder_are_its_keys_whatever_their_values():
    seen = []

    def pull(world, *, given: float = 1.0, name: "ArrayLike" = (0.0, 1.0), table=np.ones(2), contacts=()):  # noqa: F821, B008
        seen.append((given, name, table, contacts))
        return Off("nothing")

    register_effect("pull", pull)
    try:
        assert EFFECTS["pull"].keys() == {"given": 1.0, "name": (0.0, 1.0), "table": (1.0, 1.0)}
        build(small_scene(effects={"inertia": {}, "pull": {"given": "much", "name": {"a": [1, 2]}}}))
    finally:
        del EFFECTS["pull"]
    (given, name, table, contacts), *others = seen
    assert (given, name, list(table), contacts, others) == ("much", {"a": (1, 2)}, [1.0, 1.0], (), [])


@pytest.mark.parametrize(
    ("name", "builder"),
    [
        ("gravity", lambda world: None),
        ("two words", lambda world: None),
        (7, lambda world: None),
        ("nothing", None),
        ("worldless", lambda *, strength=1.0: None),
        ("demanding", lambda world, strength: None),
        ("unnamed", lambda world, *, strength: None),
        ("unsigned", int),
    ],
)
def test_what_is_no_effect_is_not_registered(name, builder):
    before = dict(EFFECTS)
    with pytest.raises(InputError, match=str(name)):
        register_effect(name, builder)
    assert before == EFFECTS


@pytest.mark.parametrize("made", [None, 7, (1, 2), object()])
def test_what_a_builder_returns_is_checked(monkeypatch, made):
    monkeypatch.setitem(EFFECTS, "mistaken", Effect(lambda world: made, "a builder that returns no energy"))
    with pytest.raises(InputError, match="mistaken"):
        build(small_scene(effects={"inertia": {}, "mistaken": {}}))
