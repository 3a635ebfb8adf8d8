"""Intel MKL PARDISO in double precision, and in single precision with iterative refinement."""

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.solve.linear.direct_solver import EXACT, LinearSolver, NotPositiveDefiniteError
from clothsim.solve.linear.dissected_factor import DissectedFactor, make_factor, useful_threads
from clothsim.solve.linear.pardiso_factor import Factor
from clothsim.solve.linear.sparsity import Pattern

MAX_REFINEMENTS = 10
MAX_CONTRACTION = 0.1
"""A refinement that leaves more than this fraction of the error shows that the single-precision factor is useless."""


class Pardiso(LinearSolver):
    """PARDISO in double precision."""

    name = "pardiso"

    def __init__(self, pattern: Pattern, threads: int, dissected: bool = False) -> None:
        self.wanted_threads = useful_threads(pattern.n_vertices, threads, dissected)
        self._factor = make_factor(pattern, self.wanted_threads, np.float64, dissected)
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

    def __init__(self, pattern: Pattern, threads: int, dissected: bool = False) -> None:
        self.wanted_threads = useful_threads(pattern.n_vertices, threads, dissected)
        self._pattern = pattern
        self._dissected = dissected
        self._single = make_factor(pattern, self.wanted_threads, np.float32, dissected)
        self.threads = self._single.threads
        self._double: Factor | DissectedFactor | None = None
        self.doubles = 0
        self.restart()

    def restart(self) -> None:
        """Try single precision again."""
        self._factor: Factor | DissectedFactor = self._single

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
            self._double = self._double or make_factor(self._pattern, self.threads, np.float64, self._dissected)
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
