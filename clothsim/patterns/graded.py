"""Graded pattern: panels under a map of their plane, with seams whose two sides change in length by one factor."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.patterns.curves import Arc, Bezier, Curve, Polyline, Straight, along_chord, scaled_curve
from clothsim.patterns.pattern import Panel, Pattern, Side

STEPS = 50
"""Bound on the Gauss-Newton steps that make both sides of all seams alike."""
ALIKE = 1e-12
"""Largest difference of the logarithms of both factors of a seam at which they are alike."""
STAY = 1.0
"""Weight of the displacements of corners over that of the changes of edges, at the size of the panel."""
SAMPLES = np.linspace(0.0, 1.0, 17)
"""Parameters of a line or a Bezier curve at which its image is looked at."""
BOW = 2e-3
"""Distance of the control points of the image of a straight line from its chord, as a fraction of that, below which it
stays straight."""
FLAT = 1e-9
"""Height of an arc over its chord below which it is a straight line, as a fraction of the chord."""


@dataclass(frozen=True)
class PlaneMap:
    """Map of the plane of a panel: origin + girth(t) q across + length(t) along, for q across and t along.

    Attributes
    ----------
    origin : (2,) array
        Point of the plane that stays where it is [m].
    along : (2,) array
        Unit direction along the trunk or the limb; across is a quarter turn clockwise from it.
    girth, length : callable
        Factor (k,) across, and coordinate (k,) [m] along, of coordinates t (k,) [m].
    """

    origin: Floats
    along: Floats
    girth: Callable[[Floats], Floats]
    length: Callable[[Floats], Floats]

    def __call__(self, points: Floats) -> Floats:
        """Images of points (k, 2) [m]."""
        across = np.array([self.along[1], -self.along[0]])
        offset = points - self.origin
        t, q = offset @ self.along, offset @ across
        image = self.origin + np.outer(self.girth(t) * q, across) + np.outer(self.length(t), self.along)
        return np.asarray(image, np.float64)

    def panel(self, panel: Panel) -> Panel:
        """The image of a panel: corners, cubic curves near the images of edges, arcs through those of their middles."""
        corners = self(panel.vertices)
        edges = tuple(
            replace(edge, curve=_mapped_curve(edge.curve, panel.vertices[[edge.start, edge.end]], self))
            for edge in panel.edges
        )
        return replace(panel, vertices=corners, edges=edges)


class SeamsAlike(NamedTuple):
    """Pattern whose seams change alike, and factors of both sides of each seam, by name.

    before: largest difference of both factors of a seam before that; moved: largest displacement of a corner [m].
    """

    pattern: Pattern
    factors: Mapping[str, tuple[float, float]]
    before: float
    moved: float


def seams_alike(graded: Pattern, original: Pattern) -> SeamsAlike:
    """The graded pattern `with_seams_alike`, and what that changed."""
    alike = with_seams_alike(graded, original)
    before = max((abs(a - b) for a, b in factors_of_seams(graded, original).values()), default=0.0)
    moved = [np.abs(alike.panels[name].vertices - panel.vertices).max() for name, panel in graded.panels.items()]
    return SeamsAlike(alike, factors_of_seams(alike, original), before, float(max(moved)))


def _mapped_curve(curve: Curve, ends: Floats, image: PlaneMap) -> Curve:
    """Curve between the images of its ends (2, 2) [m]: of a line or a Bezier curve the cubic one by least squares."""
    start, end = image(ends)
    if isinstance(curve, Straight | Bezier):
        points = np.array(along_chord(image(curve.at(ends[0], ends[1], SAMPLES)), start, end))
        weights = Bezier(((0.0, 0.0), (1.0, 0.0))).weights(SAMPLES)  # of a cubic curve from (0, 0) to (1, 0)
        controls = np.linalg.lstsq(weights[:, 1:3], points - np.outer(weights[:, 3], [1.0, 0.0]), rcond=None)[0]
        if isinstance(curve, Straight) and np.abs(controls[:, 1]).max() < BOW:
            return curve
        return Bezier(tuple((float(x), float(y)) for x, y in controls))
    if isinstance(curve, Polyline):
        return Polyline(along_chord(image(curve.points(ends[0], ends[1])[1:-1]), start, end))
    if isinstance(curve, Arc):
        middle = image(curve.at(ends[0], ends[1], np.array([0.5])))
        height = along_chord(middle, start, end)[0][1]  # of chords, positive to the left
        if abs(height) < FLAT:
            return Straight()
        chord = float(np.linalg.norm(end - start))
        radius = chord * (0.25 + height**2) / (2 * abs(height))
        return Arc(radius, abs(height) > 0.5, height < 0)
    return curve


def with_seams_alike(graded: Pattern, original: Pattern) -> Pattern:
    """Copy of a graded pattern whose edges change by the least that makes both sides of each seam change alike.

    Curves are similar to those of `graded`, so that the length of an edge goes as its chord. Each Gauss-Newton step
    closes the linearized differences r of the logarithms of both factors, J d = -r, and of all such displacements d of
    the corners takes the one whose chords change least as fractions of their lengths: the sum of |d_j - d_i|^2 / l_ij^2
    (the metric M), d = -M^-1 J^T (J M^-1 J^T)^-1 r.
    """
    names = list(graded.panels)
    offsets = dict(zip(names, np.cumsum([0, *(len(graded.panels[n].vertices) for n in names)])[:-1], strict=True))
    points = np.concatenate([graded.panels[name].vertices for name in names])
    sides = [stitch.sides for stitch in graded.stitches]
    ends = np.array([[_ends(graded, side, offsets) for side in pair] for pair in sides], np.int64).reshape(-1, 2, 2)
    fixed = np.log([[_per_chord(graded, original, side) for side in pair] for pair in sides]).reshape(-1, 2)
    inverse = np.linalg.inv(_metric(graded, offsets, len(points)))
    for _ in range(STEPS):
        # difference of the logarithms of both factors of each seam (s,), and its derivative (s, n, 2)
        chords = points[ends[..., 1]] - points[ends[..., 0]]  # (s, 2, 2)
        squared = (chords**2).sum(axis=2)
        logarithms = fixed + 0.5 * np.log(squared)
        slopes = np.zeros((len(ends), len(points), 2))
        seams = np.arange(len(ends))
        for side, sign in ((0, 1.0), (1, -1.0)):
            slope = sign * chords[:, side] / squared[:, side, None]
            np.add.at(slopes, (seams, ends[:, side, 1]), slope)
            np.add.at(slopes, (seams, ends[:, side, 0]), -slope)
        differences = logarithms[:, 0] - logarithms[:, 1]
        if np.abs(differences).max(initial=0.0) < ALIKE:
            break
        moves = np.einsum("nm,smk->snk", inverse, slopes)
        system = np.einsum("snk,tnk->st", slopes, moves)
        points = points - np.einsum("s,snk->nk", np.linalg.lstsq(system, differences, rcond=1e-10)[0], moves)
    return replace(graded, panels={name: _move_corners(graded.panels[name], points[offsets[name] :]) for name in names})


def factors_of_seams(graded: Pattern, original: Pattern) -> Mapping[str, tuple[float, float]]:
    """Factor of the length of both sides of each seam, by the name of the seam."""
    return {
        f"{a.panel}.{a.edge} to {b.panel}.{b.edge}": (_factor(graded, original, a), _factor(graded, original, b))
        for a, b in (stitch.sides for stitch in graded.stitches)
    }


def _factor(graded: Pattern, original: Pattern, side: Side) -> float:
    return graded.panels[side.panel].edge_length(side.edge) / original.panels[side.panel].edge_length(side.edge)


def _per_chord(graded: Pattern, original: Pattern, side: Side) -> float:
    """Factor of the length of an edge over its chord [1/m]."""
    panel = graded.panels[side.panel]
    edge = panel.edges[side.edge]
    return _factor(graded, original, side) / float(
        np.linalg.norm(panel.vertices[edge.end] - panel.vertices[edge.start])
    )


def _ends(pattern: Pattern, side: Side, offsets: Mapping[str, int]) -> tuple[int, int]:
    edge = pattern.panels[side.panel].edges[side.edge]
    return offsets[side.panel] + edge.start, offsets[side.panel] + edge.end


def _metric(pattern: Pattern, offsets: Mapping[str, int], n: int) -> Floats:
    """Matrix (n, n) of the sum over pairs of corners of |d_j - d_i|^2 / l_ij^2, and STAY |d_i|^2 / size^2.

    Pairs: the ends of each edge, and the corners that a seam within one panel joins: the mouth of a dart of 3 mm would
    close.
    """
    metric = np.zeros((n, n))
    for name, panel in pattern.panels.items():
        pairs = [(edge.start, edge.end) for edge in panel.edges]
        for stitch in pattern.stitches:
            if {side.panel for side in stitch.sides} == {name}:
                first, second = (panel.edges[side.edge] for side in stitch.sides)
                ends = (second.start, second.end) if stitch.right_wrong else (second.end, second.start)
                pairs += zip((first.start, first.end), ends, strict=True)
        for pair in pairs:
            squared = ((panel.vertices[pair[1]] - panel.vertices[pair[0]]) ** 2).sum()
            if squared > 0.0:
                rows = offsets[name] + np.array(pair)
                metric[np.ix_(rows, rows)] += np.array([[1, -1], [-1, 1]]) / squared
        own = slice(offsets[name], offsets[name] + len(panel.vertices))
        metric[own, own] += STAY / np.ptp(panel.vertices, axis=0).max() ** 2 * np.eye(len(panel.vertices))
    return metric


def _move_corners(panel: Panel, points: Floats) -> Panel:
    """Panel with its corners at the first of points (k, 2) [m]; arcs stay similar."""
    corners = points[: len(panel.vertices)].copy()
    edges = []
    for edge in panel.edges:
        before, after = (float(np.linalg.norm(at[edge.end] - at[edge.start])) for at in (panel.vertices, corners))
        edges.append(replace(edge, curve=scaled_curve(edge.curve, after / before)))
    return replace(panel, vertices=corners, edges=tuple(edges))
