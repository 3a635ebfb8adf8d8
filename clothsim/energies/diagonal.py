"""What pulls each vertex for itself: its rows of x, weighted squares and their derivatives."""

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.energies.base import ElementHessian
from clothsim.linalg import dot


def every_vertex(n: int) -> Ints:
    """The first n rows of x as elements of one vertex each, (n, 1)."""
    return np.arange(n)[:, None]


def weighted_square(rows: Ints, weights: Floats, x: Floats, target: Floats) -> float:
    """sum w |x - target|^2 over the rows (n, 1) of x, in the order of weights (n,) and target (n, 3)."""
    return dot(weights, ((x[rows[:, 0]] - target) ** 2).sum(axis=1))


def weighted_difference(rows: Ints, weights: Floats, x: Floats, target: Floats) -> Floats:
    """w (x - target) in these rows, 0 in the others, (N, 3)."""
    out = np.zeros_like(x)
    out[rows[:, 0]] = weights[:, None] * (x[rows[:, 0]] - target)
    return out


def diagonal_hessian(rows: Ints, weights: Floats) -> ElementHessian:
    """w I (3x3) for each of the rows."""
    return ElementHessian(rows, weights[:, None, None] * np.eye(3))
