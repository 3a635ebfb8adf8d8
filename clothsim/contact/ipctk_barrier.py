"""The same barrier by ipctk (`contact.backend = "ipctk"`): the oracle of the numba path, and its stand-in."""

from dataclasses import dataclass
from time import perf_counter
from typing import Self

import ipctk
import numpy as np
from scipy import sparse

from clothsim.arrays import Floats
from clothsim.contact.barrier import Barrier
from clothsim.contact.candidates import SLACK, Candidates
from clothsim.contact.filter import keeps_to
from clothsim.contact.surface import ContactSurface
from clothsim.energies.step import Step

SEPARATION = 1e-6
"""Share of d_hat below which no step brings a pair: ipctk's additive CCD takes millions of steps at round-off."""


class IpctkCandidates(Candidates):
    """The cache with ipctk's broad phase, collision sets and additive CCD; `limit` is d_hat, the offset 0."""

    def __init__(self, surface: ContactSurface, limit: float, reach: float) -> None:
        self.mesh = collision_mesh(surface)
        self._count = int(surface.rows.max()) + 1
        super().__init__(surface, limit, reach)

    def clear(self) -> None:
        """As the numba cache's."""
        super().clear()
        self._found = ipctk.Candidates()
        self._path: tuple[Floats, Floats] | None = None  # of the last search
        self._collisions_at: Floats | None = None
        self._collisions = ipctk.NormalCollisions()

    def rows_of(self, x: Floats) -> Floats:
        """The rows that ipctk knows, in the column-major order that it takes."""
        return np.asfortranarray(x[: self._count])

    def collisions(self, x: Floats) -> ipctk.NormalCollisions:
        """The pairs closer than d_hat at x, weighted by area."""
        if self._collisions_at is not None and np.array_equal(x, self._collisions_at):
            return self._collisions
        start = perf_counter()
        self._cover(x, x)
        collisions = ipctk.NormalCollisions()
        collisions.use_area_weighting = True
        collisions.build(self._found, self.mesh, self.rows_of(x), self.limit)
        self._collisions, self._collisions_at = collisions, x.copy()
        self.pairs = len(collisions)
        self._least = np.inf
        if self.pairs:  # ipctk returns the squared distance
            self._least = float(np.sqrt(collisions.compute_minimum_distance(self.mesh, self.rows_of(x))))
        self.seconds["candidates"] += perf_counter() - start
        return collisions

    def minimum_gap(self, x: Floats) -> float:
        """The smallest distance of a pair [m] where it is below d_hat, else inf."""
        self.collisions(x)
        return self._least

    def step_limit(self, x: Floats, dx: Floats, most: float = 1.0) -> float:
        """The fraction of dx, at most `most`, that is free of collision; keeps SEPARATION d_hat or half the gap."""
        separation = min(SEPARATION * self.limit, 0.5 * self.minimum_gap(x))
        start = perf_counter()
        self._cover(x, x + dx)
        searched = perf_counter()
        ccd = ipctk.AdditiveCCD(conservative_rescaling=SLACK)
        ways = self.rows_of(x), self.rows_of(x + dx)
        fraction = self._found.compute_collision_free_stepsize(self.mesh, *ways, separation, ccd)
        self.ccd_calls += 1
        self.seconds["candidates"] += searched - start
        self.seconds["CCD"] += perf_counter() - searched
        return min(most, float(fraction))

    def _cover(self, before: Floats, after: Floats) -> None:
        """Let ipctk's candidates hold every pair that comes closer than d_hat on a way: by its last search if near."""
        rows = self.surface.rows
        if self._path is not None and all(keeps_to(x, *self._path, rows, self.reach) for x in (before, after)):
            return
        self._found, self._path = ipctk.Candidates(), (before.copy(), after.copy())
        inflation = 0.5 * self.limit + 2.0 * self.reach
        self._found.build(self.mesh, self.rows_of(before), self.rows_of(after), inflation, ipctk.LBVH())
        self.builds += 1


@dataclass(frozen=True)
class IpctkBarrier(Barrier):
    """`Barrier` with its sums and derivatives by ipctk; friction still takes its pairs from the numba path."""

    candidates: IpctkCandidates
    exact_in_newton = False

    def begin(self, step: Step) -> Self:
        """As the numba path's. ipctk sums in the order of its search: a resumed run must search where this one did."""
        self.candidates.clear()
        return super().begin(step)

    def value(self, x: Floats) -> float:
        """Barrier energy [J]; +inf where a pair touches."""
        collisions = self.candidates.collisions(x)
        if not len(collisions):
            return 0.0
        value = float(self._potential(collisions, self.candidates.mesh, self.candidates.rows_of(x)))
        return value if np.isfinite(value) else np.inf

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        out = np.zeros_like(x)
        collisions = self.candidates.collisions(x)
        if len(collisions):
            rows = self.candidates.rows_of(x)
            out[: len(rows)] = self._potential.gradient(collisions, self.candidates.mesh, rows).reshape(-1, 3)
        return out

    def hessian(self, x: Floats, project: bool = True) -> sparse.csr_array:
        """d2E/dx2 over all rows [N/m]; projected pair by pair, or exact."""
        collisions = self.candidates.collisions(x)
        if not len(collisions):
            return sparse.csr_array((x.size, x.size))
        method = ipctk.PSDProjectionMethod.CLAMP if project else ipctk.PSDProjectionMethod.NONE
        rows = self.candidates.rows_of(x)
        columns = self._potential.hessian(collisions, self.candidates.mesh, rows, method)
        # the matrix is symmetric: its compressed columns are its compressed rows
        pointers = np.concatenate([columns.indptr, np.full(x.size - rows.size, columns.nnz, columns.indptr.dtype)])
        return sparse.csr_array((columns.data, columns.indices, pointers), shape=(x.size, x.size))

    @property
    def _potential(self) -> ipctk.BarrierPotential:
        return ipctk.BarrierPotential(self.d_hat, self.stiffness, True)


def collision_mesh(surface: ContactSurface) -> ipctk.CollisionMesh:
    """The surface as ipctk takes it: all rows up to the last that collides. It knows no pairs of names to leave out."""
    count = int(surface.rows.max()) + 1
    groups = (surface.first,) if surface.itself else (surface.first, surface.second)
    edges = np.concatenate([group.edges for group in groups])
    rest = surface.rest_positions[:count]
    mesh = ipctk.CollisionMesh(*(np.asfortranarray(each) for each in (rest, edges, surface.triangles)))
    if not surface.itself:
        mesh.can_collide = ipctk.make_vertex_patches_filter(_sides(surface, count))
    return mesh


def _sides(surface: ContactSurface, count: int) -> np.ndarray:
    """0 for the rows of the first group, 1 for those of the second."""
    sides = np.zeros(count, np.int32)
    sides[surface.second.points] = 1
    return sides
