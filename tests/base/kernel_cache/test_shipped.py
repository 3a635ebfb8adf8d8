"""Kernels shipped in a wheel: found for the compiler that made them, and for no other."""

import os
import subprocess
import sys

import pytest
from numba.core import config
from numba.core.registry import cpu_target

from clothsim.base.kernel_cache import shipped, storage
from clothsim.base.kernel_cache.shipped import identity

needs_the_level = pytest.mark.skipif(not shipped.can_run(), reason=f"a processor below {shipped.LEVEL}")

CODE = """
import sys
from pathlib import Path
import numpy as np
from clothsim.base.kernel_cache import shipped
from clothsim.base.kernel_cache import is_cached
shipped.FOLDER = Path(sys.argv[1])

from clothsim.physics.energies.membrane_kernels import value
x = np.array([[0.0, 0, 0], [1.2, 0, 0], [0, 1, 0.1]])
one = np.ones(1)
known = is_cached(value)
energy = value(x, np.array([[0, 1, 2]]), np.eye(2)[None], one, one, one)
print(known, sum(value.stats.cache_hits.values()), energy.hex())
"""


def value_with(root, folder, **environment):
    """Whether the kernel was known and came from a file, and its value in hexadecimal digits."""
    environment = os.environ | {"PYTHONPATH": str(root)} | environment
    command = [sys.executable, "-c", CODE, str(folder)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    known, hits, energy = done.stdout.split()
    return known == "True", int(hits), energy


@needs_the_level
def test_a_shipped_kernel_is_loaded_and_gives_the_same_bits(request, tmp_path):
    root, built, absent = request.config.rootpath, tmp_path / "built", tmp_path / "absent"
    *_, expected = value_with(root, absent, **shipped.environment(built))
    kernels = built / "clothsim" / "kernels"
    own = {"NUMBA_CACHE_DIR": str(tmp_path / "own")}
    assert value_with(root, kernels, **own) == (True, 1, expected)
    assert not list((tmp_path / "own").rglob("*" + storage.SUFFIX))  # nothing was compiled
    known, hits, energy = value_with(root, kernels, **own, NUMBA_CPU_NAME="generic")
    assert (known, hits) == (False, 0)
    assert float.fromhex(energy) == pytest.approx(float.fromhex(expected), rel=1e-12)
    (file,) = kernels.rglob("*" + storage.SUFFIX)
    file.write_bytes(file.read_bytes()[:-1] + b"?")  # damaged: compiled instead
    assert value_with(root, kernels, NUMBA_CACHE_DIR=str(tmp_path / "other"))[1:] == (0, expected)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder of shipped kernels for this compiler."""
    codegen = cpu_target.target_context.codegen()
    name = identity(codegen, (codegen.magic_tuple()[0], shipped.LEVEL, shipped.FEATURES))
    (tmp_path / name).mkdir()
    monkeypatch.setattr(shipped, "FOLDER", tmp_path)
    shipped._folder.cache_clear()
    yield tmp_path / name
    shipped._folder.cache_clear()


@needs_the_level
@pytest.mark.skipif(config.CPU_NAME is not None, reason="NUMBA_CPU_NAME is set")
@pytest.mark.parametrize("lacking", [None, *shipped.INSTRUCTIONS])
def test_a_processor_that_lacks_an_instruction_takes_none(folder, monkeypatch, lacking):
    present = {name: name != lacking for name in shipped.INSTRUCTIONS}
    monkeypatch.setattr(shipped.llvm, "get_host_cpu_features", lambda: present)
    found = shipped.folder_for(cpu_target.target_context.codegen())
    assert found == (folder if lacking is None else None)


@needs_the_level
def test_another_setting_of_the_compiler_takes_none(folder, monkeypatch):
    codegen = cpu_target.target_context.codegen()
    assert shipped.folder_for(codegen) == folder
    monkeypatch.setattr(config, "OPT", 1)
    assert shipped.folder_for(codegen) is None


def test_another_architecture_takes_none(monkeypatch):
    monkeypatch.setattr(shipped.platform, "machine", lambda: "arm64")
    assert not shipped.can_run()


IDENTITY = (
    "from numba.core.registry import cpu_target; from clothsim.base.kernel_cache.shipped import identity;"
    "print(identity(cpu_target.target_context.codegen()))"
)


def identity_with(root, **environment):
    environment = os.environ | {"PYTHONPATH": str(root)} | environment
    done = subprocess.run([sys.executable, "-c", IDENTITY], env=environment, capture_output=True, text=True, check=True)
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
    monkeypatch.setattr(getattr(shipped, library), "__version__", "0.0.1")
    assert identity(codegen) != before
