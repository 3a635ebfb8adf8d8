from collections import namedtuple

import numpy as np
import pytest
from numba import int64, njit, typeof, types

from clothsim.base.kernel_cache.descriptions import UnnameableError, code_text, digest_of_types


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
