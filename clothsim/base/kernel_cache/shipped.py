"""Kernels that a wheel ships, and the identity of the compiler that made them.

A wheel is built on one machine and installed on others: its kernels are compiled for a level of the processor's
instruction set (x86-64-v3: AVX2 and FMA, Intel since 2013 and AMD since 2015; Arm: none is chosen). They are found
where Python, numba, llvmlite, NumPy, the settings and the kernel's code are those of the build; all else is compiled
as ever. `python -m clothsim.cli.ship_kernels` writes them.

`identity` names the compiler: versions, processor and settings that machine code depends on.
"""

import functools
import hashlib
import platform
import sys
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding
import llvmlite.binding as llvm
import numba
import numpy as np
from numba.core import config

from clothsim.base.kernel_cache import storage

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
    settings = sorted(  # NUMBA_OPT, NUMBA_BOUNDSCHECK, Intel's SVML ...
        (name, repr(value))
        for name, value in vars(config).items()
        if name.isupper()
        and not name.startswith(("_", *_WITHOUT_EFFECT))
        and not name.endswith("NUM_THREADS")
        and isinstance(value, str | int | float | tuple | list | None)
    )
    text = repr((versions, libraries, processor or codegen.magic_tuple(), settings))
    return hashlib.blake2b(text.encode(), digest_size=8).hexdigest()


FOLDER = Path(__file__).with_name("shipped_kernels")
"""Absent in a clone."""

LEVEL = "x86-64-v3"
INSTRUCTIONS = "avx", "avx2", "bmi", "bmi2", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sse4.2", "xsave"
"""Those of LEVEL that LLVM has a name for, and that a processor must have."""

FEATURES = ",".join(f"+{name}" for name in INSTRUCTIONS)


def read(name: str, codegen: Any) -> bytes | None:
    """The content of a shipped kernel's file; None where there is none for this compiler and processor."""
    folder = folder_for(codegen)
    return None if folder is None else storage.read(folder / name)


def folder_for(codegen: Any) -> Path | None:
    """The folder of the kernels that were built for this compiler; None where this processor cannot run them."""
    if not FOLDER.is_dir():
        return None
    return _folder(identity(codegen, (codegen.magic_tuple()[0], LEVEL, FEATURES)))


def environment(folder: Path) -> dict[str, str]:
    """Variables under which a process compiles kernels to ship, into `folder`."""
    return {"NUMBA_CPU_NAME": LEVEL, "NUMBA_CPU_FEATURES": FEATURES, "NUMBA_CACHE_DIR": str(folder)}


def can_run() -> bool:
    """True where this machine's processor has the instructions of LEVEL."""
    if platform.machine().lower() not in ("x86_64", "amd64"):
        return False
    present = llvm.get_host_cpu_features()
    return all(present.get(name, False) for name in INSTRUCTIONS)


@functools.cache
def _folder(name: str) -> Path | None:
    """The folder for a compiler's identity; None where it is missing, or another processor was asked for."""
    folder = FOLDER / name
    chosen = config.CPU_NAME is not None or config.CPU_FEATURES is not None
    return folder if folder.is_dir() and not chosen and can_run() else None
