"""PSD projection as rank-one factors: eigenvalues of mollified pairs clamped at 0 (as in IPC).

Eigenpairs: Householder tridiagonalisation and the QL method with implicit shifts (Golub & Van Loan 2013, sections 8.3.1
and 8.3.3), of a batch of blocks at a time: the last index of each array is that of the block. Each number depends on
the one before it through roots and quotients, and a processor can interleave many such chains.
"""

import numpy as np

from clothsim.base.jit import kernel, part

# Translation-free coordinates of a pair.
#
# A common translation of a pair has no energy, so 9 of its 12 coordinates x_i suffice: (x1 - x0) / sqrt 2, (x3 - x2) /
# sqrt 2 and (x0 + x1 - x2 - x3) / 2, which are orthonormal: eigenvalues are the same in both.


SQRT_HALF = float(np.sqrt(0.5))


@part
def relative(g):
    """Three components in these coordinates of a quantity with a component at each of the four vertices."""
    return SQRT_HALF * (g[1] - g[0]), SQRT_HALF * (g[3] - g[2]), 0.5 * (g[0] + g[1] - g[2] - g[3])


@part
def absolute(y):
    """Inverse of `relative` for quantities without a common translation."""
    first, second, between = SQRT_HALF * y[0], SQRT_HALF * y[1], 0.5 * y[2]
    return between - first, between + first, -between - second, second - between


@part
def absolute_block(block, at, out, to):
    """out[to] = the matrix block[at] (9, 9) in all 12 coordinates.

    The size is not a compile-time constant: unrolled it would take several times as long to compile.
    """
    size = block.shape[1] // 3
    for p in range(size):
        for q in range(size):
            above = absolute((block[at, p, q], block[at, p, 3 + q], block[at, p, 6 + q]))
            middle = absolute((block[at, 3 + p, q], block[at, 3 + p, 3 + q], block[at, 3 + p, 6 + q]))
            below = absolute((block[at, 6 + p, q], block[at, 6 + p, 3 + q], block[at, 6 + p, 6 + q]))
            for j in range(4):
                column = absolute((above[j], middle[j], below[j]))
                for i in range(4):
                    out[to, 3 * i + p, 3 * j + q] = column[i]


ROUND_OFF = float(np.finfo(np.float64).eps)
"""Machine epsilon of a double."""

MAX_SWEEPS = 60
"""Sweeps an eigenvalue; QL needs about two."""

BATCH = 32
"""Blocks of a batch: their arrays just fit the first-level cache."""


@kernel
def positive_factors(blocks, indices, factors, at, first, count):
    """Positive part of the symmetric `blocks (m, 9, 9)` in the coordinates of `relative`, as rank-one factors.

    Those of block k are count[indices[k]] rows of `factors (s, 12)` from first[indices[k]] on, all from row `at` on.
    Returns the row behind them. Non-finite values propagate.
    """
    n = blocks.shape[1]
    z, d, e = np.empty((n, 2 * n, BATCH)), np.empty((n, BATCH)), np.empty((n, BATCH))
    for begin in range(0, len(blocks), BATCH):
        batch_size = min(BATCH, len(blocks) - begin)
        for i in range(n):
            for j in range(n):
                for k in range(BATCH):
                    z[i, j, k] = blocks[begin + k, i, j] if k < batch_size else 0.0
                    z[i, n + j, k] = 1.0 if i == j else 0.0
        _tridiagonal(z, d, e)
        _diagonalize(d, e, z)
        for k in range(batch_size):
            index = indices[begin + k]
            first[index] = at
            for i in range(n):
                if not d[i, k] <= 0.0:
                    _write_factor(factors, at, np.sqrt(d[i, k]), z, i, k)
                    at += 1
            count[index] = at - first[index]
    return at


@part
def _write_factor(factors, at, size, z, i, k):
    """Scaled eigenvector i of block k as a row of factors over all coordinates."""
    for p in range(3):
        v = absolute((size * z[i, 9 + p, k], size * z[i, 12 + p, k], size * z[i, 15 + p, k]))
        factors[at, p], factors[at, 3 + p], factors[at, 6 + p], factors[at, 9 + p] = v


@part
def _tridiagonal(z, d, e):
    """Tridiagonalise z (n, 2 n, m), a and the identity beside it: a = y' t y, the identity becomes y. a is overwritten.

    t is tridiagonal: d (n, m) its diagonal, e (n, m) the off-diagonal.
    """
    n, m = d.shape
    v, scale, projection = np.empty((n, m)), np.empty(m), np.empty(m)
    for i in range(n - 1):
        _householder_vector(z, d, e, v, scale, projection, i)
        _apply_householder(z, v, scale, projection, i + 1, n, False)
        _apply_householder(z, v, scale, projection, i + 1, 2 * n, True)
    for k in range(m):
        d[n - 1, k], e[n - 1, k] = z[n - 1, n - 1, k], 0.0


@part
def _householder_vector(a, d, e, v, scale, squared, i):
    """Householder reflection that clears column i below the off-diagonal: v, and scale = 2 / |v|^2."""
    n, m = d.shape
    for k in range(m):
        squared[k] = 0.0
    for j in range(i + 1, n):
        for k in range(m):
            v[j, k] = a[j, i, k]
            squared[k] += v[j, k] * v[j, k]
    for k in range(m):
        root = np.sqrt(squared[k])
        off_diagonal = -root if v[i + 1, k] > 0.0 else root
        size = squared[k] - off_diagonal * v[i + 1, k]
        scale[k] = 1.0 / size if size != 0.0 else 0.0
        v[i + 1, k] -= off_diagonal
        d[i, k], e[i, k] = a[i, i, k], off_diagonal


@part
def _apply_householder(z, v, scale, projection, first, end, columns):
    """Reflect the rows of z from `first` to `end`, or its columns, in v, which is 0 before `first`."""
    n, m = v.shape
    for i in range(first, end):
        for k in range(m):
            projection[k] = 0.0
        for j in range(first, n):
            p, q = (j, i) if columns else (i, j)
            for k in range(m):
                projection[k] += v[j, k] * z[p, q, k]
        for j in range(first, n):
            p, q = (j, i) if columns else (i, j)
            for k in range(m):
                z[p, q, k] -= scale[k] * projection[k] * v[j, k]


@part
def _diagonalize(d, e, z):
    """Diagonalise the tridiagonal matrices of d and e (n, m): d becomes their eigenvalues, y is rotated along."""
    n, m = d.shape
    tolerance, ends, rotation = np.zeros(m), np.empty(m, np.int64), np.empty((5, m))
    for i in range(n):
        for k in range(m):
            tolerance[k] = max(tolerance[k], ROUND_OFF * (abs(d[i, k]) + abs(e[i, k])))
    for first in range(n):
        for _ in range(MAX_SWEEPS):
            last = _block_ends(e, tolerance, ends, first)
            if last == first:
                break
            _ql_sweep(d, e, z, first, last, ends, rotation)


@part
def _block_ends(e, tolerance, ends, first):
    """Row at which each matrix first decouples from row `first` on; returns the last of them."""
    last = first
    for k in range(len(ends)):
        end = first
        while end < len(e) - 1 and abs(e[end, k]) > tolerance[k]:
            end += 1
        ends[k] = end
        last = max(last, end)
    return last


@part
def _ql_sweep(d, e, z, first, last, ends, rotation):
    """One QL sweep over rows first to ends (m,), upwards, with the shift of the leading 2 x 2 block (Wilkinson).

    rotation (5, m): sine and cosine of the last rotation, its shift of the diagonal, the off-diagonal it left, and the
    sine once more, 0 where there was none.
    """
    n, m = d.shape
    for k in range(m):
        rotation[0, k], rotation[1, k], rotation[2, k], rotation[3, k] = 1.0, 1.0, 0.0, 0.0
        if ends[k] > first:
            g = (d[first + 1, k] - d[first, k]) / (2.0 * e[first, k])
            root = np.sqrt(g * g + 1.0)
            rotation[3, k] = d[ends[k], k] - d[first, k] + e[first, k] / (g + root if g > 0.0 else g - root)
    for i in range(last - 1, first - 1, -1):
        _next_rotation(d, e, i, ends, rotation)
        for j in range(n, 2 * n):
            for k in range(m):
                low, high = z[i, j, k], z[i + 1, j, k]
                z[i + 1, j, k] = rotation[4, k] * low + rotation[1, k] * high
                z[i, j, k] = rotation[1, k] * low - rotation[4, k] * high
    for k in range(m):
        if ends[k] > first:
            d[first, k] -= rotation[2, k]
            e[first, k] = rotation[3, k]


@part
def _next_rotation(d, e, i, ends, rotation):
    """Rotation of rows i and i + 1, only of the matrices whose block extends below row i."""
    for k in range(len(ends)):
        sine, cosine, shift, g = rotation[0, k], rotation[1, k], rotation[2, k], rotation[3, k]
        f, b = sine * e[i, k], cosine * e[i, k]
        r = np.sqrt(f * f + g * g)
        scale = 1.0 / r if r > 0.0 else 0.0
        in_block, sine, cosine = i < ends[k], f * scale, (g * scale if r > 0.0 else 1.0)
        e[i + 1, k] = r if i < ends[k] - 1 else e[i + 1, k]
        g = d[i + 1, k] - shift
        r = (d[i, k] - g) * sine + 2.0 * cosine * b
        shift = sine * r
        d[i + 1, k] = g + shift if in_block else d[i + 1, k]
        rotation[0, k] = sine if in_block else 1.0
        rotation[1, k] = cosine if in_block else 1.0
        rotation[2, k] = shift if in_block else 0.0
        rotation[3, k] = cosine * r - b if in_block else rotation[3, k]
        rotation[4, k] = sine if in_block else 0.0
