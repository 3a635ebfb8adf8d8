"""Small dense linear algebra on stacks of matrices: 2x2 eigenpairs, Kabsch rotations.

Plain NumPy, for outputs, pictures and data bound once a step; the energies have their own kernels.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clothsim.base.arrays import Floats, as_finite
from clothsim.base.errors import InputError

LINE_TOLERANCE = 1e-12
"""Points are collinear where the second singular value of H = P'Q is below this fraction of the first: where
(height over the line / length)^2 is, in exact coordinates.
"""

_NOISE = 8.0  # round-off of one coordinate, in ulps of the largest, below which a singular value counts as 0


def dot(a: NDArray[np.floating], b: NDArray[np.floating]) -> float:
    """Return the inner product of two arrays of one shape, on one thread.

    BLAS starts its threads for 10,000 numbers: .6 ms on a busy machine where this takes .01, and other bits by chance.
    """
    return float(np.einsum("i,i", a.ravel(), b.ravel()))


def unit(vectors: NDArray[np.floating]) -> Floats:
    """Return vectors (..., d) of length 1; 0 stays 0."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0)


def cross_matrices(vectors: NDArray[np.floating]) -> Floats:
    """Return [a]x with [a]x b = a x b, (..., 3, 3), of `vectors (..., 3)`."""
    matrices = np.zeros((*vectors.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrices[..., j, i], matrices[..., i, j] = vectors[..., k], -vectors[..., k]
    return matrices


def eigen_2x2(matrices: NDArray[np.floating], semidefinite: bool = False) -> tuple[NDArray, NDArray]:
    """Return eigenvalues (..., 2), the larger first, and eigenvectors (..., 2, 2), as columns, of symmetric matrices.

    [[a, b], [b, c]]: values (a + c)/2 +- hypot((a - c)/2, b), first vector (cos t, sin t), t = atan2(2 b, a - c)/2,
    second vector its left normal: the columns are a rotation. There is no division, so equal eigenvalues and ranks 1
    and 0 are handled. Errors are round-off of the larger value; `semidefinite` clamps the values at 0 (for C = F'F).
    Keeps the dtype.
    """
    a, b, c = matrices[..., 0, 0], matrices[..., 0, 1], matrices[..., 1, 1]
    half = a.dtype.type(0.5)
    middle, radius = half * a + half * c, np.hypot(half * a - half * c, b)
    values = np.stack([middle + radius, middle - radius], axis=-1)
    angle = half * np.arctan2(2 * b, a - c)
    cosine, sine = np.cos(angle), np.sin(angle)
    vectors = np.stack([np.stack([cosine, -sine], axis=-1), np.stack([sine, cosine], axis=-1)], axis=-2)
    return (np.maximum(values, 0) if semidefinite else values), vectors


def kabsch(reference: ArrayLike, deformed: ArrayLike) -> tuple[Floats, NDArray[np.bool_]]:
    """Fit rotations R that map `reference` to `deformed`, both centred first (Kabsch 1976).

    min_R sum |R p_i - q_i|^2: H = P'Q = A S B', R = B diag(1, 1, sign det(B A')) A'.

    Parameters
    ----------
    reference, deformed : (..., k, 3) array_like
        Points [m].

    Returns
    -------
    rotations : (..., 3, 3) float64
        R.
    determined : (...) bool
        False where the best rotation is not unique, as for collinear or coincident points (s2 + d s3 = 0); R is then
        one of the best. Planar rings are determined, mirrored ones too.
    """
    points = as_finite("reference", reference), as_finite("deformed", deformed)
    shape = points[0].shape
    if len(shape) < 2 or shape[-1] != 3 or shape[-2] == 0 or points[1].shape != shape:
        raise InputError(
            f"reference and deformed must both have shape (..., k, 3) with k >= 1, not {shape} and {points[1].shape}."
        )
    P, Q = (p - p.mean(axis=-2, keepdims=True) for p in points)
    noise = []  # of the coordinates, in their own precision
    for given, p in zip((reference, deformed), points, strict=True):
        dtype = np.asarray(given).dtype
        epsilon = float(np.finfo(dtype if np.issubdtype(dtype, np.floating) else np.float64).eps)
        noise.append(_NOISE * epsilon * np.abs(p).max(axis=(-2, -1)))
    A, s, Bt = np.linalg.svd(np.swapaxes(P, -1, -2) @ Q)
    sign = np.where(np.linalg.det(A) * np.linalg.det(Bt) < 0, -1.0, 1.0)
    Bt[..., 2, :] *= sign[..., None]
    rotations = np.swapaxes(A @ Bt, -1, -2)
    size_p, size_q = np.linalg.norm(P, axis=(-2, -1)), np.linalg.norm(Q, axis=(-2, -1))
    floor = LINE_TOLERANCE * s[..., 0] + noise[0] * size_q + noise[1] * size_p
    return rotations, s[..., 1] + sign * s[..., 2] > floor
