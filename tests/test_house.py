"""Structure of the package: limits that may only fall, and what the doors load."""

import ast
import subprocess
import sys
from functools import cache

import house
import pytest

from clothsim import engine, files, gradients, patterns, render

LIMITS = {
    "arrows between rooms": 95,
    "engine names at the door": 60,
    "names at the other doors": 39,
    "modules with one importer, in their folder": 8,
    "imports inside functions": 50,
    "classes of one name in several modules": 2,
    "functions of one name in several modules": 37,
    "short private functions used once": 188,
    "modules": 445,
}


@cache
def counts():
    return {
        "arrows between rooms": len(house.arrows()),
        "engine names at the door": len(engine.__all__),
        "names at the other doors": sum(len(door.__all__) for door in (patterns, files, render, gradients)),
        "modules with one importer, in their folder": len(house.single_importers()),
        "imports inside functions": house.function_imports(),
        "classes of one name in several modules": len(house.repeated_names(ast.ClassDef)),
        "functions of one name in several modules": len(house.repeated_names(ast.FunctionDef)),
        "short private functions used once": len(house.short_helpers()),
        "modules": len(house.module_files()),
    }


@pytest.mark.parametrize("what", LIMITS)
def test_what_one_must_know_only_falls(what):
    assert counts()[what] <= LIMITS[what]


def test_docstrings_name_what_there_is():
    assert house.unknown_names() == []


def test_no_application_imports_an_engine_room():
    assert house.engine_names() == set()


@pytest.mark.parametrize("door", ["engine", "patterns", "files", "render", "gradients"])
def test_a_door_loads_nothing_until_a_name_is_used(door):
    code = f"import sys, clothsim.{door}; print([name for name in sys.modules if name.startswith('clothsim')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str(["clothsim.base", "clothsim.base.lazy_names", "clothsim", f"clothsim.{door}"])


@pytest.mark.parametrize("door", [engine, patterns, files, render, gradients])
def test_each_name_of_a_door_is_there(door):
    for name in door.__all__:
        assert getattr(door, name) is not None


@pytest.mark.parametrize("door", [patterns, files, render, gradients])
def test_no_name_of_a_door_is_hidden_by_a_module(door):
    inside = [module.rpartition(".") for module in house.module_files()]
    modules = {name for folder, _, name in inside if folder == door.__name__}
    assert modules.isdisjoint(door.__all__)
