"""Smooth displacements of a drape that the model does not explain, and what pictures tell besides them.

Friction holds a garment where it came to lie, and a coarse mesh has other folds: the cloth is elsewhere by a smooth
displacement u that no number explains. It is drawn from a normal distribution of precision B. With the sum linearised
at the drape, slope g and curvature A by the vertices, u = -(A + B)^-1 g is the most probable one, and the sum left is
lower by g'(A + B)^-1 g / 2. A number that moves the vertices by m moves them by m - (A + B)^-1 A m beside it: this is
the variable projection of Golub & Pereyra (1973), "The differentiation of pseudo-inverses and nonlinear least squares
problems whose variables separate".
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array, eye_array, kron
from scipy.sparse.linalg import splu

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import ClothsimError
from clothsim.base.triangles import area_vectors, distinct_edges, half_edges
from clothsim.gradients.camera import Residuals
from clothsim.gradients.run import traced
from clothsim.keys.settings import Solver
from clothsim.scene import paths as keys_by_path
from clothsim.scene.scene import Scene

if TYPE_CHECKING:
    from clothsim.gradients.view_fit import Seen, ViewFit

SPREAD, LENGTH = 0.01, 0.3
"""Standard deviation of a displacement at a point and the length along which it is alike, over the cloth's size."""
STRAIN = 2e-3
"""Standard deviation of the mean strain of a piece of that length."""
PROBES = 12
"""Random vectors with which a trace is estimated (Hutchinson 1989)."""


def precision_of_displacements(positions: Floats, triangles: Ints) -> csr_array:
    """Return B (3 n, 3 n) [1/m2] of the cloth at positions (n, 3) [m].

    It is that of the integral of c (|u|^2/l^2 + |grad u|^2) + |e|^2/(STRAIN l)^2 over the cloth, e the strains of its
    edges: displacements that stretch cloth are unlikely. c = log(10)/(2 pi SPREAD^2) gives u the variance SPREAD^2 in a
    large plane with edges of l/10; sizes are those of the cloth.
    """
    n, size = len(positions), float(np.ptp(positions, axis=0).max())
    ends, edge, _ = distinct_edges(half_edges(triangles))
    thirds = np.linalg.norm(area_vectors(positions[triangles]), axis=1) / 6.0
    of_edges, of_vertices = (
        np.bincount(edge, np.repeat(thirds, 3)),
        np.bincount(triangles.ravel(), np.repeat(thirds, 3)),
    )
    rows = np.repeat(np.arange(len(ends)), 2)
    between = csr_array(coo_array((np.tile([1.0, -1.0], len(ends)), (rows, ends.ravel())), shape=(len(ends), n)))
    along = positions[ends[:, 0]] - positions[ends[:, 1]]
    squares = (along**2).sum(axis=1)
    slopes = np.stack([along, -along], axis=1) / squares[:, None, None]
    places = (3 * ends[:, :, None] + np.arange(3)).ravel()
    strains = csr_array(coo_array((slopes.ravel(), (np.repeat(rows, 3), places)), shape=(len(ends), 3 * n)))
    gradients = between.T @ diags_array(2.0 * of_edges / squares) @ between  # exact of equilateral triangles
    smooth = diags_array(of_vertices / (LENGTH * size) ** 2) + gradients
    stretched = strains.T @ diags_array(of_edges / (STRAIN * LENGTH * size) ** 2) @ strains
    return csr_array(kron(smooth, eye_array(3)) * (np.log(10.0) / (2.0 * np.pi * (SPREAD * size) ** 2)) + stretched)


@dataclass(frozen=True, eq=False)
class PlacedDrape:
    """What is left of the pictures where the cloth may be displaced.

    Parameters
    ----------
    slope : (3 n,) float64
        g, of the sum by the vertices.
    curvature : (3 n, 3 n) sparse
        A, of Gauss and Newton.
    precision : (3 n, 3 n) sparse
        B, of displacements.
    """

    slope: Floats
    curvature: csr_array
    precision: csr_array

    @classmethod
    def of(cls, parts: Sequence[Residuals], precision: csr_array) -> "PlacedDrape":
        """Return that of the residuals of all pictures."""
        slope, curvature = np.zeros(precision.shape[0]), csr_array(precision.shape)
        for each in parts:
            curvature = curvature + each.jacobian.T @ each.jacobian.multiply(each.curvatures[:, None])
            slope += each.jacobian.T @ (each.weights * each.slopes)
        return cls(slope, csr_array(curvature), precision)

    @cached_property
    def _solver(self) -> Any:
        return splu(
            (self.curvature + self.precision).tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}
        )

    @cached_property
    def displacement(self) -> Floats:
        """u of the least sum, (3 n,) [m]."""
        return np.asarray(-self._solver.solve(self.slope))

    @property
    def gain(self) -> float:
        """How much lower the sum is, with its bound."""
        return float(-0.5 * self.slope @ self.displacement)

    @property
    def slope_left(self) -> Floats:
        """g + A u = -B u: the slope of the sum where the cloth is displaced, (3 n,)."""
        return np.asarray(-(self.precision @ self.displacement))

    def beside(self, moves: Floats) -> Floats:
        """Return what derivatives (3 n, k) of the vertices by numbers are beside displacements."""
        return np.asarray(moves - self._solver.solve(np.asarray(self.curvature @ moves)))

    def spread(self) -> float:
        """Return the standard deviation of displacements that the pictures show, over that of `precision`.

        One step of the EM algorithm (Dempster, Laird & Rubin 1977).
        """
        n, u = len(self.slope), self.displacement
        probes = np.random.default_rng(0).choice([-1.0, 1.0], (n, PROBES))
        trace = float((probes * (self.precision @ self._solver.solve(probes))).sum()) / PROBES
        return float(np.sqrt((u @ (self.precision @ u) + trace) / n))

    def covariance(self, moves: Floats, inverse: Floats) -> Floats:
        """Return the covariance (k, k) of numbers by displacements of `precision`.

        moves: derivatives (3 n, k) of the vertices that their step goes by; inverse: of the Hessian of the numbers.
        """
        pulls = np.asarray(self.curvature @ moves)
        return np.asarray(inverse @ (pulls.T @ splu(self.precision.tocsc()).solve(pulls)) @ inverse)


# Drape pulled to where its pictures show it, while friction is off.
#
# Friction holds a garment where it came to lie: how high trousers sit on the hips, and which way a leg hangs. That
# comes from how it was put on, which is not known, and no number of the pattern or fabric can correct it: a fit that
# may not move the garment on the body pays with its fabric. So the cloth is moved by its most probable displacement
# (`PlacedDrape`), in a few short steps of the scene without friction: these keep contact and lengths. The run that
# follows has friction again, and ends at rest.

STEPS, STEP = 4, 0.01
"""Pulls, and the time that each takes [s]."""
PULL = 0.04
"""Largest displacement of a pull, over the size of the cloth."""


def pulled(fit: "ViewFit", seen: "Seen") -> "Seen":
    """Return the run from a drape that was pulled to its pictures, or the given one where that has the lower sum."""
    scene = fit.scene_at(seen.at)
    if not seen.parts or not fit.held:
        return seen
    short = frictionless_step(scene)
    try:
        begun = pulled_positions(fit, seen, short)
    except ClothsimError:  # a view loses sight of the cloth, or a step fails: the drape stays
        return seen
    found = fit.seen(seen.at, begun)
    return found if found.parts and fit.total(found.parts, found.at) < fit.total(seen.parts, seen.at) else seen


def pulled_positions(fit: "ViewFit", seen: "Seen", scene: Scene) -> Floats:
    """Return the positions (n, 3) [m] of least sum among STEPS pulls in a scene. ClothsimError where one fails."""
    held = {name: kappa for name, kappa in fit.problem.stiffness.items() if name in scene.effects}
    x, parts = seen.positions, seen.parts
    best, least, farthest = fit.total(parts, seen.at), x, PULL * float(np.ptp(x, axis=0).max())
    for _ in range(STEPS):
        moved = PlacedDrape.of(parts, precision_of_displacements(x, fit.triangles)).displacement.reshape(-1, 3)
        longest = float(np.linalg.norm(moved, axis=1).max())
        velocity = moved * min(1.0, farthest / max(longest, 1e-12)) / STEP
        trace = traced(scene, held, 0, {"start": x, "velocity": velocity})
        x = trace.cloth_positions()
        parts = fit.residuals(x)
        total = fit.total(parts, seen.at)
        if total < best:
            best, least = total, x
    return least


def frictionless_step(scene: Scene) -> Scene:
    """Return the scene for one step of STEP without friction."""
    for key, value in (("run.duration", STEP), ("run.frames_per_second", 1 / STEP), ("run.until", "time")):
        scene = keys_by_path.replace(scene, key, value)
    scene = replace(scene, effects={name: each for name, each in scene.effects.items() if name != "friction"})
    solver = {key: value for key, value in scene.solver.as_table().items() if key != "error"} | {"dt": STEP}
    return replace(scene, solver=Solver(**solver))
