"""Geometric checks of positions: over a point, across a plane, above other cloth."""

from collections.abc import Iterator, Sequence

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.run.results import Run
from tests.hard_cases.case import Check


def frames(run: Run) -> Iterator[Floats]:
    """The cloth's vertices (n, 3) [m] of every frame."""
    return (run.positions(frame) for frame in range(len(run.times)))


def heights(points: Floats, positions: Floats, triangles: Ints) -> Floats:
    """z of each of `triangles` (m, 3) straight over or under each of `points` (p, 3): (p, m) [m], NaN beside it."""
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    e, f = (b - a)[:, :2], (c - a)[:, :2]
    r = points[:, None, :2] - a[:, :2]
    twice = e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        v = (r[..., 0] * f[:, 1] - r[..., 1] * f[:, 0]) / twice
        w = (e[:, 0] * r[..., 1] - e[:, 1] * r[..., 0]) / twice
        z = a[:, 2] + v * (b - a)[:, 2] + w * (c - a)[:, 2]
    return np.asarray(np.where((v >= 0) & (w >= 0) & (v + w <= 1), z, np.nan), np.float64)


def cut(positions: Floats, triangles: Ints, axis: int, place: float) -> Floats:
    """The points (k, 3) [m] where the triangles' edges cross the plane x[axis] = place."""
    ends = positions[triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)] - place * np.eye(3)[axis]
    side = ends[:, :, axis]
    ends = ends[side[:, 0] * side[:, 1] < 0]
    fraction = ends[:, 0, axis] / (ends[:, 0, axis] - ends[:, 1, axis])
    return np.asarray(ends[:, 0] + fraction[:, None] * (ends[:, 1] - ends[:, 0]) + place * np.eye(3)[axis])


def ways_out(positions: Floats, triangles: Ints, radius: float) -> Floats:
    """z [m] where each of the triangles' edges (3 m,) goes out of the cylinder of `radius` [m] about the z axis.

    NaN for an edge that has not one end in it and one outside.
    """
    ends = positions[triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)]
    inner = (ends[:, :, :2] ** 2).sum(axis=2).argmin(axis=1)
    rows = np.arange(len(ends))
    start, way = ends[rows, inner], ends[rows, 1 - inner] - ends[rows, inner]
    a, b = ((way * other)[:, :2].sum(axis=1) for other in (way, start))
    c = (start[:, :2] ** 2).sum(axis=1) - radius**2
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = (np.sqrt(b**2 - a * c) - b) / a  # |start + fraction way| = radius; c < 0: the other root is behind
        return np.asarray(np.where((c < 0) & (fraction <= 1), start[:, 2] + fraction * way[:, 2], np.nan), np.float64)


def over_edges(places: Sequence[float], top: float, foot: float) -> Check:
    """In no frame does cloth cross one of the upright walls x = `places` between `foot` and their `top` edge [m]."""

    def check(run: Run) -> str:
        for time, x in zip(run.times, frames(run), strict=True):
            for place in places:
                z = cut(x, run.triangles, 0, place)[:, 2]
                if ((z > foot) & (z < top)).any():
                    return (
                        f"at {time:.3g} s the cloth crosses the edge at x = {place:.3g} m, {top - z.min():.2g} m deep"
                    )
        return ""

    return check


def over_needles(run: Run) -> str:
    """In no frame does one of the bodies, upright needles all, go through the cloth between its foot and its tip."""
    needles = [points[points[:, 2].argsort()[[-1, 0]]] for _, points, _ in run.bodies(0)]
    tips, feet = (np.array([needle[k] for needle in needles]) for k in (0, 1))
    for time, x in zip(run.times, frames(run), strict=True):
        z = heights(tips, x, run.triangles)
        pierced = ((z > feet[:, 2:]) & (z < tips[:, 2:])).any(axis=1)
        if pierced.any():
            return f"at {time:.3g} s needle {int(pierced.argmax())} is through the cloth"
    return ""


def over_plane(height: float) -> Check:
    """In no frame is a vertex at or below `height` [m]."""

    def check(run: Run) -> str:
        lowest = min(float(x[:, 2].min()) for x in frames(run))
        return f"a vertex is {height - lowest:.2g} m below the plate" if lowest <= height else ""

    return check
