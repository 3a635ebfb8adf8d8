"""Diagonal quadratic energies: weighted squared distances of single vertices, and their derivatives."""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import dot
from clothsim.base.vectors import as_rows, taken
from clothsim.physics.energies.hessians import ElementHessian


def every_vertex(n: int) -> Ints:
    """The first n rows of x as elements of one vertex each, (n, 1)."""
    return np.arange(n)[:, None]


def weighted_square(rows: Ints, weights: Floats, x: Floats, target: Floats) -> float:
    """sum w |x - target|^2 over the rows (n, 1) of x, which ascend, in the order of weights (n,) and target (n, 3)."""
    squares = taken(x, as_rows(rows[:, 0])) - target
    squares *= squares
    # sum(axis=1) over three columns takes ten times as long
    return dot(weights, squares[:, 0] + squares[:, 1] + squares[:, 2])


def weighted_difference(rows: Ints, weights: Floats, x: Floats, target: Floats) -> Floats:
    """w (x - target) in the given rows, 0 in the others, (N, 3)."""
    out, at = np.zeros_like(x), as_rows(rows[:, 0])
    difference = taken(x, at) - target
    difference *= weights[:, None]
    out[at] = difference
    return out


def diagonal_hessian(rows: Ints, weights: Floats) -> ElementHessian:
    """The block w I, 3 x 3, for each of the rows [N/m]."""
    return ElementHessian(rows, weights[:, None, None] * np.eye(3))
