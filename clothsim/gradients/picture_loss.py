"""Losses of a picture as sums of squares: residuals over their noise, with derivatives by the cloth's vertices."""

import abc
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import coo_array, csr_array

from clothsim.base.arrays import Floats, Ints, as_positive
from clothsim.base.errors import InputError
from clothsim.gradients.losses import Loss


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
    pixels : (k, 2) float64
        Where in the picture it is.
    huber : float
        Residual beyond which rho(r) = r^2/2 goes on as a straight line.
    left_out : float
        Share of the picture's measurements that have no residual, or none with a derivative.
    """

    values: Floats
    jacobian: csr_array
    weights: Floats
    pixels: Floats
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
        """Return the residuals at positions (n, 3) [m], the correspondence found anew."""

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
