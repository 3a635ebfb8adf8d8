import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from kernel_sources import SOURCE, module_of
from numba.core import config

import clothsim
from clothsim.base.kernel_cache import can_store, is_cached
from clothsim.base.kernel_cache.storage import SUFFIX

PACKAGE = Path(clothsim.__file__).parent
VALUE = """
import numpy as np
from clothsim.physics.energies.membrane_kernels import value
x = np.array([[0.0, 0, 0], [1.2, 0, 0], [0, 1, 0.1]])
one = np.ones(1)
print(value(x, np.array([[0, 1, 2]]), np.eye(2)[None], one, one, one), sum(value.stats.cache_hits.values()))
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    return tmp_path


def hits(compiled, x=2.0):
    """The kernel's value at x, and whether it came out of the cache."""
    value = compiled(x)
    return value, bool(sum(compiled.stats.cache_hits.values()))


def test_an_edit_of_a_part_is_seen_and_undone(folder):
    assert not is_cached(module_of().energy)
    assert hits(module_of().energy) == (9.0, False)
    assert is_cached(module_of().energy)
    assert hits(module_of().energy) == (9.0, True)
    assert hits(module_of(SOURCE, ("return x * x", "return 2.0 * x * x")).energy) == (17.0, False)
    assert hits(module_of(SOURCE, ("FACTOR = 2.0", "FACTOR = 3.0")).energy) == (13.0, False)
    assert hits(module_of().energy) == (9.0, True)


def test_a_kernel_of_another_file_sees_an_edit_of_its_part(folder):
    """A user's kernel, with a part of the package."""
    theirs = (
        "from springs import square\nfrom clothsim.base.jit import kernel\n@kernel\ndef f(x):\n    return square(x)"
    )
    found = []
    for edit in (("x * x", "x * x"), ("x * x", "x + x + 1.0"), ("x * x", "x * x")):
        sys.modules["springs"] = module_of(SOURCE, edit)
        found.append(hits(module_of(theirs, name="theirs").f, 3.0))
    del sys.modules["springs"]
    assert found == [(9.0, False), (7.0, False), (9.0, True)]


def test_types_have_their_own_files(folder):
    kernel = module_of().energy
    assert [hits(kernel, x) for x in (2.0, 2)] == [(9.0, False), (9, False)]
    assert len(list(folder.rglob(f"*{SUFFIX}"))) == 2
    assert type(hits(module_of().energy, 2)[0]) is type(kernel(2))


def test_a_damaged_file_is_compiled_again(folder):
    hits(module_of().energy)
    (file,) = folder.rglob(f"*{SUFFIX}")
    whole = file.read_bytes()
    for damaged in (b"", whole[: len(whole) // 2], b"\x80\x04]."):
        file.write_bytes(damaged)
        assert hits(module_of().energy) == (9.0, False)
    assert hits(module_of().energy) == (9.0, True)


def test_without_a_folder_kernels_are_compiled(folder, monkeypatch):
    (folder / "file").write_text("no folder")
    monkeypatch.setattr(config, "CACHE_DIR", str(folder / "file"))
    assert not can_store()
    with pytest.warns(RuntimeWarning):
        assert hits(module_of().energy) == (9.0, False)
    assert not is_cached(module_of().energy)


def test_a_kernel_with_a_value_that_has_no_description_is_compiled_and_reports_it(folder):
    """A function of numba's `vectorize` has none."""
    theirs = """
from numba import vectorize
from clothsim.base.jit import kernel
@vectorize
def cube(x):
    return x * x * x
@kernel
def cubes(x):
    return cube(x)
"""
    with pytest.warns(RuntimeWarning, match="cubes"):
        assert hits(module_of(theirs, name="theirs").cubes) == (8.0, False)
    assert hits(module_of(theirs, name="theirs").cubes) == (8.0, False)
    assert not list(folder.rglob(f"*{SUFFIX}"))


def membrane_value(copy, cache):
    environment = os.environ | {"PYTHONPATH": str(copy), "PYTHONSAFEPATH": "1", "NUMBA_CACHE_DIR": str(cache)}
    done = subprocess.run([sys.executable, "-c", VALUE], env=environment, capture_output=True, text=True, check=True)
    value, hit = done.stdout.split()
    return float(value), int(hit)


def test_an_edit_of_the_membranes_density_is_seen_in_a_copy_of_the_package(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "copy" / "clothsim", ignore=shutil.ignore_patterns("__pycache__"))
    density = tmp_path / "copy" / "clothsim" / "physics" / "energies" / "triangle_kernels.py"
    source = density.read_text()
    returned = "return 0.5 * mu * (e11 + e22 - 2.0 * log_J) + 0.5 * lam * log_J * log_J"
    assert source.count(returned) == 1
    before, hit = membrane_value(tmp_path / "copy", tmp_path / "cache")
    assert not hit
    assert before > 0.0
    density.write_text(source.replace(returned, returned.replace("return ", "return 2.0 * (") + ")"))
    assert membrane_value(tmp_path / "copy", tmp_path / "cache") == (pytest.approx(2.0 * before, rel=1e-12), 0)
    density.write_text(source)
    assert membrane_value(tmp_path / "copy", tmp_path / "cache") == (before, 1)
    assert not list((tmp_path / "copy").rglob("*.nb?"))


def test_no_kernel_uses_numbas_own_cache():
    """It lies beside the file of the kernel and does not see the parts."""
    sources = [file for package in ("clothsim", "transfer") for file in (PACKAGE.parent / package).rglob("*.py")]
    assert len(sources) > 100
    assert [file.name for file in sources if "(cache=True" in file.read_text()] == []
