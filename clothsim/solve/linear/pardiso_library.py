"""The shared library that holds Intel MKL PARDISO.

Two distributions have it. `py-mkl-pardiso` (71 MB, no dependency but numpy) is one extension module with sequential MKL
linked into it: `pip install clothsim` brings it on Linux. `pypardiso` (0.9 GB with MKL, OpenMP and TBB) finds all of
MKL, which takes several threads: the extra `mkl`, and the default on Windows, where the small module does not export
the function.
"""

import ctypes
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

CBWR_BRANCH, CBWR_OFF, CBWR_AUTO = 1, 1, 2
"""MKL's conditional numerical reproducibility (mkl_service.h): what is asked for, none, the best of this processor."""


@dataclass(frozen=True)
class Library:
    """PARDISO as a C function.

    Attributes
    ----------
    pardiso : Callable
        The function with the sixteen arguments of MKL's manual, all pointers.
    integer : type
        NumPy's type of the integers that it counts in.
    set_threads : Callable
        Sets the number of threads of the calling thread's calls, 0 for the process's own; returns the one before.
    threaded : bool
        False where it has one thread whatever is set.
    is_reproducible : Callable
        True where sums are taken in the same order whatever the number of threads.
    make_reproducible : Callable
        Chooses that mode for the process; False where it is too late, as the library was used already.
    """

    pardiso: Callable[..., None]
    integer: type[np.signedinteger[Any]]
    set_threads: Callable[[int], int]
    threaded: bool
    is_reproducible: Callable[[], bool]
    make_reproducible: Callable[[], bool]


def load_library() -> Library:
    """PARDISO with threads where pypardiso is installed, else the sequential one.

    Returns
    -------
    Library

    Raises
    ------
    ImportError, OSError
        Where neither is installed, or the library cannot be loaded.
    """
    try:
        return _load_pypardiso()
    except ImportError:
        return _load_py_mkl_pardiso()


def _load_pypardiso() -> Library:
    _point_to_mkl()
    from pypardiso import PyPardisoSolver

    mkl = PyPardisoSolver(mtype=2).libmkl

    def is_reproducible() -> bool:
        return bool(mkl["MKL_CBWR_Get"](CBWR_BRANCH) != CBWR_OFF)

    def make_reproducible() -> bool:
        return is_reproducible() or mkl["MKL_CBWR_Set"](CBWR_AUTO) == 0

    set_threads = mkl["MKL_Set_Num_Threads_Local"]
    return Library(_bind_void(mkl, "pardiso"), np.int32, set_threads, True, is_reproducible, make_reproducible)


def _load_py_mkl_pardiso() -> Library:
    package = find_spec("pymklpardiso")
    folders = list(package.submodule_search_locations or []) if package else []
    files = sorted(file for folder in folders for file in Path(folder).glob("_mkl_pardiso.*.so"))
    if not files:
        raise ImportError("py-mkl-pardiso is not installed")
    # Its symbols bear MKL's own names: bound to themselves first, another MKL of the process does not mix in.
    module = ctypes.CDLL(str(files[0]), mode=getattr(os, "RTLD_DEEPBIND", 0))
    try:
        pardiso = _bind_void(module, "pardiso_64")
    except AttributeError as error:
        raise ImportError(f"{files[0].name} does not export pardiso_64") from error
    return Library(pardiso, np.int64, lambda threads: 0, False, lambda: False, lambda: True)


def _bind_void(library: ctypes.CDLL, name: str) -> Callable[..., None]:
    function = library[name]
    function.restype = None
    return function


@cache
def _point_to_mkl() -> None:
    """Name MKL's library to pypardiso, which else searches every folder of the environment: seconds for each solver."""
    try:
        files = metadata.files("mkl") or []
    except metadata.PackageNotFoundError:
        return
    for file in files:
        if file.name.startswith(("libmkl_rt.so", "mkl_rt.")) and file.suffix != ".lib":
            os.environ.setdefault("PYPARDISO_MKL_RT", str(Path(file.locate()).resolve()))
            return
