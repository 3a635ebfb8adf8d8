import json
import subprocess
import sys

import numpy as np
from numba import njit

from clothsim.base.jit import part
from tests.benchmarks.compile_time import OURS, Compiled, compilation_report, compiled, loaded

SMALL_RUN = """
import json, sys
sys.path[:0] = [{root!r}, {tests!r}]
from clothsim import simulate
from tests.benchmarks.compile_time import loaded
from small_scenes import small_scene
simulate(small_scene(run={{"duration": 0.04, "frames_per_second": 25}}))
print(json.dumps(loaded()))
"""


@part
def square(x):
    return x * x


@njit
def of_a_literal(x, power):
    return x**power


@njit
def sum_of_squares(x):
    total = 0.0
    for i in range(len(x)):
        total += square(x[i])
    return of_a_literal(total, 1)


def test_each_function_is_counted_once_and_within_its_caller():
    found = {function.name.rpartition(".")[2]: function for function in compiled(lambda: sum_of_squares(np.ones(3)))}
    assert set(found) == {"sum_of_squares", "square", "of_a_literal"}
    outer, inner = found["sum_of_squares"], found["square"]
    assert outer.types == "(float64[1],)"
    assert 0 < inner.own <= inner.seconds < outer.seconds
    assert outer.seconds >= outer.own + inner.seconds + found["of_a_literal"].seconds - 1e-9
    assert not compiled(lambda: sum_of_squares(np.ones(3)))


def test_a_part_is_a_function_for_python():
    assert square(3.0) == 9.0
    assert type(square(3)) is int


def test_literals_of_this_package_are_reported():
    ours, theirs = (Compiled(f"{package}.f", "(float64, Literal[int](1))", 2.0, 1.0) for package in (OURS[0], "numba."))
    assert ours.for_a_literal
    assert not theirs.for_a_literal
    text = compilation_report([ours, theirs], seconds=5.0, cpu=4.0, rows=9)
    assert "2 functions compiled in 2.0 s of the processor; the run took 4.0 s of it and 5.0 s by the clock" in text
    assert text.endswith(f"literal number: {ours.name}.")


def test_a_run_needs_each_kernel_for_one_set_of_types_and_for_no_literal(tmp_path, request):
    root = request.config.rootpath
    code = SMALL_RUN.format(root=str(root), tests=str(root / "tests" / "support"))
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    kernels = json.loads(run.stdout.splitlines()[-1])
    used = {name: types for name, types in kernels.items() if types}
    assert len(used) > 15
    assert {name: types for name, types in used.items() if len(types) > 1} == {}
    assert {name: types for name, types in used.items() if "Literal" in types[0]} == {}


def test_kernels_in_use_are_found_by_name():
    assert all(name.startswith(OURS) for name in loaded())
