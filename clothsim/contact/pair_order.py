"""Pairs in the order of their first, then their second."""

import numpy as np

from clothsim.arrays import Ints
from clothsim.jit import kernel, part

_FEW = 32
"""Numbers that insertion sorts fastest."""


def in_order(first: Ints, second: Ints) -> Ints:
    """The order (p,) of pairs by the first, then the second: what the tree was built from no longer shows in it."""
    n = int(first.max(initial=-1)) + 1
    if 8 * len(first) < n:
        return np.lexsort((second, first))
    return _order(first, second, n)


@part
def _sort(values: Ints, start: int, end: int) -> None:
    """Sort values[start:end] in place: Shell's sort, which for up to _FEW numbers is insertion."""
    gap = 1
    while gap * _FEW < end - start:
        gap = 3 * gap + 1
    while gap > 0:
        for k in range(start + gap, end):
            value, place = values[k], k
            while place >= start + gap and values[place - gap] > value:
                values[place] = values[place - gap]
                place -= gap
            values[place] = value
        gap //= 3


@kernel
def _order(first: Ints, second: Ints, n: int) -> Ints:
    """The order of pairs by first, all below n, then second."""
    places = np.zeros(n + 1, np.int64)  # of the next pair of i; in the end of the first of i + 1
    for i in first:
        places[i + 1] += 1
    for i in range(n):
        places[i + 1] += places[i]
    order = np.empty(len(first), np.int64)
    for k in range(len(first)):
        order[places[first[k]]] = second[k] << 32 | k
        places[first[k]] += 1
    start = 0
    for i in range(n):
        _sort(order, start, places[i])
        start = places[i]
    for k in range(len(order)):
        order[k] &= 0xFFFFFFFF
    return order
