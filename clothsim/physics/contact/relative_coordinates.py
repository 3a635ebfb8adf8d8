"""Translation-free coordinates of a pair, for numba kernels.

A common translation of a pair has no energy, so 9 of its 12 coordinates x_i suffice: (x1 - x0) / sqrt 2, (x3 - x2) /
sqrt 2 and (x0 + x1 - x2 - x3) / 2, which are orthonormal: eigenvalues are the same in both.
"""

import numpy as np

from clothsim.base.jit import part

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
