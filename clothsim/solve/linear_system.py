"""The Newton matrix and its solver: a pattern that serves many steps, and grows where contact couples new vertices."""

import numpy as np
from numpy.typing import NDArray

from clothsim.arrays import Floats, Ints
from clothsim.indexing import Rows
from clothsim.solve.direct_solver import LinearSolver
from clothsim.solve.linear_solvers import make_solver
from clothsim.solve.nonlinear_elimination import Patch
from clothsim.solve.sparsity import Hessian, Pattern, couplings, extended

NEW_BLOCKS = 0.02
"""Share of the blocks that may have come since the last analysis for a preconditioner to do without them: a sheet that
crumples would else be analysed anew at every second iteration."""


class System:
    """A cache of one pattern and the analysis of it.

    `base` is what the mesh couples. Each step starts with what contact is expected to couple (`begin`), so that the
    order of elimination, and with it every bit, depends on the step's own start; inside a step the pattern only grows.
    region: what the matrix is about, None for all of the cloth; rows: which of x these are. name: that of the solver
    once there is one, which no summary has to analyse a pattern for.
    """

    def __init__(self, base: Pattern, linear: str = "auto", threads: int = 0, patch: Patch | None = None) -> None:
        self.base = base
        self.patch = patch
        self.rows: Rows = slice(0, base.n_vertices) if patch is None else patch.rows
        self.analyses, self.name = 0, linear
        self._linear, self._threads = linear, threads
        self.pattern = self._analysed = base
        self._places: dict[int, tuple[Ints, NDArray[np.int32]]] = {}
        self._solver: LinearSolver | None = None

    @property
    def solver(self) -> LinearSolver:
        """That of the pattern as it is, which is analysed when its solver is first asked for."""
        if self._solver is None or self._analysed is not self.pattern:
            self.analyses += 1
            self._solver = make_solver(self._linear, self.pattern, self._threads)
            self._analysed, self.name = self.pattern, self._solver.name
        return self._solver

    def preconditioner(self, data: Floats) -> tuple[LinearSolver, Floats]:
        """A solver, and the data for it, of a matrix that is `data` but for at most a few blocks, which it lacks.

        They have come since the last analysis, and are those between the two sides of pairs that touch: without them
        each side is held as if the other stood still, at most twice as stiff. Where only some blocks of a pair are
        lacked, what is left may be indefinite (up to one in ten such matrices): NotPositiveDefiniteError says so.
        """
        known, few = self._analysed, len(self.pattern.columns) <= (1.0 + NEW_BLOCKS) * len(self._analysed.columns)
        if self._solver is None or known is self.pattern or not few:
            return self.solver, data
        return self._solver, known.restricted(data, self.pattern)

    def begin(self, couplings: list[Ints]) -> None:
        """The pattern of the base and of `couplings`, lists of rows (m, k) that act on one another."""
        self._take(extended(self.base, couplings))
        if self._analysed.same_as(self.pattern):
            self.pattern = self._analysed
        else:
            self._solver = None
        if self._solver is not None:
            self._solver.restart()

    def subsystem(self, patch: Patch) -> "System":
        """A system of a region of this one, which is of all of the cloth, with the same kind of solver."""
        return System(self.pattern.subpattern(patch.rows), self._linear, self._threads, patch)

    def assemble(self, hessians: list[Hessian]) -> Floats:
        """The sum of the Hessians as the data of the pattern, which grows first where something does not fit."""
        if self.patch is not None:
            hessians = [self.patch.hessian(hessian) for hessian in hessians]
        data, outside = self._assembled(hessians)
        if outside:
            self._take(extended(self.pattern, [couplings(hessian) for hessian in hessians]))
            data, outside = self._assembled(hessians)
        return data

    def _assembled(self, hessians: list[Hessian]) -> tuple[Floats, int]:
        """By the places of the element lists of the time before, where they are the same objects: most are."""
        known, self._places = self._places, {}

        def block_offsets(elements: Ints) -> NDArray[np.int32]:
            if id(elements) not in self._places:  # what is held keeps its id
                found = known.get(id(elements)) or (elements, self.pattern.block_offsets(elements))
                self._places[id(elements)] = found
            return self._places[id(elements)][1]

        return self.pattern.assemble(hessians, block_offsets)

    def _take(self, pattern: Pattern) -> None:
        if not pattern.same_as(self.pattern):
            self.pattern = pattern
            self._places = {}
