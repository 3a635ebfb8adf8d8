"""What the first run compiles is shared with a second process, once."""

import os
import subprocess
import sys

TWICE = """
from clothsim.cli import precompile
precompile.CORES = 1
first = precompile.start()
print(first is not None, first.wait(), precompile.start() is None)
"""


def test_a_second_process_compiles_where_nothing_is_compiled_and_ends(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", TWICE], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "0", "True"]
    kernels = {".".join(file.name.split("-")[0].split(".")[-2:]) for file in tmp_path.rglob("*.kernel")}
    assert {"membrane_kernels.fill", "hinge_kernels.fill", "sparsity._times"} <= kernels
    assert {"barrier_hessian.rank_one_factors", "psd_projection.positive_factors", "assembly.add_low_rank"} <= kernels


def test_one_core_compiles_alone(tmp_path):
    alone = "from clothsim.cli import precompile; precompile.CORES = 10**6; print(precompile.start())"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", alone], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["None"]
