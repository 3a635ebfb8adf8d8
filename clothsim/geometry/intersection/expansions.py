"""Exact floating-point expansions (Shewchuk 1997, "Adaptive precision floating-point arithmetic", section 2).

An expansion is a sum of doubles e[0] + ... + e[n - 1] that do not overlap, of growing magnitude and none of them zero:
its sign is that of its last. All operations are exact without over- and underflow, in IEEE doubles without fastmath.
"""

from clothsim.base.jit import part

SPLITTER = 2.0**27 + 1.0


@part
def two_sum(a, b):
    """a + b = high + low exactly, high the rounded sum (Knuth)."""
    high = a + b
    of_b = high - a
    return high, (a - (high - of_b)) + (b - of_b)


@part
def split(a):
    """a = high + low, each of at most 26 bits (Dekker, Veltkamp)."""
    scaled = SPLITTER * a
    high = scaled - (scaled - a)
    return high, a - high


@part
def two_product(a, b):
    """a b = high + low exactly, high the rounded product (Dekker)."""
    high = a * b
    a1, a0 = split(a)
    b1, b0 = split(b)
    return high, a0 * b0 - (((high - a1 * b1) - a0 * b1) - a1 * b0)


@part
def grow(e, n, b):
    """Add the double b to the expansion in e[:n]; returns the new n (Grow-Expansion, zeros dropped)."""
    m = 0
    for i in range(n):
        b, low = two_sum(b, e[i])
        if low != 0.0:
            e[m] = low
            m += 1
    if b != 0.0:
        e[m] = b
        m += 1
    return m


@part
def add_product2(e, n, a, b):
    """Add a b to the expansion in e[:n]; returns the new n."""
    high, low = two_product(a, b)
    return grow(e, grow(e, n, low), high)


@part
def add_product3(e, n, a, b, c):
    """Add a b c to the expansion in e[:n]; returns the new n."""
    high, low = two_product(a, b)
    return add_product2(e, add_product2(e, n, low, c), high, c)
