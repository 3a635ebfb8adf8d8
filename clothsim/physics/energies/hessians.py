"""Second derivatives by element: dense blocks, low-rank factors, blocks computed as they are assembled, diagonals."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import LANES, inlined, kernel
from clothsim.base.linalg import dot
from clothsim.base.vectors import as_rows, taken

AT_ONCE = 1024
"""Elements of a `LanesHessian` that are computed before they are assembled: 0.7 MB of hinges, within the L2 cache."""


@dataclass(frozen=True)
class ElementHessian:
    """Second derivatives as one dense block an element.

    Parameters
    ----------
    elements : (m, k) int array
        Rows of x, the vertices of each element. Rows that are not unknowns (bodies, ghosts) are allowed: the assembly
        drops them.
    blocks : (m, 3k, 3k) array
        Second derivatives [N/m], the coordinates of a vertex side by side.

    Examples
    --------
    >>> import numpy as np
    >>> hessian = ElementHessian(np.array([[0], [2]]), np.tile(5.0 * np.eye(3), (2, 1, 1)))
    >>> hessian.to_sparse(n_vertices=3).diagonal()
    array([5., 5., 5., 0., 0., 0., 5., 5., 5.])
    """

    elements: Ints
    blocks: Floats

    @property
    def nnz(self) -> int:
        """Number of entries of all blocks."""
        return self.blocks.size

    def times(self, vectors: Floats) -> Floats:
        """Products of the blocks with `vectors` (m, 3k), (m, 3k)."""
        return np.einsum("mij,mj->mi", self.blocks, vectors)

    def to_sparse(self, n_vertices: int) -> sparse.csr_array:
        """The assembled (3n, 3n) matrix [N/m]; slow, for tests and diagnostics."""
        dofs = (3 * self.elements[:, :, None] + np.arange(3)).reshape(len(self.elements), 3 * self.elements.shape[1])
        rows = np.repeat(dofs, dofs.shape[1], axis=1).ravel()
        columns = np.tile(dofs, (1, dofs.shape[1])).ravel()
        shape = (3 * n_vertices, 3 * n_vertices)
        return sparse.coo_array((self.blocks.ravel(), (rows, columns)), shape=shape).tocsr()


@dataclass(frozen=True)
class LowRankHessian:
    """Positive semi-definite second derivatives as low-rank factors: the block of element e is a sum of v v'.

    Contact pairs have rank one or two, so that their factors have a fifth of the entries of their blocks.

    Parameters
    ----------
    elements : (m, k) int array
        Rows of x, none twice in one element.
    first, count : (m,) int arrays
        The factors of element e are the `count[e]` rows of `factors` from `first[e]` on.
    factors : (s, 3k) array
        The vectors v [(N/m)^1/2].
    """

    elements: Ints
    first: Ints
    count: Ints
    factors: Floats

    @property
    def nnz(self) -> int:
        """Number of entries of all blocks."""
        return len(self.elements) * self.factors.shape[1] ** 2

    @property
    def blocks(self) -> Floats:
        """Dense blocks (m, 3k, 3k) [N/m]; slow, for tests and diagnostics."""
        blocks = np.zeros((len(self.elements), *2 * self.factors.shape[1:]))
        for chosen, factors in self._iterate_ranks():
            blocks[chosen] += factors[:, :, None] * factors[:, None, :]
        return blocks

    def times(self, vectors: Floats) -> Floats:
        """Products of the blocks with `vectors` (m, 3k), (m, 3k)."""
        products = np.zeros_like(vectors)
        for chosen, factors in self._iterate_ranks():
            products[chosen] += np.einsum("mi,mi->m", factors, vectors[chosen])[:, None] * factors
        return products

    def _iterate_ranks(self) -> Iterator[tuple[Ints, Floats]]:
        """The elements with a first factor, and these factors; those with a second factor, and so on."""
        for k in range(int(self.count.max(initial=0))):
            chosen = np.flatnonzero(self.count > k)
            yield chosen, self.factors[self.first[chosen] + k]

    def to_sparse(self, n_vertices: int) -> sparse.csr_array:
        """The assembled (3n, 3n) matrix [N/m]; slow, for tests and diagnostics."""
        return ElementHessian(self.elements, self.blocks).to_sparse(n_vertices)


@dataclass(frozen=True)
class LanesHessian:
    """Second derivatives that are computed while they are assembled, a few groups of LANES elements at a time.

    Computed all at once, the blocks would pass through main memory twice, which takes longer than computing them. The
    positions at which they are taken must not change in place before the assembly.

    Parameters
    ----------
    elements : (m, k) int array
        Rows of x.
    fill : function
        fill(lanes, first) writes the blocks of the elements from `first` on, as many as fit, to `lanes` (g, size): for
        each group of LANES elements the blocks of corners a <= b in this order, each row by row, every entry for all
        lanes side by side. The last lanes of the last group may belong to no element.
    add : function, optional
        add(data, at) adds all blocks to the data of a matrix at block offsets (`block_sums`) and returns the number
        outside of its pattern: one call of a kernel, in which a group never leaves the fastest cache.
    """

    elements: Ints
    fill: Callable[[Floats, int], None]
    add: Callable[[Floats, NDArray[np.int32]], int] | None = None

    @property
    def nnz(self) -> int:
        """Number of entries of all blocks."""
        return len(self.elements) * (3 * self.elements.shape[1]) ** 2

    @property
    def blocks(self) -> Floats:
        """Dense blocks (m, 3k, 3k) [N/m]."""
        blocks = room_for(self.elements)
        for first, lanes in self.chunks():
            unpack(blocks[first : first + AT_ONCE], lanes)
        return blocks

    def chunks(self, needed: np.ndarray | None = None) -> Iterator[tuple[int, Floats]]:
        """Iterate over chunks of AT_ONCE elements: the first element and the lanes, which the next chunk overwrites.

        A chunk without an element that is `needed` ((m,) booleans; None: all) is skipped.
        """
        count, corners = self.elements.shape
        room = np.empty((-(-min(AT_ONCE, count) // LANES), 9 * corners * (corners + 1) // 2 * LANES))
        for first in range(0, count, AT_ONCE):
            if needed is None or needed[first : first + AT_ONCE].any():
                lanes = room[: -(-(count - first) // LANES)]
                self.fill(lanes, first)
                yield first, lanes

    def times(self, vectors: Floats) -> Floats:
        """Products of the blocks with `vectors` (m, 3k), (m, 3k); few are non-zero, since few vertices are pinned."""
        products = np.zeros_like(vectors)
        for first, lanes in self.chunks(np.asarray(vectors.any(axis=1))):
            here = slice(first, first + AT_ONCE)
            blocks = room_for(self.elements[here])
            unpack(blocks, lanes)
            products[here] = np.einsum("mij,mj->mi", blocks, vectors[here])
        return products

    def to_sparse(self, n_vertices: int) -> sparse.csr_array:
        """The assembled (3n, 3n) matrix [N/m]; slow, for tests and diagnostics."""
        return ElementHessian(self.elements, self.blocks).to_sparse(n_vertices)


@dataclass(frozen=True)
class DeferredHessian:
    """Second derivatives as one dense block an element, computed while they are assembled.

    Those of a thousand contacts would fill the L2 cache, and the blocks of bodies among them are no part of a matrix.
    What they are computed from must not change in place before the assembly.

    Parameters
    ----------
    elements : (m, k) int array
        Rows of x.
    fill : function
        fill(blocks) writes `blocks` (m, 3k, 3k) [N/m].
    add : function
        As of `LanesHessian`.
    """

    elements: Ints
    fill: Callable[[Floats], None]
    add: Callable[[Floats, NDArray[np.int32]], int]

    @property
    def nnz(self) -> int:
        """Number of entries of all blocks."""
        return len(self.elements) * (3 * self.elements.shape[1]) ** 2

    @property
    def blocks(self) -> Floats:
        """Dense blocks (m, 3k, 3k) [N/m]."""
        blocks = room_for(self.elements)
        self.fill(blocks)
        return blocks

    def times(self, vectors: Floats) -> Floats:
        """Products of the blocks with `vectors` (m, 3k), (m, 3k)."""
        return ElementHessian(self.elements, self.blocks).times(vectors)

    def to_sparse(self, n_vertices: int) -> sparse.csr_array:
        """The assembled (3n, 3n) matrix [N/m]; slow, for tests and diagnostics."""
        return ElementHessian(self.elements, self.blocks).to_sparse(n_vertices)


ByElement = ElementHessian | LowRankHessian | LanesHessian | DeferredHessian
"""Second derivatives element by element, in any of the four forms."""


@dataclass(frozen=True)
class ImplicitHessian:
    """Second derivatives known by their products with vectors: where the matrix has far more entries than they cost.

    Parameters
    ----------
    elements : (m, k) int array
        Rows of x that each element couples.
    apply : function
        apply(v) is the product with v (N, 3), (N, 3) [N/m times the unit of v]. That with a translation of all
        vertices is 0, and is not asked for (`direction.without_net_force`).
    explicit : function
        explicit() is the same Hessian by element, for where a matrix is needed.
    """

    elements: Ints
    apply: Callable[[Floats], Floats]
    explicit: Callable[[], ByElement]

    @property
    def nnz(self) -> int:
        """Number of entries of all blocks, none of which is formed."""
        return 0


@dataclass(frozen=True)
class SumHessian:
    """Sum of second derivatives in several forms.

    Parameters
    ----------
    parts : tuple
        Hessians by element, each over its own list, or implicit ones.
    """

    parts: tuple[ByElement | ImplicitHessian, ...]

    @property
    def nnz(self) -> int:
        """Number of entries of all blocks."""
        return sum(part.nnz for part in self.parts)

    def to_sparse(self, n_vertices: int) -> sparse.csr_array:
        """The assembled (3n, 3n) matrix [N/m]; slow, for tests and diagnostics."""
        return sum(part.to_sparse(n_vertices) for part in explicit([self]))


Hessian: TypeAlias = ByElement | SumHessian | sparse.csr_array
"""Hessian of an energy: by element, a sum of such and of implicit ones, or a sparse matrix."""


def explicit(hessians: Iterable[Hessian]) -> list[ByElement | sparse.csr_array]:
    """The hessians with the parts of sums in place of the sums, implicit ones by element."""
    parts = (each.parts if isinstance(each, SumHessian) else (each,) for each in hessians)
    return [part.explicit() if isinstance(part, ImplicitHessian) else part for some in parts for part in some]


def split(hessians: Iterable[Hessian]) -> tuple[list[Hessian], list[ImplicitHessian]]:
    """The hessians without their implicit parts, and these."""
    formed: list[Hessian] = []
    implicit: list[ImplicitHessian] = []
    for each in hessians:
        parts = each.parts if isinstance(each, SumHessian) else (each,)
        implicit += [part for part in parts if isinstance(part, ImplicitHessian)]
        formed += [part for part in parts if not isinstance(part, ImplicitHessian)]
    return formed, implicit


def room_for(elements: Ints) -> Floats:
    """Uninitialised blocks (m, 3k, 3k) for `elements` (m, k).

    Allocated by numpy, which asks the system for large pages: an array of more than 32 MB that a kernel allocates is
    mapped in small pages at every Hessian, which takes longer than filling it.
    """
    size = 3 * elements.shape[1]
    return np.empty((len(elements), size, size))


# SIMD lanes: entries of LANES elements side by side (`jit.LANES`).


@inlined
def point(numbers, k, lane):
    """Read entries k, k + 1 and k + 2 of the element in a lane."""
    return numbers[k * LANES + lane], numbers[(k + 1) * LANES + lane], numbers[(k + 2) * LANES + lane]


@inlined
def write(numbers, block, lane, rows):
    """Write a 3 x 3 block, given as three rows, to the blocks of the element in a lane."""
    at = 9 * block * LANES + lane
    numbers[at], numbers[at + LANES], numbers[at + 2 * LANES] = rows[0]
    numbers[at + 3 * LANES], numbers[at + 4 * LANES], numbers[at + 5 * LANES] = rows[1]
    numbers[at + 6 * LANES], numbers[at + 7 * LANES], numbers[at + 8 * LANES] = rows[2]


@kernel
def unpack(blocks, lanes):
    """Copy lanes (g, size) to the dense `blocks` (m, 3k, 3k)."""
    corners = blocks.shape[1] // 3
    for e in range(len(blocks)):
        numbers, lane = lanes[e // LANES], e % LANES
        for p in range(corners):
            for q in range(p, corners):
                for row in range(3):
                    for column in range(3):
                        entry = numbers[lane]
                        blocks[e, 3 * p + row, 3 * q + column] = entry
                        blocks[e, 3 * q + column, 3 * p + row] = entry
                        lane += LANES


# Diagonal quadratic energies: weighted squared distances of single vertices, and their derivatives.


def every_vertex(n: int) -> Ints:
    """The first n rows of x as elements of one vertex each, (n, 1)."""
    return np.arange(n)[:, None]


def weighted_square(rows: Ints, weights: Floats, x: Floats, target: Floats) -> float:
    """sum w |x - target|^2 over the rows (n, 1) of x, which ascend, in the order of weights (n,) and target (n, 3)."""
    squares = taken(x, as_rows(rows[:, 0])) - target
    squares *= squares
    # sum(axis=1) over three columns takes ten times as long
    return dot(weights, squares[:, 0] + squares[:, 1] + squares[:, 2])


def weighted_difference(rows: Ints, weights: Floats, x: Floats, target: Floats) -> Floats:
    """w (x - target) in the given rows, 0 in the others, (N, 3)."""
    out, at = np.zeros_like(x), as_rows(rows[:, 0])
    difference = taken(x, at) - target
    difference *= weights[:, None]
    out[at] = difference
    return out


def diagonal_hessian(rows: Ints, weights: Floats) -> ElementHessian:
    """The block w I, 3 x 3, for each of the rows [N/m]."""
    return ElementHessian(rows, weights[:, None, None] * np.eye(3))
