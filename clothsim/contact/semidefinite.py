"""The nearest positive semi-definite block of a pair, for numba kernels: negative eigenvalues set to 0 (as in IPC).

What moves with a pair costs nothing, so 3 of the 12 eigenvalues are 0. The others belong to the coordinates
(x1 - x0) / sqrt 2, (x3 - x2) / sqrt 2, (x0 + x1 - x2 - x3) / 2, which are orthonormal and know no translation.
Eigenpairs: Householder's tridiagonal form and the QL method with implicit shifts (Golub & Van Loan 2013, sections
8.3.1 and 8.3.3): at this size three times faster than a call of LAPACK.
"""

import numpy as np

from clothsim.compiled import kernel, part

ROOT = float(np.sqrt(0.5))

ROUND_OFF = float(np.finfo(np.float64).eps)

MOST_SWEEPS = 60
"""QL needs about two an eigenvalue."""


@kernel
def clamp(blocks, numbers):
    """Make these of the symmetric blocks (m, 12, 12), which feel no translation, positive semi-definite, the nearest.

    A kernel of its own, of a size that the compiler does not know: unrolled it would take twice as long to compile.
    """
    n = blocks.shape[1] - 3
    half, a, y = np.empty((n + 3, n)), np.empty((n, n)), np.empty((n, n))
    d, e, v = np.empty(n), np.empty(n - 1), np.empty(n + 3)
    for k in range(len(numbers)):
        block = blocks[numbers[k]]
        _relative(block, half)
        _relative(half, a)
        _tridiagonal(a, d, e, y)
        _diagonal(d, e, y)
        _sum_of_squares(block, d, y, v)


@part
def _sum_of_squares(block, d, y, v):
    """block = the sum of d v v' over the positive d (n,), v (n + 3,) the row of y (n, n) in all coordinates."""
    for i in range(len(v)):
        for j in range(len(v)):
            block[i, j] = 0.0
    for k in range(len(d)):
        if d[k] <= 0.0:
            continue
        for p in range(3):
            first, second, between = ROOT * y[k, p], ROOT * y[k, 3 + p], 0.5 * y[k, 6 + p]
            v[p], v[3 + p], v[6 + p], v[9 + p] = between - first, between + first, -between - second, second - between
        for i in range(len(v)):
            vi = d[k] * v[i]
            for j in range(len(v)):
                block[i, j] += vi * v[j]


@part
def _relative(a, out):
    """The columns of a (12, m) in the coordinates without translation, as the rows of out (m, 9)."""
    for j in range(len(out)):
        for p in range(3):
            x0, x1, x2, x3 = a[p, j], a[3 + p, j], a[6 + p, j], a[9 + p, j]
            out[j, p], out[j, 3 + p], out[j, 6 + p] = ROOT * (x1 - x0), ROOT * (x3 - x2), 0.5 * (x0 + x1 - x2 - x3)


@part
def _tridiagonal(a, d, e, y):
    """a = y' t y with t tridiagonal: d its diagonal (n,), e what stands beside it (n - 1,). a (n, n) is used up."""
    n = len(d)
    v, w = np.empty(n), np.empty(n)
    for i in range(n):
        for j in range(n):
            y[i, j] = 1.0 if i == j else 0.0
    for k in range(n - 1):
        squared = 0.0
        for i in range(k + 1, n):
            v[i] = a[i, k]
            squared += v[i] * v[i]
        d[k], e[k] = a[k, k], v[k + 1]
        if k == n - 2 or squared == 0.0:
            continue
        e[k] = -np.sqrt(squared) if v[k + 1] > 0.0 else np.sqrt(squared)
        size = squared - e[k] * v[k + 1]  # |v|^2 / 2 of the mirror's normal v
        v[k + 1] -= e[k]
        along = 0.0
        for i in range(k + 1, n):
            w[i] = 0.0
            for j in range(k + 1, n):
                w[i] += a[i, j] * v[j]
            w[i] /= size
            along += v[i] * w[i]
        half = 0.5 * along / size
        for i in range(k + 1, n):
            w[i] -= half * v[i]
        for i in range(k + 1, n):
            for j in range(k + 1, n):
                a[i, j] -= v[i] * w[j] + w[i] * v[j]
        _mirror(y, v, size, k + 1, w)
    d[n - 1] = a[n - 1, n - 1]


@part
def _mirror(y, v, size, first, along):
    """The rows of y from `first` on mirrored: y - v v'y / size. along (n,) is used up."""
    n = len(y)
    for j in range(n):
        along[j] = 0.0
    for i in range(first, n):
        vi = v[i] / size
        for j in range(n):
            along[j] += vi * y[i, j]
    for i in range(first, n):
        vi = v[i]
        for j in range(n):
            y[i, j] -= vi * along[j]


@part
def _diagonal(d, e, y):
    """The tridiagonal matrix of d (n,) and e (n - 1,) made diagonal: d its eigenvalues, the rows of y turned along."""
    n = len(d)
    size = 0.0
    for i in range(n):
        size = max(size, abs(d[i]) + (abs(e[i]) if i < n - 1 else 0.0))
    least = ROUND_OFF * size
    for k in range(n):
        for _ in range(MOST_SWEEPS):
            end = k
            while end < n - 1 and abs(e[end]) > least:
                end += 1
            if end == k:
                break
            _sweep(d, e, y, k, end)


@part
def _sweep(d, e, y, first, end):
    """One sweep of turns over rows first to end, from below, with the shift of the upper two (Wilkinson)."""
    g = (d[first + 1] - d[first]) / (2.0 * e[first])
    root = np.sqrt(g * g + 1.0)
    shift = d[first] - e[first] / (g + root if g > 0.0 else g - root)
    g, s, c, moved = d[end] - shift, 1.0, 1.0, 0.0
    for i in range(end - 1, first - 1, -1):
        f, b = s * e[i], c * e[i]
        r = np.sqrt(f * f + g * g)
        if i < end - 1:
            e[i + 1] = r
        s, c = (f / r, g / r) if r > 0.0 else (0.0, 1.0)
        g = d[i + 1] - moved
        r = (d[i] - g) * s + 2.0 * c * b
        moved = s * r
        d[i + 1] = g + moved
        g = c * r - b
        for j in range(len(d)):
            low, high = y[i, j], y[i + 1, j]
            y[i + 1, j], y[i, j] = s * low + c * high, c * low - s * high
    d[first] -= moved
    e[first] = g
