"""Canonical garments: posed with a body by skinning, and brought back (Santesteban et al. 2021).

M_G(X) = W(X + B~_s + B~_p, J, theta, W~), with the weights and offsets of the body averaged at the garment's vertices
by the rows A of `transfer.diffuse`; on the body's own template it is the posed body. Its inverse gives a simulated
garment x its canonical shape X, free of the body's shape and pose:

* with fixed rows A, those of the garment's vertices where it fits, M_G is affine in each vertex and `unposed` exact;
* with the rows of each canonical position itself, X = `unposed_in_field`: a fixed point, then least squares where that
  does not converge. Weights that vary in space fold it where two limbs meet, and there it has no inverse.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from transfer.body_model import BodyModel
from transfer.errors import TransferError
from transfer.triangle_surface import Floats, as_points

LONGEST_STEP = 0.03
"""Longest step of a vertex in an iteration [m]."""
CONVERGED = 1e-9
"""Residual of a vertex that is solved [m]."""
FIXED_POINT_ITERATIONS, LEAST_SQUARES_ITERATIONS = 30, 40
SINGULAR = 1e-3
"""Least determinant of a blended matrix that is inverted: halves of a limb turned against each other have 0."""
DIFFERENCE = 1e-6
"""Half the distance of the central differences of the field [m]."""


@dataclass(frozen=True)
class PosedBody:
    """Skinning of a body in one shape and pose: p -> sum_j w_j (R_j (p + b) + t_j).

    Attributes
    ----------
    weights : ndarray (n, j)
        Skinning weights >= 0, rows of sum 1.
    offsets : ndarray (n, 3)
        b: the sum of the shape and the pose offsets [m].
    linear : ndarray (j, 3, 3)
        R.
    translations : ndarray (j, 3)
        t [m].
    """

    weights: Floats
    offsets: Floats
    linear: Floats
    translations: Floats

    def posed(self, points: ArrayLike, rows: Any) -> Floats:
        """Posed positions M_G (k, 3) [m] of canonical `points` (k, 3) [m] with averaging `rows` (k, n)."""
        given = as_points("points", points)
        linear, moves, offsets = self._blended(len(given), rows)
        return np.asarray(np.einsum("kab,kb->ka", linear, given + offsets) + moves, np.float64)

    def unposed(self, points: ArrayLike, rows: Any) -> Floats:
        """Canonical positions (k, 3) [m] of posed `points` (k, 3) [m] with fixed averaging `rows` (k, n).

        Raises
        ------
        TransferError
            A vertex has a blended matrix that cannot be inverted, or `rows` is of another garment.
        """
        given = as_points("points", points)
        linear, moves, offsets = self._blended(len(given), rows)
        size = np.abs(np.linalg.det(linear))
        if len(given) and size.min() < SINGULAR:
            worst = int(size.argmin())
            raise TransferError(
                f"Vertex {worst} is between two joints turned against each other: its blended matrix is singular.",
                "Take another frame, or weights of vertices nearer to one of the joints.",
            )
        return np.asarray(np.linalg.solve(linear, (given - moves)[..., None])[..., 0] - offsets, np.float64)

    def _blended(self, count: int, rows: Any) -> tuple[Floats, Floats, Floats]:
        """Blended matrices (k, 3, 3), translations (k, 3), and offsets (k, 3)."""
        if rows.shape != (count, len(self.weights)):
            wanted = f"({count}, {len(self.weights)})"
            raise TransferError(f"The averaging rows have shape {rows.shape}, not {wanted}.")
        weights = rows @ self.weights
        return np.tensordot(weights, self.linear, axes=1), weights @ self.translations, rows @ self.offsets


@dataclass(frozen=True)
class Unposed:
    """Canonical garment found in a field of weights.

    Attributes
    ----------
    positions : ndarray (k, 3)
        Canonical positions [m].
    residuals : ndarray (k,)
        Distance of their posed positions from the given ones [m]: 0 but where the field has no inverse.
    """

    positions: Floats
    residuals: Floats


def posed_body(model: BodyModel, beta: ArrayLike = (), theta: ArrayLike | None = None) -> PosedBody:
    """Skinning of a body model with shape parameters `beta` and rotation vectors `theta` (j, 3) [rad]."""
    turns = np.zeros((len(model.parents), 3)) if theta is None else theta
    offsets = model.shaped(beta) - model.template + model.pose_offsets(turns)
    return PosedBody(model.weights, offsets, *model.transforms(beta, turns))


def unposed_in_field(
    body: PosedBody, points: ArrayLike, averaging: Callable[[Floats], Any], start: ArrayLike
) -> Unposed:
    """Canonical positions of a posed garment, with the averaging rows of each canonical position itself.

    Parameters
    ----------
    body : PosedBody
    points : array_like (k, 3)
        Posed positions [m].
    averaging : callable
        Rows of canonical positions, such as `KernelAverage.averaging`.
    start : array_like (k, 3)
        Canonical positions to begin with [m], such as those with fixed rows.
    """
    wanted, best = as_points("points", points), as_points("start", start).copy()
    x = best.copy()
    residuals = np.full(len(x), np.inf)
    todo = np.arange(len(x))
    for _ in range(FIXED_POINT_ITERATIONS):
        rows = averaging(x[todo])
        miss = wanted[todo] - body.posed(x[todo], rows)
        error = np.linalg.norm(miss, axis=1)
        better = error < residuals[todo]
        best[todo[better]], residuals[todo[better]] = x[todo[better]], error[better]
        left = error > CONVERGED
        todo, miss, linear = todo[left], miss[left], body._blended(len(rows.indptr) - 1, rows)[0][left]
        if not len(todo):
            break
        step = np.einsum("kab,kb->ka", np.linalg.pinv(linear), miss)
        x[todo] += step * _clipped(step)[:, None]
    missed = residuals > CONVERGED
    if missed.any():
        best[missed], residuals[missed] = _least_squares(body, wanted[missed], averaging, best[missed])
    return Unposed(best, residuals)


def _least_squares(
    body: PosedBody, wanted: Floats, averaging: Callable[[Floats], Any], start: Floats
) -> tuple[Floats, Floats]:
    """Positions (k, 3) and residuals (k,) of least |M_G(X) - x|^2, each by Levenberg and Marquardt's method."""

    def miss_of(x: Floats) -> Floats:
        return wanted - body.posed(x, averaging(x))

    x, damping = start.copy(), np.full(len(start), 1e-4)
    miss = miss_of(x)
    for _ in range(LEAST_SQUARES_ITERATIONS):
        columns = [(miss_of(x - d) - miss_of(x + d)) / (2 * DIFFERENCE) for d in DIFFERENCE * np.eye(3)]
        jacobian = np.stack(columns, axis=2)
        normal = np.swapaxes(jacobian, 1, 2) @ jacobian + damping[:, None, None] * np.eye(3)
        step = np.linalg.solve(normal, np.einsum("kba,kb->ka", jacobian, miss)[..., None])[..., 0]
        trial = x + step * _clipped(step)[:, None]
        after = miss_of(trial)
        better = (after**2).sum(axis=1) < (miss**2).sum(axis=1)
        x, miss = np.where(better[:, None], trial, x), np.where(better[:, None], after, miss)
        damping = np.clip(np.where(better, damping / 5, damping * 4), 1e-12, 1e6)
        if (np.linalg.norm(miss, axis=1) < CONVERGED).all():
            break
    return x, np.linalg.norm(miss, axis=1)


def _clipped(steps: Floats) -> Floats:
    """Factors (k,) of `steps` (k, 3) that make none longer than LONGEST_STEP."""
    length = np.linalg.norm(steps, axis=1)
    return np.minimum(1.0, LONGEST_STEP / np.maximum(length, 1e-300))
