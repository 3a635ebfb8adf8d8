"""Precompilation: kernels of a first run compiled by two processes, each once."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from clothsim.run import precompile

ROOT = Path(__file__).parents[2]

THE_REST = """
import json
from clothsim.run.remaining_kernels import compile_remaining_kernels
from tests.benchmarks.compile_time import loaded
compile_remaining_kernels()
print(json.dumps([name for name, types in loaded().items() if types]))
"""


def output(code, **environment):
    """Output of the code in an interpreter of its own."""
    environment = os.environ | environment
    return subprocess.run(
        [sys.executable, "-c", code], env=environment, cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout


def test_a_second_process_begins_where_nothing_is_compiled(monkeypatch):
    begun = []
    monkeypatch.setattr(precompile.subprocess, "Popen", lambda command, **keywords: begun.append((command, keywords)))
    monkeypatch.setattr(precompile, "CORES", 1)
    monkeypatch.setattr(precompile, "kernels_are_compiled", lambda: True)
    precompile.start_precompiling()
    assert begun == []
    monkeypatch.setattr(precompile, "kernels_are_compiled", lambda: False)
    precompile.start_precompiling()
    ((command, keywords),) = begun
    assert command == [sys.executable, "-P", "-m", "clothsim.run.remaining_kernels"]
    assert keywords["env"]["PYTHONPATH"].split(os.pathsep)[0] == str(ROOT)
    monkeypatch.setattr(precompile, "CORES", 10**6)  # one core compiles alone
    precompile.start_precompiling()
    assert len(begun) == 1


def test_the_second_process_compiles_energies_matrix_and_contact():
    kernels = {".".join(name.split(".")[-2:]) for name in json.loads(output(THE_REST).splitlines()[-1])}
    longest = precompile.LONGEST.py_func
    assert ".".join([*longest.__module__.split(".")[-1:], longest.__name__]) in kernels  # else each run starts one
    assert {"membrane_kernels.add_triangles", "hinge_kernels.add_hinges", "sparsity._times"} <= kernels
    assert {"barrier_kernels.rank_one_factors", "psd_projection.positive_factors", "assembly.add_low_rank"} <= kernels


WAITER = """
import sys, time
from clothsim.run import precompile
precompile.end_with_parent()
print("ready", flush=True)
time.sleep(0.3 if sys.argv[1:] else 60)
"""
PARENT = """
import subprocess, sys
child = subprocess.Popen([sys.executable, "-c", {waiter!r}], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
child.stdout.readline()
print(child.pid, flush=True)
sys.stdin.read()
"""


@pytest.mark.skipif(not Path("/proc/self/stat").is_file(), reason="reads the state of a process from /proc")
def test_the_second_process_ends_with_a_first_one_that_is_killed():
    command = [sys.executable, "-c", PARENT.format(waiter=WAITER)]
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as parent:
        child = int(parent.stdout.readline())
        parent.kill()
        for _ in range(200):
            if not is_running(child):
                break
            time.sleep(0.05)
    assert not is_running(child)


def test_the_second_process_outlives_a_first_one_that_lets_it_finish():
    command = [sys.executable, "-c", WAITER, "short"]
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        child.stdout.readline()
        precompile.let_finish(child)
        child.stdin.close()
        assert child.wait(60) == 0


def is_running(pid):
    """False where the process has ended, or waits as a zombie to be collected."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state not in "ZX"
