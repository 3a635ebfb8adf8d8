"""Unit quaternions (w, x, y, z) of rotations: conversions and spherical interpolation."""

import numpy as np

from clothsim.base.arrays import Floats

NEARLY_ALIKE = 1e-8
"""Angle [rad] below which two rotations are interpolated linearly, where the sine of the slerp would divide by zero."""


def from_rotation_vectors(vectors: Floats) -> Floats:
    """Quaternions (..., 4) of rotation vectors (..., 3) [rad]."""
    vectors = np.asarray(vectors, np.float64)
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), 0.5 * np.sinc(angle / (2 * np.pi)) * vectors], axis=-1)


def to_rotation_vectors(quaternions: Floats) -> Floats:
    """Rotation vectors (..., 3) [rad] of at most pi, of quaternions (..., 4)."""
    q = np.where(quaternions[..., :1] < 0, -quaternions, quaternions)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., :1])
    return np.asarray(q[..., 1:] * np.where(sine > 0, angle / np.where(sine > 0, sine, 1.0), 2.0), np.float64)


def to_matrices(quaternions: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(np.asarray(quaternions, np.float64), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def from_matrices(matrices: Floats) -> Floats:
    """Unit quaternions (..., 4) of rotation matrices (..., 3, 3), by the largest of the four components (Shepperd)."""
    m = np.asarray(matrices, np.float64)
    trace = np.trace(m, axis1=-2, axis2=-1)
    diagonal = np.diagonal(m, axis1=-2, axis2=-1)
    squares = np.concatenate([trace[..., None], diagonal], axis=-1)
    k = np.argmax(squares, axis=-1)
    a, b, c = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    d, e, f = m[..., 1, 0] + m[..., 0, 1], m[..., 0, 2] + m[..., 2, 0], m[..., 2, 1] + m[..., 1, 2]
    first = 1 + squares - trace[..., None]
    first[..., 0] = 1 + trace
    first[..., 1:] += diagonal
    rows = np.stack(
        [
            np.stack([first[..., 0], a, b, c], axis=-1),
            np.stack([a, first[..., 1], d, e], axis=-1),
            np.stack([b, d, first[..., 2], f], axis=-1),
            np.stack([c, e, f, first[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    picked = np.take_along_axis(rows, k[..., None, None], axis=-2)[..., 0, :]
    return np.asarray(picked / np.linalg.norm(picked, axis=-1, keepdims=True), np.float64)


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
