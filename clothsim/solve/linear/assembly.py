"""Assembly of element blocks into a Newton matrix in 3x3 block CSR, and the addresses of those blocks.

The matrix is the upper triangle of a symmetric one in blocks of 3x3: starts (n + 1,) and columns of the blocks, the
diagonal first in each row; data (9 b,) their numbers, block by block, row by row. Only the blocks of corners a <= b of
an element are visited, in this order.
"""

import numpy as np

from clothsim.base.jit import kernel, natural, part
from clothsim.physics.energies.block_sums import BOTH, LOWER, OUTSIDE, TRANSPOSED, add_block


@part
def find(starts, columns, i, j):
    """Return the number of block (i, j), or -1 (binary search in steps that do not depend on the data)."""
    at, count = natural(starts[i]), starts[i + 1] - starts[i]
    while count > 1:
        half = count >> 1
        at += half if columns[at + half] <= j else 0
        count -= half
    return at if columns[at] == j else -1


@kernel
def block_offsets(starts, columns, elements):
    """Return the block offsets of corners a <= b of `elements (m, k)`, (m, k (k + 1) / 2).

    An offset is 4 x the number of the block in the matrix, + TRANSPOSED where its transpose is stored, + BOTH where
    both are added; LOWER and OUTSIDE mark blocks without a number.
    """
    n = len(starts) - 1
    count, corners = elements.shape
    at = np.full((count, corners * (corners + 1) // 2), LOWER, np.int32)
    for e in range(count):
        block = 0
        for a in range(corners):
            for b in range(a, corners):
                i, j = elements[e, a], elements[e, b]
                if max(i, j) < n:
                    found = find(starts, columns, min(i, j), max(i, j))
                    how = (TRANSPOSED if i > j else 0) + (BOTH if i == j and a != b else 0)
                    at[e, block] = 4 * found + how if found >= 0 else OUTSIDE
                block += 1
    return at


@kernel
def add_blocks(data, at, first, numbers, lanes, offsets, down, along):
    """Add blocks of the elements from `first` on; return the number of 3x3 blocks outside the pattern.

    Each row of numbers (g, n) holds as many elements as there are lanes. Block k of the element in lane l begins at
    offsets[k] + l; its rows are `down` apart, and its columns `along`.
    """
    flat, size, outside = numbers.reshape(-1), numbers.shape[1], 0
    for i in range(min(lanes * len(numbers), len(at) - first)):
        begin = natural(i // lanes * size + i % lanes)
        for k in range(at.shape[1]):
            where = at[first + i, k]
            if where >= 0:
                add_block(data, where, flat, begin + natural(offsets[k]), down, along)
            outside += where == OUTSIDE
    return outside


@kernel
def add_low_rank(data, at, first, count, factors):
    """Add sums of squares, sum_s f_s f_s', of elements none of which has a vertex twice; return as `add_blocks`.

    The factors f of element e are the rows first[e] to first[e] + count[e] of `factors (s, 3 k)`.
    """
    outside = 0
    for e in range(len(at)):
        k = 0
        for a in range(factors.shape[1] // 3):
            for b in range(a, factors.shape[1] // 3):
                if at[e, k] >= 0:
                    row, column = (b, a) if at[e, k] & TRANSPOSED else (a, b)
                    _add_products(data, 9 * (at[e, k] >> 2), factors, first[e], count[e], 3 * row, 3 * column)
                outside += at[e, k] == OUTSIDE
                k += 1
    return outside


@part
def _add_products(data, at, factors, first, count, row, column):
    """Add the sum over the factors of (x, y, z)(u, v, w)', the parts of a factor at two vertices."""
    xu = xv = xw = yu = yv = yw = zu = zv = zw = 0.0
    first, row, column, at = natural(first), natural(row), natural(column), natural(at)
    for k in range(first, first + count):
        x, y, z = factors[k, row], factors[k, row + 1], factors[k, row + 2]
        u, v, w = factors[k, column], factors[k, column + 1], factors[k, column + 2]
        xu, xv, xw = xu + x * u, xv + x * v, xw + x * w
        yu, yv, yw = yu + y * u, yv + y * v, yw + y * w
        zu, zv, zw = zu + z * u, zv + z * v, zw + z * w
    for i, entry in enumerate((xu, xv, xw, yu, yv, yw, zu, zv, zw)):
        data[at + i] += entry


@kernel
def add_csr(data, starts, columns, indptr, indices, values):
    """Add a symmetric CSR matrix over all rows of x; return the number of entries outside the pattern."""
    outside, n = 0, len(starts) - 1
    for i in range(n):
        for p in range(3):
            for k in range(indptr[3 * i + p], indptr[3 * i + p + 1]):
                j, q = indices[k] // 3, indices[k] % 3
                if j < i or j >= n:
                    continue
                found = find(starts, columns, i, j)
                if found < 0:
                    outside += values[k] != 0.0
                else:
                    data[9 * found + 3 * p + q] += values[k]
    return outside
