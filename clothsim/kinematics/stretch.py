"""Stretch and rotation of each triangle: the polar decomposition F = R U of a 3x2 deformation gradient.

The eigenvectors V of C = F'F are taken in closed form, the stretches never from C's eigenvalues: in float32 the
smaller one comes out negative in half of all rank-deficient samples. l1 = |F v1| and l2 = J/l1 cannot.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clothsim.kinematics.deformation_gradient import area_ratios
from clothsim.linalg import eigen_2x2

_RANK_1 = 8.0  # l2/l1 in ulps below which F v2 is round-off, so that its direction means nothing


@dataclass(frozen=True)
class Stretch:
    """F = R U with R'R = I and U symmetric, positive semi-definite; all arrays have F's dtype.

    principal_stretches: (m, 2) l1 >= l2 >= 0; directions: (m, 2, 2) whose columns v1, v2 are the principal directions
    in the material plane; R: (m, 3, 2) = W V'; R3: (m, 3, 3) R extended by n = r1 x r2 to a rotation; U: (m, 2, 2) =
    V diag(l1, l2) V'.
    """

    principal_stretches: NDArray[np.floating]
    directions: NDArray[np.floating]
    R: NDArray[np.floating]
    R3: NDArray[np.floating]
    U: NDArray[np.floating]

    @property
    def spatial_directions(self) -> NDArray[np.floating]:
        """W = R V, (m, 3, 2): unit columns along which the deformed triangles are stretched by l1 and l2."""
        return self.R @ self.directions


def principal_stretches(F: NDArray[np.floating]) -> NDArray[np.floating]:
    """l1 >= l2 >= 0 of F (..., 3, 2), (..., 2): its singular values, to a few ulps of l1; never NaN for finite F.

    l1 = |F v1|, l2 = J/l1 with J = |f1 x f2|. Keeps the dtype, float32 too.
    """
    scaled, scale = _scaled(F)
    return _stretches(scaled, _principal_directions(scaled)) * scale[..., None]


def decompose(F: NDArray[np.floating]) -> Stretch:
    """F = R U of F (m, 3, 2). Where l2 = 0 the second column of W, where l1 = 0 both, are some orthonormal choice."""
    scaled, scale = _scaled(F)
    V = _principal_directions(scaled)
    stretches = _stretches(scaled, V)
    W = _orthonormal(scaled @ V, stretches[..., 0])
    R = W @ np.swapaxes(V, -1, -2)
    normal = np.cross(W[..., 0], W[..., 1])
    R3 = np.concatenate([R, normal[..., None]], axis=-1)
    stretches = stretches * scale[..., None]
    U = (V * stretches[..., None, :]) @ np.swapaxes(V, -1, -2)
    return Stretch(stretches, V, R, R3, U)


def spatial_rotations(R3: NDArray[np.floating], frames: NDArray[np.floating]) -> NDArray[np.floating]:
    """The rotations of the triangles in space, R3 [t1 t2 n]', (m, 3, 3), from `triangle.reference_frames (m, 3, 3)`."""
    return R3 @ np.swapaxes(frames, -1, -2)


def _scaled(F: NDArray[np.floating]) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """F over its largest entry, and that entry (1 where F = 0): squares neither overflow nor vanish."""
    values = np.asarray(F)
    if not np.issubdtype(values.dtype, np.floating):
        values = values.astype(np.float64)
    scale = np.abs(values).max(axis=(-2, -1))
    scale = np.where(scale == 0, np.ones_like(scale), scale)
    return values / scale[..., None, None], scale


def _principal_directions(F: NDArray[np.floating]) -> NDArray[np.floating]:
    return eigen_2x2(np.swapaxes(F, -1, -2) @ F)[1]


def _stretches(F: NDArray[np.floating], V: NDArray[np.floating]) -> NDArray[np.floating]:
    """(l1, l2): an error d of v1 costs l1 only d^2 (Rayleigh), and J is free of cancellation at the size of l1."""
    l1 = np.linalg.norm((F @ V)[..., 0], axis=-1)
    l2 = np.divide(area_ratios(F), l1, out=np.zeros_like(l1), where=l1 > 0)
    return np.stack([l1, np.minimum(l1, l2)], axis=-1)


def _orthonormal(FV: NDArray[np.floating], l1: NDArray[np.floating]) -> NDArray[np.floating]:
    """W (..., 3, 2) from F V = W diag(l1, l2); where a column vanishes, some unit vector.

    V has made the columns orthogonal to round-off of l1; one Gram-Schmidt pass makes them so to round-off of l2.
    """
    axis_x = np.zeros_like(FV[..., 0])
    axis_x[..., 0] = 1
    w1 = _unit(np.where(l1[..., None] > 0, FV[..., 0], axis_x))
    second = FV[..., 1] - _dot(FV[..., 1], w1) * w1
    lost = np.linalg.norm(second, axis=-1) <= _RANK_1 * np.finfo(FV.dtype).eps * l1
    return np.stack([w1, _unit(np.where(lost[..., None], _perpendicular(w1), second))], axis=-1)


def _perpendicular(w: NDArray[np.floating]) -> NDArray[np.floating]:
    """A vector at right angles to the unit vectors w (..., 3): w x (the axis that w is furthest from)."""
    axis = (np.arange(3) == np.abs(w).argmin(axis=-1)[..., None]).astype(w.dtype)
    return np.cross(w, axis)


def _unit(vectors: NDArray[np.floating]) -> NDArray[np.floating]:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _dot(a: NDArray[np.floating], b: NDArray[np.floating]) -> NDArray[np.floating]:
    return (a * b).sum(axis=-1, keepdims=True)
