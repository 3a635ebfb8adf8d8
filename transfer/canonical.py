"""Canonical garments: posed with a body by skinning, and brought back (Santesteban et al. 2021).

Skinning weights, shape offsets and pose offsets at a point p off the body are means of those of the surface near it, by
one linear operator: rows A(p) >= 0 of sum 1 over the body's vertices, W~ = A W, B~_s = A B_s and B~_p = A B_p
(equations 4 to 6). Three operators:

* `ClosestAverage`: the closest surface point. Its weights jump by up to 1 between two limbs.
* `SampledAverage`: equation 4, the closest points of N samples q = p + d(p) g_i, d the distance to the body. The g_i
  are one fixed set of Gaussian vectors, so that A is a function of p: exact on the surface, its jumps at most 1/N a
  sample.
* `KernelAverage`: all vertices v within 3 h, weighted by area exp(-(|p - v|^2 - d^2)/h^2), h^2 = d^2 + (edge/2)^2, less
  the value at 3 h. It is continuous; on the surface it is a mean over half an edge.

M_G(X) = W(X + B~_s + B~_p, J, theta, W~) poses a garment; on the body's own template it is the posed body. Its inverse
gives a simulated garment x its canonical shape X, free of the body's shape and pose:

* with fixed rows A, those of the garment's vertices where it fits, M_G is affine in each vertex and `unposed` exact;
* with the rows of each canonical position itself, X = `unposed_in_field`: a fixed point, then least squares where that
  does not converge. Weights that vary in space fold it where two limbs meet, and there it has no inverse.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import igl
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, vstack
from scipy.spatial import cKDTree

from transfer.body_model import PosedBody
from transfer.errors import TransferError
from transfer.signed_distance import barycentric
from transfer.triangle_surface import Floats, Ints, as_points, as_surface

CUT = 3.0
"""Radius of the kernel's support in widths h."""
SAMPLES = 64
"""Samples of `SampledAverage`."""
CHUNK = 4096
"""Points whose averages are formed at once."""


class Average(Protocol):
    """Averaging operator of a body."""

    def averaging(self, points: ArrayLike) -> Any:
        """Rows A(p) of `points` (k, 3) [m] over the n vertices of the body: a csr_array (k, n) >= 0 of row sum 1."""


@dataclass(frozen=True)
class ClosestAverage:
    """Values at the closest surface point; made by `closest_average`.

    Attributes
    ----------
    positions : ndarray (n, 3)
    triangles : ndarray (m, 3)
    """

    positions: Floats
    triangles: Ints
    _tree: Any = field(repr=False, compare=False)

    def averaging(self, points: ArrayLike) -> Any:
        """Rows of barycentric coordinates, a csr_array (k, n)."""
        queries = as_points("points", points)
        _, corners, shares = self.nearest(queries)
        return _rows(len(queries), len(self.positions), np.full(len(queries), 3), corners.ravel(), shares.ravel())

    def nearest(self, points: Floats) -> tuple[Floats, Ints, Floats]:
        """Distances (k,) [m], corners (k, 3) and barycentric coordinates (k, 3) of the closest surface points."""
        if not len(points):
            return np.zeros(0), np.zeros((0, 3), np.int64), np.zeros((0, 3))
        squared, rows, closest = self._tree.squared_distance(
            self.positions, self.triangles, np.ascontiguousarray(points)
        )
        corners = self.triangles[np.asarray(rows).ravel()]
        shares = np.maximum(barycentric(self.positions[corners], np.asarray(closest).reshape(-1, 3)), 0.0)
        return np.sqrt(np.asarray(squared).ravel()), corners, shares / shares.sum(axis=1, keepdims=True)


@dataclass(frozen=True)
class SampledAverage:
    """Mean over the closest surface points of samples about the point; made by `sampled_average`.

    Attributes
    ----------
    surface : ClosestAverage
    samples : ndarray (s, 3)
        Gaussian vectors of unit variance.
    """

    surface: ClosestAverage
    samples: Floats

    def averaging(self, points: ArrayLike) -> Any:
        """Rows of equation 4, a csr_array (k, n)."""
        queries, count = as_points("points", points), len(self.samples)
        step = max(CHUNK // count, 1)
        parts = [self._part(queries[low : low + step]) for low in range(0, len(queries), step)]
        return vstack(parts, format="csr") if parts else self.surface.averaging(queries)

    def _part(self, points: Floats) -> Any:
        count = len(self.samples)
        distance = self.surface.nearest(points)[0]
        around = points[:, None, :] + distance[:, None, None] * self.samples
        _, corners, shares = self.surface.nearest(around.reshape(-1, 3))
        lengths = np.full(len(points), 3 * count)
        return _rows(len(points), len(self.surface.positions), lengths, corners.ravel(), shares.ravel() / count)


@dataclass(frozen=True)
class KernelAverage:
    """Mean over the vertices near the point; made by `kernel_average`.

    Attributes
    ----------
    surface : ClosestAverage
    areas : ndarray (n,)
        A third of the triangles at each vertex [m2].
    width : float
        h on the surface [m].
    """

    surface: ClosestAverage
    areas: Floats
    width: float
    _tree: Any = field(repr=False, compare=False)

    def averaging(self, points: ArrayLike) -> Any:
        """Rows of the kernel, a csr_array (k, n)."""
        queries = as_points("points", points)
        parts = [self._part(queries[low : low + CHUNK]) for low in range(0, len(queries), CHUNK)]
        return vstack(parts, format="csr") if parts else self.surface.averaging(queries)

    def _part(self, points: Floats) -> Any:
        squared = self.surface.nearest(points)[0] ** 2
        spread = squared + self.width**2
        near = self._tree.query_ball_point(points, CUT * np.sqrt(spread))
        lengths = np.array([len(found) for found in near])
        row, column = np.repeat(np.arange(len(points)), lengths), np.concatenate(near).astype(np.int64)
        apart = ((points[row] - self.surface.positions[column]) ** 2).sum(axis=1)
        end = np.exp(-CUT * CUT + squared / spread)
        values = self.areas[column] * np.maximum(np.exp((squared[row] - apart) / spread[row]) - end[row], 0.0)
        total = np.bincount(row, values, len(points))
        return _rows(len(points), len(self.areas), lengths, column, values / total[row])


def closest_average(positions: ArrayLike, triangles: ArrayLike) -> ClosestAverage:
    """Average at the closest point of a body, positions (n, 3) [m] and triangles (m, 3).

    Raises
    ------
    TransferError
        Invalid arrays.
    """
    points, faces = as_surface("body", positions, triangles)
    points, faces = np.ascontiguousarray(points), np.ascontiguousarray(faces)
    tree = igl.AABB()
    tree.init(points, faces)
    return ClosestAverage(points, faces, tree)


def sampled_average(
    positions: ArrayLike, triangles: ArrayLike, samples: int = SAMPLES, seed: int = 0
) -> SampledAverage:
    """Average of equation 4 with a fixed set of `samples`, drawn from `seed`; other arguments as `closest_average`."""
    if samples < 1:
        raise TransferError(f"samples is {samples}.", "Give a number from 1.")
    vectors = np.random.default_rng(seed).standard_normal((samples, 3))
    return SampledAverage(closest_average(positions, triangles), vectors)


def kernel_average(positions: ArrayLike, triangles: ArrayLike) -> KernelAverage:
    """Average by the kernel of the width of half a median edge on the surface; arguments as `closest_average`.

    Examples
    --------
    >>> import numpy as np
    >>> from transfer.canonical import kernel_average
    >>> x = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> average = kernel_average(x, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> average.averaging([[0.3, 0.3, 0.3]]).sum(axis=1).round(12).tolist()
    [1.0]
    """
    surface = closest_average(positions, triangles)
    corners = surface.positions[surface.triangles]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    thirds = np.repeat(doubled / 6, 3)
    areas = np.bincount(surface.triangles.ravel(), thirds, len(surface.positions)).astype(np.float64)
    return KernelAverage(surface, areas, float(np.median(edges)) / 2, cKDTree(surface.positions))


def _rows(rows: int, columns: int, lengths: Ints, column: Ints, values: Floats) -> Any:
    """csr_array (rows, columns) with `lengths` entries a row, those of one column added up."""
    starts = np.concatenate([[0], np.cumsum(lengths)])
    made = csr_array((values, column, starts), shape=(rows, columns))
    made.sum_duplicates()
    return made


LONGEST_STEP = 0.03
"""Longest step of a vertex in an iteration [m]."""
CONVERGED = 1e-9
"""Residual of a vertex that is solved [m]."""
FIXED_POINT_ITERATIONS, LEAST_SQUARES_ITERATIONS = 30, 40
DIFFERENCE = 1e-6
"""Half the distance of the central differences of the field [m]."""


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
        todo, miss, linear = todo[left], miss[left], body.blended(len(rows.indptr) - 1, rows)[0][left]
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
