"""The fixed sparsity of the Newton matrix, and assembly straight into it.

The matrix is stored as the upper triangle of a CSR matrix, 3x3 block by block. Energies hand over element blocks; each
(element, corner, corner) is looked up once, when an element list is new (`places`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from clothsim.arrays import Floats, Ints
from clothsim.compiled import kernel
from clothsim.energies.base import ByElement, ElementHessian
from clothsim.solve import scatter

Hessian: TypeAlias = ByElement | sparse.csr_array
"""What an energy hands over: blocks or squares of elements, or (by ipctk) a matrix."""


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
        """Where the blocks of corners a <= b of each of the `elements (m, k)` begin in the data, (m, k (k + 1) / 2).

        BELOW for rows beyond n_vertices, OUTSIDE for blocks that do not fit.
        """
        return scatter.places(self.starts, self.columns, elements)

    def assemble(
        self, hessians: list[Hessian], places: Callable[[Ints], NDArray[np.int32]] | None = None
    ) -> tuple[Floats, int]:
        """The sum of the Hessians as the data of the upper CSR matrix, and how many blocks do not fit.

        Rows beyond n_vertices are dropped. places: `self.places`, or what remembers it.
        """
        data = np.zeros(len(self.indices))
        outside = 0
        for hessian in hessians:
            if isinstance(hessian, ByElement):
                if len(hessian.elements):
                    into = data, self.starts, hessian.elements, (places or self.places)(hessian.elements)
                    if isinstance(hessian, ElementHessian):
                        outside += scatter.add_blocks(*into, hessian.blocks)
                    else:
                        outside += scatter.add_squares(*into, hessian.first, hessian.count, hessian.sides)
            elif hessian.nnz:
                matrix = hessian.tocsr()
                outside += scatter.add_csr(
                    data, self.starts, self.columns, matrix.indptr, matrix.indices, matrix.data, self.n_vertices
                )
        return data, outside

    def of(self, rows: Ints) -> "Pattern":
        """The pattern of the blocks between these `rows (k,)`, ascending, numbered by their place among them."""
        numbers = np.full(self.n_vertices, -1)
        numbers[rows] = np.arange(len(rows))
        starts, columns = _among(self.starts, self.columns, rows, numbers)
        return Pattern(len(rows), starts, columns, *_scalar_pattern(starts, columns))

    def own(self, data: Floats, whole: "Pattern") -> Floats:
        """Of the `data` of a pattern that holds all blocks of this one, those: all others are left out."""
        own = np.zeros(len(self.indices))
        _copy_own(own, self.starts, self.columns, data, whole.starts, whole.columns)
        return own

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

        def product(v: Floats) -> Floats:
            out = np.zeros_like(v)
            _add_product(out, data, self.starts, self.columns, v)
            return out

        return product

    def fix(self, data: Floats, fixed: np.ndarray) -> None:
        """Cut the rows and columns of `fixed` vertices ((n,) booleans) out of `data` in place; 1 on their diagonal."""
        if fixed.any():
            _fix(data, self.indptr, self.indices, fixed)

    def diagonal(self, data: Floats) -> Floats:
        """The diagonal, (3 n,): the first entry of each row."""
        return data[self.indptr[:-1]]

    def shift(self, data: Floats, amount: Floats | float) -> Floats:
        """A copy of `data` with `amount`, one for all or (3 n,), added to the diagonal."""
        shifted = data.copy()
        shifted[self.indptr[:-1]] += amount
        return shifted


def make_pattern(n_vertices: int, triangles: Ints, hessians: list[Hessian]) -> Pattern:
    """The pattern of all element lists among `hessians`, of the cloth's `triangles (m, 3)`, and the diagonal.

    The triangles are in it whether or not they are elastic: contact couples the corners of the one that it touches.
    """
    diagonal = np.arange(n_vertices)[:, None]
    elements = [hessian.elements for hessian in hessians if isinstance(hessian, ByElement)]
    return _pattern(n_vertices, np.unique(_keys(n_vertices, [diagonal, triangles, *elements])))


def coupled(pattern: Pattern, elements: list[Ints]) -> Pattern:
    """The pattern with the blocks of more `elements`, each (m, k); the same object where it holds them all."""
    n = pattern.n_vertices
    missing = [_missing(pattern.starts, pattern.columns, rows) for rows in elements if len(rows)]
    added = np.sort(np.concatenate([np.zeros(0, np.int64), *missing]))
    if not len(added):
        return pattern
    added = added[np.diff(added, prepend=-1) > 0]
    known = np.repeat(np.arange(n), np.diff(pattern.starts)) * n + pattern.columns
    return _pattern(n, np.sort(np.concatenate([known, added])))


def couplings(hessian: Hessian) -> Ints:
    """The rows of x that a Hessian couples, (m, k)."""
    if isinstance(hessian, ByElement):
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
        if isinstance(hessian, ByElement):
            local = vector[hessian.elements].reshape(len(hessian.elements), 3 * hessian.elements.shape[1])
            np.add.at(product, hessian.elements.ravel(), hessian.times(local).reshape(-1, 3))
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
def _missing(starts, columns, elements):
    """row n + column of each block of the upper triangle that `elements (m, k)` couple and the pattern has not."""
    n = len(starts) - 1
    count, corners = elements.shape
    found = np.empty(count * (corners * (corners - 1)) // 2, np.int64)
    size = 0
    for e in range(count):
        for a in range(corners):
            for b in range(a + 1, corners):
                i, j = min(elements[e, a], elements[e, b]), max(elements[e, a], elements[e, b])
                if j < n and scatter.rank(starts, columns, i, j) < 0:
                    found[size] = i * n + j
                    size += 1
    return found[:size]


@kernel
def _among(starts, columns, rows, numbers):
    """starts and columns of the blocks between `rows`; numbers (n,): the place of each row among them, or -1."""
    size = 0
    for row in rows:
        for k in range(starts[row], starts[row + 1]):
            size += numbers[columns[k]] >= 0
    inside, own = np.empty(size, np.int64), np.zeros(len(rows) + 1, np.int64)
    size = 0
    for i in range(len(rows)):
        for k in range(starts[rows[i]], starts[rows[i] + 1]):
            if numbers[columns[k]] >= 0:
                inside[size] = numbers[columns[k]]
                size += 1
        own[i + 1] = size
    return own, inside


@kernel
def _copy_own(own, starts, columns, data, whole_starts, whole_columns):
    for i in range(len(starts) - 1):
        k = starts[i]
        for whole in range(whole_starts[i], whole_starts[i + 1]):
            if k == starts[i + 1] or columns[k] != whole_columns[whole]:
                continue
            for p in range(3):
                for q in range(p if k == starts[i] else 0, 3):
                    known = scatter.place(starts, i, p, k - starts[i], q)
                    own[known] = data[scatter.place(whole_starts, i, p, whole - whole_starts[i], q)]
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
def _add_product(product, data, starts, columns, v):
    """Add A v to `product (3 n,)`, each block of the upper triangle read once.

    The first of a row is the diagonal's, of which half is there. Memory is the caller's: compiled, it costs .4 s.
    """
    first = 0  # where the three rows of a vertex begin in the data
    for i in range(len(starts) - 1):
        blocks = starts[i + 1] - starts[i]
        second = first + 3 * blocks
        third = second + 3 * blocks - 1
        a, b, c = v[3 * i], v[3 * i + 1], v[3 * i + 2]
        along_a = data[first] * a + data[first + 1] * b + data[first + 2] * c
        along_b = data[second] * b + data[second + 1] * c
        along_c = data[third] * c
        product[3 * i + 1] += data[first + 1] * a
        product[3 * i + 2] += data[first + 2] * a
        product[3 * i + 2] += data[second + 1] * b
        for k in range(1, blocks):
            p, q, r, j = first + 3 * k, second + 3 * k - 1, third + 3 * k - 2, 3 * columns[starts[i] + k]
            for n in range(3):
                along_a += data[p + n] * v[j + n]
                along_b += data[q + n] * v[j + n]
                along_c += data[r + n] * v[j + n]
                product[j + n] = product[j + n] + data[p + n] * a + data[q + n] * b + data[r + n] * c
        product[3 * i] += along_a
        product[3 * i + 1] += along_b
        product[3 * i + 2] += along_c
        first = third + 3 * blocks - 2


@kernel
def _fix(data, indptr, indices, fixed):
    for row in range(len(indptr) - 1):
        row_fixed = fixed[row // 3]
        for k in range(indptr[row], indptr[row + 1]):
            if row_fixed or fixed[indices[k] // 3]:
                data[k] = 1.0 if indices[k] == row else 0.0
