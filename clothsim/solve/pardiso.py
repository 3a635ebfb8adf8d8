"""Intel MKL PARDISO in double precision, and in single with what that leaves of the error taken away."""

import ctypes
import math
import os
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim.arrays import Floats
from clothsim.errors import ClothsimError
from clothsim.solve.direct_solver import EXACT, LinearSolver, NotPositiveDefiniteError
from clothsim.solve.pardiso_library import load_library
from clothsim.solve.sparsity import Pattern

ONE_THREAD_BELOW = 4000
"""Vertices below which PARDISO gets one thread where the scene leaves it open: a small factorisation takes 5 ms on one,
and on two now and then 50 ms, when the second must be woken (seen at 1,681 vertices; at 10,201 two take .55 of one)."""

ANALYSIS, FACTORISATION, SOLUTION, RELEASE = 11, 22, 33, -1
SYMMETRIC_POSITIVE = 2
NO_MEMORY, NOT_POSITIVE = -2, -4
MAX_REFINEMENTS = 10
MAX_CONTRACTION = 0.1
"""A refinement that leaves more than this of the error belongs to a factor that is of no use."""


class Factor:
    """PARDISO for one sparsity in one precision: AMD ordering; phase 11 once, then 22 and 33."""

    def __init__(self, pattern: Pattern, threads: int, kind: type[np.floating]) -> None:
        self._library = load_library()
        self.threads = threads if self._library.threaded else 1
        integer = self._library.integer
        self._handle = np.zeros(64, np.int64)
        self._settings = np.zeros(64, integer)
        self._settings[0] = 1  # all of them are given: zeros are no defaults
        self._settings[1] = 0  # minimum degree: 10 % faster than nested dissection at these sizes
        self._settings[27] = int(kind is np.float32)
        self._permutation = np.zeros(1, integer)
        self._kind = kind
        self._pattern = pattern
        indptr, indices = pattern.scalar
        self._indptr, self._indices = (array.astype(integer) + 1 for array in (indptr, indices))  # it counts from one
        self._data: NDArray[Any] = np.zeros(len(indices), kind)
        self._data[indptr[:-1]] = 1.0
        self._no_side = np.zeros(3 * pattern.n_vertices, kind)
        self._always = self._arguments()
        self._call(ANALYSIS, self._no_side)

    def factorise(self, data: Floats) -> None:
        """The matrix of `data`; NotPositiveDefiniteError."""
        self._pattern.write_entries(data, self._data)
        if not np.isfinite(self._data).all():
            raise NotPositiveDefiniteError  # too large for single precision
        self._call(FACTORISATION, self._no_side)

    def back_solve(self, b: Floats) -> Floats:
        """x of the matrix last factorised; what single precision cannot hold comes back as inf or NaN."""
        largest = max(float(b.max(initial=0.0)), -float(b.min(initial=0.0)))
        scale = math.ldexp(1.0, math.frexp(largest)[1] - 1)  # a power of two: no rounding, and no underflow
        scaled = np.divide(b, scale, out=np.empty(len(b), self._kind), casting="same_kind")
        return np.multiply(self._call(SOLUTION, scaled), scale, dtype=np.float64)

    def _arguments(self) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """What MKL is told before the phase and after it, always the same: made anew, it took .2 ms of each call."""
        one, kind, size, silent = map(self._integer, (1, SYMMETRIC_POSITIVE, len(self._no_side), 0))
        before = (
            _address(self._handle),
            one,  # as many factors as are kept
            one,  # the one that is used
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

    def _call(self, phase: int, b: NDArray[Any]) -> NDArray[Any]:
        x, error = np.empty_like(b), np.zeros(1, self._library.integer)
        self._library.set_threads(self.threads)  # of the process: another factor may have set its own
        before, after = self._always
        self._library.pardiso(*before, self._integer(phase), *after, _address(b), _address(x), _address(error))
        code = int(error[0])
        if code == NOT_POSITIVE:
            raise NotPositiveDefiniteError
        if code:
            raise _failure(code, len(b))
        return x

    def close(self) -> None:
        """Give back MKL's memory; the factor is of no use after. The end of the process does it too."""
        if not sys.is_finalizing() and self._handle.any():
            self._call(RELEASE, self._no_side)
            self._handle[:] = 0

    def __del__(self) -> None:
        if hasattr(self, "_always"):  # not where the library is missing
            self.close()


class Pardiso(LinearSolver):
    """In double precision."""

    name = "pardiso"

    def __init__(self, pattern: Pattern, threads: int) -> None:
        self.wanted_threads = _threads(pattern, threads)
        self._factor = Factor(pattern, self.wanted_threads, np.float64)
        self.threads = self._factor.threads

    def factorise(self, data: Floats) -> None:
        """Phase 22."""
        self._factor.factorise(data)

    def back_solve(self, b: Floats) -> Floats:
        """Phase 33."""
        return self._factor.back_solve(b)


class Mixed(LinearSolver):
    """A factor in single precision, refined in double; where it does not do, one in double.

    A factor in single costs .55 of one in double, a back-solve .42 (10,201 vertices). Of its error in the norm of the
    matrix, |x - A^-1 b|_A, a refinement x + M (b - A x) leaves some 1e-4 (Higham 2002, "Accuracy and Stability of
    Numerical Algorithms", section 12.1); where it leaves more than SLOWEST, or the factor is not positive, the matrix
    is too ill-conditioned for single precision: the double one is made then, and for all matrices until `restart`.
    """

    name = "mixed"

    def __init__(self, pattern: Pattern, threads: int) -> None:
        self.wanted_threads = _threads(pattern, threads)
        self._pattern = pattern
        self._single = Factor(pattern, self.wanted_threads, np.float32)
        self.threads = self._single.threads
        self._double: Factor | None = None
        self.doubles = 0
        self.restart()

    def restart(self) -> None:
        """Trust single precision anew."""
        self._factor = self._single

    def factorise(self, data: Floats) -> None:
        """In single precision, or in double where that was needed since `restart`."""
        self._factor.factorise(data)

    def back_solve(self, b: Floats) -> Floats:
        """By the factor, whichever it is."""
        return self._factor.back_solve(b)

    def solve(self, data: Floats, b: Floats, accuracy: float = EXACT) -> Floats:
        """x with |x - A^-1 b|_A <= accuracy |A^-1 b|_A, as far as the factor itself can tell."""
        if self._factor is self._single:
            try:
                self._factor.factorise(data)
                x = self._refined(data, b, accuracy)
            except NotPositiveDefiniteError:
                x = None
            if x is not None:
                return x
            self._double = self._double or Factor(self._pattern, self.threads, np.float64)
            self._factor = self._double
        self.doubles += 1
        return super().solve(data, b)

    def _refined(self, data: Floats, b: Floats, accuracy: float) -> Floats | None:
        """The solution; None where a refinement leaves more than SLOWEST, or what is not finite."""
        times = self._pattern.times(data)
        x = self._single.back_solve(b)
        error = whole = float(b @ x)
        for _ in range(MAX_REFINEMENTS):
            residual = b - times(x)
            correction = self._single.back_solve(residual)
            before, error = error, float(residual @ correction)
            if not abs(error) <= MAX_CONTRACTION**2 * abs(before):
                return None
            x = x + correction
            if error <= accuracy**2 * whole:
                return x
        return None


def _failure(code: int, rows: int) -> ClothsimError:
    if code == NO_MEMORY:
        return ClothsimError(
            f"There is not enough memory to factorise the Newton matrix of {rows // 3:,} vertices.",
            "Take fewer cells, or close what else needs memory.",
        )
    return ClothsimError(
        f"PARDISO gave up the Newton matrix of {rows // 3:,} vertices with its error {code}.",
        'Try solver.linear = "superlu".',
    )


def _threads(pattern: Pattern, threads: int) -> int:
    return threads or (1 if pattern.n_vertices < ONE_THREAD_BELOW else os.cpu_count() or 1)


def _address(array: NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
