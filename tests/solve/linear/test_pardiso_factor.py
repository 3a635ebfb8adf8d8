"""Both libraries that hold PARDISO, each in a process of its own: their symbols have the same names."""

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from clothsim.solve.linear.pardiso_factor import load_library

ROOT = Path(__file__).parents[3]
SOLVE = """
import json, sys
hidden, name = sys.argv[1:]
sys.modules[hidden] = None
import numpy as np
from clothsim.solve.linear.linear_solvers import make_solver, slowness
from clothsim.solve.linear.sparsity import make_pattern

n = 7
pattern = make_pattern(n, np.zeros((0, 3), int), [])
data = np.tile(4.0 * np.eye(3) + 0.5, (len(pattern.columns), 1, 1)).ravel()
solver = make_solver(name, pattern, threads=2)
b = np.arange(3.0 * n)
x = solver.solve(data, b)
library = (solver._single if name == "mixed" else solver._factor)._library
solver.solve(pattern.shift(data, 1.0), b)
print(json.dumps([x.tolist(), library.threaded, solver.threads, solver.wanted_threads, bool(slowness(solver))]))
"""


@pytest.mark.parametrize("name", ["mixed", "pardiso"])
@pytest.mark.parametrize(
    ("package", "hidden", "threaded"), [("pypardiso", "pymklpardiso", True), ("pymklpardiso", "pypardiso", False)]
)
def test_each_library_solves(package, hidden, threaded, name):
    if find_spec(package) is None:  # looked for only: to import one would load it beside the other
        pytest.skip(f"{package} is not installed")
    command = [sys.executable, "-c", SOLVE, hidden, name]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True)
    x, is_threaded, threads, wanted, slow = json.loads(done.stdout.splitlines()[-1])
    block = 4.0 * np.eye(3) + 0.5
    expected = np.linalg.solve(block, np.arange(21.0).reshape(7, 3).T).T.ravel()
    np.testing.assert_allclose(x, expected, rtol=0, atol=1e-12)
    assert (is_threaded, threads, wanted, slow) == (threaded, 2 if threaded else 1, 2, not threaded)


def test_neither_library_is_an_import_error(monkeypatch):
    for name in ("pypardiso", "pymklpardiso"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ImportError):
        load_library()
