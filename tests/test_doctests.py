"""Examples of all docstrings."""

import doctest
import importlib
from pathlib import Path

import pytest

import clothsim
import transfer

ROOTS = [Path(package.__file__).parent for package in (clothsim, transfer)]
MODULES = sorted(
    ".".join(file.relative_to(root.parent).with_suffix("").parts).removesuffix(".__init__")
    for root in ROOTS
    for file in root.rglob("*.py")
    if ">>> " in file.read_text(encoding="utf-8")
)


@pytest.mark.parametrize("name", MODULES)
def test_examples_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    failed, attempted = doctest.testmod(importlib.import_module(name))
    assert attempted > 0
    assert failed == 0


def test_the_api_has_examples():
    assert {"clothsim.run.simulation", "clothsim.run.simulate", "clothsim.scene.scene"} <= set(MODULES)
