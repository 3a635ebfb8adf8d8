"""Intel MKL PARDISO in double precision, and in single precision with iterative refinement."""

import ctypes
import math
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim.arrays import Floats
from clothsim.errors import ClothsimError
from clothsim.solve.direct_solver import EXACT, LinearSolver, NotPositiveDefiniteError
from clothsim.solve.pardiso_library import load_library
from clothsim.solve.sparsity import Pattern
from clothsim.solve.threads import solver_threads

ANALYSIS, FACTORISATION, SOLUTION, RELEASE = 11, 22, 33, -1
SYMMETRIC_POSITIVE = 2
NO_MEMORY, NOT_POSITIVE = -2, -4
ORDERED_SUMS = 2
"""iparm(34) in MKL's reproducible mode: any positive number, the same for all numbers of threads."""

MAX_REFINEMENTS = 10
MAX_CONTRACTION = 0.1
"""A refinement that leaves more than this fraction of the error shows that the single-precision factor is useless."""


class Factor:
    """PARDISO for one sparsity pattern in one precision: AMD ordering; phase 11 once, then 22 and 33."""

    def __init__(self, pattern: Pattern, threads: int, kind: type[np.floating]) -> None:
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
        self._permutation = np.zeros(1, integer)
        self._kind = kind
        self._pattern = pattern
        self._indptr, self._indices = (array.astype(integer, copy=False) for array in pattern.scalar())
        self._data: NDArray[Any] = np.zeros(len(self._indices), kind)
        self._data[self._indptr[:-1]] = 1.0
        self._indptr += 1  # PARDISO counts from one
        self._indices += 1
        self._no_right_side = np.zeros(3 * pattern.n_vertices, kind)
        self._fixed_arguments = self._arguments()
        self._call(ANALYSIS, self._no_right_side)

    def factorise(self, data: Floats) -> None:
        """Factorise the matrix of `data`; NotPositiveDefiniteError where it is not positive definite or overflows."""
        self._pattern.write_entries(data, self._data)
        if not np.isfinite(self._data).all():
            raise NotPositiveDefiniteError  # too large for single precision
        self._call(FACTORISATION, self._no_right_side)

    def back_solve(self, b: Floats) -> Floats:
        """Solve with the matrix last factorised; numbers that overflow single precision come back as inf or NaN."""
        largest = max(float(b.max(initial=0.0)), -float(b.min(initial=0.0)))
        scale = math.ldexp(1.0, math.frexp(largest)[1] - 1)  # a power of two: no rounding, and no underflow
        scaled = np.divide(b, scale, out=np.empty(len(b), self._kind), casting="same_kind")
        return np.multiply(self._call(SOLUTION, scaled), scale, dtype=np.float64)

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

    def _call(self, phase: int, b: NDArray[Any]) -> NDArray[Any]:
        x, error = np.empty_like(b), np.zeros(1, self._library.integer)
        before, after = self._fixed_arguments
        given = self._library.set_threads(self.threads)
        self._library.pardiso(*before, self._integer(phase), *after, _address(b), _address(x), _address(error))
        self._library.set_threads(given)
        code = int(error[0])
        if code == NOT_POSITIVE:
            raise NotPositiveDefiniteError
        if code:
            raise _failure(code, len(b))
        return x

    def close(self) -> None:
        """Free MKL's memory; the factor is unusable afterwards. The end of the process frees it too."""
        if not sys.is_finalizing() and self._handle.any():
            self._call(RELEASE, self._no_right_side)
            self._handle[:] = 0

    def __del__(self) -> None:
        if hasattr(self, "_fixed_arguments"):  # not where the library is missing
            self.close()


class Pardiso(LinearSolver):
    """PARDISO in double precision."""

    name = "pardiso"

    def __init__(self, pattern: Pattern, threads: int) -> None:
        self.wanted_threads = solver_threads(pattern.n_vertices, threads)
        self._factor = Factor(pattern, self.wanted_threads, np.float64)
        self.threads = self._factor.threads

    def factorise(self, data: Floats) -> None:
        """Numeric factorisation (phase 22)."""
        self._factor.factorise(data)

    def back_solve(self, b: Floats) -> Floats:
        """Forward and backward substitution (phase 33)."""
        return self._factor.back_solve(b)


class Mixed(LinearSolver):
    """Single-precision factor with iterative refinement in double; a double-precision factor where that fails.

    A factor in single costs .55 of one in double, a back-solve .42 (10,201 vertices). Of its error in the norm of the
    matrix, |x - A^-1 b|_A, a refinement x + M (b - A x) leaves some 1e-4 (Higham 2002, "Accuracy and Stability of
    Numerical Algorithms", section 12.1). Where it leaves more than MAX_CONTRACTION, or the factor is not positive
    definite, the matrix is too ill-conditioned for single precision: it is factorised in double, and so are all
    matrices until `restart`.
    """

    name = "mixed"

    def __init__(self, pattern: Pattern, threads: int) -> None:
        self.wanted_threads = solver_threads(pattern.n_vertices, threads)
        self._pattern = pattern
        self._single = Factor(pattern, self.wanted_threads, np.float32)
        self.threads = self._single.threads
        self._double: Factor | None = None
        self.doubles = 0
        self.restart()

    def restart(self) -> None:
        """Try single precision again."""
        self._factor = self._single

    def factorise(self, data: Floats) -> None:
        """Factorise in single precision, or in double where that was needed since `restart`."""
        self._factor.factorise(data)

    def back_solve(self, b: Floats) -> Floats:
        """Forward and backward substitution with the current factor."""
        return self._factor.back_solve(b)

    def solve(self, data: Floats, b: Floats, accuracy: float = EXACT) -> Floats:
        """Factorise and solve to |x - A^-1 b|_A <= accuracy |A^-1 b|_A, as estimated by the factor itself."""
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
        """Refined solution; None where refinement converges more slowly than MAX_CONTRACTION, or is not finite."""
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
            "Take fewer cells, or close other programs.",
        )
    return ClothsimError(
        f"PARDISO failed on the Newton matrix of {rows // 3:,} vertices with its error {code}.",
        'Try solver.linear = "superlu".',
    )


def _address(array: NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
