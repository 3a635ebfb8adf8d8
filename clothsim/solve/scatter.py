"""Where the blocks of elements stand in the data of a Newton matrix, and their sum there.

The matrix is the upper triangle of a symmetric one, 3x3 block by block: starts (n + 1,) and columns of the blocks, the
diagonal first in each row. Of an element only the blocks of corners a <= b are looked at, in this order: whether
block (a, b) or its transpose is in the upper triangle is no branch, which would go either way by chance.
"""

import numpy as np

from clothsim.compiled import kernel, part

BELOW, OUTSIDE = -1, -2
"""Of a block that needs no place, and of one that has none."""


@part
def rank(starts, columns, i, j):
    """Where block (i, j) stands in block row i, or -1 (binary search, in steps that do not depend on what is met)."""
    at, count = starts[i], starts[i + 1] - starts[i]
    while count > 1:
        half = count >> 1
        at += half if columns[at + half] <= j else 0
        count -= half
    return at - starts[i] if columns[at] == j else -1


@part
def place(starts, i, p, rank, q):
    """Where entry (3 i + p, 3 j + q) stands in the data, j the block of that rank: row lengths are 3 degree - p."""
    degree = starts[i + 1] - starts[i]
    row = 9 * starts[i] - 3 * i + p * 3 * degree - (p * (p - 1)) // 2
    return row + 3 * rank + q - p


@kernel
def places(starts, columns, elements):
    """Where the blocks of corners a <= b of `elements (m, k)` begin, (m, k (k + 1) / 2)."""
    n = len(starts) - 1
    count, corners = elements.shape
    at = np.full((count, corners * (corners + 1) // 2), BELOW, np.int32)
    for e in range(count):
        block = 0
        for a in range(corners):
            for b in range(a, corners):
                i, j = min(elements[e, a], elements[e, b]), max(elements[e, a], elements[e, b])
                if j < n:
                    found = rank(starts, columns, i, j)
                    at[e, block] = place(starts, i, 0, found, 0) if found >= 0 else OUTSIDE
                block += 1
    return at


@kernel
def add_blocks(data, starts, elements, at, blocks):
    """Adds dense blocks (m, 3 k, 3 k); returns how many of 3x3 have no place."""
    corners = elements.shape[1]
    outside = 0
    for e in range(len(elements)):
        block = 0
        for a in range(corners):
            for b in range(a, corners):
                first = at[e, block]
                block += 1
                if first < 0:
                    outside += first == OUTSIDE
                    continue
                i, j = elements[e, a], elements[e, b]
                length = 3 * (starts[min(i, j) + 1] - starts[min(i, j)])
                x, y, z = _entries(blocks, e, 3 * a, 3 * b)
                _add(data, first, length, x, y, z, i <= j, i == j)
                if i == j and a != b:  # a vertex that is there twice
                    x, y, z = _entries(blocks, e, 3 * b, 3 * a)
                    _add(data, first, length, x, y, z, True, True)
    return outside


@part
def _entries(blocks, e, row, column):
    """The rows of a block of 3x3."""
    return (
        (blocks[e, row, column], blocks[e, row, column + 1], blocks[e, row, column + 2]),
        (blocks[e, row + 1, column], blocks[e, row + 1, column + 1], blocks[e, row + 1, column + 2]),
        (blocks[e, row + 2, column], blocks[e, row + 2, column + 1], blocks[e, row + 2, column + 2]),
    )


@part
def _add(data, first, length, x, y, z, upper, diagonal):
    """Adds a block of 3x3 with these rows, or its transpose, where the matrix's row of this length has it."""
    second, third = first + length - 1, first + 2 * length - 3
    data[first] += x[0]
    data[first + 1] += x[1] if upper else y[0]
    data[first + 2] += x[2] if upper else z[0]
    data[second + 1] += y[1]
    data[second + 2] += y[2] if upper else z[1]
    data[third + 2] += z[2]
    if not diagonal:
        data[second] += y[0] if upper else x[1]
        data[third] += z[0] if upper else x[2]
        data[third + 1] += z[1] if upper else y[2]


@kernel
def add_squares(data, starts, elements, at, first, count, sides):
    """Adds sums of squares (`SquaresHessian`) over elements none of which has a vertex twice; returns as above."""
    corners = elements.shape[1]
    outside = 0
    for e in range(len(elements)):
        block = 0
        for a in range(corners):
            for b in range(a, corners):
                begins = at[e, block]
                block += 1
                if begins < 0:
                    outside += begins == OUTSIDE
                    continue
                i, j = elements[e, a], elements[e, b]
                length = 3 * (starts[min(i, j) + 1] - starts[min(i, j)])
                x, y, z = _products(sides, first[e], first[e] + count[e], 3 * a, 3 * b)
                _add(data, begins, length, x, y, z, i <= j, a == b)
    return outside


@part
def _products(sides, first, end, row, column):
    """The rows of the sum over the sides of (x, y, z)(u, v, w)', the parts of a side at two vertices."""
    xu = xv = xw = yu = yv = yw = zu = zv = zw = 0.0
    for k in range(first, end):
        x, y, z = sides[k, row], sides[k, row + 1], sides[k, row + 2]
        u, v, w = sides[k, column], sides[k, column + 1], sides[k, column + 2]
        xu, xv, xw = xu + x * u, xv + x * v, xw + x * w
        yu, yv, yw = yu + y * u, yv + y * v, yw + y * w
        zu, zv, zw = zu + z * u, zv + z * v, zw + z * w
    return (xu, xv, xw), (yu, yv, yw), (zu, zv, zw)


@kernel
def add_csr(data, starts, columns, indptr, indices, values, n):
    """Adds the upper triangle of a CSR matrix over all rows of x; returns how many entries have no place."""
    outside = 0
    for i in range(n):
        for p in range(3):
            for k in range(indptr[3 * i + p], indptr[3 * i + p + 1]):
                column = indices[k]
                j, q = column // 3, column % 3
                if j < i or j >= n or (i == j and q < p):
                    continue
                found = rank(starts, columns, i, j)
                if found < 0:
                    outside += values[k] != 0.0
                else:
                    data[place(starts, i, p, found, q)] += values[k]
    return outside
