"""Polar decomposition F = R U of 3x2 deformation gradients: rotations, stretches and principal directions.

The eigenvectors V of C = F'F are computed in closed form, the stretches never from the eigenvalues of C: in float32 the
smaller one comes out negative in half of all rank-deficient samples. l1 = |F v1| and l2 = J/l1 cannot.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clothsim.base.linalg import eigen_2x2
from clothsim.geometry.kinematics.deformation_gradient import area_ratios

_RANK_1 = 8.0
"""l2/l1 in ulps below which F v2 is round-off, so that its direction means nothing."""


@dataclass(frozen=True)
class PolarDecomposition:
    """F = R U with R'R = I and U symmetric positive semi-definite; all arrays have the dtype of F.

    Attributes
    ----------
    principal_stretches : (m, 2) array
        l1 >= l2 >= 0, the singular values of F.
    directions : (m, 2, 2) array
        V, whose columns v1, v2 are the principal directions in the material plane.
    R : (m, 3, 2) array
        W V', with orthonormal columns.
    R3 : (m, 3, 3) array
        R extended by the normal n = r1 x r2 to a rotation.
    U : (m, 2, 2) array
        V diag(l1, l2) V'.
    """

    principal_stretches: NDArray[np.floating]
    directions: NDArray[np.floating]
    R: NDArray[np.floating]
    R3: NDArray[np.floating]
    U: NDArray[np.floating]

    @property
    def spatial_directions(self) -> NDArray[np.floating]:
        """W = R V, (m, 3, 2): unit columns, the directions in space of the stretches l1 and l2."""
        return self.R @ self.directions


def principal_stretches(F: NDArray[np.floating]) -> NDArray[np.floating]:
    """Principal stretches l1 >= l2 >= 0 of deformation gradients: their singular values.

    l1 = |F v1|, l2 = J/l1 with J = |f1 x f2|: exact to a few ulps of l1, never NaN for finite F.

    Parameters
    ----------
    F : (..., 3, 2) array
        Deformation gradients.

    Returns
    -------
    (..., 2) array
        l1, l2 in the dtype of F, float32 too.

    Examples
    --------
    >>> import numpy as np
    >>> principal_stretches(np.array([[0.0, 2], [0.5, 0], [0, 0]]))
    array([2. , 0.5])
    """
    scaled, scale = _scaled(F)
    return _stretches(scaled, _principal_directions(scaled)) * scale[..., None]


def polar_decomposition(F: NDArray[np.floating]) -> PolarDecomposition:
    """Polar decomposition F = R U of deformation gradients.

    If l2 = 0, the second column of W = R V is an arbitrary orthonormal choice; if l1 = 0, both columns are.

    Parameters
    ----------
    F : (m, 3, 2) array
        Deformation gradients.

    Returns
    -------
    PolarDecomposition
        Rotations R (m, 3, 2) and R3 (m, 3, 3), stretch tensors U (m, 2, 2), principal stretches (m, 2), directions
        (m, 2, 2).

    Examples
    --------
    A sheet stretched by 2 along x and turned by 90 degrees about z:

    >>> import numpy as np
    >>> polar = polar_decomposition(np.array([[[0.0, -1], [2, 0], [0, 0]]]))
    >>> polar.principal_stretches
    array([[2., 1.]])
    >>> polar.R[0]
    array([[ 0., -1.],
           [ 1.,  0.],
           [ 0.,  0.]])
    """
    scaled, scale = _scaled(F)
    V = _principal_directions(scaled)
    stretches = _stretches(scaled, V)
    W = _orthonormal(scaled @ V, stretches[..., 0])
    R = W @ np.swapaxes(V, -1, -2)
    normal = np.cross(W[..., 0], W[..., 1])
    R3 = np.concatenate([R, normal[..., None]], axis=-1)
    stretches = stretches * scale[..., None]
    U = (V * stretches[..., None, :]) @ np.swapaxes(V, -1, -2)
    return PolarDecomposition(stretches, V, R, R3, U)


def _scaled(F: NDArray[np.floating]) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """F divided by its largest entry, and that entry (1 where F = 0): squares neither overflow nor vanish."""
    values = np.asarray(F)
    if not np.issubdtype(values.dtype, np.floating):
        values = values.astype(np.float64)
    scale = np.abs(values).max(axis=(-2, -1))
    scale = np.where(scale == 0, np.ones_like(scale), scale)
    return values / scale[..., None, None], scale


def _principal_directions(F: NDArray[np.floating]) -> NDArray[np.floating]:
    """Eigenvectors V (..., 2, 2) of C = F'F, the larger eigenvalue first."""
    return eigen_2x2(np.swapaxes(F, -1, -2) @ F)[1]


def _stretches(F: NDArray[np.floating], V: NDArray[np.floating]) -> NDArray[np.floating]:
    """(l1, l2): an error d of v1 changes l1 only by d^2 (Rayleigh), and J is free of cancellation at the size of l1."""
    l1 = np.linalg.norm((F @ V)[..., 0], axis=-1)
    l2 = np.divide(area_ratios(F), l1, out=np.zeros_like(l1), where=l1 > 0)
    return np.stack([l1, np.minimum(l1, l2)], axis=-1)


def _orthonormal(FV: NDArray[np.floating], l1: NDArray[np.floating]) -> NDArray[np.floating]:
    """W (..., 3, 2) from F V = W diag(l1, l2); an arbitrary unit vector where a column vanishes.

    V makes the columns orthogonal to round-off of l1; one Gram-Schmidt step makes them orthogonal to round-off of l2.
    """
    axis_x = np.zeros_like(FV[..., 0])
    axis_x[..., 0] = 1
    w1 = _unit(np.where(l1[..., None] > 0, FV[..., 0], axis_x))
    second = FV[..., 1] - (FV[..., 1] * w1).sum(axis=-1, keepdims=True) * w1
    rank_deficient = np.linalg.norm(second, axis=-1) <= _RANK_1 * np.finfo(FV.dtype).eps * l1
    axis = (np.arange(3) == np.abs(w1).argmin(axis=-1)[..., None]).astype(w1.dtype)
    return np.stack([w1, _unit(np.where(rank_deficient[..., None], np.cross(w1, axis), second))], axis=-1)


def _unit(vectors: NDArray[np.floating]) -> NDArray[np.floating]:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
