"""Rules of other systems: file names that Windows takes, text files with a named encoding."""

import ast
import subprocess
from pathlib import Path, PureWindowsPath

import pytest
from small_scenes import small_scene

import clothsim

ROOT = Path(__file__).parents[1]
SOURCES = sorted(path for package in ("clothsim", "transfer", "addons") for path in (ROOT / package).rglob("*.py"))
FORBIDDEN = set('<>:"|?*\\')
RESERVED = {"con", "prn", "aux", "nul", *(f"{port}{k}" for port in ("com", "lpt") for k in range(10))}
LONGEST = 120
"""Letters of a path inside a run's folder: Windows takes 260 with the folder's own, unless it is set up for more."""


def is_portable(name):
    """True for a relative path that Windows takes."""
    parts = PureWindowsPath(name).parts
    return len(name) <= LONGEST and all(
        not FORBIDDEN & set(part) and part.split(".")[0].lower() not in RESERVED and part[-1] not in ". "
        for part in parts
    )


def text_without_encoding(path):
    """Lines of a source that open a text file in whatever encoding the system has."""
    lines = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call) or any(keyword.arg == "encoding" for keyword in node.keywords):
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name == "open" and isinstance(node.func, ast.Name):
            modes = [arg.value for arg in node.args[1:2] if isinstance(arg, ast.Constant)]
            if not any("b" in mode for mode in modes):
                lines.append(node.lineno)
        elif (name == "read_text" and not node.args) or (name == "write_text" and len(node.args) < 2):
            lines.append(node.lineno)
    return lines


def test_text_is_opened_with_a_named_encoding():
    found = {str(path.relative_to(ROOT)): text_without_encoding(path) for path in SOURCES}
    assert len(found) > 300
    assert {name: lines for name, lines in found.items() if lines} == {}


def test_the_rule_sees_what_it_forbids(tmp_path):
    source = tmp_path / "x.py"
    source.write_text(
        'open("a")\nopen("a", "rb")\np.read_text()\np.write_text("b", encoding="utf-8")\n', encoding="utf-8"
    )
    assert text_without_encoding(source) == [1, 3]
    assert not is_portable("a:b.png")
    assert not is_portable("frames/aux.obj")
    assert is_portable("frames/drape_0001.obj")


def test_the_files_of_a_run_have_names_that_windows_takes(tmp_path):
    run = clothsim.simulate(small_scene(run={"duration": 0.04, "frames_per_second": 25}), tmp_path / "run")
    run.export(tmp_path / "run" / "drape.obj")
    names = [str(file.relative_to(tmp_path)) for file in tmp_path.rglob("*")]
    assert len(names) > 4
    assert [name for name in names if not is_portable(name)] == []


def test_the_files_of_the_repository_have_names_that_windows_takes():
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("no repository: an unpacked archive")
    assert [name for name in listed.stdout.splitlines() if not is_portable(name)] == []
