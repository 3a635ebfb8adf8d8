"""Hessians of what pulls each vertex for itself."""

from functools import lru_cache

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.energies.base import ElementHessian


def diagonal_hessian(weights: Floats) -> ElementHessian:
    """w I (3x3) for each of the first n vertices."""
    return ElementHessian(_each(len(weights)), weights[:, None, None] * np.eye(3))


@lru_cache(maxsize=8)
def _each(n: int) -> Ints:
    """One element a vertex, (n, 1): the same object each time, so that its places in a matrix are looked up once."""
    return np.arange(n)[:, None]
