"""Code of the notebooks runs, and the stored notebooks were executed from beginning to end."""

import ast
import json
import re
import shlex
from typing import Any

import matplotlib
import pytest

from clothsim.cli import main
from tests.notebooks import FOLDER

NAMES = ["accuracy", "any_mesh", "characters", "export", "farm", "first_drape", "fit_and_dress", "gradients"]
SMALLER = {
    "accuracy": [("[12, 2]", "[6, 1]"), ('"duration": 0.3', '"duration": 0.1')],
    "characters": [("run.duration=0.16", "run.duration=0.04")],
    "farm": [("count = 4", "count = 2")],
    "first_drape": [("[20, 20]", "[8, 8]"), ('"duration": 0.6', '"duration": 0.2')],
    "fit_and_dress": [("size=0.06", "size=0.1")],
}
"""What the code is run with here in place of what is in the notebook: `python -m tests.notebooks` runs it as it is."""


def code_cells(name: str) -> list[dict[str, Any]]:
    """Code cells of a notebook."""
    book = json.loads((FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))
    return [cell for cell in book["cells"] if cell["cell_type"] == "code"]


def source_of(cell: dict[str, Any]) -> str:
    """Code of a cell; its commands, `!clothsim ...`, as calls of `command` with their words."""
    source = cell["source"]
    lines = source if isinstance(source, str) else "".join(source)
    return re.sub("^!clothsim (.*)$", lambda found: f"command({shlex.split(found[1])})", lines, flags=re.MULTILINE)


def command(words: list[str]) -> None:
    """Run `clothsim` with these words in this process; AssertionError where it does not end well."""
    assert main(words) == 0


def test_these_are_all():
    assert sorted(file.stem for file in FOLDER.glob("*.ipynb")) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_the_code_runs(name, tmp_path, monkeypatch):
    if name == "first_drape":
        pytest.importorskip("viser")
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"command": command}
    sources, smaller = [source_of(cell) for cell in code_cells(name)], SMALLER.get(name, [])
    assert [sum(source.count(text) for source in sources) for text, _ in smaller] == [1] * len(smaller)
    for text, other in smaller:
        sources = [source.replace(text, other) for source in sources]
    for source in sources:
        exec(compile(source, f"{name}.ipynb", "exec"), names)
    if "run" in names:
        assert names["run"].status == "completed"


@pytest.mark.parametrize("name", NAMES)
def test_it_was_executed(name):
    cells = code_cells(name)
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    for cell in cells:
        last = ast.parse(source_of(cell)).body[-1]
        shows = isinstance(last, ast.Expr) and "close()" not in source_of(cell)
        assert not shows or cell["outputs"]
        assert all(output["output_type"] != "error" for output in cell["outputs"])
