"""Exact orientation predicates: a floating-point filter with an error bound, then expansions.

Points are rows of x (n, 3). The signs are exact where the largest |x| is about 2^200 (`scaled` scales any unit to it)
and no coordinate but zero is below 2^-200, 1e-120 times the largest: nothing over- or underflows then.

An expansion (Shewchuk 1997, "Adaptive precision floating-point arithmetic", section 2) is a sum of doubles
e[0] + ... + e[n - 1] that do not overlap, of growing magnitude and none of them zero: its sign is that of its last. All
operations are exact without over- and underflow, in IEEE doubles without fastmath.
"""

import numpy as np

from clothsim.base.arrays import Floats
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


EPSILON = 2.0**-53
"""Unit round-off of a double."""
BOUND_3D = (7.0 + 56.0 * EPSILON) * EPSILON
BOUND_2D = (3.0 + 16.0 * EPSILON) * EPSILON
"""Error of each determinant in doubles over the sum of its absolute terms (Shewchuk 1997, figures 21 and 23)."""

LARGEST_EXPONENT = 200
"""Exponent of the largest scaled coordinate."""


def scaled(x: Floats) -> Floats:
    """x times the power of two for which its largest coordinate is about 2^200: exact, and no sign changes."""
    largest = float(np.abs(x).max(initial=0.0))
    return np.ascontiguousarray(np.ldexp(x, LARGEST_EXPONENT - np.frexp(largest)[1]) if largest else x)


@part
def orient3d(x, a, b, c, d):
    """Sign of det [a - d, b - d, c - d], -1, 0 or 1: 0 where the four points are coplanar."""
    adx, ady, adz = x[a, 0] - x[d, 0], x[a, 1] - x[d, 1], x[a, 2] - x[d, 2]
    bdx, bdy, bdz = x[b, 0] - x[d, 0], x[b, 1] - x[d, 1], x[b, 2] - x[d, 2]
    cdx, cdy, cdz = x[c, 0] - x[d, 0], x[c, 1] - x[d, 1], x[c, 2] - x[d, 2]
    bc, cb = bdx * cdy, cdx * bdy
    ca, ac = cdx * ady, adx * cdy
    ab, ba = adx * bdy, bdx * ady
    determinant = adz * (bc - cb) + bdz * (ca - ac) + cdz * (ab - ba)
    terms = abs(adz) * (abs(bc) + abs(cb)) + abs(bdz) * (abs(ca) + abs(ac)) + abs(cdz) * (abs(ab) + abs(ba))
    if terms == 0.0 or abs(determinant) > BOUND_3D * terms:
        return _sign(determinant)
    return _exact_orient3d(x, a, b, c, d)


@part
def orient2d(x, a, b, c, axis):
    """Sign of det [a - c, b - c] in the projection along `axis` (0, 1, 2): 0 where the three are collinear there."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    left = (x[a, i] - x[c, i]) * (x[b, j] - x[c, j])
    right = (x[a, j] - x[c, j]) * (x[b, i] - x[c, i])
    determinant, terms = left - right, abs(left) + abs(right)
    if terms == 0.0 or abs(determinant) > BOUND_2D * terms:
        return _sign(determinant)
    e = np.empty(12)
    n = _add_determinant2(e, 0, x, a, b, i, j)
    n = _add_determinant2(e, n, x, b, c, i, j)
    n = _add_determinant2(e, n, x, c, a, i, j)
    return _sign(e[n - 1]) if n else 0


@part
def _exact_orient3d(x, a, b, c, d):
    """Exact sign of det abc - det dbc - det adc - det abd: 24 exact products of coordinates."""
    e = np.empty(96)
    n = _add_determinant3(e, 0, x, a, b, c, 1.0)
    n = _add_determinant3(e, n, x, d, b, c, -1.0)
    n = _add_determinant3(e, n, x, a, d, c, -1.0)
    n = _add_determinant3(e, n, x, a, b, d, -1.0)
    return _sign(e[n - 1]) if n else 0


@part
def _add_determinant3(e, n, x, a, b, c, sign):
    """Add sign det [a, b, c] to an expansion."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        n = add_product3(e, n, x[b, i], x[c, j], sign * x[a, k])
        n = add_product3(e, n, x[b, j], x[c, i], -sign * x[a, k])
    return n


@part
def _add_determinant2(e, n, x, a, b, i, j):
    """Add a_i b_j - a_j b_i to an expansion."""
    n = add_product2(e, n, x[a, i], x[b, j])
    return add_product2(e, n, -x[a, j], x[b, i])


@part
def _sign(value):
    return 1 if value > 0.0 else (-1 if value < 0.0 else 0)
