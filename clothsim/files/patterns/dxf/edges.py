"""Edges of a piece: its outline divided at corners and at notches."""

from collections.abc import Sequence

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.files.patterns.dxf.outline import JOINED, Part, divided
from clothsim.patterns.curves import Arc, Bezier, Curve, Straight, along_chord
from clothsim.patterns.pattern import PatternEdge
from clothsim.patterns.polyline import Polyline

NEAR = 2e-3
"""Distance of a notch from a corner or another notch at which it divides nothing [m]."""
STRAIGHT = 1e-7
"""Distance from its chord of a row of straight parts that is one straight edge [m]."""
STEPS = 60
"""Halvings of the interval in which the nearest point of a curve lies."""


def edges_of(
    loop: Sequence[Part], notches: Floats, curve_points: Floats, reach: float, corner: float
) -> tuple[Floats, tuple[PatternEdge, ...]]:
    """Corners (k, 2) [m] and edges of a loop.

    Parameters
    ----------
    loop : sequence of Part
        Closed, in order.
    notches : (k, 2) array
        Points at which an edge ends and the next one begins [m].
    curve_points : (k, 2) array
        Points that are no corners, however the loop turns there [m].
    reach : float
        Largest distance of a notch from the loop [m]: beyond, it belongs to another line.
    corner : float
        Turn of the outline at which an edge ends [rad].

    Returns
    -------
    vertices : (k, 2) array
        Corners [m], the first at or after the start of the loop.
    edges : tuple of PatternEdge
        At least two.
    """
    parts = list(loop)
    smooth = [np.linalg.norm(curve_points - part.start, axis=1).min(initial=np.inf) < JOINED for part in parts]
    ends = {k for k in range(len(parts)) if not smooth[k] and _turn(parts[k - 1], parts[k]) > corner}
    for notch in notches:
        parts, ends = _notched(parts, ends, notch, reach)
    if not ends:
        ends = {0}
    if len(ends) == 1:
        parts, ends = _divided_in_two(parts, next(iter(ends)))
    starts = sorted(ends)
    chains = [_between(parts, first, starts[(k + 1) % len(starts)]) for k, first in enumerate(starts)]
    edges = (PatternEdge(k, (k + 1) % len(chains), _curve(chain)) for k, chain in enumerate(chains))
    return np.array([chain[0].start for chain in chains]), tuple(edges)


def _turn(before: Part, after: Part) -> float:
    """Angle between two parts where they meet [rad]."""
    u, v = before.tangents[1], after.tangents[0]
    return float(np.arctan2(abs(u[0] * v[1] - u[1] * v[0]), u @ v))


def _notched(parts: list[Part], ends: set[int], notch: Floats, reach: float) -> tuple[list[Part], set[int]]:
    """The parts and the numbers of those that start an edge, with the outline divided at a notch."""
    found = [_nearest(part, notch) for part in parts]
    row = int(np.argmin([distance for _, distance in found]))
    t, distance = found[row]
    point = parts[row].curve.at(parts[row].start, parts[row].end, np.array([t]))[0]
    corners = np.array([parts[k].start for k in ends]).reshape(-1, 2)
    if distance > reach or np.linalg.norm(corners - point, axis=1).min(initial=np.inf) < NEAR:
        return parts, ends
    for k in (row, (row + 1) % len(parts)):
        if np.linalg.norm(parts[k].start - point) < STRAIGHT:
            return parts, ends | {k}
    pieces = _cut(parts[row], t)
    moved = {k + (k > row) for k in ends}
    return [*parts[:row], *pieces, *parts[row + 1 :]], moved | {row + 1}


def _nearest(part: Part, point: Floats) -> tuple[float, float]:
    """Parameter of the point of a part that is nearest to `point`, and its distance [m]."""
    t = np.linspace(0, 1, 65)
    at = lambda values: part.curve.at(part.start, part.end, values)  # noqa: E731
    best = int(np.argmin(np.linalg.norm(at(t) - point, axis=1)))
    low, high = t[max(best - 1, 0)], t[min(best + 1, 64)]
    for _ in range(STEPS):  # the distance has one minimum between both neighbours
        thirds = np.array([(2 * low + high) / 3, (low + 2 * high) / 3])
        first, second = np.linalg.norm(at(thirds) - point, axis=1)
        low, high = (low, thirds[1]) if first < second else (thirds[0], high)
    return float((low + high) / 2), float(np.linalg.norm(at(np.array([(low + high) / 2]))[0] - point))


def _cut(part: Part, t: float) -> tuple[Part, Part]:
    """A part before and after the parameter t of its curve."""
    start, end, curve = part.start, part.end, part.curve
    middle = curve.at(start, end, np.array([t]))[0]
    if isinstance(curve, Straight):
        return Part(start, middle, curve), Part(middle, end, curve)
    if isinstance(curve, Arc):
        sweep = abs(curve.circle(start, end)[2])
        halves = (Arc(curve.radius, share * sweep > np.pi, curve.right) for share in (t, 1 - t))
        return Part(start, middle, next(halves)), Part(middle, end, next(halves))
    if isinstance(curve, Bezier):
        first, second = divided(curve.points(start, end), t)
        return _bezier(first), _bezier(second)
    raise TypeError(f"A part of an outline is no {type(curve).__name__}.")


def _bezier(points: Floats) -> Part:
    """The curve of 3 or 4 control points (k, 2) [m]."""
    return Part(points[0], points[-1], Bezier(along_chord(points[1:-1], points[0], points[-1])))


def _divided_in_two(parts: list[Part], first: int) -> tuple[list[Part], set[int]]:
    """The parts from the only corner on, and the start of both edges: the other one lies at half of the length."""
    parts = [*parts[first:], *parts[:first]]
    lengths = np.cumsum([part.curve.length(part.start, part.end) for part in parts])
    row = int(np.searchsorted(lengths, lengths[-1] / 2))
    before = lengths[row - 1] if row else 0.0
    share = (lengths[-1] / 2 - before) / (lengths[row] - before)
    if share > 1 - 1e-6 or share < 1e-6:
        return parts, {0, row + (share > 0.5)}
    curve = parts[row].curve
    t = curve.parameters(parts[row].start, parts[row].end, np.array([share]))[0] if isinstance(curve, Bezier) else share
    return [*parts[:row], *_cut(parts[row], float(t)), *parts[row + 1 :]], {0, row + 1}


def _between(parts: Sequence[Part], first: int, last: int) -> list[Part]:
    """The parts from `first` up to `last`, cyclically."""
    return [*parts[first:last]] if last > first else [*parts[first:], *parts[:last]]


def _curve(chain: Sequence[Part]) -> Curve:
    """One curve for a row of parts: their own where there is one, straight where they are, else a polyline."""
    if len(chain) == 1:
        return chain[0].curve
    start, end = chain[0].start, chain[-1].end
    points = np.concatenate([*(part.samples[:-1] for part in chain), end[None]])[1:-1]
    inner_points = along_chord(points, start, end)
    inner = np.array(inner_points)
    chord = float(np.linalg.norm(end - start))
    forward = (np.diff(inner[:, 0], prepend=0, append=1) > 0).all()
    return Straight() if forward and np.abs(inner[:, 1]).max() * chord < STRAIGHT else Polyline(inner_points)
