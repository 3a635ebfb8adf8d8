"""Outline of a piece: curves in any order joined to one loop, counter-clockwise, and divided into edges.

Half a piece is unfolded; edges end at corners and at notches.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.patterns.borders import enclosed_area
from clothsim.patterns.curves import Arc, Bezier, Curve, Polyline, Straight, along_chord
from clothsim.patterns.pattern import PatternEdge

JOINED = 1e-4
"""Distance of two ends that are one point [m]."""
FOLDED = 5e-4
"""Distance from the mirror line of a curve that lies on it [m]."""
SAMPLES = 33
"""Points that a curve is sampled at for areas and distances."""


@dataclass(frozen=True)
class Part:
    """Curve between two points (2,) [m]."""

    start: Floats
    end: Floats
    curve: Curve

    def points(self, fractions: Floats) -> Floats:
        """Points (k, 2) [m] at the fractions `fractions (k,)` of the arc length."""
        return self.curve.by_length(self.start, self.end, fractions)

    @property
    def samples(self) -> Floats:
        """Points from start to end, (k, 2) [m]: the corners of a straight part or a polyline, else SAMPLES."""
        if isinstance(self.curve, Straight):
            return np.array([self.start, self.end])
        if isinstance(self.curve, Polyline):
            return self.curve.points(self.start, self.end)
        return self.curve.at(self.start, self.end, np.linspace(0, 1, SAMPLES))

    @property
    def tangents(self) -> Floats:
        """Directions at start and end, (2, 2), of length 1."""
        if isinstance(self.curve, Bezier):
            steps = np.diff(self.curve.points(self.start, self.end), axis=0)
            steps = steps[np.linalg.norm(steps, axis=1) > 0][[0, -1]]
        else:
            near = self.points(np.array([0.0, 1e-6, 1 - 1e-6, 1.0]))
            steps = np.array([near[1] - near[0], near[3] - near[2]])
        return np.asarray(steps / np.linalg.norm(steps, axis=1)[:, None], np.float64)

    def reversed(self) -> "Part":
        """The same curve from end to start."""
        return Part(self.end, self.start, _turned(self.curve, across=-1, back=True))

    def mirrored(self, line: Floats) -> "Part":
        """The reflection in a line through two points (2, 2) [m]."""
        start, end = reflected(np.array([self.start, self.end]), line)
        return Part(start, end, _turned(self.curve, across=-1, back=False))


def _turned(curve: Curve, across: int, back: bool) -> Curve:
    """The curve reflected in its chord (across = -1), its direction kept or turned back.

    Turned back, the point x e + y (-e_y, e_x) of the chord e is (1 - x), -y of the chord -e: y changes its sign too.
    """
    if isinstance(curve, Arc):
        return replace(curve, right=not curve.right)
    if isinstance(curve, Straight):
        return curve
    points = curve.controls if isinstance(curve, Bezier) else curve.inner
    turned = tuple((1 - x, across * y) for x, y in reversed(points)) if back else tuple((x, -y) for x, y in points)
    return Bezier(turned) if isinstance(curve, Bezier) else Polyline(turned)


def straight_parts(points: Floats) -> tuple[Part, ...]:
    """Straight parts through points (k, 2) [m]."""
    return tuple(Part(a, b, Straight()) for a, b in zip(points, points[1:], strict=False))


def parts_of_bezier(points: Floats) -> tuple[Part, ...]:
    """The curve of 3 or 4 control points (k, 2) [m]; in two halves where it ends at its start."""
    if np.linalg.norm(points[-1] - points[0]) > JOINED:
        return (_bezier(points),)
    return tuple(part for half in split_bezier(points, 0.5) for part in parts_of_bezier(half))


def split_bezier(points: Floats, t: float) -> tuple[Floats, Floats]:
    """Control points (k, 2) of a Bezier curve before and after the parameter t, by de Casteljau's algorithm."""
    levels = [points]
    while len(levels[-1]) > 1:
        levels.append((1 - t) * levels[-1][:-1] + t * levels[-1][1:])
    return np.array([level[0] for level in levels]), np.array([level[-1] for level in levels[::-1]])


def reflected(points: Floats, line: Floats) -> Floats:
    """Points (k, 2) reflected in a line through two points (2, 2)."""
    along = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
    offset = points - line[0]
    return np.asarray(line[0] + 2 * np.outer(offset @ along, along) - offset, np.float64)


def loop_of(name: str, layer: str, parts: Sequence[Part]) -> tuple[Part, ...]:
    """The outline as a closed loop, counter-clockwise: the largest, where the layer has several.

    Parameters
    ----------
    name, layer : str
        Piece and layer, for messages.
    parts : sequence of Part
        Curves in any order and direction.

    Raises
    ------
    InputError
        An open outline, with its gap.
    """
    rest = [part for part in parts if np.linalg.norm(part.samples - part.start, axis=1).max() > JOINED]
    if not rest:
        raise InputError(f"Piece {name} has no outline on layer {layer}.")
    loops = []
    while rest:
        chain, rest = [rest[0]], list(rest[1:])  # the parts that join the first one at its end, one after another
        while rest and np.linalg.norm(chain[-1].end - chain[0].start) > JOINED:
            ends = np.array([[part.start, part.end] for part in rest])
            distance = np.linalg.norm(ends - chain[-1].end, axis=2)
            near = np.argwhere(distance <= JOINED)
            if not len(near):
                break
            row, side = (int(k) for k in near[0])
            part = rest.pop(row)
            chain.append(part.reversed() if side else part)
        gap = float(np.linalg.norm(chain[-1].end - chain[0].start))
        if gap > JOINED:
            x, y = chain[-1].end
            raise InputError(
                f"The outline of the piece {name} on layer {layer} is open: {1e3 * gap:.3g} mm from its end at "
                f"({1e3 * x:.1f}, {1e3 * y:.1f}) mm to its start.",
                "Close it in the drawing, or name the layer of another outline: layer = ...",
            )
        loops.append(_closed(chain))
    areas = [enclosed_area(polygon(loop)) for loop in loops]
    largest = int(np.argmax(np.abs(areas)))
    loop = loops[largest]
    return loop if areas[largest] > 0 else tuple(part.reversed() for part in loop[::-1])


def polygon(loop: Sequence[Part]) -> Floats:
    """Samples of a loop, (k, 2) [m]."""
    return np.concatenate([part.samples[:-1] for part in loop])


def _closed(chain: Sequence[Part]) -> tuple[Part, ...]:
    """The chain with each part ending exactly where the next one starts."""
    following = [*chain[1:], chain[0]]
    return tuple(replace(part, end=after.start) for part, after in zip(chain, following, strict=True))


def unfolded(loop: tuple[Part, ...], mirror: Floats | None) -> tuple[Part, ...]:
    """The whole piece of a half whose outline runs along the mirror line (2, 2) [m]; another loop as it is."""
    if mirror is None:
        return loop
    on_line = [np.abs(part.samples - reflected(part.samples, mirror)).max() < 2 * FOLDED for part in loop]
    if all(on_line) or not any(on_line):
        return loop
    first = next(k for k in range(len(loop)) if not on_line[k] and on_line[k - 1])
    order = [*loop[first:], *loop[:first]]
    half = [part for part, folded in zip(order, [*on_line[first:], *on_line[:first]], strict=True) if not folded]
    return _closed([*half, *(part.mirrored(mirror).reversed() for part in half[::-1])])


NEAR = 2e-3
"""Distance of a notch from a corner or another notch at which it divides nothing [m]."""


STRAIGHT = 1e-7
"""Distance from its chord of a row of straight parts that is one straight edge [m]."""


STEPS = 60
"""Halvings of the interval in which the nearest point of a curve lies."""


def outline_edges(
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
        Points that are not corners, however the loop turns there [m].
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
        halves = (Arc(curve.radius, fraction * sweep > np.pi, curve.right) for fraction in (t, 1 - t))
        return Part(start, middle, next(halves)), Part(middle, end, next(halves))
    if isinstance(curve, Bezier):
        first, second = split_bezier(curve.points(start, end), t)
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
    fraction = (lengths[-1] / 2 - before) / (lengths[row] - before)
    if fraction > 1 - 1e-6 or fraction < 1e-6:
        return parts, {0, row + (fraction > 0.5)}
    curve = parts[row].curve
    t = fraction
    if isinstance(curve, Bezier):
        t = curve.parameters(parts[row].start, parts[row].end, np.array([fraction]))[0]
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
