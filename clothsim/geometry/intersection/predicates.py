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
from clothsim.base.vectors import cross, dot, minus, plus, unit

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


# Certain separation of two triangles: a separating direction found in doubles with an error bound.
#
# Neighbours in a flat sheet are coplanar but for round-off, where every orient3d would need exact arithmetic. These
# tests settle nearly all of them first. A separation found here is proven; anything else goes to the exact test.
#
# The clearances are lower bounds: no motion of the corners that is shorter makes the triangles intersect.


ROUND_OFF = 8.0 * EPSILON
"""Error of a dot product of a vector with a difference of points, over the sum of its absolute terms; 4 would do."""
UNDERFLOW = 1e-300
"""Bound on the error by underflow."""
DOWN = 1.0 - 64.0 * EPSILON
"""Factor that exceeds the rounding of a few dozen operations."""


@part
def separated(x, s, t):
    """True where triangles s and t (three rows of x each) certainly have no point in common.

    Directions: between the centroids; then, for nearly coplanar triangles, perpendicular to each edge within the plane.
    """
    if _separated_along(x, minus(_sum(x, t), _sum(x, s)), s, t):
        return True
    for triangle in (s, t):
        a, b, c = triangle
        normal = cross(_edge(x, a, b), _edge(x, a, c))
        for edge in (_edge(x, a, b), _edge(x, b, c), _edge(x, c, a)):
            across = cross(normal, edge)
            if _separated_along(x, across, s, t) or _separated_along(x, across, t, s):
                return True
    return False


@part
def separated_beyond_vertex(x, v, s, t):
    """True where triangles (v, s0, s1) and (v, t0, t1) certainly have only v in common."""
    n = _between_closest(x, v, s, t)
    for i in s:
        distance, error = _projected(x, n, i, v)
        if not distance > error:
            return False
    for j in t:
        distance, error = _projected(x, n, j, v)
        if not distance < -error:
            return False
    return True


@part
def _between_closest(x, v, s, t):
    """Difference of the two closest of the unit vectors from v, one to s and one to t: the direction tried."""
    nearest, n = -np.inf, (0.0, 0.0, 0.0)
    for i in s:
        for j in t:
            a, b = unit(_edge(x, v, i)), unit(_edge(x, v, j))
            cosine = dot(a, b)
            if cosine > nearest:
                nearest, n = cosine, minus(a, b)
    return n


@part
def opened(x, a, b, c, d):
    """True where triangles abc and abd certainly make more than a right angle: their normals do, c and d opposite."""
    e, u, w = _edge(x, a, b), _edge(x, a, c), _edge(x, a, d)
    lengths = dot(e, e) * np.sqrt(dot(u, u)) * np.sqrt(dot(w, w))
    return dot(cross(e, u), cross(e, w)) < -4.0 * ROUND_OFF * lengths - UNDERFLOW


@part
def clearance(x, s, t, wanted):
    """Lower bound of the distance of triangles s and t (three rows of x each); 0: no direction separates them.

    Directions: between the centroids, normal to both, perpendicular to each edge within the planes, and perpendicular
    to an edge of both, until one gives `wanted`. In exact arithmetic one separates any two triangles that are disjoint.
    """
    of_s = (0.0, 0.0, 0.0), _edge(x, s[0], s[1]), _edge(x, s[0], s[2])
    of_t = _edge(x, s[0], t[0]), _edge(x, s[0], t[1]), _edge(x, s[0], t[2])
    n = minus(plus(plus(of_t[0], of_t[1]), of_t[2]), plus(of_s[1], of_s[2]))
    best = _gap(n, of_s, of_t)
    if best >= wanted and best > 0.0:
        return best
    edges_of_s = of_s[1], minus(of_s[2], of_s[1]), of_s[2]
    edges_of_t = minus(of_t[1], of_t[0]), minus(of_t[2], of_t[1]), minus(of_t[2], of_t[0])
    normals = unit(cross(of_s[1], of_s[2])), unit(cross(edges_of_t[0], edges_of_t[2]))
    for k in range(17):
        if k < 2:
            n = normals[k]
        elif k < 11:
            n = cross(edges_of_s[(k - 2) // 3], edges_of_t[(k - 2) % 3])
        else:
            n = cross(normals[(k - 11) // 3], edges_of_s[(k - 11) % 3] if k < 14 else edges_of_t[(k - 11) % 3])
        best = max(best, _gap(n, of_s, of_t))
        if best >= wanted and best > 0.0:
            return best
    return best


@part
def clearance_beyond_vertex(x, v, s, t):
    """Lower bound of the change of any edge at v before triangles (v, s0, s1) and (v, t0, t1) share more than v, or 0.

    Their plane through v separates them until a corner has crossed it.
    """
    n = _between_closest(x, v, s, t)
    least = np.inf
    for i in s:
        distance, error = _projected(x, n, i, v)
        least = min(least, distance - error)
    for j in t:
        distance, error = _projected(x, n, j, v)
        least = min(least, -distance - error)
    return _over_length(least, n)


@part
def clearance_beyond_edge(x, a, b, c, d):
    """Lower bound of the change of any edge before triangles abc and abd share more than the edge ab, or 0.

    A plane through ab with c and d on opposite sides, its normal n bisects the angle between them. Edges that change by
    up to r < |ab| / 4 leave c at a distance of (n . ac) - r - |change of n| |ac| or more from the plane that is turned
    with ab, where |change of n| <= (|n . ab| + r) / (|ab| - r).
    """
    e, u, w = _edge(x, a, b), _edge(x, a, c), _edge(x, a, d)
    along = unit(e)
    n = unit(minus(unit(_across(along, u)), unit(_across(along, w))))
    length = np.sqrt(dot(e, e))
    if not length > 0.0 or not dot(n, n) > 0.0:
        return 0.0
    farthest = max(np.sqrt(dot(u, u)), np.sqrt(dot(w, w)))
    of_c, error_c = _projected(x, n, c, a)
    of_d, error_d = _projected(x, n, d, a)
    of_b, error_b = _projected(x, n, b, a)
    turned = (farthest + 0.25 * length) / (0.75 * length)
    least = min(of_c - error_c, -of_d - error_d) - 1.01 * (abs(of_b) + error_b) * turned
    return max(min(0.25 * length, DOWN * least / (1.0 + turned) / 1.01), 0.0)


@part
def _gap(n, s, t):
    """Lower bound of the gap of two triangles, corners (3, 3) relative to a point, along n; 0 without one."""
    high_s, low_s, high_t, low_t, largest = -np.inf, np.inf, -np.inf, np.inf, 0.0
    for p in s:
        along = n[0] * p[0] + n[1] * p[1] + n[2] * p[2]
        high_s, low_s = max(high_s, along), min(low_s, along)
        largest = max(largest, abs(n[0] * p[0]) + abs(n[1] * p[1]) + abs(n[2] * p[2]))
    for p in t:
        along = n[0] * p[0] + n[1] * p[1] + n[2] * p[2]
        high_t, low_t = max(high_t, along), min(low_t, along)
        largest = max(largest, abs(n[0] * p[0]) + abs(n[1] * p[1]) + abs(n[2] * p[2]))
    return _over_length(max(low_t - high_s, low_s - high_t) - 4.0 * (ROUND_OFF * largest + UNDERFLOW), n)


@part
def _over_length(gap, n):
    """A gap along n, not a unit vector, rounded down; 0 where it is below."""
    length = np.sqrt(dot(n, n))
    return DOWN * gap / length if gap > 0.0 and length > 0.0 else 0.0


@part
def _across(along, u):
    """The part of u perpendicular to a unit vector."""
    of_u = dot(along, u)
    return u[0] - of_u * along[0], u[1] - of_u * along[1], u[2] - of_u * along[2]


@part
def _separated_along(x, n, s, t):
    """True where n . s < n . t for all corners, by more than the error."""
    highest, lowest = -np.inf, np.inf
    for i in s:
        distance, error = _projected(x, n, i, s[0])
        highest = max(highest, distance + error)
    for j in t:
        distance, error = _projected(x, n, j, s[0])
        lowest = min(lowest, distance - error)
    return highest < lowest


@part
def _projected(x, n, i, origin):
    """n . (x_i - x_origin) and a bound on its error."""
    p, q, r = n[0] * (x[i, 0] - x[origin, 0]), n[1] * (x[i, 1] - x[origin, 1]), n[2] * (x[i, 2] - x[origin, 2])
    return p + q + r, ROUND_OFF * (abs(p) + abs(q) + abs(r)) + UNDERFLOW


@part
def _edge(x, i, j):
    """x_j - x_i."""
    return x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]


@part
def _sum(x, t):
    a, b, c = t
    return x[a, 0] + x[b, 0] + x[c, 0], x[a, 1] + x[b, 1] + x[c, 1], x[a, 2] + x[b, 2] + x[c, 2]
