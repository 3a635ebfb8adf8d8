"""Rods of a state that overlap: centre lines nearer to one another than their radii, or through a triangle.

Two lines that passed through one another between two states leave no trace in either: this check sees rods that are in
one another, CCD those that would pass. It shares nothing with contact. Signs are of double precision, not exact as
those of triangles are.
"""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints

ROUND_OFF = 1e-9
"""Fraction of the thickness by which centre lines may be nearer."""
ALONG = 2.0
"""Thicknesses along a rod up to which its edges count as neighbours."""


class CentreLine(Protocol):
    """A rod: its `edges (k, 2)` as rows of x, in order along it, and its radius [m]."""

    @property
    def edges(self) -> Ints:
        """Edges as rows of x, (k, 2)."""

    @property
    def radius(self) -> float:
        """Of its section [m]."""


def overlapping_edges(x: Floats, one: CentreLine, other: CentreLine) -> Ints:
    """Edges of two rods, or of one with itself, whose centre lines are nearer than both radii, (p, 2).

    Neighbours along a rod do not count.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> x = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, -1, 0.1], [0.5, 1, 0.1]])
    >>> a, b = (SimpleNamespace(edges=np.array([ends]), radius=0.06) for ends in ((0, 1), (2, 3)))
    >>> overlapping_edges(x, a, b).tolist()
    [[0, 0]]
    """
    thickness = (one.radius + other.radius) * (1 - ROUND_OFF)
    pairs = _near(x[one.edges].mean(axis=1), x[other.edges].mean(axis=1), _reach(x, one) + _reach(x, other) + thickness)
    if one is other:
        pairs = pairs[pairs[:, 0] < pairs[:, 1]]
        shared = (one.edges[pairs[:, 0]][:, :, None] == one.edges[pairs[:, 1]][:, None, :]).any(axis=(1, 2))
        sizes = np.linalg.norm(np.diff(x[one.edges], axis=1)[:, 0], axis=1)
        ends = np.cumsum(sizes)
        between = ends[pairs[:, 1]] - sizes[pairs[:, 1]] - ends[pairs[:, 0]]
        is_loop = one.edges[0].min() in one.edges[-1] and len(one.edges) > 2
        between = np.minimum(between, ends[-1] - between - sizes[pairs].sum(axis=1)) if is_loop else between
        pairs = pairs[~shared & (between > ALONG * thickness)]
    gaps = segment_distances(
        *x[one.edges[pairs[:, 0]]].transpose(1, 0, 2), *x[other.edges[pairs[:, 1]]].transpose(1, 0, 2)
    )
    return pairs[gaps < thickness]


def edges_through(x: Floats, rod: CentreLine, triangles: Ints) -> Ints:
    """Edges of a rod and triangles (m, 3) that they pass through, (p, 2)."""
    if not len(triangles):
        return np.zeros((0, 2), np.int64)
    corners = x[triangles]
    centres = corners.mean(axis=1)
    reach = float(np.linalg.norm(corners - centres[:, None], axis=2).max())
    pairs = _near(x[rod.edges].mean(axis=1), centres, _reach(x, rod) + reach)
    p, q = x[rod.edges[pairs[:, 0]]].transpose(1, 0, 2)
    a, b, c = corners[pairs[:, 1]].transpose(1, 0, 2)
    sides = np.sign(_volumes(a, b, c, p)) * np.sign(_volumes(a, b, c, q))
    around = np.sign([_volumes(p, q, *ends) for ends in ((a, b), (b, c), (c, a))])
    return pairs[(sides <= 0) & ((around >= 0).all(axis=0) | (around <= 0).all(axis=0))]


def segment_distances(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
    """Distances of segments a b and c d, (p, 3) each, (p,) [m] (Ericson 2005, Real-Time Collision Detection, 5.1.9)."""
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = ((s * t).sum(axis=1) for s, t in ((u, u), (v, v), (u, v)))
    uw, vw = (u * w).sum(axis=1), (v * w).sum(axis=1)
    across = uu * vv - uv * uv
    s = np.where(across > 0, np.clip((uv * vw - uw * vv) / np.where(across > 0, across, 1.0), 0.0, 1.0), 0.0)
    t = (uv * s + vw) / vv
    beyond = np.clip(t, 0.0, 1.0)
    s = np.where(beyond != t, np.clip((uv * beyond - uw) / uu, 0.0, 1.0), s)
    return np.asarray(np.linalg.norm(w + s[:, None] * u - beyond[:, None] * v, axis=1), np.float64)


def found_by_rods(x: Floats, parts: Sequence[Any]) -> list[tuple[int, int, Ints]]:
    """Numbers of the parts that overlap, a rod first, and the pairs of their edges, or of its edges and triangles."""
    rods = [k for k, part in enumerate(parts) if len(getattr(part, "edges", ()))]
    found = [(a, b, overlapping_edges(x, parts[a], parts[b])) for a in rods for b in rods if a <= b]
    for a in rods:
        others = (k for k in range(len(parts)) if k not in rods)
        found += [(a, b, edges_through(x, parts[a], parts[b].triangles)) for b in others]
    return [each for each in found if len(each[2])]


def _reach(x: Floats, rod: CentreLine) -> float:
    """Half of the longest edge [m]."""
    return 0.5 * float(np.linalg.norm(np.diff(x[rod.edges], axis=1)[:, 0], axis=1).max())


def _near(points: Floats, others: Floats, distance: float) -> Ints:
    """Pairs of points that are at most `distance` apart, (p, 2), sorted."""
    near = cKDTree(others).query_ball_point(points, distance * (1 + ROUND_OFF), return_sorted=True)
    counts = np.array([len(each) for each in near])
    second = np.concatenate([np.zeros(0, np.int64), *(np.array(each, np.int64) for each in near)])
    return np.column_stack([np.repeat(np.arange(len(points)), counts), second])


def _volumes(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
    """Six times the signed volumes of tetrahedra, (p,) [m3]."""
    return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a), np.float64)
