"""Opening of body folds by mean curvature flow, so that the body can be deflated.

Mean curvature flow, dx/dt = -M^-1 L x, in implicit steps, current areas and the initial cotangent weights
(Kazhdan, Solomon & Ben-Chen 2012: no necks pinch off). Creases open first and thin limbs draw back a little; the
weights are positive, so that no vertex leaves the convex hull.
"""

from collections.abc import Iterator

import numpy as np

from clothsim.base.arrays import Floats, Ints
from transfer.triangle_surface import Sparse

TIMES = (0.002, 0.004, 0.008, 0.016)
"""Flow times [m^2] that are tried: a cylinder of radius r loses dr in about r dr."""
SMALLEST_FRACTION = 0.5
"""Least fraction of the body's size: one that shrinks to a point frees any garment but inflates wrongly."""
LEAST, MOST = 1e-3, 10.0
"""Bounds of the cotangent weights: obtuse triangles have negative ones, slivers huge ones."""
RESIDUAL, ITERATIONS = 1e-6, 2000


def unfolding(positions: Floats, triangles: Ints) -> Iterator[Floats]:
    """Body vertices (n, 3) [m] at each of TIMES, while at least SMALLEST_FRACTION of its size remains."""
    size = np.linalg.norm(np.ptp(positions[triangles.ravel()], axis=0))
    x, before = positions, 0.0
    stiffness = _laplacian(positions, triangles)
    for time in TIMES:
        x = _flowed(x, stiffness, _vertex_areas(x, triangles), time - before)
        if np.linalg.norm(np.ptp(x[triangles.ravel()], axis=0)) < SMALLEST_FRACTION * size:
            return
        before = time
        yield x


def _flowed(x: Floats, stiffness: Sparse, areas: Floats, step: float) -> Floats:
    """One implicit step: (M + step L) x' = M x. Where the solver stops early x' is still a body, only less smooth."""
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import cg

    matrix = (diags_array(areas) + step * stiffness).tocsr()
    jacobi = diags_array(1 / matrix.diagonal())
    solved = [cg(matrix, areas * c, x0=c, rtol=RESIDUAL, maxiter=ITERATIONS, M=jacobi)[0] for c in x.T]
    return np.ascontiguousarray(np.transpose(solved))


def _laplacian(positions: Floats, triangles: Ints) -> Sparse:
    """L (n, n), positive semidefinite: each edge's weight is half the cotangents of the angles that face it."""
    from scipy.sparse import coo_array, diags_array

    n = len(positions)
    rows, columns, weights = [], [], []
    for corner in range(3):
        k, i, j = (triangles[:, (corner + side) % 3] for side in range(3))
        a, b = positions[i] - positions[k], positions[j] - positions[k]
        doubled = np.linalg.norm(np.cross(a, b), axis=1)
        rows.append(i)
        columns.append(j)
        weights.append(0.5 * (a * b).sum(axis=1) / np.maximum(doubled, np.finfo(float).tiny))
    half = coo_array((np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))), shape=(n, n)).tocsr()
    joined = (half + half.T).tocsr()
    joined.data = np.clip(joined.data, LEAST, MOST)
    return (diags_array(joined.sum(axis=1)) - joined).tocsr()


def _vertex_areas(positions: Floats, triangles: Ints) -> Floats:
    """A third of the triangles at each vertex [m^2], (n,); a vertex without any stays where it is."""
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    at = np.bincount(triangles.ravel(), np.repeat(area / 3, 3), minlength=len(positions))
    return np.maximum(at, 1e-9 * at.max())
