"""Dissection of a matrix graph: domains that do not couple, and the separator between them.

Domains can be factorised side by side. Unconnected parts are shared out among the domains; a part that is larger than
a domain is cut at the smallest separator near its middle.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from clothsim.base.arrays import Ints
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
