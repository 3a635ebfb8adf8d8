"""What is positive of the blocks of mollified pairs, as squares: negative eigenvalues count as 0 (as in IPC).

Eigenpairs: Householder's tridiagonal form and the QL method with implicit shifts (Golub & Van Loan 2013, sections
8.3.1 and 8.3.3), of many blocks in step: the last index of each array is that of the block. Each number hangs on the
one before it through roots and quotients, and a processor has time for many such chains at once.
"""

import numpy as np

from clothsim.contact.relative_coordinates import absolute
from clothsim.jit import kernel, part

ROUND_OFF = float(np.finfo(np.float64).eps)

MOST_SWEEPS = 60
"""QL needs about two an eigenvalue."""

TOGETHER = 32
"""Blocks in step: their arrays are just in the nearest cache."""


@kernel
def positive_squares(blocks, numbers, sides, at, first, count):
    """The positive part of the symmetric `blocks (m, 9, 9)` in the coordinates of `relative`, as squares.

    Those of block k are count[numbers[k]] rows of `sides (s, 12)` from first[numbers[k]] on, all from row `at` on.
    Returns the row behind them. What is no number stays so.
    """
    n = blocks.shape[1]
    z, d, e = np.empty((n, 2 * n, TOGETHER)), np.empty((n, TOGETHER)), np.empty((n, TOGETHER))
    for begin in range(0, len(blocks), TOGETHER):
        here = min(TOGETHER, len(blocks) - begin)
        for i in range(n):
            for j in range(n):
                for k in range(TOGETHER):
                    z[i, j, k] = blocks[begin + k, i, j] if k < here else 0.0
                    z[i, n + j, k] = 1.0 if i == j else 0.0
        _tridiagonal(z, d, e)
        _diagonal(d, e, z)
        for k in range(here):
            number = numbers[begin + k]
            first[number] = at
            for i in range(n):
                if not d[i, k] <= 0.0:
                    _side(sides, at, np.sqrt(d[i, k]), z, i, k)
                    at += 1
            count[number] = at - first[number]
    return at


@part
def _side(sides, at, size, z, i, k):
    for p in range(3):
        v = absolute((size * z[i, 9 + p, k], size * z[i, 12 + p, k], size * z[i, 15 + p, k]))
        sides[at, p], sides[at, 3 + p], sides[at, 6 + p], sides[at, 9 + p] = v


@part
def _tridiagonal(z, d, e):
    """Of z (n, 2 n, m), a and the identity beside it: a = y' t y, the identity becomes y. a is used up.

    t is tridiagonal: d (n, m) its diagonal, e (n, m) what stands beside it.
    """
    n, m = d.shape
    v, by, along = np.empty((n, m)), np.empty(m), np.empty(m)
    for i in range(n - 1):
        _normal(z, d, e, v, by, along, i)
        _mirrored(z, v, by, along, i + 1, n, False)
        _mirrored(z, v, by, along, i + 1, 2 * n, True)
    for k in range(m):
        d[n - 1, k], e[n - 1, k] = z[n - 1, n - 1, k], 0.0


@part
def _normal(a, d, e, v, by, squared, i):
    """Of the mirror that clears column i below what stands beside the diagonal: v, and by = 2 / |v|^2."""
    n, m = d.shape
    for k in range(m):
        squared[k] = 0.0
    for j in range(i + 1, n):
        for k in range(m):
            v[j, k] = a[j, i, k]
            squared[k] += v[j, k] * v[j, k]
    for k in range(m):
        root = np.sqrt(squared[k])
        beside = -root if v[i + 1, k] > 0.0 else root
        size = squared[k] - beside * v[i + 1, k]
        by[k] = 1.0 / size if size != 0.0 else 0.0
        v[i + 1, k] -= beside
        d[i, k], e[i, k] = a[i, i, k], beside


@part
def _mirrored(z, v, by, along, first, end, columns):
    """The rows of z from `first` to `end`, or its columns, mirrored in v, which is 0 before `first`."""
    n, m = v.shape
    for i in range(first, end):
        for k in range(m):
            along[k] = 0.0
        for j in range(first, n):
            p, q = (j, i) if columns else (i, j)
            for k in range(m):
                along[k] += v[j, k] * z[p, q, k]
        for j in range(first, n):
            p, q = (j, i) if columns else (i, j)
            for k in range(m):
                z[p, q, k] -= by[k] * along[k] * v[j, k]


@part
def _diagonal(d, e, z):
    """The tridiagonal matrices of d and e (n, m) made diagonal: d their eigenvalues, the rows of y turned along."""
    n, m = d.shape
    least, ends, turn = np.zeros(m), np.empty(m, np.int64), np.empty((5, m))
    for i in range(n):
        for k in range(m):
            least[k] = max(least[k], ROUND_OFF * (abs(d[i, k]) + abs(e[i, k])))
    for first in range(n):
        for _ in range(MOST_SWEEPS):
            last = _ends(e, least, ends, first)
            if last == first:
                break
            _sweep(d, e, z, first, last, ends, turn)


@part
def _ends(e, least, ends, first):
    """Where each matrix falls apart for the first time from row `first` on; returns the last of them."""
    last = first
    for k in range(len(ends)):
        end = first
        while end < len(e) - 1 and abs(e[end, k]) > least[k]:
            end += 1
        ends[k] = end
        last = max(last, end)
    return last


@part
def _sweep(d, e, z, first, last, ends, turn):
    """One sweep of turns over rows first to ends (m,), from below, with the shift of the upper two (Wilkinson).

    turn (5, m): sine and cosine of the last turn, what it moved along the diagonal, what it left beside it, and the
    sine once more, 0 where there was none.
    """
    n, m = d.shape
    for k in range(m):
        turn[0, k], turn[1, k], turn[2, k], turn[3, k] = 1.0, 1.0, 0.0, 0.0
        if ends[k] > first:
            g = (d[first + 1, k] - d[first, k]) / (2.0 * e[first, k])
            root = np.sqrt(g * g + 1.0)
            turn[3, k] = d[ends[k], k] - d[first, k] + e[first, k] / (g + root if g > 0.0 else g - root)
    for i in range(last - 1, first - 1, -1):
        _next_turn(d, e, i, ends, turn)
        for j in range(n, 2 * n):
            for k in range(m):
                low, high = z[i, j, k], z[i + 1, j, k]
                z[i + 1, j, k] = turn[4, k] * low + turn[1, k] * high
                z[i, j, k] = turn[1, k] * low - turn[4, k] * high
    for k in range(m):
        if ends[k] > first:
            d[first, k] -= turn[2, k]
            e[first, k] = turn[3, k]


@part
def _next_turn(d, e, i, ends, turn):
    """The turn of rows i and i + 1, of matrices that have begun: none of the others."""
    for k in range(len(ends)):
        sine, cosine, moved, g = turn[0, k], turn[1, k], turn[2, k], turn[3, k]
        f, b = sine * e[i, k], cosine * e[i, k]
        r = np.sqrt(f * f + g * g)
        by = 1.0 / r if r > 0.0 else 0.0
        inside, sine, cosine = i < ends[k], f * by, (g * by if r > 0.0 else 1.0)
        e[i + 1, k] = r if i < ends[k] - 1 else e[i + 1, k]
        g = d[i + 1, k] - moved
        r = (d[i, k] - g) * sine + 2.0 * cosine * b
        moved = sine * r
        d[i + 1, k] = g + moved if inside else d[i + 1, k]
        turn[0, k] = sine if inside else 1.0
        turn[1, k] = cosine if inside else 1.0
        turn[2, k] = moved if inside else 0.0
        turn[3, k] = cosine * r - b if inside else turn[3, k]
        turn[4, k] = sine if inside else 0.0
