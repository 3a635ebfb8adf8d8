"""Oracle in rational arithmetic: the common part of two triangles by clipping. Slow and independent of the package.

A triangle, a segment and a point are each an intersection of half-spaces n . x >= c. One triangle's corners are clipped
by the half-spaces of the other (Sutherland and Hodgman 1974): the corners of the intersection remain.
"""

from fractions import Fraction


def intersect(x, s, t):
    """True where triangles s and t (vertex numbers) have more in common than the hull of their common vertices."""
    shared = sorted({int(i) for i in s} & {int(i) for i in t})
    if len(shared) == 3:
        return True
    rows = {int(i): point(x[i]) for i in (*s, *t)}
    common = clip([rows[int(i)] for i in t], half_spaces(*(rows[int(i)] for i in s)))
    if not shared:
        return bool(common)
    hull = half_spaces(*(rows[i] for i in (shared * 3)[:3]))
    return any(dot(n, p) < c for p in common for n, c in hull)


def point(row):
    return tuple(Fraction(float(value)) for value in row)


def clip(polygon, spaces):
    """The corners of a convex polygon (or segment, or point) clipped by half-spaces."""
    for n, c in spaces:
        heights = [dot(n, p) - c for p in polygon]
        left = []
        for k, (p, h) in enumerate(zip(polygon, heights, strict=True)):
            before, height_before = polygon[k - 1], heights[k - 1]
            if h * height_before < 0:
                fraction = height_before / (height_before - h)
                left.append(tuple(a + fraction * (b - a) for a, b in zip(before, p, strict=True)))
            if h >= 0:
                left.append(p)
        polygon = left
    return polygon


def half_spaces(a, b, c):
    """(n, c) with n . x >= c, whose intersection is the hull of three points."""
    normal = cross(minus(b, a), minus(c, a))
    if any(normal):
        sides = [(cross(normal, minus(q, p)), p) for p, q in ((a, b), (b, c), (c, a))]
        return [half_space(n, p) for n, p in [(normal, a), (minus((0, 0, 0), normal), a), *sides]]
    start, end = max(((a, b), (b, c), (a, c)), key=lambda ends: dot(minus(*ends), minus(*ends)))
    along = minus(end, start)
    axes = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    if not any(along):
        return [half_space(n, a) for e in axes for n in (e, minus((0, 0, 0), e))]
    across = [cross(along, e) for e in axes]
    walls = [half_space(n, start) for m in across for n in (m, minus((0, 0, 0), m))]
    return [*walls, half_space(along, start), half_space(minus((0, 0, 0), along), end)]


def half_space(n, p):
    return n, dot(n, p)


def minus(u, v):
    return tuple(a - b for a, b in zip(u, v, strict=True))


def dot(u, v):
    return sum(a * b for a, b in zip(u, v, strict=True))


def cross(u, v):
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


def determinant_sign(a, b, c, d):
    """Sign of det [a - d, b - d, c - d]."""
    a, b, c, d = map(point, (a, b, c, d))
    value = dot(minus(a, d), cross(minus(b, d), minus(c, d)))
    return (value > 0) - (value < 0)
