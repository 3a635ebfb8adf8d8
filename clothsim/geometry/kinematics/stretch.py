"""Polar decomposition F = R U of 3x2 deformation gradients, and the thickness of a stretched sheet.

The eigenvectors V of C = F'F are computed in closed form, the stretches never from the eigenvalues of C: in float32 the
smaller one comes out negative in half of all rank-deficient samples. l1 = |F v1| and l2 = J/l1 cannot.

The thickness is the third principal stretch l3 of the plane-stress condition. Compressible Neo-Hookean with the 3D
constants: mu3 (l3^2 - 1) + lam3 ln(l1 l2 l3) = 0, lam3/mu3 = 2 nu/(1 - 2 nu).
(The plane-stress lam of the membrane, 2 nu/(1 - nu) mu, gives 30 % less thinning at nu = .3.)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clothsim.base.arrays import Floats, Ints, as_finite
from clothsim.base.errors import InputError
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
    # F V = W diag(l1, l2): V makes its columns orthogonal to round-off of l1, a Gram-Schmidt step to round-off of l2
    FV, l1 = scaled @ V, stretches[..., 0]
    axis_x = np.zeros_like(FV[..., 0])
    axis_x[..., 0] = 1
    w1 = _unit(np.where(l1[..., None] > 0, FV[..., 0], axis_x))
    second = FV[..., 1] - (FV[..., 1] * w1).sum(axis=-1, keepdims=True) * w1
    rank_deficient = np.linalg.norm(second, axis=-1) <= _RANK_1 * np.finfo(FV.dtype).eps * l1
    axis = (np.arange(3) == np.abs(w1).argmin(axis=-1)[..., None]).astype(w1.dtype)
    W = np.stack([w1, _unit(np.where(rank_deficient[..., None], np.cross(w1, axis), second))], axis=-1)
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


def _unit(vectors: NDArray[np.floating]) -> NDArray[np.floating]:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


MODELS = ("neo_hookean", "incompressible")
_MAX_ITERATIONS = 60


def thickness_stretch(l1: ArrayLike, l2: ArrayLike, poisson_ratio: ArrayLike, model: str = "neo_hookean") -> Floats:
    """Thickness stretch l3 of principal stretches l1, l2: deformed over rest thickness.

    "neo_hookean": l3 - 1 = -nu/(1 - nu) (e1 + e2) at small strains, 1/(l1 l2) at nu = .5. "incompressible": 1/(l1 l2)
    whatever nu is. A collapsed triangle (l1 l2 = 0) is infinitely thick, but at nu = 0 every l3 is 1.

    Parameters
    ----------
    l1, l2 : array_like
        Principal stretches, at least 0. All arguments broadcast.
    poisson_ratio : array_like
        nu in (-1, 0.5].
    model : {"neo_hookean", "incompressible"}
        Material through the thickness.

    Returns
    -------
    array
        l3 of the broadcast shape, dimensionless.

    Raises
    ------
    InputError
        nu or a stretch is out of range, or an auxetic sheet (nu < 0) is compressed so far that no l3 is in equilibrium.

    Examples
    --------
    >>> round(float(thickness_stretch(1.25, 1.0, 0.5)), 3)
    0.8
    """
    if model not in MODELS:
        raise InputError(f"thickness model {model!r} is unknown.", f"Choose one of {', '.join(MODELS)}.")
    first, second, nu = np.broadcast_arrays(
        as_finite("l1", l1), as_finite("l2", l2), as_finite("poisson_ratio", poisson_ratio)
    )
    _refuse("l1", first, first < 0, "at least 0")
    _refuse("l2", second, second < 0, "at least 0")
    _refuse("poisson_ratio", nu, (nu <= -1) | (nu > 0.5), "in (-1, 0.5]")
    with np.errstate(divide="ignore", over="ignore"):
        log_area = np.log(first) + np.log(second)
        return np.exp(-log_area if model == "incompressible" else _log_thickness(log_area, nu))


def deformed_thickness(
    principal_stretches: Floats, rest_thickness: ArrayLike, poisson_ratio: ArrayLike, model: str = "neo_hookean"
) -> Floats:
    """Thickness of each deformed triangle.

    Parameters
    ----------
    principal_stretches : (m, 2) array
        l1, l2 of `stretch.principal_stretches`.
    rest_thickness : (m,) array or float
        Thickness of the fabric at rest [m].
    poisson_ratio : (m,) array or float
        nu in (-1, 0.5].
    model : {"neo_hookean", "incompressible"}
        As in `thickness_stretch`.

    Returns
    -------
    (m,) array
        Thickness [m]; infinite for a collapsed triangle with nu > 0.

    Raises
    ------
    InputError
        As in `thickness_stretch`.

    Examples
    --------
    >>> import numpy as np
    >>> deformed_thickness(np.array([[1.25, 1.0], [1.0, 1.0]]), 0.5e-3, 0.5)
    array([0.0004, 0.0005])
    """
    stretch = thickness_stretch(principal_stretches[:, 0], principal_stretches[:, 1], poisson_ratio, model)
    return np.asarray(np.asarray(rest_thickness, np.float64) * stretch, np.float64)


def _log_thickness(log_area: Floats, nu: Floats) -> Floats:
    """The root y = ln l3 of g(y) = (1 - 2 nu)(e^2y - 1) + 2 nu (y + ln J), J = l1 l2.

    g is convex, and Newton starts at the upper bound, so it descends to the root without overshoot; the bracket guards
    against round-off (6 iterations suffice for J in 1e-12 ... 1e12 and nu >= 0). The form without a division covers
    nu = .5. Where an auxetic sheet nears the end of its equilibria two roots merge and half the digits are lost.
    """
    a, b = 1 - 2 * nu, 2 * nu
    collapsed = np.isneginf(log_area)
    logs = np.where(collapsed, 0.0, log_area)
    # nu >= 0: the root lies between 0 and -ln J, and e^2y <= 1 - (b/a) ln J
    # nu < 0: it is the root on the increasing branch of g, e^2y > -b/(2a); there e^2y <= 1 + 3/2 |b/a| ln J
    ratio = np.divide(b, a, out=np.full_like(a, np.inf), where=a > 0)
    turning = 0.5 * np.log(np.where(b < 0, -0.5 * ratio, 1.0))
    lower = np.where(b < 0, np.where(logs > 0, 0.0, turning), np.minimum(0.0, -logs))
    with np.errstate(invalid="ignore"):
        squeezed = np.where(logs < 0, np.minimum(-logs, 0.5 * np.log1p(ratio * np.maximum(-logs, 0))), 0.0)
        auxetic = 0.5 * np.log1p(-1.5 * np.minimum(ratio, 0) * np.maximum(logs, 0))
    upper = np.where(b < 0, auxetic, squeezed)
    lowest = a * np.expm1(2 * lower) + b * (lower + logs)
    bad: Ints = np.argwhere((collapsed & (nu < 0)) | ((b < 0) & (logs < 0) & (lowest > 0)))
    if len(bad):
        raise InputError(
            f"entry {bad[0].tolist()} has no equilibrium thickness: a sheet with poisson_ratio below 0 is compressed "
            "too far.",
            'Use a poisson_ratio of at least 0 or model "incompressible".',
        )
    y = upper
    for _ in range(_MAX_ITERATIONS):
        twice = np.minimum(2 * y, 700.0)  # exp would overflow beyond: only at nu = .5, where its factor a is 0
        slope = 2 * a * np.exp(twice) + b
        g = a * np.expm1(twice) + b * (y + logs)
        step = np.divide(g, slope, out=np.zeros_like(g), where=slope > 0)
        y, before = np.clip(y - step, lower, upper), y
        if (np.abs(y - before) <= 4 * np.finfo(float).eps * np.abs(y)).all():
            break
    return np.where(collapsed & (nu > 0), np.inf, y)


def _refuse(name: str, values: Floats, bad: np.ndarray, requirement: str) -> None:
    """InputError that names the first bad entry of an array."""
    entries = np.argwhere(bad)
    if len(entries):
        index = f"[{', '.join(str(i) for i in entries[0])}]" if values.ndim else ""
        raise InputError(f"{name}{index} must be {requirement}, not {values[tuple(entries[0])]}.")
