"""Functions in a process of their own: values, errors, and processes that end or are ended."""

import pytest

from clothsim import InputError
from clothsim.base.process_memory import in_own_process

BOUNDS = {"memory": 3 << 29, "seconds": 60.0, "what": "file.usdc"}


def test_values_and_errors_come_back():
    assert in_own_process("posixpath:join", "a", "b", **BOUNDS) == "a/b"
    with pytest.raises(InputError) as refused:
        in_own_process("clothsim.base.inputs:refuse_unknown", "solver", ["dd"], ["dt"], **BOUNDS)
    assert "dd" in refused.value.sentence
    assert "dt" in refused.value.remedy


@pytest.mark.parametrize(
    ("function", "argument"), [("os:abort", ()), ("builtins:bytes", (1 << 40,)), ("no_such_module:name", ())]
)
def test_a_process_that_ends_is_bad_input(function, argument):
    with pytest.raises(InputError, match=r"file\.usdc"):
        in_own_process(function, *argument, **BOUNDS)


def test_a_process_that_does_not_end_is_ended():
    with pytest.raises(InputError, match="longer than"):
        in_own_process("time:sleep", 60, memory=3 << 29, seconds=0.2, what="file.usdc")
