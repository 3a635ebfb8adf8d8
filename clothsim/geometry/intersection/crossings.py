"""Intersections of a state: pairs of surfaces by the names of cloths and bodies, and rods that overlap.

Rods overlap where their centre lines are nearer to one another than their radii, or pass through a triangle. Two lines
that passed through one another between two states leave no trace in either: this check sees rods that are in one
another, CCD those that would pass. It shares nothing with contact. Its signs are of double precision, not exact as
those of triangles are.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.geometry.intersection.intersecting_pairs import LIMIT, intersecting_pairs, intersection_points
from clothsim.geometry.intersection.proved_separations import ProvedSeparations

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


class CheckedSurface(Protocol):
    """A cloth or a body of a scene; `triangles (m, 3)` are rows of x."""

    @property
    def name(self) -> str:
        """Unique name in the scene."""

    @property
    def role(self) -> str:
        """Role in the scene: "cloth" or "body"."""

    @property
    def triangles(self) -> Ints:
        """Triangles as rows of x, (m, 3)."""


@dataclass(frozen=True)
class Crossing:
    """Intersections of a cloth with itself, another cloth or a body, or of a rigid body with a body.

    Attributes
    ----------
    first, second : str
        Names of the two surfaces.
    role : str
        "cloth" or "body", of the second; "rigid" where both are bodies.
    pairs : (p, 2) int array
        The triangles of each surface, counted in it from 0.
    position : (3,) array
        A point near the first pair [m].
    parts : tuple of str
        What is counted of each surface: triangles, or the edges of a rod.
    """

    first: str
    second: str
    role: str
    pairs: Ints
    position: Floats
    parts: tuple[str, str] = ("triangle", "triangle")

    @property
    def summary(self) -> str:
        """Both names: "cloth and ball intersect" or "cloth intersects itself"."""
        return f"{self.first} " + ("intersects itself" if self.first == self.second else f"and {self.second} intersect")

    @property
    def sentence(self) -> str:
        """The first pair: "triangle 3 of cloth intersects triangle 17 of ball near (0.1, 0.2, 0.3) m"."""
        i, j = self.pairs[0]
        at = ", ".join(f"{value:.4g}" for value in self.position)
        if self.first == self.second:
            return f"{self.parts[0]}s {i} and {j} of {self.first} intersect near ({at}) m"
        return f"{self.parts[0]} {i} of {self.first} intersects {self.parts[1]} {j} of {self.second} near ({at}) m"


def crossings(
    x: Floats, parts: Sequence[CheckedSurface], limit: int = LIMIT, proofs: ProvedSeparations | None = None
) -> tuple[Crossing, ...]:
    """All intersections of cloths with bodies, with themselves and with each other, and of rigid bodies with bodies.

    Other bodies are never checked against each other. There are two searches, and one for each rigid body.

    Parameters
    ----------
    x : (N, 3) array
        Positions of all vertices [m].
    parts : sequence of CheckedSurface
        Cloths, then bodies.
    limit : int
        Number of triangle pairs at which a search ends.
    proofs : ProvedSeparations, optional
        Of the last state; they become those of x. Pairs whose proof holds are not tested; the result is the same.

    Returns
    -------
    tuple of Crossing
        One for each pair of surfaces that intersect, in their order.

    Examples
    --------
    >>> import numpy as np
    >>> from types import SimpleNamespace
    >>> x = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, -1], [1, 1, 1], [9, 9, 0]])
    >>> sheet = SimpleNamespace(name="sheet", role="cloth", triangles=np.array([[0, 1, 2]]))
    >>> peg = SimpleNamespace(name="peg", role="body", triangles=np.array([[3, 4, 5]]))
    >>> [crossing.summary for crossing in crossings(x, [sheet, peg])]
    ['sheet and peg intersect']
    """
    cloths = [part for part in parts if part.role == "cloth"]
    bodies = [part for part in parts if part.role == "body"]
    found = _between(x, cloths, None, limit, proofs) + _between(x, cloths, bodies, limit, proofs)
    rigid = [part for part in bodies if getattr(part, "rigid", False)]
    for number, one in enumerate(rigid):
        others = [part for part in bodies if part not in rigid[: number + 1]]
        found += [replace(each, role="rigid") for each in _between(x, [one], others, limit, proofs)]
    lines: Sequence[Any] = parts
    for a, b, pairs in found_by_rods(x, lines):
        at = x[lines[a].edges[pairs[0, 0]]].mean(axis=0)
        what = ("edge", "edge" if len(getattr(lines[b], "edges", ())) else "triangle")
        found.append(Crossing(lines[a].name, lines[b].name, lines[b].role, pairs, at, what))
    if proofs is not None:
        proofs.end_state()
    order = {part.name: k for k, part in enumerate(parts)}
    return tuple(sorted(found, key=lambda each: (order[each.first], order[each.second])))


def _between(
    x: Floats,
    cloths: Sequence[CheckedSurface],
    bodies: Sequence[CheckedSurface] | None,
    limit: int,
    proofs: ProvedSeparations | None,
) -> list[Crossing]:
    """Crossings of the cloths with bodies; None: with themselves and each other."""
    cloths = [part for part in cloths if len(part.triangles)]  # no rods
    others = cloths if bodies is None else bodies
    if not cloths or not others:
        return []
    first, starts = _together(cloths)
    second, other_starts = (first, starts) if bodies is None else _together(others)
    search = intersecting_pairs if proofs is None else proofs.intersecting_pairs
    pairs = search(x, first, None if bodies is None else second, limit)
    if not len(pairs):
        return []
    owners = np.column_stack(
        [
            np.searchsorted(starts, pairs[:, 0], side="right") - 1,
            np.searchsorted(other_starts, pairs[:, 1], side="right") - 1,
        ]
    )
    found = []
    for a, b in np.unique(owners, axis=0):
        chosen = pairs[(owners == (a, b)).all(axis=1)]
        position = intersection_points(x, first, second, chosen[:1])[0]
        local = chosen - [starts[a], other_starts[b]]
        found.append(Crossing(cloths[a].name, others[b].name, others[b].role, local, position))
    return found


def _together(parts: Sequence[CheckedSurface]) -> tuple[Ints, Ints]:
    """Triangles of all parts, and the first of each."""
    counts = [len(part.triangles) for part in parts]
    return np.concatenate([part.triangles for part in parts]), np.cumsum([0, *counts[:-1]])
