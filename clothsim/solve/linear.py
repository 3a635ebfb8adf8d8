"""Direct solvers for the symmetric positive definite Newton matrix behind one `solve`; the analysis serves the run."""

import abc
import os
import sys
from importlib import metadata
from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from clothsim.arrays import Floats
from clothsim.errors import InputError, MissingPackageError
from clothsim.solve.pattern import Pattern


class NotPositiveDefiniteError(Exception):
    """The factorisation met a pivot that is not positive."""


ONE_THREAD_BELOW = 4000
"""Vertices below which PARDISO gets one thread where the scene leaves it open: a small factorisation takes 5 ms on one,
and on two now and then 50 ms, when the second must be woken (seen at 1,681 vertices; at 10,201 two take .55 of one)."""


class LinearSolver(abc.ABC):
    """Solves A x = b for one sparsity and many values."""

    name: str
    threads: int = 1

    @abc.abstractmethod
    def __init__(self, pattern: Pattern, threads: int) -> None:
        """Analyse the pattern; threads 0: all cores."""

    @abc.abstractmethod
    def factorise(self, data: Floats) -> None:
        """Factorise the matrix whose upper triangle is `data` in the pattern; NotPositiveDefiniteError if it is not."""

    @abc.abstractmethod
    def back_solve(self, b: Floats) -> Floats:
        """x of the matrix last factorised."""

    def solve(self, data: Floats, b: Floats) -> Floats:
        """Factorise, then solve."""
        self.factorise(data)
        return self.back_solve(b)


class Pardiso(LinearSolver):
    """Intel MKL PARDISO through pypardiso: mtype 2, AMD ordering; phase 11 once, then 22 and 33."""

    name = "pardiso"

    def __init__(self, pattern: Pattern, threads: int) -> None:
        from pypardiso import PyPardisoSolver

        _tell_where_mkl_is()
        self._solver = PyPardisoSolver(mtype=2)
        self._solver.set_iparm(1, 1)
        self._solver.set_iparm(2, 0)  # minimum degree: 10 % faster than nested dissection at these sizes
        self._pattern = pattern
        self.threads = threads or (1 if pattern.n_vertices < ONE_THREAD_BELOW else os.cpu_count() or 1)
        self._solver.libmkl.MKL_Set_Num_Threads(self.threads)
        self._call(11, self._template(), np.zeros(3 * pattern.n_vertices))

    def factorise(self, data: Floats) -> None:
        """Phase 22."""
        self._matrix = self._pattern.upper(data)
        self._call(22, self._matrix, np.zeros(3 * self._pattern.n_vertices))

    def back_solve(self, b: Floats) -> Floats:
        """Phase 33."""
        return self._call(33, self._matrix, b)

    def close(self) -> None:
        """Give back MKL's memory; the solver is of no use after. The end of the process does it too."""
        if not sys.is_finalizing() and hasattr(self, "_solver"):
            self._solver.free_memory(everything=True)

    def __del__(self) -> None:
        if hasattr(self, "_solver"):  # not where pypardiso is missing
            self.close()

    def _template(self) -> sparse.csr_matrix:
        data = np.zeros(len(self._pattern.indices))
        data[self._pattern.indptr[:-1]] = 1.0
        return self._pattern.upper(data)

    def _call(self, phase: int, matrix: sparse.csr_matrix, b: Floats) -> Floats:
        from pypardiso.pardiso_wrapper import PyPardisoError

        self._solver.set_phase(phase)
        try:
            return self._solver._call_pardiso(matrix, b)
        except PyPardisoError as error:
            if error.value == -4:
                raise NotPositiveDefiniteError from error
            raise


class Cholmod(LinearSolver):
    """SuiteSparse CHOLMOD through scikit-sparse, where that is installed."""

    name = "cholmod"

    def __init__(self, pattern: Pattern, threads: int) -> None:
        from sksparse.cholmod import analyze

        ones = np.ones(len(pattern.indices))
        self._pattern = pattern
        self._factor = analyze(_full(pattern, ones), ordering_method="amd")

    def factorise(self, data: Floats) -> None:
        """Numeric factorisation with the kept analysis."""
        from sksparse.cholmod import CholmodNotPositiveDefiniteError

        try:
            self._factor.cholesky_inplace(_full(self._pattern, data))
        except CholmodNotPositiveDefiniteError as error:
            raise NotPositiveDefiniteError from error

    def back_solve(self, b: Floats) -> Floats:
        """Both triangles."""
        return self._factor(b)


class SuperLU(LinearSolver):
    """SciPy's SuperLU in symmetric mode: everywhere there, about ten times slower."""

    name = "superlu"

    def __init__(self, pattern: Pattern, threads: int) -> None:
        self._pattern = pattern

    def factorise(self, data: Floats) -> None:
        """With diagonal pivots; a negative pivot says that the matrix is not positive definite."""
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
        """Both triangles."""
        return self._factor.solve(b)


SOLVERS: dict[str, type[LinearSolver]] = {"pardiso": Pardiso, "cholmod": Cholmod, "superlu": SuperLU}
MODULES = {"pardiso": "pypardiso", "cholmod": "sksparse.cholmod"}


def make_solver(name: str, pattern: Pattern, threads: int = 0) -> LinearSolver:
    """The solver of that name; "auto": the first of pardiso, cholmod, superlu that is installed.

    InputError for an unknown name, MissingPackageError for one that is not installed. threads 0: all cores.
    """
    if name == "auto":
        for kind in SOLVERS.values():
            try:
                return kind(pattern, threads)
            except (ImportError, OSError):
                continue
    if name not in SOLVERS:
        raise InputError(f"solver.linear is {name!r}.", f"Known: auto, {', '.join(SOLVERS)}.")
    try:
        return SOLVERS[name](pattern, threads)
    except (ImportError, OSError) as error:
        raise MissingPackageError(
            f"solver.linear = {name!r} needs the package {MODULES[name].split('.')[0]}, which is not installed.",
            'Install it, or take linear = "auto".',
        ) from error


def slowness(solver: LinearSolver) -> str:
    """One line for the user where the fast solver is missing, else an empty string."""
    if solver.name != "superlu":
        return ""
    return (
        f"The linear solver is SuperLU, about ten times slower than PARDISO, which does not exist for {sys.platform} "
        "on this processor or is not installed; scikit-sparse (CHOLMOD) helps."
    )


def _tell_where_mkl_is() -> None:
    """Name MKL's library to pypardiso, which else searches every folder of the environment: seconds for each solver."""
    try:
        files = metadata.files("mkl") or []
    except metadata.PackageNotFoundError:
        return
    for file in files:
        if file.name.startswith(("libmkl_rt.so", "mkl_rt.")) and file.suffix != ".lib":
            os.environ.setdefault("PYPARDISO_MKL_RT", str(Path(file.locate()).resolve()))
            return


def _full(pattern: Pattern, data: Floats) -> sparse.csc_matrix:
    upper = pattern.upper(data)
    return (upper + sparse.triu(upper, k=1).T).tocsc()
