"""Table of generators: each name has its function, and only the modules of a named generator are imported."""

import inspect
import json
import subprocess
import sys

import pytest
from import_graph import reached, run_roots

from clothsim.mesh.generators.table import GENERATORS

PACKAGE = "clothsim.mesh.generators."
OWN = {
    "rectangle": {"shapes"},
    "mannequin": {"mannequin", "mannequin.generator"},
    "shirt": {"garments", "implicit_surface", "shapes", "mannequin", "mannequin.body_limbs", "mannequin.generator"},
}


def generator_modules(modules):
    return {name.removeprefix(PACKAGE) for name in modules if name.startswith(PACKAGE)}


def test_each_name_has_its_function():
    assert {name: generator.__name__ for name, generator in GENERATORS.items()} == {name: name for name in GENERATORS}


def test_an_unknown_name_is_no_generator():
    assert "capsul" not in GENERATORS
    with pytest.raises(KeyError):
        GENERATORS["capsul"]


def test_a_run_imports_no_generator_before_a_scene_names_one():
    modules = reached(*run_roots(), within_functions=False)
    assert generator_modules(modules) == {"table"}


@pytest.mark.parametrize("name", OWN)
def test_a_generator_imports_its_own_modules_alone(name):
    module = inspect.getmodule(GENERATORS[name]).__name__
    assert generator_modules(reached(module, within_functions=True)) == OWN[name]


def test_a_rectangle_scene_imports_the_shapes_alone():
    code = (
        "import json, sys\n"
        "from clothsim.scene.assembly.scene_world import build\n"
        "from clothsim.scene.scene import Scene\n"
        "build(Scene(cloth={'mesh': 'rectangle', 'cells': [2, 2]}, effects={'inertia': {}}))\n"
        "print(json.dumps(sorted(sys.modules)))"
    )
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert generator_modules(json.loads(printed)) == {"table", "shapes"}
