"""Sparsity pattern of the Newton matrix, and assembly of element blocks into it.

The matrix is stored as the upper triangle of a symmetric one in blocks of 3x3. Energies return element blocks; the
offset of each (element, corner, corner) is looked up once, when an element list is new (`block_offsets`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import LANES, kernel, natural
from clothsim.physics.energies.hessians import ByElement, ElementHessian, LowRankHessian
from clothsim.solve.linear import assembly

Explicit: TypeAlias = ByElement | sparse.csr_array
"""Hessian with entries: blocks, low-rank factors or lanes by element, or a sparse matrix."""


@dataclass(frozen=True)
class SparsityPattern:
    """Upper triangle of a symmetric matrix over n vertices, in b blocks of 3x3.

    The data of a matrix are the (9 b,) numbers of its blocks, each row by row; diagonal blocks are stored whole.

    Parameters
    ----------
    n_vertices : int
        Number of block rows n.
    starts : (n + 1,) int64
        First block of each row; the diagonal block comes first.
    columns : (b,) int64
        Block columns, ascending in a row.
    """

    n_vertices: int
    starts: Ints
    columns: Ints

    @property
    def nonzeros(self) -> int:
        """Number of scalars in the upper triangle."""
        return 9 * len(self.columns) - 3 * self.n_vertices

    def scalar(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """indptr and indices of the scalar upper triangle in CSR (int32, as direct solvers take them)."""
        row_lengths = (3 * np.diff(self.starts)[:, None] - np.arange(3)).ravel()
        indptr = np.concatenate([[0], np.cumsum(row_lengths)]).astype(np.int32)
        indices = np.empty(indptr[-1], np.int32)
        _fill_indices(indices, indptr, self.starts, self.columns)
        return indptr, indices

    def write_entries(self, data: Floats, entries: NDArray[Any]) -> None:
        """Write `data` in the order of the scalar upper triangle; overflow gives inf."""
        _write_entries(entries, self.starts, data)

    def block_offsets(self, elements: Ints) -> NDArray[np.int32]:
        """Return the block offsets of `elements (m, k)`, (m, k (k + 1) / 2): see `assembly.block_offsets`."""
        return assembly.block_offsets(self.starts, self.columns, elements)

    def assemble(
        self, hessians: list[Explicit], block_offsets: Callable[[Ints], NDArray[np.int32]] | None = None
    ) -> tuple[Floats, int]:
        """Sum Hessians into data of this pattern; rows beyond n_vertices are dropped.

        Parameters
        ----------
        hessians : list
            Hessians over all rows of x [N/m].
        block_offsets : callable, optional
            Replacement of `self.block_offsets`, such as a cache of it.

        Returns
        -------
        data : (9 b,) float64
            Sum of the blocks inside the pattern.
        outside : int
            Number of blocks outside the pattern.
        """
        data = np.zeros(9 * len(self.columns))
        outside = 0
        for hessian in hessians:
            if not isinstance(hessian, ByElement):
                matrix = hessian.tocsr()
                arrays = matrix.indptr, matrix.indices, matrix.data
                outside += assembly.add_csr(data, self.starts, self.columns, *arrays) if hessian.nnz else 0
                continue
            if not len(hessian.elements):
                continue
            at = (block_offsets or self.block_offsets)(hessian.elements)
            if isinstance(hessian, LowRankHessian):
                outside += assembly.add_low_rank(data, at, hessian.first, hessian.count, hessian.factors)
            elif isinstance(hessian, ElementHessian):
                size = hessian.blocks.shape[1]
                numbers = np.ascontiguousarray(hessian.blocks).reshape(len(at), size * size)
                outside += assembly.add_blocks(data, at, 0, numbers, 1, _offsets_in_dense(size), size, 1)
            elif hessian.add is not None:
                outside += hessian.add(data, at)
            else:
                offsets = _offsets_in_lanes(at.shape[1])
                for first, lanes in hessian.chunks():
                    outside += assembly.add_blocks(data, at, first, lanes, LANES, offsets, 3 * LANES, LANES)
        return data, outside

    def subpattern(self, rows: Ints) -> "SparsityPattern":
        """Return the pattern of the blocks between `rows (k,)`, ascending, renumbered 0..k-1."""
        numbers = np.full(self.n_vertices, -1)
        numbers[rows] = np.arange(len(rows))
        return SparsityPattern(len(rows), *_among(self.starts, self.columns, rows, numbers))

    def restricted(self, data: Floats, whole: "SparsityPattern") -> Floats:
        """Return the blocks of this pattern out of the `data` of a pattern that contains it."""
        restricted = np.zeros(9 * len(self.columns))
        _copy_own(restricted, self.starts, self.columns, data, whole.starts, whole.columns)
        return restricted

    def same_as(self, other: "SparsityPattern") -> bool:
        """True where both have the same blocks."""
        return self is other or (
            np.array_equal(self.starts, other.starts) and np.array_equal(self.columns, other.columns)
        )

    def upper(self, data: Floats) -> sparse.csr_matrix:
        """Return the upper triangle as a scipy matrix."""
        (indptr, indices), size = self.scalar(), 3 * self.n_vertices
        entries = np.empty(len(indices))
        self.write_entries(data, entries)
        return sparse.csr_matrix((entries, indices, indptr), shape=(size, size))

    def times(self, data: Floats) -> Callable[[Floats], Floats]:
        """Return v -> A v for the matrix of `data`."""
        return lambda v: _times(data, self.starts, self.columns, v)

    def translated(self, data: Floats) -> Floats:
        """Return A t for the translations t of all vertices by 1 along x, y and z, (3, 3 n): read once, A is long."""
        return _translated(data, self.starts, self.columns)

    def fix(self, data: Floats, fixed: np.ndarray) -> None:
        """Set the rows and columns of `fixed` vertices ((n,) bool) to those of the identity, in place (Dirichlet)."""
        if fixed.any():
            _fix(data, self.starts, self.columns, fixed)

    def diagonal(self, data: Floats) -> Floats:
        """Return the diagonal, (3 n,)."""
        return data.take(self._on_diagonal)

    def shift(self, data: Floats, amount: Floats | float) -> Floats:
        """Return a copy of `data` with `amount`, one for all or (3 n,), added to the diagonal."""
        shifted = data.copy()
        shifted[self._on_diagonal] += amount
        return shifted

    @cached_property
    def _on_diagonal(self) -> Ints:
        return (9 * self.starts[:-1, None] + np.array([0, 4, 8])).ravel()


@cache
def _offsets_in_lanes(count: int) -> Ints:
    """Positions of the first entries of `count` blocks in the lanes of a group."""
    return 9 * LANES * np.arange(count)


@cache
def _offsets_in_dense(size: int) -> Ints:
    """Positions of the first entries of the blocks of corners a <= b in a dense block of `size` rows."""
    rows, columns = np.triu_indices(size // 3)
    return np.asarray(3 * (rows * size + columns), np.int64)


def make_pattern(n_vertices: int, triangles: Ints, hessians: list[Explicit]) -> SparsityPattern:
    """Make the pattern of the diagonal, of the cloth's `triangles (m, 3)` and of all element lists of `hessians`.

    The triangles are included whether or not a membrane acts: contact couples the corners of a triangle.
    """
    diagonal = np.arange(n_vertices)[:, None]
    elements = [hessian.elements for hessian in hessians if isinstance(hessian, ByElement)]
    keys = []  # row n + column of each block of the upper triangle
    for rows in (diagonal, triangles, *elements):
        for a in range(rows.shape[1]):
            for b in range(rows.shape[1]):
                i, j = rows[:, a], rows[:, b]
                upper = (i <= j) & (j < n_vertices)
                keys.append(i[upper] * n_vertices + j[upper])
    return _pattern(n_vertices, np.unique(np.concatenate(keys)))


def extended(pattern: SparsityPattern, elements: list[Ints]) -> SparsityPattern:
    """Return the pattern with the blocks of more `elements`, each (m, k); the same object where none is new."""
    n = pattern.n_vertices
    missing = [_missing(pattern.starts, pattern.columns, rows) for rows in elements if len(rows)]
    added = np.sort(np.concatenate([np.zeros(0, np.int64), *missing]))
    if not len(added):
        return pattern
    added = added[np.diff(added, prepend=-1) > 0]
    known = np.repeat(np.arange(n), np.diff(pattern.starts)) * n + pattern.columns
    return _pattern(n, np.sort(np.concatenate([known, added])))


def couplings(hessian: Explicit) -> Ints:
    """Return the rows of x that a Hessian couples, (m, k)."""
    if isinstance(hessian, ByElement):
        return hessian.elements
    entries = hessian.tocoo()
    return np.column_stack([entries.row, entries.col]).astype(np.int64) // 3


def _pattern(n: int, keys: Ints) -> SparsityPattern:
    rows, columns = keys // n, keys % n
    starts = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=n))])
    return SparsityPattern(n, starts, columns)


def hessian_product(hessians: list[Explicit], vector: Floats) -> Floats:
    """Return (sum of Hessians) vector, (N, 3), over all rows: also those of bodies and ghosts."""
    product = np.zeros_like(vector)
    for hessian in hessians:
        if isinstance(hessian, ByElement):
            local = vector[hessian.elements].reshape(len(hessian.elements), 3 * hessian.elements.shape[1])
            np.add.at(product, hessian.elements.ravel(), hessian.times(local).reshape(-1, 3))
        else:
            product += (hessian @ vector.ravel()).reshape(-1, 3)
    return product


@kernel
def _missing(starts, columns, elements):
    """row n + column of each block of the upper triangle that `elements (m, k)` couple and the pattern lacks."""
    n = len(starts) - 1
    count, corners = elements.shape
    found = np.empty(count * (corners * (corners - 1)) // 2, np.int64)
    size = 0
    for e in range(count):
        for a in range(corners):
            for b in range(a + 1, corners):
                i, j = min(elements[e, a], elements[e, b]), max(elements[e, a], elements[e, b])
                if j < n and assembly.find(starts, columns, i, j) < 0:
                    found[size] = i * n + j
                    size += 1
    return found[:size]


@kernel
def _among(starts, columns, rows, numbers):
    """starts and columns of the blocks between `rows`; numbers (n,): the new number of each row, or -1."""
    size = 0
    for row in rows:
        for k in range(starts[row], starts[row + 1]):
            size += numbers[columns[k]] >= 0
    inside, restricted = np.empty(size, np.int64), np.zeros(len(rows) + 1, np.int64)
    size = 0
    for i in range(len(rows)):
        for k in range(starts[rows[i]], starts[rows[i] + 1]):
            if numbers[columns[k]] >= 0:
                inside[size] = numbers[columns[k]]
                size += 1
        restricted[i + 1] = size
    return restricted, inside


@kernel
def _copy_own(restricted, starts, columns, data, whole_starts, whole_columns):
    for i in range(len(starts) - 1):
        k = starts[i]
        for whole in range(whole_starts[i], whole_starts[i + 1]):
            if k == starts[i + 1] or columns[k] != whole_columns[whole]:
                continue
            for p in range(9):
                restricted[9 * k + p] = data[9 * whole + p]
            k += 1


@kernel
def _fill_indices(indices, indptr, starts, columns):
    for i in range(len(starts) - 1):
        for p in range(3):
            at = indptr[3 * i + p]
            for k in range(starts[i], starts[i + 1]):
                for q in range(p if k == starts[i] else 0, 3):
                    indices[at] = 3 * columns[k] + q
                    at += 1


@kernel
def _write_entries(entries, starts, data):
    """Write the upper triangles of diagonal blocks and all of the others, row by row of the scalar matrix."""
    at = 0
    for i in range(len(starts) - 1):
        for p in range(3):
            for q in range(p, 3):
                entries[at] = data[9 * starts[i] + 3 * p + q]
                at += 1
            for k in range(starts[i] + 1, starts[i + 1]):
                to, source = natural(at), natural(9 * k + 3 * p)
                for q in range(3):
                    entries[to + q] = data[source + q]
                at += 3


@kernel
def _times(data, starts, columns, v):
    """A v; each block of the upper triangle is read once, for itself and for its transpose."""
    product = np.zeros_like(v)
    for i in range(len(starts) - 1):
        x, y, z = v[3 * i], v[3 * i + 1], v[3 * i + 2]
        k = 9 * starts[i]
        u = data[k] * x + data[k + 1] * y + data[k + 2] * z
        r = data[k + 3] * x + data[k + 4] * y + data[k + 5] * z
        s = data[k + 6] * x + data[k + 7] * y + data[k + 8] * z
        for block in range(starts[i] + 1, starts[i + 1]):
            k, j = 9 * block, 3 * columns[block]
            a, b, c = v[j], v[j + 1], v[j + 2]
            u += data[k] * a + data[k + 1] * b + data[k + 2] * c
            r += data[k + 3] * a + data[k + 4] * b + data[k + 5] * c
            s += data[k + 6] * a + data[k + 7] * b + data[k + 8] * c
            product[j] += data[k] * x + data[k + 3] * y + data[k + 6] * z
            product[j + 1] += data[k + 1] * x + data[k + 4] * y + data[k + 7] * z
            product[j + 2] += data[k + 2] * x + data[k + 5] * y + data[k + 8] * z
        product[3 * i] += u
        product[3 * i + 1] += r
        product[3 * i + 2] += s
    return product


@kernel
def _translated(data, starts, columns):
    """A t for the three translations: sums of the blocks of each row, added as `_times` does."""
    products = np.zeros((3, 3 * (len(starts) - 1)))
    for i in range(len(starts) - 1):
        for axis in range(3):
            k = 9 * starts[i] + axis
            u, r, s = data[k], data[k + 3], data[k + 6]
            for block in range(starts[i] + 1, starts[i + 1]):
                k, j = 9 * block, 3 * columns[block]
                u += data[k + axis]
                r += data[k + axis + 3]
                s += data[k + axis + 6]
                products[axis, j] += data[k + 3 * axis]
                products[axis, j + 1] += data[k + 3 * axis + 1]
                products[axis, j + 2] += data[k + 3 * axis + 2]
            products[axis, 3 * i] += u
            products[axis, 3 * i + 1] += r
            products[axis, 3 * i + 2] += s
    return products


@kernel
def _fix(data, starts, columns, fixed):
    for i in range(len(starts) - 1):
        for k in range(starts[i], starts[i + 1]):
            if fixed[i] or fixed[columns[k]]:
                for p in range(9):
                    data[9 * k + p] = 1.0 if k == starts[i] and p % 4 == 0 else 0.0
