import os
import subprocess
import sys
from collections import namedtuple

import numpy as np
import pytest
from kernel_sources import SOURCE, module_of
from numba import float32, int64, njit, typeof, types, vectorize
from numba.core.registry import cpu_target

from clothsim.base.jit import kernel
from clothsim.base.kernel_cache.cache import UnnameableError, code_text, digest, digest_of_types


def digest_of(compiled):
    return digest(compiled, cpu_target.target_context)


@pytest.mark.parametrize(
    "edit",
    [
        ("return x * x", "return 2.0 * x * x"),
        ("return scaled(square(x))", "return scaled(square(x + 1.0))"),
        ("FACTOR = 2.0", "FACTOR = 2"),
        ("by=FACTOR", "by=3.0"),
        ("np.array([1.0, 2.0])", "np.array([1.5, 2.0])"),
        ("np.array([1.0, 2.0])", "np.array([1, 2])"),
        ("@part\ndef square", "@inlined\ndef square"),
        ("@inlined\ndef scaled", "@part\ndef scaled"),
        ("return 1.0 / x", "return 1.0 / (x + 0.0)"),
        ('@register_jitable(error_model="numpy")', "@register_jitable"),
        ('@register_jitable(error_model="numpy")', '@register_jitable(error_model="numpy", inline="always")'),
        ("math.sin", "math.cos"),
    ],
)
def test_what_a_kernel_reaches_changes_its_digest(edit):
    assert digest_of(module_of(SOURCE, edit).outer) != digest_of(module_of().outer)


@pytest.mark.parametrize(
    "edit",
    [
        ("The square.", "Its square."),
        ("The energy.", "Its energy."),
        ("    return x * x", "\n\n    # x^2\n    return x * x"),
        ("UNUSED = 7", "UNUSED = 8"),
        ("STIFF = 1", "STIFF = 3"),
    ],
)
def test_what_it_does_not_use_does_not(edit):
    assert digest_of(module_of(SOURCE, edit).outer) == digest_of(module_of(name="elsewhere").outer)


def test_names_within_a_module_and_a_closure_and_an_enumeration_count():
    module = module_of()
    two, three = module.made_with(2), module.made_with(3)
    assert digest_of(two) == digest_of(module_of().made_with(2))
    assert digest_of(two) != digest_of(three)
    assert digest_of(two) != digest_of(module_of(SOURCE, ("STIFF = 1", "STIFF = 3")).made_with(2))
    through = "\n\n@kernel\ndef through(x):\n    return springs.square(x) * springs.FACTOR\n"
    with_part, with_other, with_factor = module_of(), module_of(SOURCE, ("x * x", "x * x * x")), module_of()
    with_factor.FACTOR = 5.0
    digests = set()
    for springs in (with_part, module_of(), with_other, with_factor):
        namespace = {"springs": springs, "kernel": kernel}
        exec(through, namespace)
        digests.add(digest_of(namespace["through"]))
    assert len(digests) == 3


def test_a_docstring_that_is_also_read_counts():
    one, other = (
        module_of(f'from numba import njit\n@njit\ndef f(x):\n    "{word}"\n    return len("{word}")').f
        for word in ("a", "b")
    )
    assert digest_of(one) != digest_of(other)


def test_it_is_the_same_in_each_process(request):
    code = (
        "from numba.core.registry import cpu_target; from kernel_sources import module_of;"
        "from clothsim.base.kernel_cache.cache import digest;"
        "print(digest(module_of().outer, cpu_target.target_context))"
    )
    paths = os.pathsep.join([str(request.config.rootpath), str(request.config.rootpath / "tests" / "support")])
    for seed in "12":
        environment = os.environ | {"PYTHONPATH": paths, "PYTHONHASHSEED": seed}
        done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
        assert done.stdout.strip() == digest_of(module_of().outer)


def test_the_compilers_options_count():
    def f(x):
        return x * x + 1.0

    made = [kernel(f), njit(f), njit(fastmath=True)(f), njit(fastmath={"contract"})(f), njit(locals={"x": float32})(f)]
    assert len({digest_of(compiled) for compiled in made}) == len(made)
    assert digest_of(njit(f)) == digest_of(njit(f))


def test_an_object_that_looks_like_a_function_of_numba_has_no_digest():
    @vectorize
    def cube(x):
        return x * x * x

    @njit
    def cubes(x):
        return cube(x)

    with pytest.raises(UnnameableError):
        digest_of(cubes)


def test_a_value_without_a_lasting_description_has_no_digest():
    thing = object()

    @njit
    def with_an_object(x):
        return x if thing is None else 2 * x

    with pytest.raises(UnnameableError):
        digest_of(with_an_object)


def test_types_are_distinguished_and_functions_are_no_lasting_types():
    vectors = [typeof(np.zeros((2, 3))), typeof(np.zeros((3, 2)).T), typeof(np.zeros(3)), types.float64, int64]
    signatures = [(types.UniTuple(vector, 2), vector) for vector in vectors] + [tuple(vectors), (vectors[0],)]
    assert len({digest_of_types(signature) for signature in signatures}) == len(signatures)
    assert digest_of_types((types.Omitted(1.0),)) != digest_of_types((types.Omitted(2.0),))
    one, other = (typeof(namedtuple("Pair", fields)(1.0, 2.0)) for fields in ("x y", "y x"))
    assert digest_of_types((one,)) != digest_of_types((other,))
    frozen = np.zeros(3)
    frozen.flags.writeable = False
    assert digest_of_types((typeof(frozen),)) != digest_of_types((typeof(np.zeros(3)),))
    with pytest.raises(UnnameableError):
        digest_of_types((typeof(njit(lambda x: x)),))


def test_bytecode_is_identified_by_its_constants_and_names_alone():
    def texts(*sources):
        return [code_text(compile(source, f"{k}.py", "exec").co_consts[0]) for k, source in enumerate(sources)]

    plain, commented, documented, reported = texts(
        "def f(x): return x + 1",
        "\n# more\ndef f(x):\n  return x + 1",
        "def f(x):\n  'a'\n  return x + 1",
        "def f(x):\n  'b'\n  return x + 1",
    )
    assert plain == commented
    assert documented == reported
    others = texts(
        "def f(x): return x + 1.0", "def f(x): return x + 0.0", "def f(x): return x + -0.0", "def f(y): return y"
    )
    assert len({plain, *others}) == 5
