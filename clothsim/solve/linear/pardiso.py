"""Intel MKL PARDISO: double precision, single precision with iterative refinement, and two domains side by side.

Dissection cuts the graph of a matrix into domains that do not couple, and the separator between them. Unconnected
parts are shared out among the domains; a part that is larger than a domain is cut at the smallest separator near its
middle.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import lapack
from scipy.sparse import csgraph

from clothsim.base.arrays import Floats, Ints
from clothsim.base.parallel import together
from clothsim.solve.linear.direct_solver import EXACT, LinearSolver, NotPositiveDefiniteError, solver_threads
from clothsim.solve.linear.pardiso_factor import Factor, in_range
from clothsim.solve.linear.sparsity import SparsityPattern

LARGEST_DOMAIN = 0.65
"""Fraction of the vertices in the larger of two domains up to which unconnected parts are not cut."""
CUTS = (0.45, 0.475, 0.5, 0.525, 0.55)
"""Fractions of a part on one side of its cut that are tried."""
SEPARATOR_WEIGHT = 6.0
"""Cost of a vertex of the separator over one of the larger side: the cheapest cut is taken."""
LARGEST_SEPARATOR = 0.06
"""Fraction of the vertices in the separator from which on a matrix stays whole: its dense matrix would cost more."""


@dataclass(frozen=True)
class Dissection:
    """Rows of two domains, (a,) and (b,), and of the separator between them, (s,), each ascending."""

    domains: tuple[Ints, ...]
    separator: Ints


def dissection(pattern: SparsityPattern) -> Dissection | None:
    """Dissect the graph of a pattern in two; None where its separator would be too large."""
    n = pattern.n_vertices
    graph = sparse.csr_array((np.ones(len(pattern.columns), np.int8), pattern.columns, pattern.starts), shape=(n, n))
    graph = (graph + graph.T).tocsr()
    count, parts = csgraph.connected_components(graph, directed=False)
    sizes = np.bincount(parts, minlength=count)
    side = np.zeros(n, np.int8)
    largest = int(sizes.argmax())
    separator = np.zeros(n, bool)
    loads = [0, 0]
    order = np.argsort(-sizes, kind="stable")
    if sizes[largest] > LARGEST_DOMAIN * n:
        rows = np.flatnonzero(parts == largest)
        cut = _cut(graph[rows][:, rows].tocsr())
        side[rows] = cut
        separator[rows[cut == 2]] = True
        loads = [int((cut == 0).sum()), int((cut == 1).sum())]
        order = order[order != largest]
    place = np.zeros(count, np.int8)
    for part in order:
        place[part] = lighter = int(loads[1] < loads[0])
        loads[lighter] += sizes[part]
    others = np.isin(parts, order)
    side[others] = place[parts[others]]
    if separator.sum() > LARGEST_SEPARATOR * n:
        return None
    return Dissection(tuple(np.flatnonzero((side == k) & ~separator) for k in range(2)), np.flatnonzero(separator))


def _cut(graph: sparse.csr_array) -> np.ndarray:
    """Cut a connected graph: (n,) 0 and 1 for both sides, 2 for the separator.

    Sides are sorted by the difference of the distances from two far vertices; the separator is the smallest set of
    vertices that meets all edges between the sides (Koenig's theorem).
    """
    one = int(_distances(graph, 0).argmax())
    from_one = _distances(graph, one)
    other = int(from_one.argmax())
    order = np.argsort(from_one - _distances(graph, other), kind="stable")
    least, best = np.inf, np.zeros(graph.shape[0], np.int8)
    for fraction in CUTS:
        after = np.zeros(graph.shape[0], bool)
        after[order[int(fraction * len(order)) :]] = True
        cover = _smallest_cover(graph, after)
        larger = max((after & ~cover).sum(), (~after & ~cover).sum())
        cost = float(larger + SEPARATOR_WEIGHT * cover.sum())
        if cost < least:
            least, best = cost, np.where(cover, 2, after)
    return best


def _distances(graph: sparse.csr_array, start: int) -> Ints:
    """Edges between `start` and each vertex, (n,)."""
    return csgraph.dijkstra(graph, indices=start, unweighted=True).astype(np.int64)


def _smallest_cover(graph: sparse.csr_array, after: np.ndarray) -> np.ndarray:
    """Smallest set of vertices, (n,) bool, that meets all edges between the sides `after` and not `after`."""
    left, right = np.flatnonzero(~after), np.flatnonzero(after)
    between = graph[left][:, right].tocsr()
    matched = csgraph.maximum_bipartite_matching(between, perm_type="column")  # of each left vertex, or -1
    reached_left, reached_right = matched < 0, np.zeros(len(right), bool)
    frontier = reached_left & (np.diff(between.indptr) > 0)
    partner = np.full(len(right), -1)
    partner[matched[matched >= 0]] = np.flatnonzero(matched >= 0)
    while frontier.any():
        new = (between[np.flatnonzero(frontier)].sum(axis=0) > 0) & ~reached_right
        reached_right |= new
        frontier = np.zeros(len(left), bool)
        frontier[partner[np.flatnonzero(new)]] = True
        frontier &= ~reached_left
        reached_left |= frontier
    cover = np.zeros(graph.shape[0], bool)
    cover[left] = ~reached_left & (np.diff(between.indptr) > 0)
    cover[right] = reached_right
    return cover


# Factor of a matrix in two domains, which threads factorise side by side, and of their separator.
#
# With the domains numbered first and the separator s last the matrix has the factor of both domains and of
#
#     S = A_ss - sum_k A_sk A_kk^-1 A_ks,
#
# the Schur complement of the separator: PARDISO returns each domain's part of it. The domains depend on the pattern
# alone, so that the bits are the same at every number of threads.

MIN_VERTICES = 1500
"""Vertices of a matrix from which on it is dissected."""
MIN_TOGETHER = 4000
"""Vertices from which on its back-solves, of half a millisecond at this size, are worth a thread each."""
CHOLESKY = {np.float32: (lapack.spotrf, lapack.spotrs), np.float64: (lapack.dpotrf, lapack.dpotrs)}


def useful_threads(n_vertices: int, threads: int, dissected: bool) -> int:
    """Return the threads of a factor, 0: by size; one where a step has helpers and the matrix stays whole.

    MKL's own threads wait for one another actively: a matrix of 1,000 vertices is done before.
    """
    return 1 if dissected and n_vertices < MIN_VERTICES else solver_threads(n_vertices, threads)


def make_factor(
    pattern: SparsityPattern, threads: int, kind: type[np.floating], dissected: bool = False
) -> "Factor | DissectedFactor":
    """Return a factor of the matrices of a pattern: in domains where that is asked for, it is large and has a cut."""
    parts = dissection(pattern) if dissected and pattern.n_vertices >= MIN_VERTICES else None
    return Factor(pattern, threads, kind) if parts is None else DissectedFactor(pattern, parts, threads, kind)


class DissectedFactor:
    """Factor in domains, with the methods of `Factor`."""

    def __init__(self, pattern: SparsityPattern, parts: Dissection, threads: int, kind: type[np.floating]) -> None:
        self._kind = kind
        self._side_by_side = pattern.n_vertices >= MIN_TOGETHER
        self._separator = _unknowns(parts.separator)
        self._cholesky: NDArray[Any] = np.zeros((0, 0), kind)
        inner = max(1, threads // len(parts.domains))
        rows = [np.concatenate([domain, parts.separator]) for domain in parts.domains]
        self._domains = together(
            *(
                partial(_Domain, pattern, each, len(parts.separator), number == 0, inner, kind)
                for number, each in enumerate(rows)
            )
        )
        self.threads = min(threads, sum(domain.factor.threads for domain in self._domains))

    def factorise(self, data: Floats) -> None:
        """Factorise the matrix of `data`; NotPositiveDefiniteError where it is not positive definite or overflows."""
        together(*(partial(domain.factorise, data) for domain in self._domains))
        if len(self._separator):
            schur = sum(domain.factor.schur for domain in self._domains)
            if not np.isfinite(schur).all():
                raise NotPositiveDefiniteError
            self._cholesky, failed = CHOLESKY[self._kind][0](schur, lower=1, overwrite_a=1)
            if failed:
                raise NotPositiveDefiniteError

    def back_solve(self, b: Floats) -> Floats:
        """Solve with the matrix last factorised; numbers that overflow single precision come back as inf or NaN."""
        scaled = np.empty(len(b), self._kind)
        scale, x = in_range(b, scaled), np.empty_like(scaled)
        if not len(self._separator):
            self._each([partial(domain.write_solution, scaled, x) for domain in self._domains])
        else:
            halves = self._each([partial(domain.forward, scaled) for domain in self._domains])
            left = scaled[self._separator]
            for half in halves:
                left += half[-len(left) :]
            solution, _ = CHOLESKY[self._kind][1](self._cholesky, left, lower=1)
            x[self._separator] = solution
            pairs = zip(self._domains, halves, strict=True)
            self._each([partial(domain.write_backward, half, x) for domain, half in pairs])
        return np.multiply(x, scale, dtype=np.float64)

    def _each(self, tasks: list[Callable[[], Any]]) -> list[Any]:
        return together(*tasks, long=self._side_by_side)


class _Domain:
    """A domain with the separator, whose rows come last; the first of two holds the separator's own blocks."""

    def __init__(
        self,
        pattern: SparsityPattern,
        rows: Ints,
        n_separator: int,
        is_first: bool,
        threads: int,
        kind: type[np.floating],
    ) -> None:
        own = len(rows) - n_separator
        self._unknowns = _unknowns(rows[:own])
        self._separator = _unknowns(rows[own:])
        self._entries, domain_pattern = _restriction(pattern, rows, len(rows) if is_first else own)
        self._kind = kind
        self.factor = Factor(domain_pattern, threads, kind, len(self._separator))

    def factorise(self, data: Floats) -> None:
        """Factorise, with the Schur complement of the separator."""
        own = data[np.maximum(self._entries, 0)]
        own[self._entries < 0] = 0.0
        self.factor.factorise(own)

    def write_solution(self, b: NDArray[Any], x: NDArray[Any]) -> None:
        """Write the solution of a domain without a separator into x."""
        x[self._unknowns] = self.factor.solve(b[self._unknowns])

    def forward(self, b: NDArray[Any]) -> NDArray[Any]:
        """Eliminate the domain's unknowns: what they add to the right-hand side of the separator comes last."""
        return self.factor.forward(np.concatenate([b[self._unknowns], np.zeros(len(self._separator), self._kind)]))

    def write_backward(self, eliminated: NDArray[Any], x: NDArray[Any]) -> None:
        """Write the domain's solution into x, which holds that of the separator."""
        eliminated[len(self._unknowns) :] = x[self._separator]
        x[self._unknowns] = self.factor.backward(eliminated)[: len(self._unknowns)]


def _unknowns(rows: Ints) -> Ints:
    return (3 * rows[:, None] + np.arange(3)).ravel()


def _restriction(pattern: SparsityPattern, rows: Ints, coupled: int) -> tuple[Ints, SparsityPattern]:
    """Pattern of the blocks between `rows (k,)`, numbered 0..k-1, and the offset of each of its numbers in the whole.

    Blocks between the rows from number `coupled` on are left out: their diagonal is in the pattern with an offset of
    -1, for 0.
    """
    numbers = np.full(pattern.n_vertices, -1)
    numbers[rows] = np.arange(len(rows))
    i = numbers[np.repeat(np.arange(pattern.n_vertices), np.diff(pattern.starts))]
    j = numbers[pattern.columns]
    chosen = np.flatnonzero((i >= 0) & (j >= 0) & ((np.minimum(i, j) < coupled) | (i == j)))
    i, j = i[chosen], j[chosen]
    order = np.lexsort((np.maximum(i, j), np.minimum(i, j)))
    chosen, i, j = chosen[order], i[order], j[order]
    straight, transposed = np.arange(9), np.arange(9).reshape(3, 3).T.ravel()
    entries = 9 * chosen[:, None] + np.where((i <= j)[:, None], straight, transposed)
    entries[np.minimum(i, j) >= coupled] = -1
    starts = np.concatenate([[0], np.cumsum(np.bincount(np.minimum(i, j), minlength=len(rows)))])
    return entries.ravel(), SparsityPattern(len(rows), starts, np.maximum(i, j))


MAX_REFINEMENTS = 10
MAX_CONTRACTION = 0.1
"""A refinement that leaves more than this fraction of the error shows that the single-precision factor is useless."""


class Pardiso(LinearSolver):
    """PARDISO in double precision."""

    name = "pardiso"

    def __init__(self, pattern: SparsityPattern, threads: int, dissected: bool = False) -> None:
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

    def __init__(self, pattern: SparsityPattern, threads: int, dissected: bool = False) -> None:
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
