"""Canonical descriptions of values, bytecode and types, identical in every process."""

import dis
import functools
import hashlib
from types import CodeType
from typing import Any

from numba import types

PLAIN = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis), range, slice)
"""Types that `repr` describes completely."""

_READ_THE_FIRST_CONSTANT = {(instruction, 0) for instruction in dis.hasconst}
_TYPES = (types.Number, types.Boolean, types.Array, types.Literal, types.NoneType, types.UnicodeType)
"""Types of arguments that are described by their names: classes, and functions as arguments, are not."""


class UnnameableError(Exception):
    """Value without a complete description that is identical in every process."""


def unnameable(value: Any) -> str:
    """Raise the error, in the place of a text."""
    raise UnnameableError(f"{value!r} of {type(value).__module__}.{type(value).__qualname__}")


def plain(value: Any) -> str:
    """Description of a value of the types `PLAIN`."""
    return f"{type(value).__qualname__} {value!r}"


def array(value: Any) -> str:
    """Description of a NumPy array or scalar: its bytes."""
    if value.dtype.hasobject:
        return unnameable(value)
    return f"array {value.dtype.descr} {value.shape} {value.strides} {value.tobytes().hex()}"


def named_type(value: Any) -> str:
    """Description of a type of numba, NumPy or LLVM; `UnnameableError` where its name holds an address."""
    text = f"{type(value).__qualname__} {value}"
    return unnameable(value) if "0x" in text else text


@functools.cache
def code_text(code: CodeType) -> str:
    """Bytecode, names and constants; neither its file, nor its lines, nor its docstring."""
    variables = code.co_varnames, code.co_freevars, code.co_cellvars, code.co_names
    counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
    table = getattr(code, "co_exceptiontable", b"")
    constants = [_constant(value) for value in code.co_consts[_docstrings(code) :]]
    return repr((code.co_code, table, variables, counts, len(code.co_consts), constants))


def _constant(value: Any) -> str:
    """One of those that a code object holds: a frozen set has its own order in each process."""
    if isinstance(value, tuple):
        return f"tuple {[_constant(item) for item in value]}"
    if isinstance(value, frozenset):
        return f"set {sorted(_constant(item) for item in value)}"
    return code_text(value) if isinstance(value, CodeType) else plain(value)


def _docstrings(code: CodeType) -> int:
    """1 where the first constant is a string that no instruction reads, 0 otherwise."""
    if not code.co_consts or not isinstance(code.co_consts[0], str):
        return 0
    instructions = set(zip(code.co_code[::2], code.co_code[1::2], strict=True))
    return int(instructions.isdisjoint(_READ_THE_FIRST_CONSTANT))


def names_of(code: CodeType) -> set[str]:
    """Those that the code and the functions within it look up: globals, and attributes too."""
    within = (value for value in code.co_consts if isinstance(value, CodeType))
    return set(code.co_names).union(*map(names_of, within))


def digest_of_types(signature: Any) -> str:
    """A hash of 12 digits of the types of a kernel's arguments; `UnnameableError` where a function or class is one."""
    arguments = signature if isinstance(signature, tuple) else signature.args
    described = [_type(argument) for argument in arguments]
    returned = None if isinstance(signature, tuple) else signature.return_type
    return hashlib.blake2b(repr((described, str(returned))).encode(), digest_size=6).hexdigest()


def _type(argument: Any) -> str:
    if isinstance(argument, types.BaseTuple):
        return f"{argument} {getattr(argument, 'fields', ())} {[_type(item) for item in argument]}"
    if isinstance(argument, types.Optional):
        return f"{argument} {_type(argument.type)}"
    if isinstance(argument, types.Omitted):
        return f"omitted {argument.value!r}" if isinstance(argument.value, PLAIN) else unnameable(argument)
    return str(argument) if isinstance(argument, _TYPES) else unnameable(argument)
