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
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

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


class PartCompiler(Compiler):
    """Numba's compiler with the result in a `LinkedLibrary`."""

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Compile a Python function."""
        if self.state.library is None:
            self.state.library = LinkedLibrary(self.state.targetctx.codegen(), func.__qualname__)
        return super().compile_extra(func)


class KernelCompiler(Compiler):
    """Numba's compiler without garbage collection: it makes millions of objects, and nearly all live until the end."""

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
