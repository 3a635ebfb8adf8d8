"""The Newton matrix and its solver: a pattern that serves many steps, and grows where contact couples new vertices."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from clothsim.arrays import Floats, Ints
from clothsim.solve.direct import LinearSolver
from clothsim.solve.linear import make_solver
from clothsim.solve.pattern import Hessian, Pattern, coupled, couplings, make_pattern
from clothsim.solve.region import Region


class System:
    """A cache of one pattern and the analysis of it.

    `base` is what the mesh couples. Each step starts with what contact couples within reach (`begin`), so that the
    order of elimination, and with it every bit, depends on the step's own start; inside a step the pattern only grows.
    region: the rows of x that the matrix is about, None for the first ones, all of the cloth.
    """

    def __init__(self, base: Pattern, linear: str = "auto", threads: int = 0, region: Region | None = None) -> None:
        self.base = base
        self.region = region
        self.rows = np.arange(base.n_vertices) if region is None else region.rows
        self.analyses = 0
        self._linear, self._threads = linear, threads
        self.pattern = base
        self._places: dict[int, tuple[Ints, NDArray[np.int32]]] = {}
        self.solver = self._analysed(base)

    def begin(self, couplings: list[Ints]) -> None:
        """The pattern of the base and of `couplings`, lists of rows (m, k) that act on one another."""
        self._take(coupled(self.base, couplings))
        self.solver.restart()

    def of(self, region: Region, hessians: list[Hessian]) -> "System":
        """A system of a region, with the same kind of solver; its pattern is that of the `hessians` over x."""
        own = [region.hessian(hessian) for hessian in hessians]
        pattern = make_pattern(len(region.rows), np.zeros((0, 3), np.int64), own)
        return System(pattern, self._linear, self._threads, region)

    def assemble(self, hessians: list[Hessian], nearby: Callable[[], list[Ints]]) -> Floats:
        """The sum of the Hessians as the data of the pattern, which grows first where something does not fit.

        nearby: gives the couplings that may soon be needed too.
        """
        if self.region is not None:
            region = self.region
            hessians = [region.hessian(hessian) for hessian in hessians]
            return self._grown(hessians, lambda: [*map(region.renumbered, nearby())])
        return self._grown(hessians, nearby)

    def _grown(self, hessians: list[Hessian], nearby: Callable[[], list[Ints]]) -> Floats:
        data, outside = self._assembled(hessians)
        if outside:
            own = [couplings(hessian) for hessian in hessians]
            self._take(coupled(self.pattern, [*own, *nearby()]))
            data, outside = self._assembled(hessians)
        return data

    def _assembled(self, hessians: list[Hessian]) -> tuple[Floats, int]:
        """By the places of the element lists of the time before, where they are the same objects: most are."""
        known, self._places = self._places, {}

        def places(elements: Ints) -> NDArray[np.int32]:
            if id(elements) not in self._places:  # what is held keeps its id
                found = known.get(id(elements)) or (elements, self.pattern.places(elements))
                self._places[id(elements)] = found
            return self._places[id(elements)][1]

        return self.pattern.assemble(hessians, places)

    def _take(self, pattern: Pattern) -> None:
        if not pattern.same_as(self.pattern):
            self.pattern = pattern
            self._places = {}
            self.solver = self._analysed(pattern)

    def _analysed(self, pattern: Pattern) -> LinearSolver:
        self.analyses += 1
        return make_solver(self._linear, pattern, self._threads)
