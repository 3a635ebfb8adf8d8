"""Guaranteed path: deflation of the body until the garment is clear, then inflation under IPC.

The body is deflated until the garment is clear of it, and grows back as a moving obstacle; where no depth clears it, as
between folds in contact, its folds are opened first. Where that does not help either and the garment
was clear of the body that it was made for, that body is morphed into the other one under the garment.

Deflation: each vertex moves inward along its normal by the depth, but at most by LARGEST_FRACTION of the half thickness
of the body below it. It returns along the same straight line: a moving obstacle that only moves outward.

Opening of folds: mean curvature flow, dx/dt = -M^-1 L x, in implicit steps, current areas and the initial cotangent
weights (Kazhdan, Solomon & Ben-Chen 2012: no necks pinch off). Creases open first and thin limbs draw back a little;
the weights are positive, so that no vertex leaves the convex hull.

Overlap of a body with itself, as of thighs, in which a garment has no room: it is pressed in by a few millimetres about
the points at which it intersects itself. The garment grows onto that shape under contact; in its drape the body closes
again, and one part carries the vertices between (`clothsim.solve.pinch`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import cg
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import unit
from clothsim.base.triangles import cotangent_laplacian, thirds_at_vertices, triangle_areas
from clothsim.engine import components, intersecting_pairs, intersection_points
from transfer.errors import TransferError
from transfer.signed_distance import SKIN, BodySurface, body_surface
from transfer.triangle_surface import edges_of

LARGEST_FRACTION = 0.9
"""Largest displacement as a fraction of the half thickness: the rest keeps the two surfaces apart."""
SMOOTHINGS = 8
"""Smoothing iterations of thickness and normals, which vary strongly at ears and fingers."""
RAYS, OPENING = 7, np.radians(20.0)
"""Rays that measure the thickness below a vertex, and angle of all but one to its normal [rad]."""


def half_thickness(body: BodySurface) -> Floats:
    """Half thickness of the body below each vertex, (n,) [m]: median over a cone of rays, then smoothed."""
    thicknesses, inward = [], -body.vertex_normals
    steepest = np.eye(3)[np.argmin(np.abs(inward), axis=1)]
    side = unit(np.cross(inward, steepest))
    other = np.cross(inward, side)
    angles = 2 * np.pi * np.arange(RAYS - 1) / (RAYS - 1)
    tilted = [inward + np.tan(OPENING) * (np.cos(a) * side + np.sin(a) * other) for a in angles]
    for directions in [unit(ray) for ray in (inward, *tilted)]:
        distance, _ = body.exits(body.positions + 10 * SKIN * body.size * directions, directions)
        thicknesses.append(np.where(np.isfinite(distance), distance, 0.0))  # no hit: the rim of an open body stays
    return smoothed(0.5 * np.median(thicknesses, axis=0), body.triangles)


def outward_normals(body: BodySurface) -> Floats:
    """Smoothed unit normals of the body, (n, 3), along which it is deflated."""
    return unit(smoothed(body.vertex_normals, body.triangles))


def deflated(body: BodySurface, depth: float, half: Floats, normals: Floats) -> Floats:
    """Body vertices moved inward by `depth` [m], (n, 3) [m].

    half (n,): its `half_thickness` [m]; normals (n, 3): its `outward_normals`.
    """
    return np.asarray(body.positions - np.minimum(depth, LARGEST_FRACTION * half)[:, None] * normals, np.float64)


def smoothed(values: Floats, triangles: Ints, rounds: int = SMOOTHINGS) -> Floats:
    """Values (n,) or (n, k) after as many averages with the mean of their neighbours."""
    ends = edges_of(triangles)
    owner, neighbours = np.concatenate([ends, ends[:, ::-1]]).T
    count = np.bincount(owner, minlength=len(values))
    weights = csr_array((1.0 / count[owner], (owner, neighbours)), shape=(len(values), len(values)))
    weights.sort_indices()
    alone = count == 0
    for _ in range(rounds):
        means = weights @ values
        means[alone] = values[alone]
        values = 0.5 * (values + means)
    return values


TIMES = (0.002, 0.004, 0.008, 0.016)
"""Flow times [m^2] that are tried: a cylinder of radius r loses dr in about r dr."""
SMALLEST_FRACTION = 0.5
"""Least fraction of the body's size: one that shrinks to a point frees any garment but inflates wrongly."""
COTANGENTS = 1e-3, 10.0
"""Bounds of the weights of the flow."""
RESIDUAL, ITERATIONS = 1e-6, 2000


def unfolding(positions: Floats, triangles: Ints) -> Iterator[Floats]:
    """Body vertices (n, 3) [m] at each of TIMES, while at least SMALLEST_FRACTION of its size remains."""
    size = np.linalg.norm(np.ptp(positions[triangles.ravel()], axis=0))
    x, before = positions, 0.0
    stiffness = cotangent_laplacian(positions, triangles, COTANGENTS)
    for time in TIMES:
        at = thirds_at_vertices(triangle_areas(x[triangles]), triangles, len(x))
        areas = np.maximum(at, 1e-9 * at.max())  # a vertex without triangles stays where it is
        # one implicit step: (M + step L) x' = M x. Where the solver stops early x' is still a body, only less smooth
        matrix = (diags_array(areas) + (time - before) * stiffness).tocsr()
        jacobi = diags_array(1 / matrix.diagonal())
        solved = [cg(matrix, areas * c, x0=c, rtol=RESIDUAL, maxiter=ITERATIONS, M=jacobi)[0] for c in x.T]
        x = np.ascontiguousarray(np.transpose(solved))
        if np.linalg.norm(np.ptp(x[triangles.ravel()], axis=0)) < SMALLEST_FRACTION * size:
            return
        before = time
        yield x


DEPTHS = (0.0025, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16)
"""Deflation depths [m], in the order in which they are tried."""
DEEPEST = DEPTHS[-4:-1]
"""Depths tried once the folds are open [m]."""


@dataclass(frozen=True)
class Clearing:
    """Body frames from the thinnest, which a garment is clear of, to the body itself; each (k, 3) [m].

    description: deflation in words; a single frame means that no deflation was needed.
    """

    frames: tuple[Floats, ...]
    description: str = ""

    @property
    def body(self) -> Floats:
        """Thinnest frame, (k, 3) [m]."""
        return self.frames[0]


def clearings(garment: Floats, triangles: Ints, body: BodySurface) -> Iterator[Clearing]:
    """Clearings by the least depth that frees `garment` (n, 3) [m] of the body, then of the body unfolded.

    The second serves where inflation fails: creases that close pinch the cloth in them.
    """

    def clear_of(positions: Floats) -> bool:
        together = np.concatenate([garment, positions])
        if len(intersecting_pairs(together, triangles, body.triangles + len(garment), limit=1)):
            return False  # found in a tenth of the time that preparing the body takes
        try:
            surface = body_surface(positions, body.triangles)
        except TransferError:  # the deflated body has no volume
            return False
        return not surface.penetration(garment).count

    def thinner(of: BodySurface, depths: Sequence[float]) -> tuple[float, Floats] | None:
        half, normals = half_thickness(of), outward_normals(of)
        thin = ((depth, deflated(of, depth, half, normals)) for depth in depths)
        return next((thinned for thinned in thin if clear_of(thinned[1])), None)

    if clear_of(body.positions):
        yield Clearing((body.positions,))
        return
    thinned = thinner(body, DEPTHS)
    if thinned is not None:
        yield Clearing((thinned[1], body.positions), f"{1e3 * thinned[0]:.3g} mm thinner")
    for opened in unfolding(body.positions, body.triangles):
        thinned = thinner(body_surface(opened, body.triangles), DEEPEST)
        if thinned is not None:
            description = f"without folds and {1e3 * thinned[0]:.3g} mm thinner"
            yield Clearing((thinned[1], opened, body.positions), description)
            return


OPENING_DEPTHS = (0.006, 0.012)
"""Depths by which a body is pressed in at an overlap [m], in the order in which they are tried."""
NEAR = 0.06
"""Distance from a point within which an overlap is there, as a fraction of the body's largest extent."""
LINKED = 0.03
"""Distance within which points belong to one overlap, as such a fraction."""
WHOLE, NONE = 0.018, 0.055
"""Distances from the overlap up to which, and from which on, the depth is whole and none, as such fractions."""


@dataclass(frozen=True)
class Overlap:
    """Overlap of a body with itself.

    Parameters
    ----------
    points : (k, 3) array
        Points at which triangles of the body intersect one another [m].
    opened : (n, 3) array
        The body, pressed in about them [m].
    depth : float
        Depth of that [m].
    reach : float
        Distance from the points within which it is pressed in [m].
    """

    points: Floats
    opened: Floats
    depth: float
    reach: float

    def __len__(self) -> int:
        return len(self.points)

    def holds(self, positions: Floats) -> np.ndarray:
        """Mask (m,) of the positions (m, 3) [m] that are where the body is pressed in."""
        return np.asarray(_distances(self.points, positions) < self.reach)

    @property
    def where(self) -> str:
        """Their mean as text."""
        return f"near ({', '.join(f'{value:.3g}' for value in self.points.mean(axis=0))}) m"


NO_OVERLAP = Overlap(np.zeros((0, 3)), np.zeros((0, 3)), 0.0, 0.0)


def overlaps_at(body: BodySurface, place: Floats) -> Iterator[Overlap]:
    """Yield the overlap that begins near a place (3,) [m], at each of the OPENING_DEPTHS; nothing where none does."""
    pairs = intersecting_pairs(body.positions, body.triangles)
    points = intersection_points(body.positions, body.triangles, body.triangles, pairs)
    extent = float(np.ptp(body.positions, axis=0).max())
    if not len(points):
        return
    links = cKDTree(points).query_pairs(LINKED * extent, output_type="ndarray")
    label = components(np.column_stack([links, links[:, 1]]), len(points))
    points = points[np.isin(label, label[np.linalg.norm(points - place, axis=1) < NEAR * extent])]
    if not len(points):
        return
    left = (NONE * extent - _distances(points, body.positions)) / ((NONE - WHOLE) * extent)
    left = np.clip(left, 0.0, 1.0)
    weights = left * left * (3.0 - 2.0 * left)
    half, normals = half_thickness(body), outward_normals(body)
    for depth in OPENING_DEPTHS:
        inward = deflated(body, depth, half, normals) - body.positions
        yield Overlap(points, body.positions + weights[:, None] * inward, depth, NONE * extent)


def flypapered_rows(overlap: Overlap, positions: Floats, flypapered: np.ndarray) -> Ints:
    """Rows of the vertices (n, 3) [m] that are marked as flypapered (n,) where the body overlaps itself."""
    return np.flatnonzero(flypapered & overlap.holds(positions)).astype(np.int64)


def _distances(points: Floats, positions: Floats) -> Floats:
    """Distances (m,) of positions (m, 3) to the nearest of the points (k, 3) [m]."""
    return np.asarray(cKDTree(points).query(positions)[0], np.float64)
