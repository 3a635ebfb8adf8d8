"""Barrier with sums, derivatives, candidates and collision detection by ipctk: the oracle of contact."""

from collections import Counter
from dataclasses import dataclass
from time import perf_counter
from typing import Self

import ipctk
import numpy as np
from scipy import sparse

from clothsim.base.arrays import Floats
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.contact.candidates import SLACK, Candidates
from clothsim.physics.contact.filter import follows_path
from clothsim.physics.contact.surface import ContactSurface
from clothsim.physics.energies.base import Step

MIN_SEPARATION = 1e-6
"""Fraction of d_hat below which no step brings a pair: ipctk's additive CCD takes millions of steps at round-off."""


class IpctkCandidates(Candidates):
    """Candidate cache with ipctk's broad phase, collision sets and additive CCD; without offset."""

    def __init__(self, surface: ContactSurface, d_hat: float, skin: float) -> None:
        self.mesh = collision_mesh(surface)
        self._count = int(surface.rows.max()) + 1
        super().__init__(surface, d_hat, skin)

    def clear(self) -> None:
        """Search again at the next call."""
        super().clear()
        self._ipctk_candidates = ipctk.Candidates()
        self._pushing = ipctk.Candidates()
        self._shared: SharedFeatures | None = None
        self._ipctk_path: tuple[Floats, Floats] | None = None  # of the last search
        self._collisions_at: Floats | None = None
        self._collisions: tuple[ipctk.NormalCollisions, ...] = ()

    def rows_of(self, x: Floats) -> Floats:
        """Rows of x that ipctk knows, in the column-major order that it takes."""
        return np.asfortranarray(x[: self._count])

    def collisions(self, x: Floats) -> tuple[ipctk.NormalCollisions, ...]:
        """Collisions at x, weighted by area, and those that exclude what triangles share."""
        if self._collisions_at is not None and np.array_equal(x, self._collisions_at):
            return self._collisions
        start = perf_counter()
        self._ensure_ipctk_covers(x, x)
        collisions = ipctk.NormalCollisions()
        collisions.use_area_weighting = True
        collisions.build(self._pushing, self.mesh, self.rows_of(x), self.d_hat)
        assert self._shared is not None
        self._collisions = collisions, self._shared.collisions(x)
        self._collisions_at = x.copy()
        self.pairs = len(collisions)
        self.seconds["candidates"] += perf_counter() - start
        return self._collisions

    def minimum_gap(self, x: Floats) -> float:
        """Smallest distance of an active pair [m]; inf where no pair is active."""
        self._ensure_ipctk_covers(x, x)
        collisions = ipctk.NormalCollisions()
        collisions.build(self._ipctk_candidates, self.mesh, self.rows_of(x), self.d_hat)
        if not len(collisions):
            return np.inf
        return float(np.sqrt(collisions.compute_minimum_distance(self.mesh, self.rows_of(x))))  # it returns the square

    def step_limit(self, x: Floats, dx: Floats, most: float = 1.0) -> float:
        """Collision-free fraction of dx, at most `most`; keeps MIN_SEPARATION d_hat or half the gap."""
        separation = min(MIN_SEPARATION * self.d_hat, 0.5 * self.minimum_gap(x))
        start = perf_counter()
        self._ensure_ipctk_covers(x, x + dx)
        searched = perf_counter()
        ccd = ipctk.AdditiveCCD(conservative_rescaling=SLACK)
        paths = self.rows_of(x), self.rows_of(x + dx)
        fraction = self._ipctk_candidates.compute_collision_free_stepsize(self.mesh, *paths, separation, ccd)
        self.ccd_calls += 1
        self.seconds["candidates"] += searched - start
        self.seconds["CCD"] += perf_counter() - searched
        return min(most, float(fraction))

    def _ensure_ipctk_covers(self, before: Floats, after: Floats) -> None:
        """Search again unless ipctk's candidates hold every pair closer than d_hat on a path."""
        rows = self.surface.rows
        if self._ipctk_path is not None and all(
            follows_path(x, *self._ipctk_path, rows, self.skin) for x in (before, after)
        ):
            return
        self._ipctk_candidates, self._ipctk_path = ipctk.Candidates(), (before.copy(), after.copy())
        inflation = 0.5 * self.d_hat + 2.0 * self.skin
        self._ipctk_candidates.build(self.mesh, self.rows_of(before), self.rows_of(after), inflation, ipctk.LBVH())
        flat_points = set(self.surface.flat.points.tolist())
        flat_edges = set(np.flatnonzero(self.surface.are_flat(self.mesh.edges)).tolist())
        found, self._pushing = self._ipctk_candidates, ipctk.Candidates()
        self._pushing.fv_candidates = [pair for pair in found.fv_candidates if pair.vertex_id not in flat_points]
        self._pushing.ee_candidates = [
            pair for pair in found.ee_candidates if flat_edges.isdisjoint((pair.edge0_id, pair.edge1_id))
        ]
        self._shared = shared_features(self._pushing, self.mesh)
        self.builds += 1


@dataclass(frozen=True)
class SharedFeatures:
    """Edges and vertices that triangles share: the terms of `distinct_features` beside the triangles.

    ipctk 1.6.1 has them too (IMPROVED_MAX_APPROX), but counts those of vertices several times.

    Attributes
    ----------
    edges, vertices : (e, 2), (v, 2) array
        Number of a point, and of an edge or vertex.
    edge_weights, vertex_weights : (e,), (v,) array
        Coefficient times a quarter of the area of the point [m2].
    ends : (e, 2) array
        Vertices of the edges.
    """

    edges: np.ndarray
    vertices: np.ndarray
    edge_weights: np.ndarray
    vertex_weights: np.ndarray
    ends: np.ndarray

    def collisions(self, x: Floats) -> ipctk.NormalCollisions:
        """The terms at x: an edge whose closest point is an end counts as that vertex."""
        start, end = x[self.ends[:, 0]], x[self.ends[:, 1]]
        along, offset = end - start, x[self.edges[:, 0]] - start
        t = (along * offset).sum(axis=1) / (along * along).sum(axis=1)
        inside = (t > 0.0) & (t < 1.0)
        closest_ends = np.where(t <= 0.0, self.ends[:, 0], self.ends[:, 1])[~inside]
        found = ipctk.NormalCollisions()
        found.ev_collisions = [
            _weighted(ipctk.EdgeVertexNormalCollision(edge, point), weight)
            for (point, edge), weight in zip(self.edges[inside], self.edge_weights[inside], strict=True)
        ]
        points = np.concatenate([self.vertices[:, 0], self.edges[~inside, 0]])
        others = np.concatenate([self.vertices[:, 1], closest_ends])
        weights = np.concatenate([self.vertex_weights, self.edge_weights[~inside]])
        found.vv_collisions = [
            _weighted(ipctk.VertexVertexNormalCollision(*two), weight)
            for *two, weight in zip(points, others, weights, strict=True)
        ]
        return found


def _weighted(collision: ipctk.NormalCollision, weight: float) -> ipctk.NormalCollision:
    collision.weight = weight
    return collision


def shared_features(candidates: ipctk.Candidates, mesh: ipctk.CollisionMesh) -> SharedFeatures:
    """Count the triangles of each point's candidates at every edge and vertex."""
    triangles: Counter[tuple[int, int]] = Counter()
    extra: Counter[tuple[int, int]] = Counter()
    edges: Counter[tuple[int, int]] = Counter()
    for pair in candidates.fv_candidates:
        triangles.update((pair.vertex_id, int(corner)) for corner in mesh.faces[pair.face_id])
        edges.update((pair.vertex_id, int(edge)) for edge in mesh.faces_to_edges[pair.face_id])
    for (point, edge), count in edges.items():
        extra.update({(point, int(end)): count - 1 for end in mesh.edges[edge]})
    of_edges = {key: 1 - count for key, count in edges.items() if count > 1}
    of_vertices = {key: 1 - count + extra[key] for key, count in triangles.items() if 1 - count + extra[key]}
    rows = [np.array(list(each), np.int64).reshape(-1, 2) for each in (of_edges, of_vertices)]
    weights = [
        np.array(list(each.values())) * np.array([mesh.vertex_area(point) / 4 for point, _ in each])
        for each in (of_edges, of_vertices)
    ]
    ends = np.asarray(mesh.edges)[rows[0][:, 1]].reshape(-1, 2)
    return SharedFeatures(rows[0], rows[1], weights[0], weights[1], ends)


@dataclass(frozen=True)
class IpctkBarrier(Barrier):
    """`Barrier` with its sums and derivatives by ipctk; friction still takes its pairs from the numba path."""

    candidates: IpctkCandidates
    exact_in_newton = False

    def begin(self, step: Step) -> Self:
        """Copy for the step; clears the cache, as ipctk sums in its search order and a resumed run must repeat it."""
        self.candidates.clear()
        return super().begin(step)

    def value(self, x: Floats) -> float:
        """Barrier energy [J]; +inf where a pair touches."""
        candidates = self.candidates
        rows = candidates.rows_of(x)
        value = sum(float(self._potential(found, candidates.mesh, rows)) for found in candidates.collisions(x))
        return value if np.isfinite(value) else np.inf

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        out = np.zeros_like(x)
        rows = self.candidates.rows_of(x)
        for found in self.candidates.collisions(x):
            if len(found):
                out[: len(rows)] += self._potential.gradient(found, self.candidates.mesh, rows).reshape(-1, 3)
        return out

    def hessian(self, x: Floats, project: bool = True) -> sparse.csr_array:
        """d2E/dx2 over all rows [N/m]; projected pair by pair, or exact."""
        method = ipctk.PSDProjectionMethod.CLAMP if project else ipctk.PSDProjectionMethod.NONE
        rows = self.candidates.rows_of(x)
        present = [found for found in self.candidates.collisions(x) if len(found)]
        if not present:
            return sparse.csr_array((x.size, x.size))
        columns = sum(self._potential.hessian(found, self.candidates.mesh, rows, method) for found in present)
        # the matrix is symmetric: its compressed columns are its compressed rows
        pointers = np.concatenate([columns.indptr, np.full(x.size - rows.size, columns.nnz, columns.indptr.dtype)])
        return sparse.csr_array((columns.data, columns.indices, pointers), shape=(x.size, x.size))

    @property
    def _potential(self) -> ipctk.BarrierPotential:
        return ipctk.BarrierPotential(self.d_hat, self.stiffness, True)


def by_ipctk(contact: Barrier) -> IpctkBarrier:
    """The same barrier by ipctk; it knows no offset and no excluded pairs."""
    surface = contact.candidates.surface
    first, second = np.unique(surface.labels[surface.first.points]), np.unique(surface.labels[surface.second.points])
    assert not contact.offset
    assert surface.allowed[np.ix_(first, second)].all()
    candidates = IpctkCandidates(surface, contact.d_hat, skin=contact.d_hat)
    scales = contact.areas, contact.masses, contact.stiffness, contact.adaptive
    return IpctkBarrier(candidates, contact.d_hat, 0.0, *scales, contact.name)


def collision_mesh(surface: ContactSurface) -> ipctk.CollisionMesh:
    """The surface as an ipctk mesh: all rows up to the last that collides. Excluded pairs of objects are ignored."""
    count = int(surface.rows.max()) + 1
    groups = (surface.first,) if surface.is_self_contact else (surface.first, surface.second)
    edges = np.concatenate([group.edges for group in groups])
    rest = surface.rest_positions[:count]
    mesh = ipctk.CollisionMesh(*(np.asfortranarray(array) for array in (rest, edges, surface.triangles)))
    if not surface.is_self_contact:
        mesh.can_collide = ipctk.make_vertex_patches_filter(_group_labels(surface, count))
    return mesh


def _group_labels(surface: ContactSurface, count: int) -> np.ndarray:
    """0 for the rows of the first group, 1 for those of the second."""
    group_labels = np.zeros(count, np.int32)
    group_labels[surface.second.points] = 1
    return group_labels
