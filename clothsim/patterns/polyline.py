"""Curve of a pattern edge that is a polyline, as drawings of cutting machines give it."""

from dataclasses import dataclass

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

    def by_length(self, start: Floats, end: Floats, share: Floats) -> Floats:
        """Points (k, 2) [m] at the fractions `share (k,)` of the arc length."""
        return self.at(start, end, share)
