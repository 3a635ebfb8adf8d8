"""SIMD lanes: entries of LANES elements side by side (`jit.LANES`)."""

from clothsim.base.jit import LANES, inlined, kernel


@inlined
def point(numbers, k, lane):
    """Read entries k, k + 1 and k + 2 of the element in a lane."""
    return numbers[k * LANES + lane], numbers[(k + 1) * LANES + lane], numbers[(k + 2) * LANES + lane]


@inlined
def write(numbers, block, lane, rows):
    """Write a 3 x 3 block, given as three rows, to the blocks of the element in a lane."""
    at = 9 * block * LANES + lane
    numbers[at], numbers[at + LANES], numbers[at + 2 * LANES] = rows[0]
    numbers[at + 3 * LANES], numbers[at + 4 * LANES], numbers[at + 5 * LANES] = rows[1]
    numbers[at + 6 * LANES], numbers[at + 7 * LANES], numbers[at + 8 * LANES] = rows[2]


@kernel
def unpack(blocks, lanes):
    """Copy lanes (g, size) to the dense `blocks` (m, 3k, 3k)."""
    corners = blocks.shape[1] // 3
    for e in range(len(blocks)):
        numbers, lane = lanes[e // LANES], e % LANES
        for p in range(corners):
            for q in range(p, corners):
                for row in range(3):
                    for column in range(3):
                        entry = numbers[lane]
                        blocks[e, 3 * p + row, 3 * q + column] = entry
                        blocks[e, 3 * q + column, 3 * p + row] = entry
                        lane += LANES
