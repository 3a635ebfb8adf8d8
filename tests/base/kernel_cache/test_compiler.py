import os
import subprocess
import sys

import pytest
from numba.core import config
from numba.core.registry import cpu_target

from clothsim.base.kernel_cache import compiler
from clothsim.base.kernel_cache.compiler import identity

CODE = (
    "from numba.core.registry import cpu_target; from clothsim.base.kernel_cache.compiler import identity;"
    "print(identity(cpu_target.target_context.codegen()))"
)


def identity_with(root, **environment):
    environment = os.environ | {"PYTHONPATH": str(root)} | environment
    done = subprocess.run([sys.executable, "-c", CODE], env=environment, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_it_knows_the_processor_that_numba_is_reported(request):
    root = request.config.rootpath
    here = identity_with(root)
    assert here == identity_with(root, NUMBA_NUM_THREADS="1", NUMBA_DEBUG_CACHE="0", NUMBA_CACHE_DIR="elsewhere")
    generic = identity_with(root, NUMBA_CPU_NAME="generic")
    assert len({here, generic, identity_with(root, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="+sse3")}) == 3


@pytest.mark.parametrize(("name", "value"), [("OPT", 1), ("BOUNDSCHECK", 1), ("LOOP_VECTORIZE", 0), ("A_LATER_ONE", 1)])
def test_it_knows_settings_that_change_code(name, value, monkeypatch):
    codegen = cpu_target.target_context.codegen()
    before = identity(codegen)
    monkeypatch.setattr(config, name, value, raising=False)
    assert identity(codegen) != before


@pytest.mark.parametrize("library", ["numba", "llvmlite", "np"])
def test_it_knows_the_versions(library, monkeypatch):
    codegen = cpu_target.target_context.codegen()
    before = identity(codegen)
    monkeypatch.setattr(getattr(compiler, library), "__version__", "0.0.1")
    assert identity(codegen) != before
