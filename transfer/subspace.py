"""Linear models of drapes: principal components in a metric, ridge regression, nearest neighbours.

With a metric G = M + w L'ML (areas M, a Laplacian L) the principal components of drapes v_k are orthonormal in G, and
the best rank-k approximation is that in the norm e'Ge. Ridge regression from the parameters of a drape (measures of the
body, fabric) to its coefficients is the baseline that every other model of drapes has to beat.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from transfer.errors import TransferError
from transfer.triangle_surface import Floats


@dataclass(frozen=True, eq=False)
class Subspace:
    """Affine subspace of drapes.

    Attributes
    ----------
    mean : (m,) ndarray
    basis : (m, k) ndarray
        Orthonormal in the metric.
    dual : (m, k) ndarray
        Metric times basis: the coefficients of v are dual' (v - mean).
    variances : (k,) ndarray
        Of the coefficients of the training drapes, falling.
    """

    mean: Floats
    basis: Floats
    dual: Floats
    variances: Floats

    def coefficients(self, drapes: ArrayLike) -> Floats:
        """Coefficients (n, k) of drapes (n, m)."""
        return (np.asarray(drapes, np.float64) - self.mean) @ self.dual

    def drapes(self, coefficients: ArrayLike) -> Floats:
        """Drapes (n, m) of coefficients (n, k)."""
        return self.mean + np.asarray(coefficients, np.float64) @ self.basis.T


def metric_components(drapes: ArrayLike, count: int, metric: Any = None) -> Subspace:
    """Principal components of drapes in a metric.

    Parameters
    ----------
    drapes : (n, m) array_like
        A drape a row, all coordinates one after the other [m].
    count : int
        Number of components, at most n - 1 and the rank.
    metric : (m, m) array or sparse array, optional
        Symmetric positive definite; default: the identity.

    Notes
    -----
    By the Gram matrix of the centred drapes D: D G D' = U s U', basis D' U s^(-1/2). It costs n products with G, not an
    eigenproblem of size m.

    Examples
    --------
    >>> drapes = [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]
    >>> metric_components(drapes, 1).variances.round(3)
    array([2.])
    """
    given = np.asarray(drapes, np.float64)
    if given.ndim != 2 or len(given) < 2 or not np.isfinite(given).all():
        raise TransferError(f"drapes must be (n, m), finite, n at least 2, not {given.shape}.", "Give a drape a row.")
    mean = given.mean(axis=0)
    centred = given - mean
    weighted = (metric @ centred.T).T if metric is not None else centred
    values, vectors = np.linalg.eigh(centred @ weighted.T)
    order = np.argsort(values)[::-1][: max(1, int(count))]
    order = order[values[order] > 1e-12 * max(float(values.max()), 1e-300)]
    scale = np.sqrt(values[order])
    basis = centred.T @ vectors[:, order] / scale
    dual = np.asarray(weighted.T @ vectors[:, order] / scale)
    return Subspace(mean, basis, dual, values[order] / (len(given) - 1))


@dataclass(frozen=True, eq=False)
class Ridge:
    """Linear map from standardised inputs; box: training range, to which inputs are clipped."""

    low: Floats
    high: Floats
    centre: Floats
    scale: Floats
    weights: Floats

    def __call__(self, inputs: ArrayLike) -> Floats:
        """Outputs (n, k) of inputs (n, p), clipped to the box."""
        clipped = np.clip(np.asarray(inputs, np.float64), self.low, self.high)
        return _features((clipped - self.centre) / self.scale) @ self.weights


def ridge(inputs: ArrayLike, outputs: ArrayLike, penalty: float = 1e-3) -> Ridge:
    """Ridge regression with an intercept that is not penalised.

    Parameters
    ----------
    inputs : (n, p) array_like
        Parameters of the drapes; standardised here.
    outputs : (n, k) array_like
        Coefficients.
    penalty : float
        Multiplies n and the squared weights.
    """
    x, y = np.asarray(inputs, np.float64), np.asarray(outputs, np.float64)
    if x.ndim != 2 or y.ndim != 2 or len(x) != len(y):
        raise TransferError(f"inputs {x.shape} and outputs {y.shape} do not fit.", "Give (n, p) and (n, k).")
    centre, scale = x.mean(axis=0), x.std(axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    features = _features((x - centre) / scale)
    penalties = np.r_[0.0, np.full(features.shape[1] - 1, penalty * len(x))]
    normal = features.T @ features + np.diag(penalties)
    return Ridge(x.min(axis=0), x.max(axis=0), centre, scale, np.linalg.lstsq(normal, features.T @ y, rcond=None)[0])


def nearest(inputs: ArrayLike, outputs: ArrayLike, asked: ArrayLike, count: int = 1) -> Floats:
    """Means (q, k) of the outputs of the `count` nearest standardised inputs, weighted by the inverse distance."""
    x, y, q = (np.asarray(each, np.float64) for each in (inputs, outputs, asked))
    scale = np.where(x.std(axis=0) > 0, x.std(axis=0), 1.0)
    distances = np.linalg.norm((q[:, None] - x[None]) / scale, axis=2)
    chosen = np.argsort(distances, axis=1, kind="stable")[:, :count]
    weights = 1.0 / np.maximum(np.take_along_axis(distances, chosen, axis=1), 1e-12)
    return np.einsum("qc,qck->qk", weights / weights.sum(axis=1, keepdims=True), y[chosen])


def _features(standardised: Floats) -> Floats:
    return np.column_stack([np.ones(len(standardised)), standardised])
