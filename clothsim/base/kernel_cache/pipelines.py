"""Compilation of kernels, and of their parts as LLVM code to link and not as machine code.

Numba compiles each function as if Python might call it: LLVM optimises it with all that it calls, and translates it. A
kernel then takes in the optimised code of its parts, and is optimised and translated with them again: a part at the
fourth level was optimised four times, and its own machine code never ran.
"""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import llvmlite.binding as llvm
from numba.core import compiler
from numba.core.codegen import JITCodeLibrary

ENVIRONMENT = "_ZN08NumbaEnv"
"""Prefix of the variables that hold a function's Python objects; numba writes their addresses."""


class LinkedLibrary(JITCodeLibrary):
    """LLVM code of one function and its callees, for kernels to link: without optimisation across functions."""

    def _optimize_final_module(self) -> None:
        """Leave it to the kernel."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        engine = self._codegen._engine
        for variable in self._final_module.global_variables:
            if variable.name.startswith(ENVIRONMENT) and not engine.is_symbol_defined(variable.name):
                engine.add_module(llvm.parse_assembly(str(variable)))
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """0: there is no machine code. Numba asks for the wrapper for Python, which a part has not."""
        self._ensure_finalized()
        return 0


class Flags(compiler.Flags):
    """Numba's settings of one compilation, compared by what was set.

    They are in the key under which each call within a kernel is looked up. Numba hashes and compares dictionaries of
    all options, which it makes each time: a tenth of a compilation. The class's name is in the names of symbols.
    """

    __slots__ = ()

    def __hash__(self) -> int:
        return _HASH

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, compiler.Flags):
            return NotImplemented
        if self._values == other._values:
            return True
        given = self._values.keys() | other._values.keys()  # all others have their defaults in both
        return all(getattr(self, name) == getattr(other, name) for name in given)


_HASH = hash(compiler.Flags())
"""Numba hashes the names of the options and not their values."""


class LeanCompiler(compiler.Compiler):
    """Numba's compiler with `Flags`."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.state.flags = Flags(self.state.flags)


class PartCompiler(LeanCompiler):
    """Compiler with the result in a `LinkedLibrary`."""

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Compile a Python function."""
        if self.state.library is None:
            self.state.library = LinkedLibrary(self.state.targetctx.codegen(), func.__qualname__)
        return super().compile_extra(func)


class KernelCompiler(LeanCompiler):
    """Compiler without garbage collection: it makes millions of objects, and nearly all live until the end."""

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Compile a Python function."""
        with _collector_paused():
            return super().compile_extra(func)


@contextmanager
def _collector_paused() -> Iterator[None]:
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
