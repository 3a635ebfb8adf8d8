"""NVIDIA cuDSS, a direct solver on the GPU, through nvmath-python: written against its API, never run on a GPU here."""

import importlib
import logging
from typing import Any

import numpy as np
from scipy import sparse

from clothsim.base.arrays import Floats
from clothsim.base.errors import MissingPackageError
from clothsim.solve.linear.direct_solver import LinearSolver, NotPositiveDefiniteError
from clothsim.solve.linear.sparsity import Pattern

API = "nvmath.sparse.advanced"
"""Module with DirectSolver, by the API of nvmath-python 1.0."""


class CuDss(LinearSolver):
    """Cholesky factor on the GPU in double precision, of the upper triangle in CSR; analysed once.

    Matrix and right sides stay in the memory of the host: nvmath copies the values into buffers that it keeps on the
    GPU, so that its plan holds for the next matrix too, and returns solutions to the host.

    Parameters
    ----------
    pattern : Pattern
        Sparsity of the upper triangle.
    threads, dissected : int, bool
        Unused: the GPU has its own.

    Raises
    ------
    ImportError
        Where nvmath-python is not installed.
    MissingPackageError
        Where CUDA finds no GPU, or a library of CUDA is missing.
    """

    name = "cudss"

    def __init__(self, pattern: Pattern, threads: int, dissected: bool = False) -> None:
        advanced = importlib.import_module(API)
        self._pattern = pattern
        indptr, indices = pattern.scalar()
        rows = 3 * pattern.n_vertices
        entries = np.zeros(len(indices))
        entries[indptr[:-1]] = 1.0
        self._matrix = sparse.csr_array((entries, indices, indptr), shape=(rows, rows))
        try:
            options = advanced.DirectSolverOptions(
                sparse_system_type=advanced.DirectSolverMatrixType.SPD,
                sparse_system_view=advanced.DirectSolverMatrixViewType.UPPER,
                logger=_silent(),
            )
            self._solver: Any = advanced.DirectSolver(self._matrix, np.zeros(rows), options=options)
            self._solver.plan()
        except Exception as error:  # CUDA, the driver and cuDSS each have their own
            reason = (str(error).splitlines() or [""])[0]
            raise MissingPackageError(
                f"solver.linear = 'cudss' could not start cuDSS on a GPU ({type(error).__name__}: {reason}).",
                'It needs an NVIDIA GPU, its driver and all of clothsim[cuda]; or take linear = "auto".',
            ) from error

    def factorise(self, data: Floats) -> None:
        """Numeric factorisation with the plan of the pattern."""
        self._pattern.write_entries(data, self._matrix.data)
        if not np.isfinite(self._matrix.data).all():
            raise NotPositiveDefiniteError
        self._solver.reset_operands(a=self._matrix)
        if self._solver.factorize().info:  # the row at which the leading minor is not positive
            raise NotPositiveDefiniteError

    def back_solve(self, b: Floats) -> Floats:
        """Forward and backward substitution."""
        self._solver.reset_operands(b=np.ascontiguousarray(b, float))
        return self._solver.solve()

    def close(self) -> None:
        """Free the memory on the GPU; the factor is unusable afterwards."""
        if hasattr(self, "_solver"):  # not where there is no GPU
            self._solver.free()
            del self._solver

    def __del__(self) -> None:
        self.close()


def _silent() -> logging.Logger:
    """A logger without nvmath's warning at each new matrix that it is to be factorised."""
    logger = logging.getLogger("clothsim.solve.linear.cudss")
    logger.setLevel(logging.ERROR)
    return logger
