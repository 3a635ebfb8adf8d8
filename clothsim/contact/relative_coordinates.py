"""Coordinates of a pair that know no translation, for numba kernels.

What moves with a pair costs nothing, so of its 12 coordinates x_i 9 count: (x1 - x0) / sqrt 2, (x3 - x2) / sqrt 2 and
(x0 + x1 - x2 - x3) / 2, which are orthonormal: eigenvalues are the same in both.
"""

import numpy as np

from clothsim.jit import part

ROOT = float(np.sqrt(0.5))


@part
def relative(g):
    """What has a part at each of the four vertices, as its three parts in these coordinates."""
    return ROOT * (g[1] - g[0]), ROOT * (g[3] - g[2]), 0.5 * (g[0] + g[1] - g[2] - g[3])


@part
def absolute(y):
    """The other way."""
    first, second, between = ROOT * y[0], ROOT * y[1], 0.5 * y[2]
    return between - first, between + first, -between - second, second - between


@part
def absolute_block(block, at, out, to):
    """out[to] = the matrix block[at] (9, 9) over all coordinates, (12, 12).

    Of a size that the compiler does not know: unrolled it would take several times as long to compile.
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
