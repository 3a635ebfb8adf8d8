"""Loss of a scan: measured points of a worn garment against the surface of the cloth, and how a scan is registered.

Each point q is compared with the nearest point c of the cloth, by |q - c|. No point tells where the cloth is too long:
so each edge of its border is compared with where the points end beside it.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Self

import igl
import numpy as np
from scipy.sparse import coo_array, csr_array, vstack
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from clothsim.base.arrays import Floats, Ints, as_points
from clothsim.base.errors import InputError
from clothsim.base.triangles import area_vectors, barycentric
from clothsim.files.meshes.mesh_file import NO_NORMALS
from clothsim.gradients.camera import Camera, Obstacle, PictureLoss, Residuals, by_vertices, checked_noise
from clothsim.mesh.refinement import refined
from clothsim.mesh.topology import border_edges

THINNED = 0.01
"""Side of the cells of which each has one point that is compared, over the size of the scan."""
ALIKE = 0.1
"""Size of a piece whose points err alike, over that of the scan."""
FACING = 0.5
"""Cosine between normals of a point and of the cloth below which the point is of another layer, or of none."""
FAR = 0.2
"""Median distance of the points from the cloth, over the size of the scan, from which it is refused."""
MISSING = 0.15
"""Distance within which the end of the scan is looked for at an edge of the border, over the size of the scan."""
STRIP, STEEP = 6.0, 0.35
"""Least width of the strip of an edge, in distances of neighbours, and how steeply its points may rise."""
MOST_POINTS = 50_000
"""Points by which the ends of a scan are looked for: of more a random part."""
BREAK = 14.0
"""Mean distances of neighbours along a strip at which its points break off: by chance one in e^14 does."""


@dataclass(frozen=True, eq=False)
class ScanSurface(PictureLoss):
    """Mean of rho(|q - c|/noise) over points q of a scan, rho the Huber function, and over hems, to where it ends.

    Parameters
    ----------
    points : (k, 3) array
        Of the garment alone [m].
    normals : (k, 3) array
        On the same side as those of the cloth (counter-clockwise triangles); a point on another layer is left out by
        its normal. Empty: all points count.
    noise : float
        Standard deviation of a point [m].
    huber : float
        Residual over the noise from which it counts less than its square.
    frame : int
        Number of the frame, below 0 from the last.
    refinements : int
        The surface is that of the cloth refined so many times (`mesh.refinement`).

    Examples
    --------
    >>> from clothsim.mesh.generators.shapes import sphere
    >>> ball, triangles = sphere(0.2, 2)
    >>> loss = ScanSurface(sphere(0.2, 4)[0])
    >>> small, large = (loss.evaluate(s * ball, triangles)[0] for s in (1.0, 1.05))
    >>> small < 0.1, large > 1.0
    (True, True)
    """

    points: Floats
    normals: Floats = field(default_factory=lambda: NO_NORMALS, repr=False)
    noise: float = 2e-3
    huber: float = 3.0
    frame: int = -1
    refinements: int = 1

    def checked(self) -> Self:
        """Return itself. InputError for points that cannot be compared."""
        checked_noise(self.noise, self.huber)
        points = as_points("The points of the scan", self.points)
        if len(points) < 4 or not self.size > 0.0:
            raise InputError(f"The scan has {len(points)} points, which make no surface.", "Give more of them.")
        if len(self.normals) and np.shape(self.normals) != points.shape:
            raise InputError(f"There are {len(points)} points and {len(self.normals)} normals.", "Give one for each.")
        return self

    @cached_property
    def size(self) -> float:
        """Largest extent of the points [m]."""
        return float(np.ptp(self.points, axis=0).max())

    @cached_property
    def compared(self) -> Ints:
        """Points that are compared: one in each cell."""
        cells = np.floor(self.points / (THINNED * self.size)).astype(np.int64)
        return np.sort(np.unique(cells, axis=0, return_index=True)[1])

    @cached_property
    def tree(self) -> tuple[cKDTree, float]:
        """Search tree of distinct points, at most MOST_POINTS, and the median distance between neighbours [m]."""
        distinct = np.unique(np.asarray(self.points, np.float64), axis=0)
        chosen = np.random.default_rng(0).permutation(len(distinct))[:MOST_POINTS]
        tree = cKDTree(distinct[chosen])
        return tree, float(np.median(tree.query(tree.data, k=2)[0][:, 1]))

    def residuals(self, positions: Floats, triangles: Ints) -> Residuals:
        """Return |q - c|/noise of the points, and then those of the border."""
        noise, huber = checked_noise(self.noise, self.huber)
        refinement, fine = refined(triangles, len(positions), self.refinements)
        x = np.asarray(refinement @ positions)
        rows = self.compared
        points = np.asarray(self.points, np.float64)[rows]
        squares, face, closest = igl.point_mesh_squared_distance(points, x, fine)
        away = float(np.sqrt(np.median(squares)))
        if not away < FAR * self.size:
            raise InputError(
                f"The scan is {self.size:.3g} m wide and lies {away:.3g} m from the cloth.",
                "Give its unit (scale), or points of the skin by which it is laid onto the body (skin).",
            )
        own = area_vectors(x[fine[face]])
        own /= np.linalg.norm(own, axis=1)[:, None]
        keep = np.arange(len(points))
        if len(self.normals):
            given = np.asarray(self.normals, np.float64)[rows]
            lengths = np.linalg.norm(given, axis=1)
            keep = np.flatnonzero((own * given).sum(axis=1) > FACING * lengths)
            if not len(keep):
                raise InputError(
                    "No normal of the scan agrees with that of the cloth there.", "Turn them round, or leave them out."
                )
        corners, q = fine[face[keep]], points[keep]
        weights = barycentric(x[corners], np.asarray(closest)[keep])
        surface = np.einsum("kp,kpc->kc", weights, x[corners])
        away = q - surface
        sizes = np.linalg.norm(away, axis=1)
        near = sizes < 1e-6 * noise
        directions = np.where(near[:, None], own[keep], away / np.where(near, 1.0, sizes)[:, None])
        entries = (weights.ravel(), (np.repeat(np.arange(len(keep)), 3), corners.ravel()))
        at = csr_array(coo_array(entries, shape=(len(keep), len(x))) @ refinement)
        hems = self._hems(x, fine, refinement)
        return Residuals(
            np.concatenate([sizes, hems.values]) / noise,
            csr_array(vstack([by_vertices(at, -directions), hems.jacobian]) / noise),
            np.concatenate([np.ones(len(keep)), hems.weights]),
            np.concatenate([self._blocks(q), hems.blocks]),
            huber,
            1.0 - len(keep) / len(points),
        )

    def _hems(self, x: Floats, fine: Ints, refinement: csr_array) -> Residuals:
        """How far the points go on beyond edges of the border [m], below 0 where they end before.

        The points on a strip about the outward direction t of an edge, from inside until they break off, end at u. They
        lie evenly there, so that the scan ends one mean distance of neighbours further. t and the last point are held.
        """
        ends, half = border_edges(fine)
        middles, along = x[ends].mean(axis=1), x[ends[:, 1]] - x[ends[:, 0]]
        lengths = np.linalg.norm(along, axis=1)
        along /= lengths[:, None]
        outward = middles - x[fine[half // 3, (half % 3 + 2) % 3]]
        outward -= (outward * along).sum(axis=1)[:, None] * along
        outward /= np.linalg.norm(outward, axis=1)[:, None]
        tree, spacing = self.tree
        density = np.log(2.0) / (np.pi * spacing**2)  # of which it is the median distance
        widths = np.maximum(lengths, STRIP * spacing)
        found = np.full(len(ends), np.nan)
        for k, near in enumerate(tree.query_ball_point(middles, MISSING * self.size)):
            away = tree.data[near] - middles[k]
            u, v, w = away @ outward[k], away @ along[k], away @ np.cross(along[k], outward[k])
            u = np.sort(u[(np.abs(v) < 0.5 * widths[k]) & (np.abs(w) < STEEP * np.abs(u) + 3.0 * spacing)])
            step = 1.0 / (density * widths[k])
            breaks = np.flatnonzero(np.diff(u) > BREAK * step)
            count = len(u) if not len(breaks) else int(breaks[0]) + 1
            if count > BREAK:
                found[k] = u[count - 1] + step
        rows = np.flatnonzero(np.isfinite(found))
        entries = (np.full(2 * len(rows), 0.5), (np.repeat(np.arange(len(rows)), 2), ends[rows].ravel()))
        at = csr_array(coo_array(entries, shape=(len(rows), len(x))) @ refinement)
        weights = lengths[rows] / (THINNED * self.size)
        jacobian = by_vertices(at, -outward[rows])
        return Residuals(found[rows], jacobian, weights, self._blocks(middles[rows]), self.huber)

    def _blocks(self, places: Floats) -> Ints:
        return np.floor(places / (ALIKE * self.size)).astype(np.int64)

    def camera(self, upright: int) -> Camera:
        """Return a camera that sees the points from their wider side; upright: the vertical axis."""
        low, high = np.min(self.points, axis=0), np.max(self.points, axis=0)
        level = [k for k in range(3) if k != upright]
        deep = min(level, key=lambda k: float(high[k] - low[k]))
        forward, down = np.zeros(3), np.zeros(3)
        forward[deep], down[upright] = 1.0, -1.0
        axes = np.array([np.cross(down, forward), down, forward])
        position = 0.5 * (low + high) - 3.0 * self.size * forward
        return Camera(480, 480, np.full(2, 1200.0), np.full(2, 239.5), axes, position)


# Registration of a scan: the rigid motion that lays its skin onto the bodies of the scene.
#
# Iterated closest points (Besl & McKay 1992) with the distance to the plane of the nearest triangle (Chen & Medioni
# 1992), from the pose as it is and from the 60 turns of an icosahedron: one lies within 45 degrees of any other.
# The farthest points are left out of each step.

COARSE, FINE = 300, 3000
"""Points of the skin with which the motion is searched for, and refined."""
SEARCH_STEPS, MOST_STEPS = 6, 60
"""Steps from each initial motion, and from the best ones."""
BEST = 3
"""Initial motions that are refined."""
KEPT = 0.9
"""Fraction of the points that a step goes by: the others are no skin, or of a part in another posture."""
CAPPED = 0.05
"""Largest distance of a point, over the size of the body, that counts where two motions are compared."""
STANDS = 1e-7
"""Motion in a step, over the size of the body, at which it ends."""
MOST_LEFT = 0.008
"""Median distance of the skin from the bodies, over their size, above which a scan is not registered."""


@dataclass(frozen=True, eq=False)
class Registration:
    """Rigid motion x R + t of points (k, 3), and what it leaves: median and mean capped distance of the skin [m]."""

    rotation: Floats
    translation: Floats
    distance: float
    misfit: float

    def moved(self, points: Floats) -> Floats:
        """Return points (k, 3) in the coordinates of the scene."""
        return np.asarray(points @ self.rotation + self.translation)

    @property
    def angle(self) -> float:
        """The angle of the rotation [rad]."""
        return float(np.arccos(np.clip(0.5 * (np.trace(self.rotation) - 1.0), -1.0, 1.0)))


def registered(skin: Floats, scan: Floats, body: Obstacle) -> Registration:
    """Return the rigid motion that lays the skin of a scan onto the bodies of a scene.

    Parameters
    ----------
    skin : (k, 3) float64
        Points on bare parts of the body: head, hands, legs [m].
    scan : (m, 3) float64
        All points of the scan, whose box is laid onto that of the bodies at first [m].
    body : Obstacle
        The bodies.

    Raises
    ------
    InputError
        Where the skin does not come to lie on the bodies, or there are none.
    """
    if not len(body.triangles):
        raise InputError("The scene has no body onto which the scan is laid.", "Leave skin out.")
    size = float(np.ptp(body.positions, axis=0).max())
    middle = 0.5 * (scan.min(axis=0) + scan.max(axis=0))
    centre = 0.5 * (body.positions.min(axis=0) + body.positions.max(axis=0))
    turns = Rotation.create_group("I").as_matrix()
    first = [(np.eye(3), np.zeros(3)), *((turn, centre - middle @ turn) for turn in turns)]
    some = skin[:: max(1, len(skin) // COARSE)]
    begun = sorted((_iterated(some, body, *pose, SEARCH_STEPS) for pose in first), key=lambda each: each.misfit)
    more = skin[:: max(1, len(skin) // FINE)]
    ends = [_iterated(more, body, each.rotation, each.translation, MOST_STEPS) for each in begun[:BEST]]
    best = min(ends, key=lambda each: each.misfit)
    if not best.distance < MOST_LEFT * size:
        raise InputError(
            f"The skin of the scan lies {best.distance:.3g} m from the body once it is laid onto it.",
            "Give its unit (scale), points of skin alone, and the body in the posture of the scan.",
        )
    return best


def _iterated(skin: Floats, body: Obstacle, rotation: Floats, translation: Floats, most: int) -> Registration:
    """Closest points and rigid motions in turn, from an initial motion."""
    planes = area_vectors(body.corners)
    planes /= np.maximum(np.linalg.norm(planes, axis=1), 1e-300)[:, None]
    size, distances = float(np.ptp(body.positions, axis=0).max()), np.zeros(0)
    for _ in range(most):
        at = skin @ rotation + translation
        squares, face, closest = igl.point_mesh_squared_distance(at, body.positions, body.triangles)
        distances = np.sqrt(squares)
        keep = np.argsort(squares, kind="stable")[: max(6, int(KEPT * len(at)))]
        turn, shift = igl.rigid_alignment(at[keep], np.asarray(closest)[keep], planes[face[keep]])
        turn, shift = np.asarray(turn), np.asarray(shift).ravel()
        rotation, translation = rotation @ turn, translation @ turn + shift
        if np.abs(at @ turn + shift - at).max() < STANDS * size:
            break
    misfit = float(np.minimum(distances, CAPPED * size).mean())
    return Registration(rotation, translation, float(np.median(distances)), misfit)
