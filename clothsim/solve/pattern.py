"""The fixed sparsity of the Newton matrix, and assembly straight into it.

The matrix is stored as the upper triangle of a CSR matrix, 3x3 block by block. Energies hand over element blocks; each
(element, corner, corner) is looked up once, when an element list is new (`places`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import sparse

from clothsim.arrays import Floats, Ints
from clothsim.compiled import kernel
from clothsim.energies.base import ElementHessian

BELOW, OUTSIDE = -1, -2
"""Of a block that needs no place, and of one that has none."""

Hessian: TypeAlias = ElementHessian | sparse.csr_array
"""What an energy hands over: element blocks, or (by ipctk) a matrix."""


@dataclass(frozen=True)
class Pattern:
    """Upper triangle of a symmetric matrix over n vertices, 3x3 blocks.

    starts (n + 1,), columns: the block pattern, diagonal first in each row; indptr, indices: the scalar CSR pattern.
    """

    n_vertices: int
    starts: Ints
    columns: Ints
    indptr: NDArray[np.int32]
    indices: NDArray[np.int32]

    def places(self, elements: Ints) -> NDArray[np.int32]:
        """Where the block of corners a, b of each of the `elements (m, k)` begins in the data, (m, k, k).

        BELOW for blocks of the lower triangle and for rows beyond n_vertices, OUTSIDE for those that do not fit.
        """
        return _places(self.starts, self.columns, elements)

    def assemble(
        self, hessians: list[Hessian], places: Callable[[Ints], NDArray[np.int32]] | None = None
    ) -> tuple[Floats, int]:
        """The sum of the Hessians as the data of the upper CSR matrix, and how many blocks do not fit.

        Rows beyond n_vertices are dropped. places: `self.places`, or what remembers it.
        """
        data = np.zeros(len(self.indices))
        outside = 0
        for hessian in hessians:
            if isinstance(hessian, ElementHessian):
                if len(hessian.elements):
                    at = (places or self.places)(hessian.elements)
                    outside += _add_blocks(data, self.starts, hessian.elements, at, hessian.blocks)
            elif hessian.nnz:
                matrix = hessian.tocsr()
                outside += _add_csr(
                    data, self.starts, self.columns, matrix.indptr, matrix.indices, matrix.data, self.n_vertices
                )
        return data, outside

    def same_as(self, other: "Pattern") -> bool:
        """True where both have the same blocks."""
        return self is other or (
            np.array_equal(self.starts, other.starts) and np.array_equal(self.columns, other.columns)
        )

    def upper(self, data: Floats) -> sparse.csr_matrix:
        """The upper triangle as a scipy matrix."""
        size = 3 * self.n_vertices
        return sparse.csr_matrix((data, self.indices, self.indptr), shape=(size, size))

    def times(self, data: Floats) -> Callable[[Floats], Floats]:
        """v -> A v for the symmetric matrix whose upper triangle is `data`."""
        return lambda v: _times(data, self.indptr, self.indices, v)

    def fix(self, data: Floats, fixed: np.ndarray) -> None:
        """Cut the rows and columns of `fixed` vertices ((n,) booleans) out of `data` in place; 1 on their diagonal."""
        if fixed.any():
            _fix(data, self.indptr, self.indices, fixed)

    def diagonal(self, data: Floats) -> Floats:
        """The diagonal, (3 n,): the first entry of each row."""
        return data[self.indptr[:-1]]

    def shift(self, data: Floats, amount: Floats) -> Floats:
        """A copy of `data` with `amount (3 n,)` added to the diagonal."""
        shifted = data.copy()
        shifted[self.indptr[:-1]] += amount
        return shifted


def make_pattern(n_vertices: int, triangles: Ints, hessians: list[Hessian]) -> Pattern:
    """The pattern of all element lists among `hessians`, of the cloth's `triangles (m, 3)`, and the diagonal.

    The triangles are in it whether or not they are elastic: contact couples the corners of the one that it touches.
    """
    diagonal = np.arange(n_vertices)[:, None]
    elements = [hessian.elements for hessian in hessians if isinstance(hessian, ElementHessian)]
    return _pattern(n_vertices, np.unique(_keys(n_vertices, [diagonal, triangles, *elements])))


def coupled(pattern: Pattern, elements: list[Ints]) -> Pattern:
    """The pattern with the blocks of more `elements`, each (m, k); the same object where it holds them all."""
    n = pattern.n_vertices
    rows = np.repeat(np.arange(n), np.diff(pattern.starts))
    known = rows * n + pattern.columns
    added = np.setdiff1d(_keys(n, elements), known)
    return _pattern(n, np.sort(np.concatenate([known, added]))) if len(added) else pattern


def couplings(hessian: Hessian) -> Ints:
    """The rows of x that a Hessian couples, (m, k)."""
    if isinstance(hessian, ElementHessian):
        return hessian.elements
    entries = hessian.tocoo()
    return np.column_stack([entries.row, entries.col]).astype(np.int64) // 3


def _keys(n: int, elements: list[Ints]) -> Ints:
    """row n + column of each block of the upper triangle that `elements` couple, with repetitions."""
    keys = [np.zeros(0, np.int64)]
    for rows in elements:
        for a in range(rows.shape[1]):
            for b in range(rows.shape[1]):
                i, j = rows[:, a], rows[:, b]
                upper = (i <= j) & (j < n)
                keys.append(i[upper] * n + j[upper])
    return np.concatenate(keys)


def _pattern(n: int, keys: Ints) -> Pattern:
    rows, columns = keys // n, keys % n
    starts = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=n))])
    indptr, indices = _scalar_pattern(starts, columns)
    return Pattern(n, starts, columns, indptr, indices)


def times(hessians: list[Hessian], vector: Floats) -> Floats:
    """(sum of Hessians) vector, (N, 3), over all rows: also those of bodies and ghosts."""
    product = np.zeros_like(vector)
    for hessian in hessians:
        if isinstance(hessian, ElementHessian):
            local = vector[hessian.elements].reshape(len(hessian.elements), 3 * hessian.elements.shape[1])
            result = np.einsum("mij,mj->mi", hessian.blocks, local).reshape(-1, 3)
            np.add.at(product, hessian.elements.ravel(), result)
        else:
            product += (hessian @ vector.ravel()).reshape(-1, 3)
    return product


def _scalar_pattern(starts: Ints, columns: Ints) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """indptr and indices (int32, as the direct solvers take them) of the scalar upper triangle."""
    degree = np.diff(starts)
    row_lengths = (3 * degree[:, None] - np.arange(3)).ravel()
    indptr = np.concatenate([[0], np.cumsum(row_lengths)]).astype(np.int32)
    indices = np.empty(indptr[-1], np.int32)
    _fill_indices(indices, indptr, starts, columns)
    return indptr, indices


@kernel
def _fill_indices(indices, indptr, starts, columns):
    for i in range(len(starts) - 1):
        for p in range(3):
            at = indptr[3 * i + p]
            for k in range(starts[i], starts[i + 1]):
                for q in range(p if k == starts[i] else 0, 3):
                    indices[at] = 3 * columns[k] + q
                    at += 1


@njit(cache=True, inline="always")
def _rank(starts, columns, i, j):
    """Where block (i, j) stands in block row i, or -1 (binary search)."""
    low, high = starts[i], starts[i + 1]
    while low < high:
        middle = (low + high) // 2
        if columns[middle] < j:
            low = middle + 1
        else:
            high = middle
    return low - starts[i] if low < starts[i + 1] and columns[low] == j else -1


@njit(cache=True, inline="always")
def _place(starts, i, p, rank, q):
    """Where entry (3 i + p, 3 j + q) stands in the data, j the block of that rank: row lengths are 3 degree - p."""
    degree = starts[i + 1] - starts[i]
    row = 9 * starts[i] - 3 * i + p * 3 * degree - (p * (p - 1)) // 2
    return row + 3 * rank + q - p


@kernel
def _places(starts, columns, elements):
    n = len(starts) - 1
    count, corners = elements.shape
    at = np.full((count, corners, corners), BELOW, np.int32)
    for e in range(count):
        for a in range(corners):
            i = elements[e, a]
            if i >= n:
                continue
            for b in range(corners):
                j = elements[e, b]
                if i <= j < n:
                    rank = _rank(starts, columns, i, j)
                    at[e, a, b] = _place(starts, i, 0, rank, 0) if rank >= 0 else OUTSIDE
    return at


@kernel
def _add_blocks(data, starts, elements, at, blocks):
    n = len(starts) - 1
    outside = 0
    for e in range(len(elements)):
        for a in range(elements.shape[1]):
            i = elements[e, a]
            if i >= n:
                continue
            length = 3 * (starts[i + 1] - starts[i])
            for b in range(elements.shape[1]):
                first = at[e, a, b]
                if first < 0:
                    outside += first == OUTSIDE
                    continue
                second, third = first + length - 1, first + 2 * length - 3
                for q in range(3):
                    data[first + q] += blocks[e, 3 * a, 3 * b + q]
                for q in range(1 if i == elements[e, b] else 0, 3):
                    data[second + q] += blocks[e, 3 * a + 1, 3 * b + q]
                for q in range(2 if i == elements[e, b] else 0, 3):
                    data[third + q] += blocks[e, 3 * a + 2, 3 * b + q]
    return outside


@kernel
def _add_csr(data, starts, columns, indptr, indices, values, n):
    outside = 0
    for i in range(n):
        for p in range(3):
            for k in range(indptr[3 * i + p], indptr[3 * i + p + 1]):
                column = indices[k]
                j, q = column // 3, column % 3
                if j < i or j >= n or (i == j and q < p):
                    continue
                rank = _rank(starts, columns, i, j)
                if rank < 0:
                    outside += values[k] != 0.0
                else:
                    data[_place(starts, i, p, rank, q)] += values[k]
    return outside


@njit(cache=True, error_model="numpy")
def _times(data, indptr, indices, v):
    """A v, each entry of the upper triangle read once; the first of a row is the diagonal's."""
    product = np.zeros_like(v)
    for i in range(len(v)):
        along = data[indptr[i]] * v[i]
        for k in range(indptr[i] + 1, indptr[i + 1]):
            along += data[k] * v[indices[k]]
            product[indices[k]] += data[k] * v[i]
        product[i] += along
    return product


@kernel
def _fix(data, indptr, indices, fixed):
    for row in range(len(indptr) - 1):
        row_fixed = fixed[row // 3]
        for k in range(indptr[row], indptr[row + 1]):
            if row_fixed or fixed[indices[k] // 3]:
                data[k] = 1.0 if indices[k] == row else 0.0
