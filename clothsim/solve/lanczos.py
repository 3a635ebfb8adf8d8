"""The Newton direction of the exact Hessian in a Krylov space, curving down or not, by the factor of the projected one.

The projected Hessian is safe but too stiff where cloth is compressed: Newton on it alone converges linearly, at a rate
of about .7 on folding cloth. The exact one is indefinite there, in many places at once: each crease that grows is a
direction of negative curvature. With M the inverse of the projected one, Lanczos' method builds vectors W from b with
W' M^-1 W = 1 and W' A W = T tridiagonal, and in them

    x = W f(T) W' b,    f(t) = 1 / max(|t|, 1 / trust):

where A curves up, Newton's step; where it curves down, one as long against the slope (saddle-free Newton, Dauphin et
al. 2014); and along no eigenvector longer than `trust` times what M takes. It descends, as b'x > 0. Conjugate gradients
that stop at the first direction of negative curvature (Steihaug 1983) leave all others for later iterations.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dstev

from clothsim.arrays import Floats
from clothsim.linalg import dot

RELATIVE_ERROR = 0.1
MAX_PRODUCTS = 8


class KrylovSolution(NamedTuple):
    """x; whether A curves down, or hardly up, somewhere in the space of it; the products A v that it took.

    0 products where it took none, or where one was no number and x is what the preconditioner alone makes of b.
    """

    x: Floats
    negative_curvature: bool
    products: int


def saddle_free_solve(
    times: Callable[[Floats], Floats],
    precondition: Callable[[Floats], Floats],
    b: Floats,
    trust: float,
    preconditioned: Floats,
    above: bool = False,
) -> KrylovSolution:
    """The x of the module for A x = b, to RELATIVE_ERROR in the preconditioner's norm or in MAX_PRODUCTS products.

    times: v -> A v, which is overwritten; precondition: r -> M r, M positive definite; preconditioned: M b; trust: see
    `trust.Trust`; above: whether M^-1 is at least A, as the projected Hessian of the same place is. Where it is, no
    direction is left out that couples much more than the last, and the error is told by the last coupling: the next
    would take a back-solve more.
    """
    whole = norm = float(np.sqrt(max(dot(b, preconditioned), 0.0)))
    if not norm > 0.0:
        return KrylovSolution(np.zeros_like(b), False, 0)
    residual, image, before = b, preconditioned, np.zeros_like(b)
    vectors: list[Floats] = []
    diagonal, beside = np.empty(MAX_PRODUCTS), np.zeros(MAX_PRODUCTS)  # of T
    while True:
        last = len(vectors)
        dual, vector = residual / norm, image / norm
        vectors.append(vector)
        residual = times(vector)
        diagonal[last] = curvature = dot(vector, residual)
        if not np.isfinite(curvature + norm):
            return KrylovSolution(preconditioned, False, 0)
        values, rotation, _ = dstev(diagonal[: last + 1], beside[: max(last, 1)])  # NumPy's eigh takes three times this
        shares = rotation.copy() @ (whole * rotation[0] / np.maximum(np.abs(values), 1.0 / trust))
        if len(vectors) == MAX_PRODUCTS or (above and last and norm * abs(shares[-1]) <= RELATIVE_ERROR * whole):
            break
        residual -= curvature * dual
        residual -= norm * before
        image = precondition(residual)
        before, norm = dual, float(np.sqrt(max(dot(residual, image), 0.0)))
        if not norm * abs(shares[-1]) > RELATIVE_ERROR * whole:
            break
        beside[last] = norm
    x = np.zeros_like(b)
    for share, vector in zip(shares, vectors, strict=True):
        x += share * vector
    return KrylovSolution(x, bool(values[0] < 1.0 / trust), len(vectors))
