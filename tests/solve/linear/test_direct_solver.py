"""Number of threads of the solver and of BLAS, and equal bits at each where that is asked for."""

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from threadpoolctl import threadpool_info

from clothsim.solve.linear import direct_solver
from clothsim.solve.linear.direct_solver import MOST, ONE_THREAD_BELOW, available_cores, one_blas_thread, solver_threads

ROOT = Path(__file__).parents[3]
IN_A_PROCESS = """
import hashlib, json, sys, tempfile
from clothsim import InputError, simulate
from small_scenes import SHEET, small_scene
from clothsim.solve.linear.pardiso_factor import load_library

def bits(**solver):
    solver = {"dt": 0.02, "tolerance": 1e-3, "linear": "mixed", **solver}
    cloth = SHEET | {"cells": (20, 20)}
    run = simulate(small_scene(cloth=cloth, solver=solver, run={"duration": 0.1}), tempfile.mkdtemp())
    return hashlib.md5(run.positions(-1).tobytes()).hexdigest()

first = json.loads(sys.argv[1])
found = [bits(**solver) for solver in first]
try:
    late = bits(repeatable=True)
except InputError:
    late = "late"
print(json.dumps([found, late, load_library().is_reproducible()]))
"""


def in_a_process(*solvers):
    """Bits of runs with these settings, of a repeatable one after them, and MKL's mode at the end."""
    if find_spec("pypardiso") is None:
        pytest.skip("pypardiso is not installed: PARDISO has one thread")
    code = f"import sys; sys.path.insert(0, 'tests/support')\n{IN_A_PROCESS}"
    command = [sys.executable, "-c", code, json.dumps(solvers)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def test_a_repeatable_scene_has_the_same_bits_at_each_number_of_threads():
    found, late, reproducible = in_a_process(*({"threads": n, "repeatable": True} for n in (1, 2, 2, 1)))
    assert reproducible
    assert {late} == set(found)


def test_a_scene_that_asks_for_nothing_leaves_mkl_as_it_was_and_then_it_is_too_late():
    _, late, reproducible = in_a_process({"threads": 1})
    assert not reproducible
    assert late == "late"


@pytest.mark.parametrize("cores", [1, 2, 64])
def test_the_number_follows_the_size_only_where_it_is_open(monkeypatch, cores):
    monkeypatch.setattr(direct_solver, "available_cores", lambda: cores)
    assert [solver_threads(n, 0) for n in (4, ONE_THREAD_BELOW - 1)] == [1, 1]
    assert solver_threads(ONE_THREAD_BELOW, 0) == min(MOST, cores)
    assert [solver_threads(10**6, n) for n in (1, 2, 16)] == [1, 2, 16]


def test_available_cores_are_those_of_the_process():
    assert available_cores() >= 1


def test_blas_has_one_thread_within_and_its_own_number_after():
    direct_solver.blas_libraries.cache_clear()  # another test may have loaded PARDISO's BLAS since the first step

    def counts():
        return [each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"]

    with direct_solver.ThreadpoolController().limit(limits=2, user_api="blas"):
        before = counts()
        with one_blas_thread():
            assert set(counts()) == {1}
        assert counts() == before
    assert 2 in before
