"""Exact intersection test of two triangles, including degenerate ones (a segment, a point).

Triangles are closed sets: touching is intersecting. Triangles with common vertices (indices, not positions) intersect
where they have more in common than the hull of those: the vertex, or the edge. With the same three vertices they
intersect.

Every test is made of signs of determinants, without a special case for degeneracy. Two facts make that possible:
triangles meet where an edge of one meets the other; and coplanar points of which three make a triangle with area in the
projection along an axis keep their arrangement in it.
"""

from clothsim.base.jit import part
from clothsim.geometry.intersection.predicates import opened, orient2d, orient3d, separated, separated_beyond_vertex


@part
def triangles_intersect(x, s, t):
    """True where triangles s and t (three rows of x (n, 3) each) intersect."""
    shared, a, b = shared_vertices(s, t)
    if shared == 3:
        return True
    if shared == 2:
        return _intersect_beyond_edge(x, a, b, s[0] + s[1] + s[2] - a - b, t[0] + t[1] + t[2] - a - b)
    if shared == 1:
        return _intersect_beyond_vertex(x, a, others(s, a), others(t, a))
    return _intersect(x, s, t)


@part
def shared_vertices(s, t):
    """The number of common vertices of s and t, and up to two of them."""
    count, a, b = 0, -1, -1
    for i in s:
        if i in t and i not in (a, b):
            if count == 0:
                a = i
            elif count == 1:
                b = i
            count += 1
    return count, a, b


@part
def others(s, v):
    """The corners of s other than v, in the order of the triangle."""
    if s[0] == v:
        return s[1], s[2]
    return (s[2], s[0]) if s[1] == v else (s[0], s[1])


@part
def _intersect(x, s, t):
    """Closed triangles without a common vertex: an edge of one meets the other."""
    if separated(x, s, t):
        return False
    of_s = _sides(x, t, s)
    if of_s[0] == of_s[1] == of_s[2] != 0:
        return False
    of_t = _sides(x, s, t)
    if of_t[0] == of_t[1] == of_t[2] != 0:
        return False
    for i, j in ((0, 1), (1, 2), (2, 0)):
        if _edge_meets(x, s[i], s[j], of_s[i], of_s[j], t) or _edge_meets(x, t[i], t[j], of_t[i], of_t[j], s):
            return True
    return False


@part
def _sides(x, s, t):
    """The sides of the plane of s on which the corners of t lie."""
    a, b, c = s
    return orient3d(x, a, b, c, t[0]), orient3d(x, a, b, c, t[1]), orient3d(x, a, b, c, t[2])


@part
def _intersect_beyond_vertex(x, v, s, t):
    """True where triangles (v, s0, s1) and (v, t0, t1) have a point other than v in common.

    The farthest common point on its ray from v is where one triangle ends: on the edge opposite v. Where v itself lies
    on that edge, the triangle degenerates to its two edges ("arms") from v.
    """
    if separated_beyond_vertex(x, v, s, t):
        return False
    s_degenerate, t_degenerate = _on_segment(x, v, s[0], s[1]), _on_segment(x, v, t[0], t[1])
    if not s_degenerate and not t_degenerate:
        return _segment_meets(x, s[0], s[1], (v, t[0], t[1])) or _segment_meets(x, t[0], t[1], (v, s[0], s[1]))
    for i in s:
        for j in t:
            if s_degenerate and t_degenerate:
                meet = _arms_overlap(x, v, i, j)
            elif s_degenerate:
                meet = _arm_meets(x, v, i, t)
            else:
                meet = _arm_meets(x, v, j, s)
            if meet:
                return True
    return False


@part
def _arm_meets(x, v, p, t):
    """True where segment vp and triangle (v, t0, t1), v not on the edge t0 t1, have a point other than v in common."""
    if _coincide(x, v, p):
        return False
    return _segment_meets(x, p, p, (v, t[0], t[1])) or _segments_meet(x, v, p, t[0], t[1])


@part
def _arms_overlap(x, v, p, q):
    """True where segments vp and vq have a point other than v in common."""
    if _coincide(x, v, p) or _coincide(x, v, q):
        return False
    return _on_segment(x, p, v, q) or _on_segment(x, q, v, p)


@part
def _intersect_beyond_edge(x, a, b, c, d):
    """True where triangles abc and abd have a point beyond ab in common: folded onto each other, or collinear."""
    if opened(x, a, b, c, d) or orient3d(x, a, b, c, d) != 0:
        return False
    for axis in range(3):
        if orient2d(x, a, b, c, axis) * orient2d(x, a, b, d, axis) > 0:
            return True
    return _overlap_behind(x, a, b, c, d) or _overlap_behind(x, b, a, c, d)


@part
def _overlap_behind(x, a, b, c, d):
    """True where c and d both lie on the line ab behind b and overlap."""
    return _on_segment(x, b, a, c) and _on_segment(x, b, a, d) and _arms_overlap(x, b, c, d)


@part
def _segment_meets(x, p, q, t):
    """True where segment pq and triangle t have a point in common."""
    of_p = orient3d(x, t[0], t[1], t[2], p)
    of_q = orient3d(x, t[0], t[1], t[2], q)
    return _edge_meets(x, p, q, of_p, of_q, t)


@part
def _edge_meets(x, p, q, of_p, of_q, t):
    """`_segment_meets` with the sides of the plane of t on which p and q lie."""
    a, b, c = t
    if of_p * of_q > 0:
        return False
    if of_p != of_q:  # the line meets the plane in one point, inside t where it passes all edges on the same side
        ab, bc, ca = orient3d(x, p, q, a, b), orient3d(x, p, q, b, c), orient3d(x, p, q, c, a)
        return (ab >= 0 and bc >= 0 and ca >= 0) or (ab <= 0 and bc <= 0 and ca <= 0)
    if _segments_meet(x, p, q, a, b) or _segments_meet(x, p, q, b, c) or _segments_meet(x, p, q, c, a):
        return True
    return _inside(x, p, a, b, c)


@part
def _inside(x, p, a, b, c):
    """True where p, coplanar with abc, lies inside it and not on its edges."""
    for axis in range(3):
        ab, bc, ca = orient2d(x, a, b, p, axis), orient2d(x, b, c, p, axis), orient2d(x, c, a, p, axis)
        if ab == bc == ca != 0:
            return True
    return False


@part
def _segments_meet(x, p, q, a, b):
    """True where segments pq and ab have a point in common: an end of one on the other, or they cross."""
    if _on_segment(x, p, a, b) or _on_segment(x, q, a, b) or _on_segment(x, a, p, q) or _on_segment(x, b, p, q):
        return True
    if orient3d(x, p, q, a, b) != 0:
        return False
    for axis in range(3):
        if (
            orient2d(x, p, q, a, axis) * orient2d(x, p, q, b, axis) < 0
            and orient2d(x, a, b, p, axis) * orient2d(x, a, b, q, axis) < 0
        ):
            return True
    return False


@part
def _on_segment(x, p, a, b):
    """True where p lies on the closed segment ab."""
    for axis in range(3):
        if not min(x[a, axis], x[b, axis]) <= x[p, axis] <= max(x[a, axis], x[b, axis]):
            return False
    return orient2d(x, a, b, p, 0) == 0 and orient2d(x, a, b, p, 1) == 0 and orient2d(x, a, b, p, 2) == 0


@part
def _coincide(x, a, b):
    """True where two vertices have the same position."""
    return x[a, 0] == x[b, 0] and x[a, 1] == x[b, 1] and x[a, 2] == x[b, 2]
