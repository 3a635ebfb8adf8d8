"""Outline loss of a picture: the border of a mask against the contour of the cloth as a camera sees it.

The contour consists of the occluding edges, of which one triangle faces the camera and the other does not, and of the
edges of the border that are seen: hem, neckline and the end of a sleeve tell lengths. It counts where the cloth ends
in the picture: where a ray beside it meets no cloth. The mask's border is that of its smoothed indicator; where a body
in front of the cloth makes it, and next to the ends of such a piece (T-junctions), it is left out.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Self

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.sparse import coo_array, csr_array
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints, as_positive
from clothsim.base.errors import InputError
from clothsim.base.ray_casting import first_hits
from clothsim.gradients.camera import (
    Camera,
    Obstacle,
    PictureLoss,
    Residuals,
    as_mask,
    blocks_of,
    by_vertices,
    checked_noise,
)
from clothsim.mesh.refinement import refined
from clothsim.mesh.topology import border_edges, interior_edges

SMOOTHING = 1.0
"""Standard deviation of the Gaussian that smooths a mask [pixels]: a circle of radius R shrinks by 1/(2 R)."""
BESIDE = 1.0
"""How far beside the contour a ray decides whether the cloth ends there [pixels]."""
OUTSIDE, JUNCTION = 2.0, 4.0
"""How far outside of the mask's border a body is looked for, and what lies so near a piece made by it is left out."""
IN_FRONT = 6.0
"""How much nearer a body is where it is in front of the cloth, and not what the cloth lies on [pixels of its size]."""
WITHIN = 0.3
"""Fraction of the way from an edge into its triangle at which it must be seen."""
CANDIDATES = 4
"""Points of the contour of which the nearest to a point of the mask is taken, each moved along its edge."""
TURN = 10.0
"""Pixels that opposite normals count for, over 2, where the nearest point is looked for."""


@dataclass(frozen=True, eq=False)
class Contour:
    """Points of the contour of a cloth in a picture.

    Parameters
    ----------
    ends : (k, 2) int64
        Vertices of the edge of each point.
    along : (k,) float64
        Where on it, 0 to 1.
    points : (k, 3) float64
        [m].
    pixels, normals : (k, 2) float64
        Projection, and outward unit normal.
    lengths : (k,) float64
        Length of the contour that each stands for [pixels].
    """

    ends: Ints
    along: Floats
    points: Floats
    pixels: Floats
    normals: Floats
    lengths: Floats

    def taken(self, rows: Ints) -> "Contour":
        """Return some of the points."""
        return Contour(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


@dataclass(frozen=True, eq=False)
class Matches:
    """A correspondence that is held: points of the contour, and points of the mask's border with their normals."""

    ends: Ints
    along: Floats
    targets: Floats
    normals: Floats
    weights: Floats
    refinement: csr_array
    camera: Camera
    noise: float
    huber: float
    left_out: float

    def residuals(self, positions: Floats) -> Residuals:
        """Return n.(pi(x) - m)/noise at positions (n, 3) of the cloth."""
        k, fine = len(self.ends), self.refinement.shape[0]
        weights = np.column_stack([1.0 - self.along, self.along])
        entries = (weights.ravel(), (np.repeat(np.arange(k), 2), self.ends.ravel()))
        at = csr_array(coo_array(entries, shape=(k, fine)) @ self.refinement)
        points = at @ positions
        away = (self.normals * (self.camera.project(points) - self.targets)).sum(axis=1)
        by_points = np.einsum("kp,kpc->kc", self.normals, self.camera.jacobians(points)) / self.noise
        jacobian = by_vertices(at, by_points)
        return Residuals(away / self.noise, jacobian, self.weights, blocks_of(self.targets), self.huber, self.left_out)

    def switched(self, other: "Matches") -> float:
        """Return the fraction of correspondences that another one does not have, by edge and place in the picture."""
        own, others = (set(zip(*each.ends.T.tolist(), *each.targets.T.tolist(), strict=True)) for each in (self, other))
        return len(own ^ others) / max(len(own) + len(others), 1)


@dataclass(frozen=True, eq=False)
class MaskBorder(PictureLoss):
    """Mean of rho(n.(pi(x) - m)/noise) over a mask's border and over the cloth's contour, rho the Huber function.

    Each point m of the mask's border, with normal n, is compared with the nearest point x of the contour, and each
    point of the contour with the nearest m. "Nearest" counts a difference of normals as TURN pixels.

    Parameters
    ----------
    camera : Camera
        Of the picture.
    mask : (height, width) array
        True or 1 where the cloth, or the panels of a label, are seen.
    noise : float
        Standard deviation of the border [pixels].
    huber : float
        Residual over the noise from which it counts less than its square.
    frame : int
        Number of the frame, below 0 from the last.
    obstacle : Obstacle
        Bodies in front of and behind the cloth [m].
    label : (k,) int array
        Triangles of the cloth that the mask shows, as of a panel; empty: all.
    refinements : int
        The contour is that of the cloth refined so many times (`mesh.refinement`): a polygon's lies up to h^2/(8 R)
        inside.
    spacing : float
        Distance of its points [pixels].

    Examples
    --------
    >>> from clothsim.mesh.generators.shapes import sphere
    >>> ball, triangles = sphere(0.2, 3)
    >>> camera = Camera(160, 120, (200, 200), (79.5, 59.5), np.eye(3), (0, 0, -1))
    >>> v, u = np.indices((120, 160))
    >>> disc = np.hypot(u - 79.5, v - 59.5) < 200 * 0.2 / np.sqrt(1 - 0.2**2)
    >>> loss = MaskBorder(camera, disc)
    >>> small, large = (loss.evaluate(s * ball, triangles)[0] for s in (1.0, 1.05))
    >>> small < 0.1, large > 1.0
    (True, True)
    """

    camera: Camera
    mask: np.ndarray
    noise: float = 1.0
    huber: float = 3.0
    frame: int = -1
    obstacle: Obstacle = field(default_factory=Obstacle)
    label: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    refinements: int = 2
    spacing: float = 2.0

    def checked(self) -> Self:
        """Return itself. InputError for a mask that has no border."""
        checked_noise(self.noise, self.huber)
        _ = self.border
        return self

    def residuals(self, positions: Floats, triangles: Ints) -> Residuals:
        """Return n.(pi(x) - m)/noise of both ways."""
        return self.matched(positions, triangles).residuals(positions)

    def matched(self, positions: Floats, triangles: Ints) -> Matches:
        """Return the correspondence at positions (n, 3) of the cloth.

        InputError where the camera sees no contour of it.
        """
        noise, huber = checked_noise(self.noise, self.huber)
        contour, refinement = self.contour(positions, triangles)
        targets, normals, lengths = self.border
        order = cKDTree(np.column_stack([contour.pixels, TURN * contour.normals]))
        near = order.query(np.column_stack([targets, TURN * normals]), k=CANDIDATES)[1].clip(max=len(contour.ends) - 1)
        pixels = self.camera.project((refinement @ positions)[contour.ends.ravel()]).reshape(-1, 2, 2)
        places, squares = _nearest_along(pixels[near], targets[:, None])
        turns = ((contour.normals[near] - normals[:, None]) ** 2).sum(axis=2)
        best = np.arange(len(near)), np.argmin(squares + TURN**2 * turns, axis=1)
        nearest, along = near[best], places[best]
        ends = contour.ends[nearest]
        own = self._of_the_cloth(contour.points[nearest])
        tree = cKDTree(np.column_stack([targets, TURN * normals]))
        back = tree.query(np.column_stack([contour.pixels, TURN * contour.normals]))[1]
        returned = own[back]
        return Matches(
            np.concatenate([ends[own], contour.ends[returned]]),
            np.concatenate([along[own], contour.along[returned]]),
            np.concatenate([targets[own], targets[back[returned]]]),
            np.concatenate([normals[own], normals[back[returned]]]),
            np.concatenate([lengths[own], contour.lengths[returned]]),
            refinement,
            self.camera,
            noise,
            huber,
            1.0 - float(own.mean()),
        )

    @cached_property
    def border(self) -> tuple[Floats, Floats, Floats]:
        """Points of the smoothed mask's border, outward normals (k, 2), and the length each stands for [pixels]."""
        covered = as_mask("The mask", self.mask, (self.camera.width, self.camera.height))
        smooth = gaussian_filter(covered, SMOOTHING, mode="nearest") - 0.5
        down, right = np.gradient(smooth)
        points, normals = list[Floats](), list[Floats]()
        for step in ((0, 1), (1, 0)):
            beside = smooth[step[0] :, step[1] :]
            here = smooth[: beside.shape[0], : beside.shape[1]]
            v, u = np.nonzero((here > 0) != (beside > 0))
            t = here[v, u] / (here[v, u] - beside[v, u])
            points.append(np.column_stack([u + step[1] * t, v + step[0] * t]))
            slopes = [(1 - t) * each[v, u] + t * each[v + step[0], u + step[1]] for each in (right, down)]
            normals.append(-np.column_stack(slopes))
        outward = np.concatenate(normals)
        sizes = np.linalg.norm(outward, axis=1)
        if not len(sizes) or not sizes.max() > 0.0:
            raise InputError("The mask has no border: its specks are smaller than a pixel.", "Segment the cloth.")
        sloped = sizes > 1e-6
        outward = outward[sloped] / sizes[sloped, None]
        # a line crosses |n_x| + |n_y| edges of the grid of pixels on each pixel of its length
        return np.concatenate(points)[sloped], outward, 1.0 / np.abs(outward).sum(axis=1)

    def contour(self, positions: Floats, triangles: Ints) -> tuple[Contour, csr_array]:
        """Return the contour at positions (n, 3), and the refined vertices as combinations of the cloth's.

        InputError where the camera sees none.
        """
        refinement, fine = refined(triangles, len(positions), self.refinements)
        x = np.asarray(refinement @ positions)
        count = len(triangles)
        label, pieces = np.asarray(self.label, np.int64), 4**self.refinements
        if not len(label):
            own = np.arange(count * pieces)
        else:
            if label.min() < 0 or label.max() >= count:
                raise InputError(f"The label names triangle {label.max()}, and the cloth has {count}.")
            own = (pieces * np.unique(label)[:, None] + np.arange(pieces)).ravel()
        ends, tips = _edges(x, fine[own], self.camera.position)
        # points on edges, none of them seen yet, and the tips (k, 2) of the triangles at each
        spacing = as_positive("spacing", self.spacing)
        pixels = self.camera.project(x[ends.ravel()]).reshape(-1, 2, 2)
        along_edge = pixels[:, 1] - pixels[:, 0]
        lengths = np.linalg.norm(along_edge, axis=1)
        counts = np.maximum(np.ceil(lengths / spacing).astype(np.int64), 1)
        normals = np.column_stack([along_edge[:, 1], -along_edge[:, 0]]) / np.maximum(lengths, 1e-12)[:, None]
        inward = self.camera.project(x[tips[:, 0]]) - pixels[:, 0]
        normals *= -np.sign((inward * normals).sum(axis=1))[:, None]
        edge = np.repeat(np.arange(len(ends)), counts)
        number = np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts)
        along = (number + 0.5) / counts[edge]
        points = (1 - along)[:, None] * x[ends[edge, 0]] + along[:, None] * x[ends[edge, 1]]
        pixels = self.camera.project(points)
        found = Contour(ends[edge], along, points, pixels, normals[edge], (lengths / counts)[edge])
        corners = np.concatenate([x[fine], self.obstacle.corners])
        is_own = np.zeros(len(corners), bool)
        is_own[own] = True
        inner = (1.0 - WITHIN) * found.points[:, None] + WITHIN * x[tips[edge]]
        tolerance = 0.25 * float(np.linalg.norm(x[fine[:, 1]] - x[fine[:, 0]], axis=1).mean())
        n, eye = len(inner), self.camera.position
        into = (inner - eye).transpose(1, 0, 2).reshape(-1, 3)
        beside = self.camera.rays(found.pixels + BESIDE * found.normals)
        hits = first_hits(corners, eye, np.concatenate([into, beside]))
        reached = hits.distance[: 2 * n] > np.linalg.norm(into, axis=1) - tolerance
        seen = reached[:n] | reached[n:]
        nearer = hits.distance[2 * n :] < self._in_front_of(found.points)
        covered = (hits.triangle[2 * n :] >= 0) & is_own[hits.triangle[2 * n :]]
        u, v = found.pixels.T
        inside = (u > -0.5) & (u < self.camera.width - 0.5) & (v > -0.5) & (v < self.camera.height - 0.5)
        visible = np.flatnonzero(seen & ~covered & ~nearer & inside)
        if not len(visible):
            raise InputError("The camera sees no contour of the cloth.", "Check its pose, and what is in front.")
        return found.taken(visible), refinement

    def _in_front_of(self, points: Floats) -> Floats:
        """Distance to the camera below which something is in front of points (k, 3), not only beside them, (k,) [m]."""
        away = np.linalg.norm(points - self.camera.position, axis=1)
        return np.asarray(away * (1.0 - IN_FRONT / self.camera.focal.min()))

    def _of_the_cloth(self, nearest: Floats) -> np.ndarray:
        """Points of the mask's border that no body in front makes, given the contour's points (k, 3) next to them."""
        targets, normals, _ = self.border
        own = np.ones(len(targets), bool)
        if not len(self.obstacle.triangles):
            return own
        rays = self.camera.rays(targets + OUTSIDE * normals)
        beyond = first_hits(self.obstacle.corners, self.camera.position, rays).distance
        made = beyond < self._in_front_of(nearest)
        if made.any():
            own = cKDTree(targets[made]).query(targets)[0] > JUNCTION
        if not own.any():
            raise InputError("All of the mask's border belongs to a body in front.", "Check the pose of the camera.")
        return own


def _edges(x: Floats, triangles: Ints, eye: Floats) -> tuple[Ints, Ints]:
    """Ends (k, 2) of occluding edges and of the border, and the tips (k, 2) of the triangles there."""
    a, b, c = (x[triangles[:, k]] for k in range(3))
    towards = (np.cross(b - a, c - a) * (eye - a)).sum(axis=1) > 0
    hinges, pairs = interior_edges(triangles)
    turned = towards[pairs[:, 0]] != towards[pairs[:, 1]]
    border, half = border_edges(triangles)
    tips = triangles[half // 3, (half % 3 + 2) % 3]
    ends = np.concatenate([hinges[turned, :2], border])
    return ends, np.concatenate([hinges[turned, 2:], np.column_stack([tips, tips])])


def _nearest_along(ends: Floats, targets: Floats) -> tuple[Floats, Floats]:
    """Parameters of the points of segments (..., 2, 2) nearest to targets (..., 2), and their squared distances."""
    edge = ends[..., 1, :] - ends[..., 0, :]
    squares = np.maximum((edge**2).sum(axis=-1), 1e-24)
    along = np.clip(((targets - ends[..., 0, :]) * edge).sum(axis=-1) / squares, 0.0, 1.0)
    away = ends[..., 0, :] + along[..., None] * edge - targets
    return along, (away**2).sum(axis=-1)
