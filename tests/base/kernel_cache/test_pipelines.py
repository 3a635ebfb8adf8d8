"""Kernels whose parts are linked as LLVM code: the numbers of numba's own compiler."""

import gc

import numpy as np
import pytest
from numba import njit
from numba.core import compiler, config

from clothsim.base.jit import kernel, part
from clothsim.base.kernel_cache import KernelCompiler
from clothsim.base.kernel_cache.pipelines import Flags

pytestmark = pytest.mark.skipif(bool(config.DISABLE_JIT), reason="nothing is compiled")

SOURCE = """
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
cross = part(cross)

def norm(a):
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
norm = part(norm)

def area(a, b):
    if a[0] > 1e3:
        raise ValueError("far")
    return 0.5 * norm(cross(a, b))
area = part(area)

def areas(a, b):
    out = np.empty(len(a))
    for i in range(len(a)):
        out[i] = area(a[i], b[i]) + area(b[i], a[i]) / (1.0 + norm(a[i]))
    return out
areas = kernel(areas)
"""


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))


def areas_with(part, kernel):
    import math

    names = {"__name__": "areas", "part": part, "kernel": kernel, "np": np, "math": math}
    exec(SOURCE, names)
    return names["areas"]


def test_parts_of_parts_give_the_bits_of_numbas_compiler(cache):
    ours = areas_with(part, kernel)
    theirs = areas_with(njit(error_model="numpy"), njit(error_model="numpy"))
    a, b = np.random.default_rng(0).normal(size=(2, 50, 3))
    assert np.array_equal(ours(a, b), theirs(a, b))
    assert np.array_equal(areas_with(part, kernel)(a, b), ours(a, b))  # from the cache
    assert np.array_equal(ours(a, b), [ours.py_func(a[i : i + 1], b[i : i + 1])[0] for i in range(50)])


def test_an_error_of_a_part_is_raised(cache):
    a = np.full((2, 3), 1e4)
    with pytest.raises(ValueError, match="far"):
        areas_with(part, kernel)(a, a)


@pytest.mark.parametrize("enabled", [True, False])
def test_the_garbage_collector_is_left_as_it_was(cache, enabled, monkeypatch):
    was = gc.isenabled()
    during = []
    extra = KernelCompiler.__mro__[1].compile_extra
    monkeypatch.setattr(
        KernelCompiler.__mro__[1], "compile_extra", lambda *a: during.append(gc.isenabled()) or extra(*a)
    )
    try:
        gc.enable() if enabled else gc.disable()
        kernel(lambda x: x + 1.0)(2.0)
        assert gc.isenabled() == enabled
    finally:
        gc.enable() if was else gc.disable()
    assert during
    assert not any(during)


def test_settings_are_equal_where_numbas_are():
    ours, same = Flags(), Flags()
    ours.error_model = "numpy"
    same.inherit_if_not_set("error_model", "numpy")
    other = ours.copy()
    other.nrt = True
    given = [ours, same, other, Flags(), ours.copy()]
    given[3].nrt = False  # the default, set
    plain = [compiler.Flags(each) for each in given]
    for i, first in enumerate(given):
        for k, second in enumerate(given):
            assert (first == second) is (plain[i] == plain[k]) is (first == plain[k])
        assert hash(first) == hash(plain[i])
        assert first.summary() == plain[i].summary()  # in the names of symbols
    assert ours == same != other
    assert given[3] == Flags()
    assert ours != "numpy"
