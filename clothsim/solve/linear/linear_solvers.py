"""Table of direct solvers for the Newton matrix, and the CHOLMOD and SuperLU ones."""

import sys

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError, MissingPackageError
from clothsim.solve.linear.direct_solver import LinearSolver, NotPositiveDefiniteError
from clothsim.solve.linear.pardiso import Mixed, Pardiso
from clothsim.solve.linear.sparsity import SparsityPattern


class Cholmod(LinearSolver):
    """SuiteSparse CHOLMOD through scikit-sparse, where that is installed."""

    name = "cholmod"

    def __init__(self, pattern: SparsityPattern, threads: int, dissected: bool = False) -> None:
        from sksparse.cholmod import analyze

        ones = np.ones(9 * len(pattern.columns))
        self._pattern = pattern
        self._factor = analyze(_full(pattern, ones), ordering_method="amd")

    def factorise(self, data: Floats) -> None:
        """Numeric factorisation with the cached symbolic analysis."""
        from sksparse.cholmod import CholmodNotPositiveDefiniteError

        _refuse_not_finite(data)
        try:
            self._factor.cholesky_inplace(_full(self._pattern, data))
        except CholmodNotPositiveDefiniteError as error:
            raise NotPositiveDefiniteError from error

    def back_solve(self, b: Floats) -> Floats:
        """Forward and backward substitution."""
        return self._factor(b)


class SuperLU(LinearSolver):
    """SciPy SuperLU in symmetric mode: available everywhere, about ten times slower than PARDISO."""

    name = "superlu"

    def __init__(self, pattern: SparsityPattern, threads: int, dissected: bool = False) -> None:
        self._pattern = pattern

    def factorise(self, data: Floats) -> None:
        """Factorisation with diagonal pivots; a pivot that is not positive raises NotPositiveDefiniteError."""
        _refuse_not_finite(data)
        try:
            self._factor = linalg.splu(
                _full(self._pattern, data),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:  # "Factor is exactly singular"
            raise NotPositiveDefiniteError from error
        if not (self._factor.U.diagonal() > 0).all():
            raise NotPositiveDefiniteError

    def back_solve(self, b: Floats) -> Floats:
        """Forward and backward substitution."""
        return self._factor.solve(b)


SOLVERS: dict[str, type[LinearSolver]] = {
    "mixed": Mixed,
    "pardiso": Pardiso,
    "cholmod": Cholmod,
    "superlu": SuperLU,
}
REMEDIES = {
    "mixed": "clothsim[mkl]",
    "pardiso": "clothsim[mkl]",
    "cholmod": "clothsim[cholmod]",
}
"""Commands that install the library of a solver."""


def make_solver(name: str, pattern: SparsityPattern, threads: int = 0, dissected: bool = False) -> LinearSolver:
    """Make the solver of a name; "auto": the first of mixed, cholmod, superlu that is installed.

    Parameters
    ----------
    name : str
        "auto" or a key of SOLVERS.
    pattern : SparsityPattern
        Sparsity of the Newton matrix.
    threads : int
        0: by size (`direct_solver.solver_threads`).
    dissected : bool
        Factorise a large matrix in domains, see `LinearSolver`.

    Raises
    ------
    InputError
        For an unknown name.
    MissingPackageError
        For a solver whose package is not installed.
    """
    if name == "auto":
        for kind in SOLVERS.values():
            try:
                return kind(pattern, threads, dissected)
            except (ImportError, OSError):
                continue
    if name not in SOLVERS:
        raise InputError(f"solver.linear is {name!r}.", f"Known: auto, {', '.join(SOLVERS)}.")
    try:
        return SOLVERS[name](pattern, threads, dissected)
    except (ImportError, OSError) as error:
        raise MissingPackageError(
            f"solver.linear = {name!r} needs a library that is not installed.",
            f"Run: pip install '{REMEDIES[name]}', or use linear = \"auto\".",
        ) from error


def slowness(solver: LinearSolver) -> str:
    """Return a note for the user where a faster solver could be installed, else an empty string."""
    if solver.wanted_threads > solver.threads:
        return (
            f"The linear solver is MKL's sequential one, on {solver.threads} of {solver.wanted_threads} threads: "
            "`pip install 'clothsim[mkl]'` brings the threaded one (0.9 GB)."
        )
    if solver.name != "superlu":
        return ""
    return (
        f"The linear solver is SuperLU, about ten times slower than PARDISO, which does not exist for {sys.platform} "
        "on this processor or is not installed; `pip install 'clothsim[cholmod]'` (CHOLMOD) helps."
    )


def _refuse_not_finite(data: Floats) -> None:
    if not np.isfinite(data).all():
        raise NotPositiveDefiniteError


def _full(pattern: SparsityPattern, data: Floats) -> sparse.csc_matrix:
    upper = pattern.upper(data)
    return (upper + sparse.triu(upper, k=1).T).tocsc()
