"""Losses of normals and depths in a picture: pixels of the cloth against the surface that their rays meet.

The ray of a pixel is fixed, so that the point that it meets slides on the surface as the cloth moves: a triangle with
corners x, normal m and the ray d (one unit deep) has the depth t = m.(x_0 - C)/(m.d), and dt = m.(sum w dx)/(m.d). Its
barycentric coordinates w change with the slip d dt - sum w dx. Only where another layer comes into a ray, or leaves it,
is the loss not continuous.
"""

import abc
from dataclasses import dataclass, field
from functools import cached_property
from typing import Self

import numpy as np
from scipy.ndimage import binary_erosion
from scipy.sparse import coo_array, csr_array, eye_array, kron

from clothsim.base.arrays import Floats, Ints, as_positive
from clothsim.base.errors import InputError
from clothsim.base.ray_casting import first_hits
from clothsim.base.triangles import area_vectors, barycentric
from clothsim.gradients.camera import Camera, Obstacle, PictureLoss, Residuals, blocks_of, checked_noise
from clothsim.mesh.refinement import refined

GATE = np.cos(np.radians(60.0))
"""Cosine between a measured and a simulated normal below which they are of different folds, and have no residual."""
MARGIN = 5
"""Pixels next to the border of what was measured that are not compared: they tell what the mask's border tells, and
come into and leave the cloth as it moves."""
EDGE_ON = 0.05
"""Cosine between ray and triangle below which a pixel has no residual."""


@dataclass(frozen=True, eq=False)
class PixelHits:
    """Where the rays of some pixels meet the cloth.

    Parameters
    ----------
    corners : (k, 3) int64
        Vertices of the refined mesh at the triangle of each.
    weights : (k, 3) float64
        Barycentric coordinates.
    rays : (k, 3) float64
        Directions, one unit deep.
    x : (n, 3) float64
        Positions of the refined mesh [m].
    triangles : (m, 3) int64
        Its triangles.
    refinement : (3 n, 3 n_cloth) sparse
        Its coordinates as combinations of those of the cloth.
    """

    corners: Ints
    weights: Floats
    rays: Floats
    x: Floats
    triangles: Ints
    refinement: csr_array

    @cached_property
    def planes(self) -> Floats:
        """Normals of the triangles, twice their area long, (k, 3) [m2]."""
        return area_vectors(self.x[self.corners])

    @cached_property
    def depth_slopes(self) -> Floats:
        """Derivative of the depth by the corners, (k, 3, 3)."""
        across = (self.planes * self.rays).sum(axis=1)
        return self.weights[:, :, None] * (self.planes / across[:, None])[:, None, :]

    @cached_property
    def slides(self) -> Floats:
        """Derivative of the barycentric coordinates by the corners, (k, 3, 3, 3): coordinate, corner, axis."""
        corners = self.x[self.corners]
        opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
        rises = np.cross(self.planes[:, None, :], opposite) / (self.planes**2).sum(axis=1)[:, None, None]
        along = (rises * self.rays[:, None, :]).sum(axis=2)
        own = rises[:, :, None, :] * self.weights[:, None, :, None]
        return along[:, :, None, None] * self.depth_slopes[:, None, :, :] - own

    def by_corners(self, slopes: Floats) -> csr_array:
        """Return derivatives (k r, 3 n_cloth) of r numbers a pixel from those by its corners, (k, r, 3, 3)."""
        k, r = slopes.shape[:2]
        columns = np.broadcast_to(3 * self.corners[:, None, :, None] + np.arange(3), slopes.shape)
        rows = np.broadcast_to(np.arange(k * r).reshape(k, r, 1, 1), slopes.shape)
        entries = (slopes.ravel(), (rows.ravel(), columns.ravel()))
        return csr_array(coo_array(entries, shape=(k * r, self.x.size)) @ self.refinement)

    def normals(self) -> tuple[Floats, csr_array]:
        """Return the interpolated vertex normals (k, 3), on the side of the camera, and their derivatives (3 k, ...).

        The normal of a vertex is that of the sum of the vector areas of its triangles.
        """
        used = np.unique(self.corners)
        number = np.full(len(self.x), -1)
        number[used] = np.arange(len(used))
        near = self.triangles[(number[self.triangles] >= 0).any(axis=1)]
        areas = area_vectors(self.x[near])
        sums = np.zeros((len(used), 3))
        for k in range(3):
            own = number[near[:, k]] >= 0
            np.add.at(sums, number[near[own, k]], areas[own])
        lengths = np.linalg.norm(sums, axis=1)
        units = sums / lengths[:, None]
        by_area = (np.eye(3) - units[:, :, None] * units[:, None, :]) / lengths[:, None, None]
        own_units = units[number[self.corners]]
        q = (self.weights[:, :, None] * own_units).sum(axis=1)
        sizes = np.linalg.norm(q, axis=1)
        sign = -np.sign((q * self.rays).sum(axis=1))
        n = q / sizes[:, None]
        across = (sign / sizes)[:, None, None] * (np.eye(3) - n[:, :, None] * n[:, None, :])
        slid = self.by_corners(np.einsum("kij,kcj,kcda->kida", across, own_units, self.slides))
        turned = np.einsum("kij,kc,kcjl->kcil", across, self.weights, by_area[number[self.corners]])
        # a sparse matrix (3 k, 3 used) of blocks (k, c, 3, 3) in columns (k, c)
        size = len(turned)
        rows = 3 * np.arange(size)[:, None, None, None] + np.arange(3)[:, None]
        places = 3 * number[self.corners][:, :, None, None] + np.arange(3)
        r, c, v = np.broadcast_arrays(rows, places, turned)
        blocks = csr_array(coo_array((v.ravel(), (r.ravel(), c.ravel())), shape=(3 * size, 3 * len(used))))
        # derivatives (3 used, 3 n) of the sums of the vector areas about vertices: [c - b]_x of the corner a
        at = self.x[near]
        edges = np.roll(at, -2, axis=1) - np.roll(at, -1, axis=1)
        x, y, z = (edges[:, :, k] for k in range(3))
        zero = np.zeros_like(x)
        crosses = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=2).reshape(len(near), 3, 3, 3)
        total = csr_array((3 * len(used), self.x.size))
        for k in range(3):
            seen = np.flatnonzero(number[near[:, k]] >= 0)
            rows = 3 * number[near[seen, k]][:, None, None, None] + np.arange(3)[:, None]
            columns = 3 * near[seen][:, :, None, None] + np.arange(3)
            both = np.broadcast_arrays(rows, columns, crosses[seen])
            total = total + csr_array(
                coo_array((both[2].ravel(), (both[0].ravel(), both[1].ravel())), shape=total.shape)
            )
        return sign[:, None] * n, csr_array(slid + blocks @ (total @ self.refinement))


@dataclass(frozen=True, eq=False)
class _OfPixels(PictureLoss):
    """Mean of the Huber function of residuals of pixels, every `step`-th of a row and of a column.

    camera, huber, frame, obstacle, refinements: as of `MaskBorder`.
    """

    camera: Camera
    measured: Floats
    noise: float
    huber: float = 3.0
    frame: int = -1
    obstacle: Obstacle = field(default_factory=Obstacle)
    refinements: int = 1
    step: int = 6

    @abc.abstractmethod
    def _checked(self) -> tuple[Floats, np.ndarray]:
        """The picture, and where it has values, (height, width)."""

    @abc.abstractmethod
    def _compared(self, met: PixelHits, values: Floats, depths: Floats) -> tuple[Floats, csr_array, np.ndarray]:
        """Residuals (k, r) over the noise, their derivatives (k r, 3 n), and which of the k pixels count."""

    def checked(self) -> Self:
        """Return itself. InputError for a picture that cannot be compared."""
        checked_noise(self.noise, self.huber)
        self._checked()
        return self

    def residuals(self, positions: Floats, triangles: Ints) -> Residuals:
        """Return the residuals of the pixels whose rays meet the cloth first."""
        _, huber = checked_noise(self.noise, self.huber)
        picture, valid = self._checked()
        step = int(as_positive("step", self.step))
        v, u = np.nonzero(binary_erosion(valid, iterations=MARGIN, border_value=1))
        chosen = (v % step == step // 2) & (u % step == step // 2)
        u, v = u[chosen], v[chosen]
        if not len(u):
            raise InputError("No pixel of the picture is compared.", "Make its step shorter, or check the mask.")
        refinement, fine = refined(triangles, len(positions), self.refinements)
        x = np.asarray(refinement @ positions)
        rays = self.camera.rays(np.column_stack([u, v]))
        hits = first_hits(np.concatenate([x[fine], self.obstacle.corners]), self.camera.position, rays)
        met = np.flatnonzero((hits.triangle >= 0) & (hits.triangle < len(fine)))
        corners = fine[hits.triangle[met]]
        planes = area_vectors(x[corners])
        sizes = np.linalg.norm(planes, axis=1) * np.linalg.norm(rays[met], axis=1)
        facing = np.abs((planes * rays[met]).sum(axis=1)) > EDGE_ON * sizes
        met, corners, planes = met[facing], corners[facing], planes[facing]
        if not len(met):
            raise InputError("No ray of the picture meets the cloth.", "Check the camera's pose and the start.")
        # double precision: the point of the plane of the triangle that embree found
        depths = (planes * (x[corners[:, 0]] - self.camera.position)).sum(axis=1) / (planes * rays[met]).sum(axis=1)
        points = self.camera.position + depths[:, None] * rays[met]
        weights = barycentric(x[corners], points)
        full = csr_array(kron(refinement, eye_array(3)))
        surface = PixelHits(corners, weights, rays[met], x, fine, full)
        values, slopes, counted = self._compared(surface, picture[v[met], u[met]], depths)
        rows = np.flatnonzero(counted)
        if not len(rows):
            raise InputError(
                "No pixel agrees with the cloth to 60 degrees.", "Turn the normals round: x right, y down."
            )
        r = values.shape[1]
        lines = (r * rows[:, None] + np.arange(r)).ravel()
        pixels = np.repeat(np.column_stack([u, v])[met[rows]].astype(np.float64), r, axis=0)
        left_out = 1.0 - len(rows) / len(u)
        blocks, ones = blocks_of(pixels), np.ones(len(lines))
        return Residuals(values[rows].ravel(), csr_array(slopes[lines]), ones, blocks, huber, left_out)


@dataclass(frozen=True, eq=False)
class Normals(_OfPixels):
    """Mean of rho((n - m)/noise) over the components of normals: simulated n, measured m in the camera's axes.

    Parameters
    ----------
    camera : Camera
        Of the picture.
    measured : (height, width, 3) array
        Normals in the axes right, down and forward, towards the camera (the third is negative); 0 or nan where there is
        none, as outside of the mask.
    noise : float
        Standard deviation of their direction [degrees].
    huber, frame, obstacle, refinements
        As of `MaskBorder`.
    step : int
        Every so many pixels of a row and of a column are compared.

    Notes
    -----
    A pixel whose normals are more than 60 degrees apart sees another fold, and is left out.
    """

    noise: float = 5.0

    def _checked(self) -> tuple[Floats, np.ndarray]:
        given = np.asarray(self.measured, np.float64)
        if given.shape != (self.camera.height, self.camera.width, 3):
            raise InputError(
                f"The normals have the shape {given.shape}, the camera {self.camera.width} x {self.camera.height} "
                "pixels.",
                "Give an array (height, width, 3).",
            )
        sizes = np.linalg.norm(np.nan_to_num(given), axis=2)
        valid = sizes > 0.0
        if not valid.any():
            raise InputError("The picture has no normals.", "Give unit vectors where the cloth is seen.")
        return given / np.where(valid, sizes, 1.0)[:, :, None], valid

    def _compared(self, met: PixelHits, values: Floats, depths: Floats) -> tuple[Floats, csr_array, np.ndarray]:
        found, slopes = met.normals()
        wanted = values @ self.camera.rotation
        noise = np.radians(self.noise)
        return (found - wanted) / noise, slopes / noise, (found * wanted).sum(axis=1) > GATE


@dataclass(frozen=True, eq=False)
class Depth(_OfPixels):
    """Mean of rho((t - z)/noise) over pixels: t the depth of the cloth along the camera's axis, z the measured one.

    Parameters
    ----------
    camera : Camera
        Of the picture.
    measured : (height, width) array
        Depths along the axis [m]; 0, inf or nan where there is none, as outside of the mask.
    noise : float
        Their standard deviation [m].
    huber, frame, obstacle, refinements, step
        As of `Normals`.
    """

    noise: float = 5e-3

    def _checked(self) -> tuple[Floats, np.ndarray]:
        given = np.asarray(self.measured, np.float64)
        if given.shape != (self.camera.height, self.camera.width):
            raise InputError(
                f"The depths have the shape {given.shape}, the camera {self.camera.width} x {self.camera.height} "
                "pixels.",
                "Give an array (height, width).",
            )
        valid = np.isfinite(given) & (given > 0.0)
        if not valid.any():
            raise InputError("The picture has no depths.", "Give metres in front of the camera.")
        return given, valid

    def _compared(self, met: PixelHits, values: Floats, depths: Floats) -> tuple[Floats, csr_array, np.ndarray]:
        slopes = met.by_corners(met.depth_slopes[:, None] / self.noise)
        return ((depths - values) / self.noise)[:, None], slopes, np.ones(len(values), bool)
