"""Lexicographic order of index pairs by counting sort."""

import numpy as np

from clothsim.base.arrays import Ints
from clothsim.base.jit import kernel, part

INSERTION_SIZE = 32
"""Length up to which insertion sort is fastest."""


def lexicographic_order(first: Ints, second: Ints) -> Ints:
    """Order (p,) of pairs by the first index, then the second: the result does not depend on the shape of a tree."""
    n = int(first.max(initial=-1)) + 1
    if 8 * len(first) < n:
        return np.lexsort((second, first))
    return _order(first, second, n)


@part
def _sort(values: Ints, start: int, end: int) -> None:
    """Sort values[start:end] in place: Shell sort, which up to INSERTION_SIZE is insertion sort."""
    gap = 1
    while gap * INSERTION_SIZE < end - start:
        gap = 3 * gap + 1
    while gap > 0:
        for k in range(start + gap, end):
            value, slot = values[k], k
            while slot >= start + gap and values[slot - gap] > value:
                values[slot] = values[slot - gap]
                slot -= gap
            values[slot] = value
        gap //= 3


@kernel
def _order(first: Ints, second: Ints, n: int) -> Ints:
    """Order of pairs by first, all below n, then second."""
    slots = np.zeros(n + 1, np.int64)  # of the next pair of i; at the end, of the first pair of i + 1
    for i in first:
        slots[i + 1] += 1
    for i in range(n):
        slots[i + 1] += slots[i]
    order = np.empty(len(first), np.int64)
    for k in range(len(first)):
        order[slots[first[k]]] = second[k] << 32 | k
        slots[first[k]] += 1
    start = 0
    for i in range(n):
        _sort(order, start, slots[i])
        start = slots[i]
    for k in range(len(order)):
        order[k] &= 0xFFFFFFFF
    return order
