"""What pulls each vertex for itself: its rows of x, weighted squares and their derivatives."""

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.energies.hessians import ElementHessian
from clothsim.indexing import as_rows, taken
from clothsim.linalg import dot


def every_vertex(n: int) -> Ints:
    """The first n rows of x as elements of one vertex each, (n, 1)."""
    return np.arange(n)[:, None]


def weighted_square(rows: Ints, weights: Floats, x: Floats, target: Floats) -> float:
    """sum w |x - target|^2 over the rows (n, 1) of x, which ascend, in the order of weights (n,) and target (n, 3)."""
    squares = taken(x, as_rows(rows[:, 0])) - target
    squares *= squares
    return dot(weights, squares[:, 0] + squares[:, 1] + squares[:, 2])  # a sum along so short an axis takes tenfold


def weighted_difference(rows: Ints, weights: Floats, x: Floats, target: Floats) -> Floats:
    """w (x - target) in these rows, 0 in the others, (N, 3)."""
    out, place = np.zeros_like(x), as_rows(rows[:, 0])
    difference = taken(x, place) - target
    difference *= weights[:, None]
    out[place] = difference
    return out


def diagonal_hessian(rows: Ints, weights: Floats) -> ElementHessian:
    """w I (3x3) for each of the rows."""
    return ElementHessian(rows, weights[:, None, None] * np.eye(3))
