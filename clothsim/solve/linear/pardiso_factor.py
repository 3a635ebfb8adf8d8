"""One factor of Intel MKL PARDISO, and the shared library that makes it.

Two distributions have the library. `py-mkl-pardiso` (71 MB, no dependency but numpy) is one extension module with
sequential MKL linked into it: `pip install clothsim` brings it on Linux. `pypardiso` (0.9 GB with MKL, OpenMP and TBB)
finds all of MKL, which takes several threads: the extra `mkl`, and the default on Windows, where the small module does
not export the function.
"""

import ctypes
import math
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError
from clothsim.solve.linear.direct_solver import NotPositiveDefiniteError
from clothsim.solve.linear.sparsity import SparsityPattern

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


ANALYSIS, FACTORISATION, SOLUTION, RELEASE = 11, 22, 33, -1
FORWARD, BACKWARD = 331, 333
"""Halves of a solution where some unknowns are left."""
SYMMETRIC_POSITIVE = 2
NO_MEMORY, NOT_POSITIVE = -2, -4
FULL_SCHUR = 1
"""iparm(36): return the matrix of the unknowns that are left, both triangles of it."""
ORDERED_SUMS = 2
"""iparm(34) in MKL's reproducible mode: any positive number, the same for all numbers of threads."""


class Factor:
    """PARDISO for one sparsity pattern in one precision: AMD ordering; phase 11 once, then 22 and 33.

    Parameters
    ----------
    pattern : SparsityPattern
        Sparsity of the upper triangle.
    threads : int
        Threads that the library may take.
    kind : type
        np.float64 or np.float32.
    left : int
        Unknowns at the end that are not eliminated: `schur` is their matrix once all others are.
    """

    def __init__(self, pattern: SparsityPattern, threads: int, kind: type[np.floating], left: int = 0) -> None:
        self._library = load_library()
        self.threads = threads if self._library.threaded else 1
        integer = self._library.integer
        self._handle = np.zeros(64, np.int64)
        self._settings = np.zeros(64, integer)
        self._settings[0] = 1  # all settings are given: zeros are not defaults
        self._settings[1] = 0  # minimum degree: 10 % faster than nested dissection at these sizes
        self._settings[27] = int(kind is np.float32)
        if self._library.is_reproducible():
            self._settings[33] = ORDERED_SUMS
        self._permutation = np.zeros(3 * pattern.n_vertices if left else 1, integer)
        self.schur: NDArray[Any] = np.zeros((left, left), kind)
        if left:
            self._permutation[-left:] = 1
            self._settings[35] = FULL_SCHUR
        self._kind = kind
        self._pattern = pattern
        self._indptr, self._indices = (array.astype(integer, copy=False) for array in pattern.scalar())
        self._data: NDArray[Any] = np.zeros(len(self._indices), kind)
        self._data[self._indptr[:-1]] = 1.0
        self._indptr += 1  # PARDISO counts from one
        self._indices += 1
        self._no_right_side = np.zeros(3 * pattern.n_vertices, kind)
        self._right, self._solution = np.empty_like(self._no_right_side), np.empty_like(self._no_right_side)
        self._error = np.zeros(1, integer)
        self._fixed_arguments = self._arguments()
        self._back_solve_arguments = self._arguments_of(SOLUTION, self._right, self._solution)
        self._call(ANALYSIS, self._no_right_side)

    def factorise(self, data: Floats) -> None:
        """Factorise the matrix of `data`; NotPositiveDefiniteError where it is not positive definite or overflows."""
        self._pattern.write_entries(data, self._data)
        if not np.isfinite(self._data).all():
            raise NotPositiveDefiniteError  # too large for single precision
        self._call(FACTORISATION, self._no_right_side, self.schur if len(self.schur) else None)

    def back_solve(self, b: Floats) -> Floats:
        """Solve with the matrix last factorised; numbers that overflow single precision come back as inf or NaN."""
        scale = in_range(b, self._right)
        self._run(self._back_solve_arguments)
        return np.multiply(self._solution, scale, dtype=np.float64)

    def solve(self, b: NDArray[Any]) -> NDArray[Any]:
        """Solve for b of this precision; none may be left."""
        return self._call(SOLUTION, b)

    def forward(self, b: NDArray[Any]) -> NDArray[Any]:
        """Eliminate: the right-hand side of those that are left comes last, before it what `backward` needs."""
        return self._call(FORWARD, b)

    def backward(self, eliminated: NDArray[Any]) -> NDArray[Any]:
        """Solve for all others, once the last entries are the solution of those that were left."""
        return self._call(BACKWARD, eliminated)

    def _arguments(self) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """Arguments of the MKL call before and after the phase: built once, as that took .2 ms of each call."""
        one, kind, size, silent = map(self._integer, (1, SYMMETRIC_POSITIVE, len(self._no_right_side), 0))
        before = (
            _address(self._handle),
            one,  # maximum number of factors
            one,  # number of the factor in use
            kind,
        )
        after = (
            size,
            _address(self._data),
            _address(self._indptr),
            _address(self._indices),
            _address(self._permutation),
            one,  # right-hand sides
            _address(self._settings),
            silent,
        )
        return before, after

    def _integer(self, value: int) -> Any:
        counts = ctypes.c_int64 if self._library.integer is np.int64 else ctypes.c_int32
        return ctypes.byref(counts(value))

    def _call(self, phase: int, b: NDArray[Any], x: NDArray[Any] | None = None) -> NDArray[Any]:
        x = np.empty_like(b) if x is None else x
        self._run(self._arguments_of(phase, b, x))
        return x

    def _arguments_of(self, phase: int, b: NDArray[Any], x: NDArray[Any]) -> tuple[Any, ...]:
        before, after = self._fixed_arguments
        return *before, self._integer(phase), *after, _address(b), _address(x), _address(self._error)

    def _run(self, arguments: tuple[Any, ...]) -> None:
        given = self._library.set_threads(self.threads)
        self._library.pardiso(*arguments)
        self._library.set_threads(given)
        code = int(self._error[0])
        if code == NOT_POSITIVE:
            raise NotPositiveDefiniteError
        vertices = len(self._no_right_side) // 3
        if code == NO_MEMORY:
            raise ClothsimError(
                f"There is not enough memory to factorise the Newton matrix of {vertices:,} vertices.",
                "Use fewer cells, or close other programs.",
            )
        if code:
            raise ClothsimError(
                f"PARDISO failed on the Newton matrix of {vertices:,} vertices with its error {code}.",
                'Try solver.linear = "superlu".',
            )

    def close(self) -> None:
        """Free MKL's memory; the factor is unusable afterwards. The end of the process frees it too."""
        if not sys.is_finalizing() and self._handle.any():
            self._call(RELEASE, self._no_right_side)
            self._handle[:] = 0

    def __del__(self) -> None:
        if hasattr(self, "_fixed_arguments"):  # not where the library is missing
            self.close()


def in_range(b: Floats, out: NDArray[Any]) -> float:
    """Write b in another precision over a power of two, so that nothing is rounded or underflows; return that power."""
    largest = max(float(b.max(initial=0.0)), -float(b.min(initial=0.0)))
    scale = math.ldexp(1.0, math.frexp(largest)[1] - 1)
    np.divide(b, scale, out=out, casting="same_kind")
    return scale


def _address(array: NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
