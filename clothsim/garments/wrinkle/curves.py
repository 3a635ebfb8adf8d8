"""Wrinkle curves: crests across the compression, evenly spaced, each followed over the frames in the material.

A curve runs through a point of the material, its seed, along the direction of s1 as far as the cloth is compressed
(streamlines at a distance of one wave: Jobard and Lefer 1997). It keeps its seed: in each frame it is traced again in
the field of that frame, grows or fades in and dies where its seed is compressed no longer. New ones fill the gaps.
"""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from clothsim.base.arrays import Floats, Ints
from clothsim.garments.wrinkle.compression import Compression, Waves, amplitude

LEAST = 0.01
"""Compression 1 - s2 below which cloth is not wrinkled."""
FADE = 0.12
"""Time in which a curve comes or goes [s]."""
APART, NEAREST = 0.75, 0.5
"""Distance of a new seed, and of the points of a new curve, from other curves, over the wavelength."""
SHORTEST = 0.75
"""Least length of a crest over the wavelength."""
MOST_CURVES = 400
"""Bound on the curves of a cloth."""


@dataclass(frozen=True)
class FineSheet:
    """A finer cloth at rest, on which curves are traced.

    Attributes
    ----------
    points, normals : (k, 3) arrays
        Vertices [m] and unit normals.
    edge : float
        Mean edge [m].
    waves : Waves
        The wavelengths of its fabric.
    """

    points: Floats
    normals: Floats
    edge: float
    waves: Waves

    @cached_property
    def tree(self) -> cKDTree:
        """The vertices for searches."""
        return cKDTree(self.points)


@dataclass(frozen=True)
class Crest:
    """A crest.

    Attributes
    ----------
    seed : (3,) array
        Point of the material that it runs through [m].
    wavelength : float
        [m].
    strength : float
        From 0, not there yet, to 1.
    points : (q, 3) array
        At rest, about an edge apart [m].
    """

    seed: Floats
    wavelength: float
    strength: float = 0.0
    points: Floats = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True)
class CompressionField:
    """The compression of a frame at the vertices of a sheet, and their positions in space (k, 3) [m]."""

    sheet: FineSheet
    compression: Compression
    positions: Floats

    def trace(self, seed: Floats, crests: bool = True, most: int = 4000) -> tuple[Floats, Ints]:
        """The line through a seed along the crests, or across them, as far as the cloth is compressed.

        Returns its points (q, 3) [m] and the nearest vertex of each (q,); none where the seed is not compressed.
        """
        sides = [self._half(seed, sign, crests, most) for sign in (-1.0, 1.0)]
        (back, behind), (ahead, before) = sides
        if not len(ahead):
            return np.zeros((0, 3)), np.zeros(0, np.int64)
        return np.concatenate([back[:0:-1], ahead]), np.concatenate([behind[:0:-1], before])

    def _half(self, seed: Floats, sign: float, crests: bool, most: int) -> tuple[Floats, Ints]:
        sheet, amount = self.sheet, self.compression.amount
        directions = self.compression.along if crests else self.compression.across
        point, last = np.asarray(seed, np.float64), None
        points, rows = [], []
        distance, row = sheet.tree.query(point)
        for _ in range(most):
            if distance > sheet.edge or amount[row] < LEAST:
                break
            points.append(point)
            rows.append(row)
            direction = directions[row] * sign if last is None else directions[row]
            if last is not None and direction @ last < 0:
                direction = -direction
            if last is not None and direction @ last < 0.5:  # no field turns so: another layer, or noise
                break
            last = direction
            step = point + sheet.edge * direction
            distance, row = sheet.tree.query(step)
            step -= ((step - sheet.points[row]) @ sheet.normals[row]) * sheet.normals[row]
            distance = float(np.linalg.norm(step - sheet.points[row]))
            if len(points) > 4 and np.linalg.norm(step - points[0]) < 0.7 * sheet.edge:  # closed
                break
            point = step
        return np.array(points).reshape(-1, 3), np.array(rows, np.int64)

    def wavelength_at(self, seed: Floats, points: Floats, rows: Ints) -> float:
        """Wavelength of a crest through a seed [m], from its tension, length and curvature."""
        sheet, stretches = self.sheet, self.compression.stretches
        longest = sheet.edge * max(len(self.trace(seed, crests=False, most=400)[0]), 1)
        along, across = stretches[rows].mean(axis=0)
        tension, length = sheet.waves.stretching * (float(along) - 1), sheet.edge * max(len(points) - 1, 1)
        radius = math.inf  # of curvature in space [m]: of a circle through the ends and the middle of the crest
        if len(rows) >= 5:
            a, b, c = self.positions[rows[[0, len(rows) // 2, -1]]]
            doubled = float(np.linalg.norm(np.cross(b - a, c - a)))
            sides = float(np.linalg.norm(b - a) * np.linalg.norm(c - b) * np.linalg.norm(c - a))
            if doubled > 1e-9 * sides ** (2 / 3):
                radius = sides / (2 * doubled)
        return sheet.waves.wavelength(tension, length, radius, longest, float(across))


def followed_curves(curves: list[Crest], field: CompressionField, seconds: float) -> list[Crest]:
    """The curves of the next frame, `seconds` later: those before in the new field, and new ones in the gaps."""
    gain = 1 - math.exp(-seconds / FADE)
    kept: list[Crest] = []
    for curve in sorted(curves, key=lambda each: -each.strength):
        points, rows = field.trace(curve.seed)
        length = field.sheet.edge * len(points)
        own = curve.wavelength
        if len(points) > 1:
            own += gain * (field.wavelength_at(curve.seed, points, rows) - own)
        alive = length > SHORTEST * own and not _near(curve.seed[None], kept, NEAREST * own)[0]
        strength = curve.strength + gain * (float(alive) - curve.strength)
        if not alive and strength < 0.1:
            continue
        kept.append(replace(curve, wavelength=own, strength=strength, points=points if alive else curve.points))
    return _filled(kept, field, gain)


def _filled(curves: list[Crest], field: CompressionField, strength: float) -> list[Crest]:
    """The curves with new ones beside them, a wave apart, then where the cloth is compressed most and has none."""
    amount, sheet = field.compression.amount, field.sheet
    found, queue = list(curves), list(curves)
    covered = amount < LEAST
    for curve in curves:
        _cover(covered, sheet, curve.points, NEAREST * curve.wavelength)
    while len(found) < MOST_CURVES:
        made = None
        while queue and made is None:
            made = _beside(queue[0], found, field, strength)
            if made is None:
                queue.pop(0)
        while made is None and not covered.all():
            row = int(np.where(covered, -1.0, amount).argmax())
            made = _curve(sheet.points[row], found, field, strength)
            if made is None:  # nor is there room for one near it
                _cover(covered, sheet, sheet.points[[row]], 2 * sheet.edge)
        if made is None:
            return found
        _cover(covered, sheet, made.points, NEAREST * made.wavelength)
        found.append(made)
        queue.append(made)
    return found


def _cover(covered: NDArray[np.bool_], sheet: FineSheet, points: Floats, distance: float) -> None:
    """Mark the vertices within `distance` of points (q, 3) [m]."""
    for near in sheet.tree.query_ball_point(points, distance) if len(points) else ():
        covered[near] = True


def _beside(curve: Crest, found: list[Crest], field: CompressionField, strength: float) -> Crest | None:
    """A new curve a wave beside another one; None where there is no room."""
    sheet = field.sheet
    points = curve.points[:: max(1, round(0.5 * curve.wavelength / sheet.edge))]
    if not len(points):
        return None
    aside = curve.wavelength * field.compression.across[sheet.tree.query(points)[1]]
    seeds = np.stack([points - aside, points + aside], axis=1).reshape(-1, 3)
    distances, rows = sheet.tree.query(seeds)
    free = (distances <= sheet.edge) & (field.compression.amount[rows] >= LEAST)
    free[free] = ~_near(seeds[free], found, APART * curve.wavelength)
    return next(filter(None, (_curve(seed, found, field, strength) for seed in seeds[free])), None)


def _curve(seed: Floats, found: list[Crest], field: CompressionField, strength: float) -> Crest | None:
    """The curve through a seed, as far as others are not near; None where it is too short."""
    points, rows = field.trace(seed)
    if len(points) < 2:
        return None
    own = field.wavelength_at(seed, points, rows)
    free = ~_near(points, found, NEAREST * own)
    middle = int(np.linalg.norm(points - seed, axis=1).argmin())
    if not free[middle]:
        return None
    low = middle - int(np.argmin(np.r_[free[middle::-1], False])) + 1
    high = middle + int(np.argmin(np.r_[free[middle:], False]))
    if field.sheet.edge * (high - low) < SHORTEST * own:
        return None
    return Crest(np.asarray(seed, np.float64), own, strength, points[low:high])


def _near(points: Floats, curves: list[Crest], distance: float) -> NDArray[np.bool_]:
    """True for each of points (q, 3) [m] that is nearer than `distance` to a curve, (q,)."""
    others = np.concatenate([np.zeros((0, 3)), *(each.points for each in curves)])
    if not len(others) or not len(points):
        return np.zeros(len(points), bool)
    return np.asarray(cdist(points, others).min(axis=1) < distance)


AT_ONCE = 4000
"""Vertices whose distances to all curves are in memory at once."""


def heights(curves: list[Crest], field: CompressionField) -> Floats:
    """Displacements along the normals, (k,) [m]: sines between neighbouring crests.

    At the distances r1 <= r2 of the two nearest crests the phase is 2 pi r1/(r1 + r2): a crest at r1 = 0, a valley
    half way. Beyond an outer crest it is 2 pi r1/lambda, and the wave fades within one length.
    """
    sheet, out = field.sheet, np.zeros(len(field.positions))
    curves = [each for each in curves if len(each.points)]
    if not curves:
        return out
    longest = max(each.wavelength for each in curves)
    others = np.concatenate([each.points for each in curves])
    first = np.cumsum([0, *(len(each.points) for each in curves)])[:-1]
    blocks = range(0, len(sheet.points), AT_ONCE)
    parts = [np.minimum.reduceat(cdist(others, sheet.points[k : k + AT_ONCE]), first, axis=0) for k in blocks]
    distances = np.concatenate(parts, axis=1)
    order = np.argpartition(distances, min(1, len(curves) - 1), axis=0)[:2]
    order = np.take_along_axis(order, np.argsort(np.take_along_axis(distances, order, axis=0), axis=0), axis=0)
    r1 = np.take_along_axis(distances, order[:1], axis=0)[0]
    r2 = np.take_along_axis(distances, order[1:2], axis=0)[0] if len(curves) > 1 else np.full(len(r1), np.inf)
    waves, strengths = (np.array([getattr(e, name) for e in curves])[order[0]] for name in ("wavelength", "strength"))
    between = r1 + r2 < 1.6 * waves
    r1 = np.minimum(r1, 4 * longest)
    spacing = np.where(between, np.where(np.isfinite(r2), r1 + r2, 1.0), waves)
    phase = 2 * np.pi * r1 / spacing
    fading = np.where(between, 1.0, np.clip(1.5 - r1 / waves, 0.0, 1.0))
    return fading * strengths * amplitude(spacing, field.compression.stretches[:, 1]) * np.cos(phase)
