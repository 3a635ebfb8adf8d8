"""Pinhole camera of a calibrated picture, and losses of pictures: of key points that are seen in one, for example."""

import abc
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array, csr_array

from clothsim.base.arrays import Floats, Ints, as_finite, as_points, as_positive, as_vector
from clothsim.base.errors import InputError
from clothsim.gradients.losses import Loss

ORTHONORMAL = 1e-6
"""Largest entry of R R' - I of a rotation."""
COLMAP = {"SIMPLE_PINHOLE": 3, "PINHOLE": 4}
"""Models of COLMAP that are read, and their numbers of parameters: SIMPLE_RADIAL, its default, has 4 too."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera with the conventions of OpenCV.

    x = R (X - C), u = f_x x/z + c_x, v = f_y y/z + c_y: the camera looks along +z, x to the right, y down; the centre
    of the first pixel, on top to the left, is at (0, 0). A picture has no distortion: undistort it before.

    Parameters
    ----------
    width, height : int
        Size of the picture [pixels].
    focal : (2,) array_like
        f_x and f_y [pixels].
    principal : (2,) array_like
        c_x and c_y [pixels].
    rotation : (3, 3) array_like
        R, from the scene to the camera.
    position : (3,) array_like
        C [m].

    Raises
    ------
    InputError
        For a rotation that is none, or a size or focal length that is not positive.

    Examples
    --------
    A point 2 m in front of a camera at the origin that looks along z:

    >>> camera = Camera(640, 480, (500, 500), (319.5, 239.5), [[1, 0, 0], [0, 1, 0], [0, 0, 1]], (0, 0, 0))
    >>> camera.project([[0.2, -0.1, 2.0]]).tolist()
    [[369.5, 214.5]]
    """

    width: int
    height: int
    focal: Floats
    principal: Floats
    rotation: Floats
    position: Floats

    def __post_init__(self) -> None:
        for name, count in (("focal", 2), ("principal", 2), ("position", 3)):
            value = as_finite(name, getattr(self, name))
            if value.shape != (count,):
                raise InputError(f"Camera.{name} has the shape {value.shape}.", f"Give {count} numbers.")
            object.__setattr__(self, name, value)
        rotation = as_finite("rotation", self.rotation)
        square = rotation.shape == (3, 3)
        if not square or np.abs(rotation @ rotation.T - np.eye(3)).max() > ORTHONORMAL or np.linalg.det(rotation) < 0:
            raise InputError(
                "Camera.rotation is not a rotation matrix.", "Its rows are the axes right, down and forward."
            )
        object.__setattr__(self, "rotation", rotation)
        least = min(as_positive("Camera.width", self.width), as_positive("Camera.height", self.height))
        if least < 1 or not self.focal.min() > 0.0:
            raise InputError("Camera has a size or a focal length that is not positive.", "Give both in pixels.")

    @classmethod
    def of_colmap(
        cls, model: str, width: int, height: int, params: ArrayLike, quaternion: ArrayLike, translation: ArrayLike
    ) -> Self:
        """Return the camera of COLMAP's models SIMPLE_PINHOLE (f, cx, cy) and PINHOLE (fx, fy, cx, cy).

        model, size and params of cameras.txt, quaternion (w, x, y, z) and translation t of images.txt, x = R X + t; its
        first pixel is centred at (0.5, 0.5). InputError for a model with distortion, as SIMPLE_RADIAL.
        """
        numbers = as_finite("params", params)
        if model not in COLMAP:
            raise InputError(
                f"COLMAP's model {model!r} is not read, {' and '.join(COLMAP)} are.",
                "Undistort the pictures: image_undistorter.",
            )
        if numbers.shape != (COLMAP[model],):
            raise InputError(f"params has the shape {numbers.shape}.", f"{model} has {COLMAP[model]} of them.")
        fx, fy, cx, cy = numbers if len(numbers) == 4 else (numbers[0], *numbers)
        q = as_finite("quaternion", quaternion)
        if q.shape != (4,) or not q.any():
            raise InputError("The quaternion is not (w, x, y, z).", "Give QW, QX, QY, QZ of images.txt.")
        w, (x, y, z) = q[0] / np.linalg.norm(q), q[1:] / np.linalg.norm(q)
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        rotation = np.eye(3) + 2 * w * cross + 2 * cross @ cross
        position = -rotation.T @ as_vector("translation", translation)
        return cls(width, height, np.array([fx, fy]), np.array([cx, cy]) - 0.5, rotation, position)

    @classmethod
    def of_blender(cls, width: int, height: int, field_of_view: float, matrix_world: ArrayLike) -> Self:
        """Return a camera of Blender: angle of the longer side [rad], square pixels, no shift, matrix_world (4, 4)."""
        matrix = as_finite("matrix_world", matrix_world)
        if matrix.shape != (4, 4):
            raise InputError(f"matrix_world has the shape {matrix.shape}.", "Give the (4, 4) of the camera object.")
        axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
        f = 0.5 * max(width, height) / np.tan(0.5 * field_of_view)
        centre = 0.5 * np.array([width, height]) - 0.5
        axes = axes * np.array([1.0, -1.0, -1.0])
        return cls(width, height, np.array([f, f]), centre, axes.T, matrix[:3, 3])

    def in_camera(self, points: ArrayLike) -> Floats:
        """Return R (X - C) of points (n, 3) [m]."""
        return np.asarray((as_points("points", points) - self.position) @ self.rotation.T, np.float64)

    def project(self, points: ArrayLike) -> Floats:
        """Return the pixels (n, 2) of points (n, 3) [m]. InputError for one that is not in front of the camera."""
        local = self.in_camera(points)
        if len(local) and not local[:, 2].min() > 0.0:
            raise InputError(f"Point {int(local[:, 2].argmin())} is not in front of the camera.", "Check its pose.")
        return np.asarray(self.focal * local[:, :2] / local[:, 2:] + self.principal, np.float64)

    def rays(self, pixels: ArrayLike) -> Floats:
        """Return the directions (k, 3) from the camera through pixels (k, 2), one unit deep each."""
        local = (np.asarray(pixels, np.float64) - self.principal) / self.focal
        return np.asarray(np.column_stack([local, np.ones(len(local))]) @ self.rotation, np.float64)

    def jacobians(self, points: ArrayLike) -> Floats:
        """Return the derivatives of `project` by the points, (n, 2, 3) [pixels/m]."""
        local = self.in_camera(points)
        out = np.zeros((len(local), 2, 3))
        for k, f in enumerate(self.focal):
            out[:, k, k] = f / local[:, 2]
            out[:, k, 2] = -f * local[:, k] / local[:, 2] ** 2
        return np.asarray(out @ self.rotation, np.float64)


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals of a picture with their correspondence held.

    Parameters
    ----------
    values : (k,) float64
        Residuals over their noise.
    jacobian : (k, 3 n) sparse float64
        Derivatives by the coordinates of the cloth's vertices, x, y, z of the first one first [1/m].
    weights : (k,) float64
        How many independent measurements each counts for.
    blocks : (k, 2) or (k, 3) int64
        Piece of the picture, or of the scan, in which it lies: measurements of one err alike.
    huber : float
        Residual beyond which rho(r) = r^2/2 goes on as a straight line.
    left_out : float
        Share of the picture's measurements that have no residual, or none with a derivative.
    """

    values: Floats
    jacobian: csr_array
    weights: Floats
    blocks: Ints
    huber: float
    left_out: float = 0.0

    @property
    def costs(self) -> Floats:
        """rho of each, (k,)."""
        sizes = np.abs(self.values)
        return np.where(sizes <= self.huber, 0.5 * sizes**2, self.huber * (sizes - 0.5 * self.huber))

    @property
    def slopes(self) -> Floats:
        """rho'(r) of each, (k,)."""
        return np.clip(self.values, -self.huber, self.huber)

    @property
    def curvatures(self) -> Floats:
        """Weight of the square of each in Gauss and Newton's Hessian: less beyond `huber`, (k,)."""
        return self.weights * np.minimum(1.0, self.huber / np.maximum(np.abs(self.values), 1e-12))

    @property
    def mean(self) -> float:
        """Weighed mean of rho."""
        return float(self.weights @ self.costs / self.weights.sum())

    def mean_derivative(self) -> Floats:
        """Return the derivative of `mean` by the vertices, (n, 3), weights held."""
        return np.asarray(self.jacobian.T @ (self.weights * self.slopes / self.weights.sum())).reshape(-1, 3)


BLOCK = 40
"""Side of a block of pixels that err alike."""


def blocks_of(pixels: Floats) -> Ints:
    """Return the block of each of some pixels, (k, 2)."""
    return np.floor(pixels / BLOCK).astype(np.int64)


def by_vertices(weights: csr_array, by_points: Floats) -> csr_array:
    """Return derivatives by vertices (k, 3 n) of numbers with derivatives (k, 3) by points that are `weights @ x`."""
    entries = weights.tocoo()
    columns = (3 * entries.col[:, None] + np.arange(3)).ravel()
    values = (entries.data[:, None] * by_points[entries.row]).ravel()
    return csr_array(
        coo_array((values, (np.repeat(entries.row, 3), columns)), shape=(weights.shape[0], 3 * weights.shape[1]))
    )


@dataclass(frozen=True, eq=False)
class Obstacle:
    """Positions (n, 3) [m] and triangles (m, 3) of what may hide the cloth: the body."""

    positions: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    triangles: Ints = field(default_factory=lambda: np.zeros((0, 3), np.int64))

    @property
    def corners(self) -> Floats:
        """Corners of the triangles (m, 3, 3) [m]."""
        return self.positions[self.triangles]


class PictureLoss(Loss):
    """Weighed mean of the Huber function of residuals over their noise."""

    @abc.abstractmethod
    def residuals(self, positions: Floats, triangles: Ints) -> Residuals:
        """Return the residuals at positions (n, 3) [m], with a correspondence of their own."""

    def evaluate(self, positions: Floats, triangles: Ints) -> tuple[float, Floats]:
        """Return the mean, and its derivative with the correspondence held (envelope theorem)."""
        found = self.residuals(positions, triangles)
        return found.mean, found.mean_derivative()


def checked_noise(noise: float, huber: float) -> tuple[float, float]:
    """Return both as positive numbers. InputError for another."""
    return as_positive("noise", noise), as_positive("huber", huber)


def as_mask(name: str, mask: np.ndarray, size: tuple[int, int]) -> Floats:
    """Return how much of each pixel is covered, (height, width), 0 to 1, of a mask of True and False or 0 to 1.

    InputError for one of another size (width, height), one without a border, and numbers beyond.
    """
    given = np.asarray(mask)
    if given.shape != size[::-1]:
        raise InputError(
            f"{name} has the shape {given.shape}, its camera {size[0]} x {size[1]} pixels.",
            "Give an array (height, width), or the camera of this picture.",
        )
    if given.dtype.kind not in "bfiu" or not np.isfinite(given.astype(np.float64)).all():
        raise InputError(f"{name} has entries that are not numbers.", "Give True and False, or coverage from 0 to 1.")
    covered = given.astype(np.float64)
    if covered.min() < 0.0 or covered.max() > 1.0:
        raise InputError(f"{name} has entries from {covered.min():g} to {covered.max():g}.", "Divide by the largest.")
    if covered.max() < 0.5:
        raise InputError(f"{name} is empty: no pixel shows the cloth.", "Leave the view out, or invert the mask.")
    if covered.min() > 0.5:
        raise InputError(f"{name} is full: every pixel shows the cloth.", "Invert the mask, or segment the cloth.")
    return covered


@dataclass(frozen=True, eq=False)
class KeyPoints(PictureLoss):
    """Mean of rho((pixel of a vertex - pixel in the picture)/noise) over both coordinates, rho the Huber function.

    Parameters
    ----------
    camera : Camera
        Of the picture.
    vertices : (k,) int array
        Vertices of the cloth, as a hem's corner or a seam's end.
    pixels : (k, 2) array
        Where they are in the picture.
    noise : float
        Standard deviation of a pixel's coordinate [pixels].
    huber : float
        Residual over the noise beyond which rho(r) = r^2/2 goes on as a straight line: an outlier counts less.
    frame : int
        Number of the frame, below 0 from the last.
    """

    camera: Camera
    vertices: Ints
    pixels: Floats
    noise: float = 1.0
    huber: float = 3.0
    frame: int = -1

    def residuals(self, positions: Floats, triangles: Ints) -> Residuals:
        """Return (pi(x) - m)/noise, u and v of the first point first."""
        rows, pixels = np.asarray(self.vertices, np.int64), as_finite("pixels", self.pixels)
        if pixels.shape != (len(rows), 2) or not len(rows):
            raise InputError(f"There are {len(rows)} key points and pixels of the shape {pixels.shape}.")
        if rows.min() < 0 or rows.max() >= len(positions):
            raise InputError(f"A key point is vertex {rows.max()}, and the cloth has {len(positions)}.")
        noise, huber = checked_noise(self.noise, self.huber)
        away = (self.camera.project(positions[rows]) - pixels) / noise
        twice = np.repeat(rows, 2)
        at = csr_array((np.ones(len(twice)), (np.arange(len(twice)), twice)), shape=(len(twice), len(positions)))
        slopes = self.camera.jacobians(positions[rows]).reshape(-1, 3) / noise
        weights = np.ones(len(twice))
        return Residuals(away.ravel(), by_vertices(at, slopes), weights, blocks_of(np.repeat(pixels, 2, axis=0)), huber)
