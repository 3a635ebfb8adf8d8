"""Implicit surface of tapered capsules (limbs) and their smooth union: negative inside, a distance near the surface.

A limb is a straight axis with elliptic sections whose half axes r(t) follow a cubic through its knots; its ends are
half ellipsoids. With m the vector from the nearest point of the axis, k0 = |m / r| and k1 = |m / r^2|, its distance is
approximated by k0 (k0 - 1) / k1, exact to first order at the surface of an ellipsoid.
The union is f = -s log sum_i exp(-f_i / s): symmetric in the limbs, smooth, never above the sharp union.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from clothsim.base.arrays import Floats

RANGE = 0.25
"""Distance beyond which a limb is ignored [m]."""


@dataclass(frozen=True)
class Limb:
    """Tapered capsule.

    start (3,) [m]; axes (3, 3): rows across, deep, along; length [m]; caps (2,) [m]; knots (k,): positions along the
    axis of the half axes radii (k, 2) [m]; slopes (k, 2): their derivatives.
    """

    start: Floats
    axes: Floats
    length: float
    caps: tuple[float, float]
    knots: Floats
    radii: Floats
    slopes: Floats

    def distance(self, points: Floats) -> tuple[Floats, Floats]:
        """Return an approximate signed distance (n,) [m] of `points (n, 3)` to the surface, and its gradient (n, 3)."""
        m = (points - self.start) @ self.axes.T
        along = np.clip(m[:, 2], 0.0, self.length)
        r, widening = self._radii(along, m[:, 2])
        m[:, 2] -= along
        a = m / r
        b = a / r
        k0 = np.maximum(np.sqrt(np.einsum("ni,ni->n", a, a)), 1e-12)
        k1 = np.maximum(np.sqrt(np.einsum("ni,ni->n", b, b)), 1e-9)
        by_k0, by_k1 = ((2 * k0 - 1) / (k1 * k0))[:, None], (-k0 * (k0 - 1) / k1**3)[:, None]
        slope = by_k0 * (a / r) + by_k1 * (b / (r * r))
        by_radius = -(by_k0 * (a * a) + 2 * by_k1 * (b * b)) / r
        slope[:, 2] += np.einsum("ni,ni->n", by_radius[:, :2], widening)
        return k0 * (k0 - 1) / k1, slope @ self.axes

    def box(self) -> tuple[Floats, Floats]:
        """Return the lowest and the highest corner (3,) [m] of a bounding box."""
        ends = np.stack([self.start, self.start + self.length * self.axes[2]])
        room = max(self.radii.max(), *self.caps)
        return ends.min(axis=0) - room, ends.max(axis=0) + room

    def mirrored(self) -> "Limb":
        """Return the mirror image about the plane x = 0."""
        across = np.array([-1.0, 1.0, 1.0])
        return replace(self, start=across * self.start, axes=across * self.axes)

    def _radii(self, along: Floats, position: Floats) -> tuple[Floats, Floats]:
        """Half axes (n, 3) at `along (n,)`, and the growth along the axis of those of the section (n, 2)."""
        if len(self.knots) == 1:
            ball = np.append(self.radii[0], self.caps[0])
            return np.broadcast_to(ball, (len(along), 3)), np.zeros((len(along), 2))
        k = np.clip(np.searchsorted(self.knots, along, side="right") - 1, 0, len(self.knots) - 2)
        span = (self.knots[k + 1] - self.knots[k])[:, None]
        t = (along - self.knots[k])[:, None] / span
        change = self.radii[k + 1] - self.radii[k]
        c1, c2 = span * self.slopes[k], 3 * change - span * (2 * self.slopes[k] + self.slopes[k + 1])
        c3 = span * (self.slopes[k] + self.slopes[k + 1]) - 2 * change
        section = self.radii[k] + t * (c1 + t * (c2 + t * c3))
        widening = (c1 + t * (2 * c2 + 3 * t * c3)) / span
        beside = (position > 0) & (position < self.length)
        cap = np.where(position > 0.5 * self.length, self.caps[1], self.caps[0])
        return np.column_stack([section, cap]), widening * beside[:, None]


def limb(
    start: ArrayLike, end: ArrayLike, across: Floats, profile: Sequence[Sequence[float]], caps: tuple[float, float]
) -> Limb:
    """Make a limb from `start (3,)` to `end (3,)` [m]; where they coincide, an ellipsoid upright along z.

    across (3,): direction of the first half axis, made normal to the axis; profile: rows (fraction of the length, half
    axis across, half axis deep [m]); caps: lengths of its ends beyond the axis [m].
    """
    first, last = np.asarray(start, np.float64), np.asarray(end, np.float64)
    length = float(np.linalg.norm(last - first))
    along = (last - first) / length if length else np.array([0.0, 0.0, 1.0])
    side = np.asarray(across, np.float64) - np.dot(across, along) * along
    side /= np.linalg.norm(side)
    table = np.asarray(profile, np.float64)
    knots, radii = length * table[:, 0], table[:, 1:]
    slopes = np.zeros_like(radii)
    if len(knots) > 2:  # of the parabola through three knots; flat at the ends, where the caps begin
        step, rise = np.diff(knots)[:, None], np.diff(radii, axis=0)
        each = rise / step
        slopes[1:-1] = (each[:-1] * step[1:] + each[1:] * step[:-1]) / (step[1:] + step[:-1])
    return Limb(first, np.stack([side, np.cross(along, side), along]), length, caps, knots, radii, slopes)


def smooth_union(limbs: Sequence[Limb], points: Floats, smoothing: float) -> tuple[Floats, Floats]:
    """Return f (n,) [m] and its gradient (n, 3) of the union of `limbs`, at `points (n, 3)`; smoothing: s [m].

    A limb whose box is more than RANGE away adds less than s exp(-RANGE / s) and is left out; far from all, f is RANGE.
    """
    total, gradient = np.full(len(points), np.exp(-RANGE / smoothing)), np.zeros((len(points), 3))
    for one in limbs:
        low, high = one.box()
        near = np.flatnonzero(((points > low - RANGE) & (points < high + RANGE)).all(axis=1))
        if len(near):
            distance, slope = one.distance(points[near])
            fraction = np.exp(-np.maximum(distance, -RANGE) / smoothing)
            total[near] += fraction
            gradient[near] += fraction[:, None] * slope
    return -smoothing * np.log(total), gradient / total[:, None]


def lattice_union(limbs: Sequence[Limb], nodes: tuple[Floats, Floats, Floats], smoothing: float, band: float) -> Floats:
    """Return f [m] of the union at the nodes of a lattice (x, y, z), to s exp(-band / s) where f is below `band`."""
    total = np.full([len(axis) for axis in nodes], np.exp(-band / smoothing))
    for one in limbs:
        low, high = one.box()
        part = tuple(
            slice(*np.searchsorted(axis, (low[k] - band, high[k] + band)).tolist()) for k, axis in enumerate(nodes)
        )
        points = np.stack(np.meshgrid(*(axis[p] for axis, p in zip(nodes, part, strict=True)), indexing="ij"), axis=3)
        distance = one.distance(points.reshape(-1, 3))[0].reshape(points.shape[:3])
        total[part] += np.exp(-np.maximum(distance, -RANGE) / smoothing)
    return np.asarray(-smoothing * np.log(total), np.float64)
