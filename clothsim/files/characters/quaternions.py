"""Unit quaternions (w, x, y, z) of rotations: conversions and spherical interpolation.

Conversions are SciPy's; its products and interpolations take two to eight times as long as the few lines here.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from clothsim.base.arrays import Floats

NEARLY_ALIKE = 1e-8
"""Angle [rad] below which two rotations are interpolated linearly, where the sine of the slerp would divide by zero."""


def from_rotation_vectors(vectors: Floats) -> Floats:
    """Quaternions (..., 4) of rotation vectors (..., 3) [rad]."""
    return _scalar_first(Rotation.from_rotvec(np.reshape(vectors, (-1, 3))), np.shape(vectors)[:-1])


def to_rotation_vectors(quaternions: Floats) -> Floats:
    """Rotation vectors (..., 3) [rad] of at most pi, of quaternions (..., 4)."""
    return np.reshape(_rotations(quaternions).as_rotvec(), (*quaternions.shape[:-1], 3))


def to_matrices(quaternions: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    return np.reshape(_rotations(quaternions).as_matrix(), (*quaternions.shape[:-1], 3, 3))


def from_matrices(matrices: Floats) -> Floats:
    """Unit quaternions (..., 4) of rotation matrices (..., 3, 3)."""
    return _scalar_first(Rotation.from_matrix(np.reshape(matrices, (-1, 3, 3))), np.shape(matrices)[:-2])


def _rotations(quaternions: Floats) -> Rotation:
    """SciPy's rotations, whose quaternions end with w."""
    return Rotation.from_quat(np.reshape(quaternions, (-1, 4))[:, [1, 2, 3, 0]])


def _scalar_first(rotations: Rotation, shape: tuple[int, ...]) -> Floats:
    return np.reshape(rotations.as_quat()[:, [3, 0, 1, 2]], (*shape, 4))


def product(first: Floats, second: Floats) -> Floats:
    """Hamilton products (..., 4): the rotation `second`, then `first`."""
    w, v = first[..., :1], first[..., 1:]
    u, x = second[..., :1], second[..., 1:]
    real = w * u - np.sum(v * x, axis=-1, keepdims=True)
    return np.concatenate([real, w * x + u * v + np.cross(v, x)], axis=-1)


def slerp(start: Floats, end: Floats, fraction: float) -> Floats:
    """Spherical linear interpolation along the shorter arc (Shoemake 1985).

    Parameters
    ----------
    start, end : (..., 4) ndarray
        Unit quaternions.
    fraction : float
        From 0 to 1.

    Returns
    -------
    (..., 4) ndarray
        Unit quaternions.
    """
    cosine = np.sum(start * end, axis=-1, keepdims=True)
    end = np.where(cosine < 0, -end, end)
    angle = 2 * np.arctan2(
        np.linalg.norm(end - start, axis=-1, keepdims=True), np.linalg.norm(end + start, axis=-1, keepdims=True)
    )
    near = angle < NEARLY_ALIKE
    sine = np.where(near, 1.0, np.sin(angle))
    weights = [np.where(near, part, np.sin(part * angle) / sine) for part in (1 - fraction, fraction)]
    mixed = weights[0] * start + weights[1] * end
    return np.asarray(mixed / np.linalg.norm(mixed, axis=-1, keepdims=True), np.float64)
