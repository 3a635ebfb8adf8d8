"""What the first run compiles is shared with a second process, once."""

import json
import os
import subprocess
import sys
from pathlib import Path

from clothsim.cli import ahead

ROOT = Path(__file__).parents[1]

COMPILED = """
from pathlib import Path
from clothsim.cli import ahead

from clothsim.energies.membrane_kernels import fill
print(ahead._compiled())
folder = Path(fill.stats.cache_path)
folder.mkdir(parents=True, exist_ok=True)
(folder / "membrane_kernels.fill-56.py311.nbi").touch()
print(ahead._compiled())
"""
THE_REST = """
import json
from clothsim.cli.ahead import compile_the_rest
from clothsim.study.compile_time import loaded
compile_the_rest()
print(json.dumps([name for name, types in loaded().items() if types]))
"""


def output(code, **environment):
    """What the code prints in an interpreter of its own."""
    environment = os.environ | environment
    return subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    ).stdout


def test_a_second_process_begins_where_nothing_is_compiled(monkeypatch):
    begun = []
    monkeypatch.setattr(ahead.subprocess, "Popen", lambda command, **keywords: begun.append((command, keywords)))
    monkeypatch.setattr(ahead, "CORES", 1)
    monkeypatch.setattr(ahead, "_compiled", lambda: True)
    ahead.start()
    assert begun == []
    monkeypatch.setattr(ahead, "_compiled", lambda: False)
    ahead.start()
    ((command, keywords),) = begun
    assert command == [sys.executable, "-P", "-m", "clothsim.cli.ahead"]
    assert keywords["env"]["PYTHONPATH"].split(os.pathsep)[0] == str(ROOT)
    monkeypatch.setattr(ahead, "CORES", 10**6)  # one core compiles alone
    ahead.start()
    assert len(begun) == 1


def test_a_kernel_in_the_cache_tells_that_all_are_compiled(tmp_path):
    assert output(COMPILED, NUMBA_CACHE_DIR=str(tmp_path)).split() == ["False", "True"]


def test_the_second_process_compiles_energies_matrix_and_contact():
    kernels = {".".join(name.split(".")[-2:]) for name in json.loads(output(THE_REST).splitlines()[-1])}
    assert {"membrane_kernels.fill", "hinge_kernels.fill", "pattern._times"} <= kernels
    assert {"barrier_hessian.squares", "semidefinite.positive_squares", "scatter.add_squares"} <= kernels
