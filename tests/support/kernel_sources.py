"""Kernels compiled from edited source text."""

import sys
from types import ModuleType

SOURCE = '''
"""Density of a spring."""
import enum
import math
import numpy as np
from clothsim.base.jit import inlined, kernel, part
from numba.extending import register_jitable

FACTOR = 2.0
TABLE = np.array([1.0, 2.0])
UNUSED = 7


class Kind(enum.IntEnum):
    STIFF = 1
    SOFT = 2


@part
def square(x):
    """The square."""
    return x * x


@inlined
def scaled(x, by=FACTOR):
    return by * x


@register_jitable(error_model="numpy")
def share(x):
    return 1.0 / x


@kernel
def energy(x):
    """The energy."""
    return scaled(square(x)) + TABLE[0] + math.sin(0.0)


def made_with(power):
    @kernel
    def powers(x):
        return x**power + Kind.STIFF

    return powers


@kernel
def outer(x):
    return energy(x) + share(x)
'''


def module_of(source: str = SOURCE, *edits: tuple[str, str], name: str = "springs") -> ModuleType:
    """The module that the source gives after the edits (old text, new text), which must change it."""
    for old, new in edits:
        assert old in source
        source = source.replace(old, new)
    module = ModuleType(name)
    sys.modules.pop(name, None)
    exec(compile(source, f"{name}.py", "exec"), vars(module))
    return module
