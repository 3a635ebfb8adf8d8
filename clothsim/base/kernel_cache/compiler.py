"""The compiler's identity: versions, processor and settings that machine code depends on."""

import hashlib
import sys
from typing import Any

import llvmlite
import llvmlite.binding
import numba
import numpy as np
from numba.core import config

FORMAT = 3
"""Raised when files of an earlier clothsim could no longer be read, or `pipelines` has changed."""

_WITHOUT_EFFECT = (
    "CUDA_", "CPU_", "DUMP_", "CACHE_", "DEBUG_CACHE", "GDB_", "COLOR_SCHEME", "SHOW_HELP", "FULL_TRACE", "HTML"
)  # fmt: skip
"""Prefixes of the settings of numba that change no machine code, and CPU_, which the codegen tells.

All others count, those of later versions too.
"""


def identity(codegen: Any, processor: tuple[str, str, str] | None = None) -> str:
    """A hash of 16 digits of what compiles.

    Parameters
    ----------
    codegen : numba.core.codegen.CPUCodegen
        It knows the processor's name and features, or NUMBA_CPU_NAME and NUMBA_CPU_FEATURES instead.
    processor : tuple of str, optional
        Another one: triple, name, features.
    """
    versions = (FORMAT, sys.implementation.cache_tag, sys.version_info[:3], sys.flags.optimize)
    libraries = (numba.__version__, llvmlite.__version__, llvmlite.binding.llvm_version_info, np.__version__)
    text = repr((versions, libraries, processor or codegen.magic_tuple(), _settings()))
    return hashlib.blake2b(text.encode(), digest_size=8).hexdigest()


def _settings() -> list[tuple[str, str]]:
    """Those of numba.config that machine code may depend on (NUMBA_OPT, NUMBA_BOUNDSCHECK, Intel's SVML ...)."""
    return sorted(
        (name, repr(value))
        for name, value in vars(config).items()
        if name.isupper()
        and not name.startswith(("_", *_WITHOUT_EFFECT))
        and not name.endswith("NUM_THREADS")
        and isinstance(value, str | int | float | tuple | list | None)
    )
