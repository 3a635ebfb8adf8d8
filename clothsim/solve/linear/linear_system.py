"""Newton matrix and its solver: one sparsity pattern for many steps, extended where contact couples vertices.

A patch is for nonlinear elimination: the unconverged vertices are minimised by themselves, all others fixed. Late in a
solve of crumpling cloth a hundredth of the vertices still moves: separate creases that grow. Every iteration over the
whole cloth pays for all other vertices too, and one crease that overshoots shortens the step of all (Lanzkron, Rose &
Wilkes 1996).
"""

from collections.abc import Callable
from dataclasses import replace
from operator import is_
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel
from clothsim.base.parallel import together
from clothsim.base.vectors import Rows
from clothsim.physics.energies.hessians import ByElement, Hessian, explicit
from clothsim.solve.linear.assembly import OUTSIDE
from clothsim.solve.linear.dependent_rows import NO_DEPENDENT_ROWS, DependentRows
from clothsim.solve.linear.direct_solver import LinearSolver, solver_threads
from clothsim.solve.linear.linear_solvers import make_solver
from clothsim.solve.linear.sparsity import Explicit, SparsityPattern, couplings, extended

RINGS = 3
"""Rings of neighbours that a patch adds around the unconverged vertices."""
MIN_VERTICES = 4000
"""Vertices of a cloth from which on patches pay: ten of the repository's scenes, all smaller, took 1.04 to 1.43 times
as long with them; a sheet of 5,041 vertices took .9, one of 10,201 .8.
"""
MAX_FRACTION = 0.5
"""Largest fraction of the vertices in a patch: a larger one would cost what the whole cloth does."""
NONE = np.zeros(0, np.int64)


class Patch:
    """Subset of the vertices: rows (k,) of x that move, ascending; moving (N,): the same as booleans.

    Renumbered element lists are cached: the same list comes back as the same object.
    """

    def __init__(self, rows: Ints, count: int) -> None:
        self.rows = rows
        self.moving = np.zeros(count, bool)
        self.moving[rows] = True
        self._numbers = np.full(count, len(rows))  # fixed vertices get a row that the assembler drops
        self._numbers[rows] = np.arange(len(rows))
        self._known: dict[int, tuple[Ints, Ints]] = {}

    def renumbered(self, elements: Ints) -> Ints:
        """Return rows of x (m, j) as rows of the patch's matrix."""
        found = self._known.get(id(elements))
        if found is None:
            found = self._known[id(elements)] = (
                elements,
                self._numbers[elements],
            )  # a list in the cache keeps its id
        return found[1]

    def hessian(self, hessian: Explicit) -> Explicit:
        """Return a Hessian over x as one over the patch's rows."""
        if isinstance(hessian, ByElement):
            return replace(hessian, elements=self.renumbered(hessian.elements))
        entries = (3 * self.rows[:, None] + np.arange(3)).ravel()
        return sparse.csr_array(hessian.tocsr()[entries][:, entries])


def unconverged(moved: Floats, least: float, pattern: SparsityPattern, fixed: np.ndarray) -> Ints:
    """Select the rows (k,) that moved further than `least`, with RINGS rings of neighbours.

    Parameters
    ----------
    moved : (n,) float64
        Displacement of each vertex in the last step [m].
    least : float
        Threshold [m].
    pattern : SparsityPattern
        Adjacency.
    fixed : (n,) bool
        Dirichlet vertices.

    Returns
    -------
    (k,) int64
        Empty where the patch would be too large, or the cloth is small.
    """
    chosen = (moved > least) & ~fixed
    if len(moved) < MIN_VERTICES or not 0 < chosen.sum() <= MAX_FRACTION * len(moved):
        return NONE
    for _ in range(RINGS):
        grown = chosen.copy()
        _grow(grown, chosen, pattern.starts, pattern.columns)
        chosen = grown
    found = np.flatnonzero(chosen & ~fixed)
    return found if len(found) <= MAX_FRACTION * len(moved) else NONE


@kernel
def _grow(grown, chosen, starts, columns):
    """Add the neighbours of the `chosen` (n,) to `grown (n,)`."""
    for i in range(len(chosen)):
        for k in range(starts[i], starts[i + 1]):
            grown[i] |= chosen[columns[k]]
            grown[columns[k]] |= chosen[i]


NEW_BLOCKS = 0.02
"""Fraction of blocks that may be missing from the last symbolic analysis for a preconditioner to do without them: a
crumpling sheet would otherwise be reanalysed at every second iteration."""
SPARE_BLOCKS = 0.1
"""Fraction of blocks beyond those of a matrix that `System.cover` keeps, as the next matrix may need them again."""
MIN_TOGETHER = 1000
"""Vertices from which on two assemblies, of a millisecond each at this size, are worth a thread each."""

Offsets: TypeAlias = dict[int, tuple[Ints, NDArray[np.int32]]]
"""Lists of elements and their block offsets, by the lists' ids."""


class System:
    """Cached sparsity pattern, its symbolic analysis and its solver.

    Each step starts with what contact is expected to couple (`begin`), so that the elimination order, and with it every
    bit, depends on the step's own start; inside a step the pattern only grows.

    Parameters
    ----------
    base : SparsityPattern
        Couplings of the mesh.
    linear : str
        Name of the solver, see `linear_solvers.SOLVERS`.
    threads : int
        0: by size (`direct_solver.solver_threads`).
    patch : Patch, optional
        Vertices that the matrix is restricted to; None: all unknowns.
    dependent : DependentRows
        Rows of x that follow unknowns (vertices of rigid bodies).
    repeatable : bool
        True: take a factor in domains on one thread too, so that the bits are those of several.

    Attributes
    ----------
    rows : slice or (k,) int64
        Rows of x that the matrix is about.
    threads : int
        Threads that a step may take.
    name : str
        Name of the solver once one was made; a summary reads it without an analysis.
    """

    def __init__(
        self,
        base: SparsityPattern,
        linear: str = "auto",
        threads: int = 0,
        patch: Patch | None = None,
        dependent: DependentRows = NO_DEPENDENT_ROWS,
        repeatable: bool = False,
    ) -> None:
        self.base = base
        self.dependent = dependent
        self.patch = patch
        self.rows: Rows = slice(0, base.n_vertices) if patch is None else patch.rows
        self.analyses, self.name = 0, linear
        self._linear, self._threads = linear, threads
        self.threads = solver_threads(base.n_vertices, threads)
        self._dissected = repeatable or self.threads > 1
        self.pattern = self._analysed = base
        self._offsets: Offsets = {}
        self._solver: LinearSolver | None = None
        self._wider: tuple[list[Ints], System] | None = None

    @property
    def solver(self) -> LinearSolver:
        """Solver of the current pattern; the symbolic analysis runs when it is first requested."""
        if self._solver is None or self._analysed is not self.pattern:
            self.analyses += 1
            self._solver = None  # its factor is freed before the next one takes its memory
            self._solver = make_solver(self._linear, self.pattern, self._threads, self._dissected)
            self._analysed, self.name = self.pattern, self._solver.name
        return self._solver

    def preconditioner(self, data: Floats) -> tuple[LinearSolver, Floats]:
        """Return a solver, and data for it, of a matrix that equals `data` but for at most a few missing blocks.

        The missing blocks are those gained since the last analysis; they couple the two sides of contact pairs. Without
        them each side is held as if the other stood still, which is at most twice as stiff. Where only some blocks of a
        pair are missing, the rest may be indefinite (up to one in ten such matrices); NotPositiveDefiniteError then.
        """
        known, few = self._analysed, len(self.pattern.columns) <= (1.0 + NEW_BLOCKS) * len(self._analysed.columns)
        if self._solver is None or known is self.pattern or not few:
            return self.solver, data
        return self._solver, known.restricted(data, self.pattern)

    def begin(self, couplings: list[Ints]) -> None:
        """Set the pattern to the base and `couplings`, lists of rows (m, k) that act on one another."""
        self._set_pattern(extended(self.base, self.dependent.coupled(couplings) if self.dependent else couplings))
        if self._analysed.same_as(self.pattern):
            self.pattern = self._analysed
        else:
            self._solver = None
        if self._solver is not None:
            self._solver.restart()

    def cover(self, couplings: list[Ints]) -> None:
        """Extend the pattern to `couplings`, and leave out what only earlier matrices coupled where that is much."""
        wider = extended(self.pattern, couplings)
        if wider is not self.pattern:
            least = extended(self.base, couplings)
            self._set_pattern(least if len(wider.columns) > (1.0 + SPARE_BLOCKS) * len(least.columns) else wider)

    def widened(self, elements: list[Ints]) -> "System":
        """Return a system whose base has the couplings of `elements` too, (m, k) each; the last one is cached."""
        lists, system = self._wider or ([], self)
        if self._wider is not None and len(lists) == len(elements) and all(map(is_, lists, elements)):
            return system
        base = extended(self.base, elements)
        if self._wider is None or not system.base.same_as(base):
            system = System(base, self._linear, self._threads, dependent=self.dependent, repeatable=self._dissected)
        self._wider = elements, system
        return system

    def subsystem(self, patch: Patch) -> "System":
        """Return a system of the vertices of a patch, with the same kind of solver."""
        return System(
            self.pattern.subpattern(patch.rows), self._linear, self._threads, patch, repeatable=self._dissected
        )

    def assemble(self, given: list[Hessian]) -> Floats:
        """Sum the Hessians as data of the pattern, which is extended first where a block is outside of it."""
        return self.assemble_two(given)[0]

    def assemble_two(
        self, given: list[Hessian], others: Callable[[], list[Hessian]] | None = None
    ) -> tuple[Floats, Floats | None]:
        """Assemble beside one another the Hessians, as `assemble`, and others: None where these need more blocks."""
        hessians = self._own(given)
        known = self._offsets
        offsets = self._known_offsets(hessians)
        if any(at.min() == OUTSIDE for key, (_, at) in offsets.items() if key not in known):  # the least of all
            offsets = self._extended(hessians)
        pattern = self.pattern

        def first() -> tuple[Floats, int]:
            return pattern.assemble(hessians, lambda elements: _block_offsets(elements, offsets, pattern))

        def second() -> tuple[Floats, int]:
            own = self._own(others()) if others is not None else []
            return pattern.assemble(own, lambda elements: _block_offsets(elements, offsets, pattern))

        tasks = (first,) if others is None else (first, second)
        (data, outside), *more = together(*tasks, long=pattern.n_vertices >= MIN_TOGETHER)
        if outside:  # of a sparse matrix, which has no offsets
            offsets = self._extended(hessians)
            return self.pattern.assemble(hessians, lambda elements: _block_offsets(elements, offsets, self.pattern))[
                0
            ], None
        return data, (more[0][0] if more and not more[0][1] else None)

    def _extended(self, hessians: list[Explicit]) -> Offsets:
        """Extend the pattern to all blocks of Hessians; return their block offsets in it."""
        self._set_pattern(extended(self.pattern, [couplings(hessian) for hessian in hessians]))
        return self._known_offsets(hessians)

    def _own(self, given: list[Hessian]) -> list[Explicit]:
        """The Hessians by the rows of this system's matrix."""
        hessians = self.dependent.hessians(explicit(given))
        return hessians if self.patch is None else [self.patch.hessian(hessian) for hessian in hessians]

    def _known_offsets(self, hessians: list[Explicit]) -> Offsets:
        """Block offsets, by the lists' ids; cached for lists that are the same objects as before: most are."""
        lists = [each.elements for each in hessians if isinstance(each, ByElement) and len(each.elements)]
        known = self._offsets
        self._offsets = {  # a list in the cache keeps its id
            id(elements): known.get(id(elements)) or (elements, self.pattern.block_offsets(elements))
            for elements in lists
        }
        return self._offsets

    def _set_pattern(self, pattern: SparsityPattern) -> None:
        if not pattern.same_as(self.pattern):
            self.pattern = pattern
            self._offsets = {}


def _block_offsets(elements: Ints, known: Offsets, pattern: SparsityPattern) -> NDArray[np.int32]:
    """Block offsets of a list in a pattern, the known ones where there are any."""
    cached = known.get(id(elements))
    return pattern.block_offsets(elements) if cached is None else cached[1]
