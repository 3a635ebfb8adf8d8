"""Saddle-free Newton direction of an indefinite Hessian in a Krylov space (Lanczos' method, preconditioned).

The projected Hessian is safe but too stiff where cloth is compressed: Newton on it alone converges linearly, at a rate
of about .7 on folding cloth. The exact one is indefinite there, in many directions at once: each crease that grows
is one of negative curvature. With M the inverse of the projected one, Lanczos' method builds vectors W from b with
W' M^-1 W = 1 and W' A W = T tridiagonal, and in them

    x = W f(T) W' b,    f(t) = 1 / max(|t|, 1 / radius):

Newton's step along positive curvature; along negative curvature a step of the same length downhill (saddle-free Newton,
Dauphin et al. 2014); and along no eigenvector longer than `radius` times M b. It is a descent direction, as b'x > 0.
Conjugate gradients that stop at the first direction of negative curvature (Steihaug 1983) leave all others for later
iterations.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dstev

from clothsim.base.arrays import Floats
from clothsim.base.linalg import dot

RELATIVE_ERROR = 0.1
MAX_PRODUCTS = 8


EIGENVALUE_ERROR = 1e-3
MAX_EIGENVECTOR_PRODUCTS = 80


class KrylovSolution(NamedTuple):
    """Solution x; negative_curvature: A is indefinite, or nearly, in its Krylov space; products A v taken.

    products is 0 where none was needed, or where one was not finite and x is the preconditioned right-hand side alone.
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
    """Solve A x = b in the sense of the module, to RELATIVE_ERROR in the preconditioner's norm.

    Parameters
    ----------
    times : callable
        v -> A v for v (n,); its result is overwritten.
    precondition : callable
        r -> M r with M symmetric positive definite.
    b : (n,) float64
        Right-hand side.
    trust : float
        Trust radius, see `direction.Trust`.
    preconditioned : (n,) float64
        M b.
    above : bool
        True where M^-1 >= A, as for the projected Hessian of the same point. No omitted direction then couples much
        more than the last one, so the last coupling bounds the error; the next would cost another back-solve.

    Returns
    -------
    KrylovSolution
        After at most MAX_PRODUCTS products.
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
        coefficients = rotation.copy() @ (whole * rotation[0] / np.maximum(np.abs(values), 1.0 / trust))
        if len(vectors) == MAX_PRODUCTS or (above and last and norm * abs(coefficients[-1]) <= RELATIVE_ERROR * whole):
            break
        residual -= curvature * dual
        residual -= norm * before
        image = precondition(residual)
        before, norm = dual, float(np.sqrt(max(dot(residual, image), 0.0)))
        if not norm * abs(coefficients[-1]) > RELATIVE_ERROR * whole:
            break
        beside[last] = norm
    x = np.zeros_like(b)
    for coefficient, vector in zip(coefficients, vectors, strict=True):
        x += coefficient * vector
    return KrylovSolution(x, bool(values[0] < 1.0 / trust), len(vectors))


def lowest_eigenvector(
    times: Callable[[Floats], Floats], precondition: Callable[[Floats], Floats], start: Floats
) -> tuple[float, Floats]:
    """Lowest eigenvalue t and its eigenvector v of A v = t M^-1 v, by Lanczos' method with full orthogonalisation.

    Parameters
    ----------
    times : callable
        v -> A v for v (n,); its result is overwritten.
    precondition : callable
        r -> M r with M symmetric positive definite.
    start : (n,) float64
        r; the Krylov space is that of M r, and v has r.v >= 0.

    Returns
    -------
    (float, (n,) float64)
        The lowest Ritz pair, v' M^-1 v = 1, once its residual is below EIGENVALUE_ERROR |t|, or after
        MAX_EIGENVECTOR_PRODUCTS products. nan and 0 where a number is not finite.
    """
    vectors: list[Floats] = []
    duals: list[Floats] = []  # M^-1 v
    diagonal, beside = np.zeros(MAX_EIGENVECTOR_PRODUCTS), np.zeros(MAX_EIGENVECTOR_PRODUCTS)
    residual, value, coefficients = start.copy(), np.nan, np.zeros(0)
    for last in range(MAX_EIGENVECTOR_PRODUCTS):
        image = precondition(residual)
        squared = dot(residual, image)
        if not np.isfinite(squared):
            return np.nan, np.zeros_like(start)
        norm = float(np.sqrt(max(squared, 0.0)))
        if last:
            beside[last - 1] = norm
            if norm * abs(coefficients[-1]) <= EIGENVALUE_ERROR * abs(value):
                break
        elif not norm:
            break
        duals.append(residual / norm)
        vectors.append(image / norm)
        residual = times(vectors[-1])
        diagonal[last] = dot(vectors[-1], residual)
        for _ in range(2):  # once leaves what cancellation costs
            for vector, dual in zip(vectors, duals, strict=True):
                residual -= dot(vector, residual) * dual
        values, rotation, _ = dstev(diagonal[: last + 1], beside[: max(last, 1)])
        value, coefficients = float(values[0]), rotation[:, 0] * (1.0 if rotation[0, 0] >= 0.0 else -1.0)
    found = np.zeros_like(start)
    for coefficient, vector in zip(coefficients, vectors, strict=True):
        found += coefficient * vector
    return value, found
