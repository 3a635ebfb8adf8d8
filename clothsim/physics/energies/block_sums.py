"""Sums of element blocks into the data of a matrix: for kernels that add blocks as they compute them.

`at` (m, k (k + 1) / 2) are the block offsets of m elements of k corners: where each of their blocks is in the matrix,
corners a <= b in this order (`solve.linear.assembly`). Block (a, b) or its transpose is added by a choice of strides,
not by a branch, which would be mispredicted half of the time.
"""

from clothsim.base.jit import LANES, inlined, natural

LOWER, OUTSIDE = -1, -2
"""Block offset of a block that is not stored (a row beyond the unknowns), and of one that the pattern lacks."""
TRANSPOSED, BOTH = 1, 2
"""Flags in a block offset: the transpose is stored; the block is diagonal and receives both block and transpose."""


@inlined
def add_block(data, where, numbers, first, down, along):
    """Add one 3x3 block that begins at numbers[first]; its rows are `down` apart, its columns `along`."""
    at, middle = 9 * (where >> 2), first + down + along
    swap = (where & TRANSPOSED) * (down - along)  # no branch
    down, along = natural(down - swap), natural(along + swap)
    data[at] += numbers[first]
    data[at + 1] += numbers[first + along]
    data[at + 2] += numbers[first + 2 * along]
    data[at + 3] += numbers[first + down]
    data[at + 4] += numbers[middle]
    data[at + 5] += numbers[middle + along]
    data[at + 6] += numbers[first + 2 * down]
    data[at + 7] += numbers[middle + down]
    data[at + 8] += numbers[middle + down + along]
    if where & BOTH:  # a diagonal block: the transpose follows
        for i in range(3):
            for j in range(3):
                data[at + 3 * i + j] += numbers[first + j * down + i * along]


@inlined
def add_dense(data, at, e, block, corners):
    """Add the dense block of element e, its (9 corners^2,) numbers; return the number of those outside the pattern."""
    outside, k = 0, 0
    for a in range(corners):
        for b in range(a, corners):
            if at[e, k] >= 0:
                add_block(data, at[e, k], block, natural(9 * corners * a + 3 * b), 3 * corners, 1)
            outside += at[e, k] == OUTSIDE
            k += 1
    return outside


@inlined
def add_lanes(data, at, first, lanes):
    """Add the blocks of a group of LANES elements from `first` on, `lanes` of a `LanesHessian`.

    Returns the number of blocks outside the pattern.
    """
    outside = 0
    for lane in range(min(LANES, len(at) - first)):
        for k in range(at.shape[1]):
            where = at[first + lane, k]
            if where >= 0:
                add_block(data, where, lanes, natural(9 * LANES * k + lane), 3 * LANES, LANES)
            outside += where == OUTSIDE
    return outside
