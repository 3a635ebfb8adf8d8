"""Plane curves between two points, sampled by arc length: straight lines, polylines, Bezier curves, circular arcs."""

from dataclasses import dataclass, replace
from functools import lru_cache
from math import comb

import numpy as np

from clothsim.base.arrays import Floats


@dataclass(frozen=True)
class Polyline:
    """Straight pieces from start to end through inner points.

    Attributes
    ----------
    inner : tuple of (float, float)
        Inner points relative to the chord e = end - start: start + x e + y (-e_y, e_x).
    """

    inner: tuple[tuple[float, float], ...]

    def points(self, start: Floats, end: Floats) -> Floats:
        """All points with both ends, (k, 2) [m]."""
        chord = end - start
        inner = np.reshape(np.array(self.inner, np.float64), (-1, 2))
        between = start + inner[:, :1] * chord + inner[:, 1:] * np.array([-chord[1], chord[0]])
        return np.concatenate([start[None], between, end[None]])

    def length(self, start: Floats, end: Floats) -> float:
        """Arc length [m]."""
        return float(np.linalg.norm(np.diff(self.points(start, end), axis=0), axis=1).sum())

    def at(self, start: Floats, end: Floats, t: Floats) -> Floats:
        """Points (k, 2) [m] at the fractions t (k,) of the arc length; 0 and 1 give the ends exactly."""
        points = self.points(start, end)
        lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        found = np.column_stack([np.interp(t * lengths[-1], lengths, row) for row in points.T])
        found[t == 0], found[t == 1] = start, end
        return found

    def by_length(self, start: Floats, end: Floats, fractions: Floats) -> Floats:
        """Points (k, 2) [m] at the fractions `fractions (k,)` of the arc length."""
        return self.at(start, end, fractions)


TABLE = 512
"""Cells of the parameter interval in which arc length is tabulated (interpolation errs by less than 1e-6 of it)."""


@dataclass(frozen=True)
class Straight:
    """Straight line from start to end."""

    def at(self, start: Floats, end: Floats, t: Floats) -> Floats:
        """Points (k, 2) [m] at the parameters t (k,) in [0, 1]."""
        return start + t[:, None] * (end - start)

    def length(self, start: Floats, end: Floats) -> float:
        """Arc length [m]."""
        return float(np.linalg.norm(end - start))

    def by_length(self, start: Floats, end: Floats, fractions: Floats) -> Floats:
        """Points (k, 2) [m] at the fractions `fractions (k,)` of the arc length."""
        return self.at(start, end, fractions)


@dataclass(frozen=True)
class Bezier:
    """Bezier curve with one (quadratic) or two (cubic) control points.

    Attributes
    ----------
    controls : tuple of (float, float)
        Control points relative to the chord e = end - start: start + x e + y (-e_y, e_x).
    """

    controls: tuple[tuple[float, float], ...]

    def points(self, start: Floats, end: Floats) -> Floats:
        """All control points with both ends, (3 or 4, 2) [m]."""
        chord = end - start
        across = np.array([-chord[1], chord[0]])
        return np.array([start, *(start + x * chord + y * across for x, y in self.controls), end])

    def at(self, start: Floats, end: Floats, t: Floats) -> Floats:
        """Points (k, 2) [m] at the parameters t (k,), evaluated by de Casteljau's algorithm."""
        return _de_casteljau(self.points(start, end), t)

    def length(self, start: Floats, end: Floats) -> float:
        """Arc length [m]."""
        return float(self._lengths(start, end)[-1])

    def by_length(self, start: Floats, end: Floats, fractions: Floats) -> Floats:
        """Points (k, 2) [m] at the fractions `fractions (k,)` of the arc length; 0 and 1 give the ends exactly."""
        found = self.at(start, end, self.parameters(start, end, fractions))
        found[fractions == 0], found[fractions == 1] = start, end
        return found

    def parameters(self, start: Floats, end: Floats, fractions: Floats) -> Floats:
        """Parameters (k,) of the points at the fractions `fractions (k,)` of the arc length."""
        lengths = self._lengths(start, end)
        return np.interp(fractions * lengths[-1], lengths, np.linspace(0, 1, TABLE + 1))

    def weights(self, t: Floats) -> Floats:
        """Weights (k, 3 or 4) of `points` in the curve at the parameters t (k,): Bernstein's polynomials."""
        degree = len(self.controls) + 1
        powers = np.arange(degree + 1)
        count = np.array([comb(degree, power) for power in range(degree + 1)], np.float64)
        return np.asarray(count * t[:, None] ** powers * (1 - t[:, None]) ** powers[::-1], np.float64)

    def _lengths(self, start: Floats, end: Floats) -> Floats:
        """Arc length up to each of the TABLE + 1 parameters, by Gauss quadrature of the speed in each cell [m]."""
        nodes, weights = _gauss()
        control = self.points(start, end)
        t = ((np.arange(TABLE)[:, None] + nodes) / TABLE).ravel()
        speeds = np.linalg.norm(_de_casteljau((len(control) - 1) * np.diff(control, axis=0), t), axis=1)
        return np.concatenate([[0.0], np.cumsum(speeds.reshape(TABLE, -1) @ weights) / TABLE])


@dataclass(frozen=True)
class Arc:
    """Circular arc.

    Attributes
    ----------
    radius : float
        Radius [m]; half of the chord where it is less.
    large : bool
        True for the longer of the two arcs.
    right : bool
        True where it bulges to the right of the direction of travel.
    """

    radius: float
    large: bool
    right: bool

    def circle(self, start: Floats, end: Floats) -> tuple[Floats, float, float]:
        """Centre (2,) and radius [m], and sweep [rad], counter-clockwise if positive."""
        chord = end - start
        half = float(np.linalg.norm(chord)) / 2
        radius = max(self.radius, half)
        left = np.array([-chord[1], chord[0]]) / (2 * half)
        side = (1 if self.right else -1) * (-1 if self.large else 1)
        rise = np.sqrt(radius - half) * np.sqrt(radius + half)  # no overflow
        sweep = 2 * np.arcsin(half / radius)
        sweep = 2 * np.pi - sweep if self.large else sweep
        return (start + end) / 2 + side * rise * left, radius, float(sweep if self.right else -sweep)

    def at(self, start: Floats, end: Floats, t: Floats) -> Floats:
        """Points (k, 2) [m] at the parameters t (k,): equal angles; 0 and 1 give the ends exactly.

        The secant to the parameter t is the chord, turned by (t - 1) sweep / 2 and scaled by
        sin(t sweep / 2) / sin(sweep / 2): no digit is lost where the radius is far larger than the chord.
        """
        half = self.circle(start, end)[2] / 2
        turn = (t - 1) * half
        scale = np.sin(t * half) / np.sin(half) if half else t
        chord = end - start
        secants = np.column_stack([np.cos(turn), np.sin(turn)]) * scale[:, None]
        x, y = secants.T
        found = np.asarray(start + x[:, None] * chord + y[:, None] * [-chord[1], chord[0]], np.float64)
        found[t == 0], found[t == 1] = start, end
        return found

    def length(self, start: Floats, end: Floats) -> float:
        """Arc length [m]."""
        _, radius, sweep = self.circle(start, end)
        return radius * abs(sweep)

    def by_length(self, start: Floats, end: Floats, fractions: Floats) -> Floats:
        """Points (k, 2) [m] at the fractions `fractions (k,)` of the arc length."""
        return self.at(start, end, fractions)


Curve = Straight | Bezier | Arc | Polyline


def along_chord(points: Floats, start: Floats, end: Floats) -> tuple[tuple[float, float], ...]:
    """Points (k, 2) [m] relative to the chord e = end - start: the x, y of start + x e + y (-e_y, e_x)."""
    chord = end - start
    offset = (points - start) / (chord @ chord)
    return tuple(zip((offset @ chord).tolist(), (offset @ np.array([-chord[1], chord[0]])).tolist(), strict=True))


def scaled_curve(curve: Curve, scale: float) -> Curve:
    """The curve between ends that are `scale` times as far apart."""
    return replace(curve, radius=scale * curve.radius) if isinstance(curve, Arc) else curve


def _de_casteljau(points: Floats, t: Floats) -> Floats:
    """Value (k, 2) of the Bezier polynomial with the coefficients (p, 2) at t (k,)."""
    levels = np.repeat(points[:, None, :], len(t), axis=1)
    while len(levels) > 1:
        levels = (1 - t)[:, None] * levels[:-1] + t[:, None] * levels[1:]
    return np.asarray(levels[0], np.float64)


@lru_cache(maxsize=1)
def _gauss() -> tuple[Floats, Floats]:
    """Nodes in [0, 1] and weights of Gauss's rule of three points."""
    nodes, weights = np.polynomial.legendre.leggauss(3)
    return (nodes + 1) / 2, weights / 2
