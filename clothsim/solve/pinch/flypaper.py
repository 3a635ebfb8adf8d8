"""Flypapered vertices: cloth vertices that follow a triangle of a body while two parts close on them; their record."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.base.triangles import half_edges
from clothsim.mesh.world import SurfaceRows, World
from clothsim.physics.energies.base import Constraint, Prescribed
from clothsim.solve.pinch.pinch_gaps import PinchedVertices, frames, normals
from clothsim.solve.stepping.state import State

MEMORY = "contact.pinch"
"""Name of the flypapered vertices in `State.memory`."""
WIDENING = "contact.pinch.widening"
"""Name of the factor on the gap of a pinch in `State.memory`."""


@dataclass(frozen=True)
class Flypapered:
    """Flypapered vertices and where each is on its triangle.

    Parameters
    ----------
    vertices : (k,) int array
        Rows of x, ascending.
    triangles : (k, 3) int array
        Rows of x of the body triangle that supports each.
    weights : (k, 3) array
        Weights of its corners, at the point to which the offset belongs.
    offsets : (k, 3) array
        From that point to the vertex, in the frame of the triangle: two tangents and the normal [m].
    far : (k, 3) int array
        Rows of x of the body triangle that closed on the vertex from the other side.
    far_weights : (k, 3) array
        Weights of its corners, at the point that did.
    """

    vertices: Ints
    triangles: Ints
    weights: Floats
    offsets: Floats
    far: Ints
    far_weights: Floats

    def __len__(self) -> int:
        return len(self.vertices)

    def points(self, x: Floats) -> Floats:
        """Points of the triangles at x (N, 3), (k, 3) [m]."""
        return np.asarray(np.einsum("kc,kcd->kd", self.weights, x[self.triangles]))

    def positions(self, x: Floats) -> Floats:
        """Positions of the vertices where the bodies are as in x (N, 3), (k, 3) [m]."""
        return self.points(x) + np.einsum("kc,kcd->kd", self.offsets, frames(x, self.triangles))

    def far_heights(self, x: Floats) -> Floats:
        """Heights of the far points above the triangles at x (N, 3), (k,) [m]; negative where the parts crossed."""
        far = np.einsum("kc,kcd->kd", self.far_weights, x[self.far])
        return np.asarray(np.einsum("kd,kd->k", far - self.points(x), normals(x, self.triangles)))

    def only(self, chosen: np.ndarray) -> Self:
        """Those of a mask or of indices."""
        return type(self)(*(each[chosen] for each in self._parts))

    def joined(self, other: Self) -> Self:
        """Both, by ascending vertices; they have none in common."""
        joined = type(self)(*(np.concatenate(two) for two in zip(self._parts, other._parts, strict=True)))
        return joined.only(np.argsort(joined.vertices))

    def mask(self, size: int) -> np.ndarray:
        """The vertices as a mask over the rows of x, (N,)."""
        mask = np.zeros(size, bool)
        mask[self.vertices] = True
        return mask

    def raised(self, by: Floats) -> Self:
        """Further along the normals of the triangles, by (k,) [m]."""
        offsets = self.offsets.copy()
        offsets[:, 2] += by
        return replace(self, offsets=offsets)

    def as_array(self) -> Floats:
        """One row a vertex, (k, 16), as a checkpoint keeps it."""
        return np.column_stack(self._parts).astype(np.float64)

    @property
    def _parts(self) -> tuple[Any, ...]:
        return self.vertices, self.triangles, self.weights, self.offsets, self.far, self.far_weights


def flypapered_in(memory: Mapping[str, Any]) -> Flypapered:
    """Return the flypapered vertices that a state remembers."""
    rows = np.asarray(memory.get(MEMORY, ()), np.float64).reshape(-1, 16)
    whole = rows.astype(np.int64)
    return Flypapered(whole[:, 0], whole[:, 1:4], rows[:, 4:7], rows[:, 7:10], whole[:, 10:13], rows[:, 13:])


NONE_FLYPAPERED = flypapered_in({})


def attached(x: Floats, vertices: Ints, near: tuple[Ints, Floats], far: tuple[Ints, Floats]) -> Flypapered:
    """Return the vertices flypapered from where they are in x (N, 3) [m].

    near, far: triangles (k, 3) that support them and that close on them, and the weights (k, 3) of a point of each.
    """
    triangles, weights = near
    points = np.einsum("kc,kcd->kd", weights, x[triangles])
    offsets = np.einsum("kd,kcd->kc", x[vertices] - points, frames(x, triangles))
    return Flypapered(vertices, triangles, weights, offsets, *far)


def with_bodies(world: World, x: Floats, time: float) -> Floats:
    """Return x (N, 3) with the bodies where they are at `time` [s]."""
    moved = x.copy()
    for body, rows in zip(world.bodies, world.body_slices, strict=True):
        if not body.motion.still:
            moved[rows] = body.at(time)
    return moved


@dataclass(frozen=True)
class FlypaperedPositions(Constraint):
    """Dirichlet positions of flypapered vertices: those of their triangles at the time, and their offsets."""

    world: World
    flypapered: Flypapered

    @property
    def still(self) -> bool:
        """False: the body moves."""
        return False

    def at(self, time: float) -> Prescribed:
        """The flypapered vertices and their positions at `time` [s]."""
        bodies = with_bodies(self.world, self.world.start(), time)
        return Prescribed(self.flypapered.vertices, self.flypapered.positions(bodies))

    def holder(self, row: int) -> str:
        """The key of the scene, for a flypapered row."""
        return "contact.pinch" if row in self.flypapered.vertices else ""


# Parts of bodies at a pinch: the supporting surface of each vertex, and the patch of the body that is its own.

SAME_PINCH = 4.0
"""Distance within which a vertex is held by the part that carries its neighbour, in median cloth edges."""
MUCH_MORE = 1.5
"""Ratio of the displacements of two parts in a step from which on they are not alike."""
OWN_PART = 2.0
"""Ratio of the distances of two points at the start of the run from which on a vertex is of the part of the nearer."""
OWN_PATCH = 2.5
"""Radius of the patch about a supporting triangle with which contact goes on, in longest cloth edges."""
FACES_AWAY = -0.3
"""Cosine of the normals from which on a triangle does not belong to the patch of a supporting triangle."""


def median_and_longest_edge(world: World, x: Floats) -> tuple[float, float]:
    """Median and largest length of the cloth edges at x [m]."""
    lengths = np.linalg.norm(x[world.edges[:, 1]] - x[world.edges[:, 0]], axis=1)
    return float(np.median(lengths)), float(lengths.max())


def with_supports(world: World, x: Floats, end: Floats, found: PinchedVertices, known: Flypapered) -> Flypapered:
    """Carry the vertices of a pinch from where they are.

    Of the two points between which a vertex is pinched, one may have been much nearer to it at the start of the run:
    its part holds the vertex. So the trunk holds the side of a shirt, also where an arm turns back and both move alike.
    Among other vertices, that in the narrowest gap is held by the part that moves less against the whole cloth; where
    both move about alike, by the closer one. Those about it are held by the same part: cloth on two parts would be torn
    where they slide along one another.

    Parameters
    ----------
    world : World
        Meshes.
    x, end : (N, 3) array
        At the start of the step, and as it would end: the bodies there, the cloth with its velocity [m].
    found : PinchedVertices
        The pinch, without vertices of `known`.
    known : Flypapered
        Flypapered already.
    """
    if not len(found.vertices):
        return known
    near, far = normals(x, found.near), normals(x, found.far)
    at, reach = x[found.vertices], SAME_PINCH * median_and_longest_edge(world, x)[0]
    distance, along = np.full(len(at), np.inf), near.copy()
    if len(known):
        distance, nearest = cKDTree(x[known.vertices]).query(at)
        along = normals(x, known.triangles)[nearest]
    moves = end - x
    common, left = moves[: world.n_cloth].mean(axis=0), np.ones(len(at), bool)
    sides = (found.near, found.near_weights), (found.far, found.far_weights)
    slow, fast = (np.linalg.norm(np.einsum("kc,kcd->kd", w, moves[rows]) - common, axis=1) for rows, w in sides)
    takes_near = slow <= MUCH_MORE * fast  # the nearer part moves less against the cloth, or about as much
    begun = world.start()
    for body, rows in zip(world.bodies, world.body_slices, strict=True):
        begun[rows] = body.positions  # also where a body is moved by hand
    points = (np.einsum("kc,kcd->kd", w, begun[rows]) for rows, w in sides)
    from_near, from_far = (np.linalg.norm(begun[found.vertices] - point, axis=1) for point in points)
    is_of_near, is_of_far = OWN_PART * from_near <= from_far, OWN_PART * from_far <= from_near
    takes_near = (takes_near | is_of_near) & ~is_of_far
    for _ in range(len(at)):
        rank = np.where(left, distance, np.inf)
        k = int(rank.argmin())
        if not rank[k] <= reach:
            k = int(np.where(left, found.gaps, np.inf).argmin())
        elif not (is_of_near[k] or is_of_far[k]):
            takes_near[k] = near[k] @ along[k] >= far[k] @ along[k]
        left[k] = False
        normal = near[k] if takes_near[k] else far[k]
        closer = np.linalg.norm(at - at[k], axis=1)
        distance, along = (
            np.where(closer < distance, closer, distance),
            np.where((closer < distance)[:, None], normal, along),
        )
    takes = takes_near[:, None]
    support = np.where(takes, found.near, found.far), np.where(takes, found.near_weights, found.far_weights)
    other = np.where(takes, found.far, found.near), np.where(takes, found.far_weights, found.near_weights)
    return known.joined(attached(x, found.vertices, support, other))


def own_rows(world: World, x: Floats, flypapered: Flypapered) -> Ints:
    """Sorted keys v N + q of the body rows q of the patch about the supporting triangle of each flypapered row v.

    The patch grows from the triangle over common edges, as far as OWN_PATCH and while the normals do not face away.
    """
    triangles = world.body_triangles
    unit, centres = normals(x, triangles), x[triangles].mean(axis=1)
    radii = np.linalg.norm(x[triangles] - centres[:, None], axis=2).max(axis=1)
    radius = OWN_PATCH * median_and_longest_edge(world, x)[1]
    size, wanted = len(x), flypapered.triangles
    keys, sought = ((each[:, 0] * size + each[:, 1]) * size + each[:, 2] for each in (triangles, wanted))
    order = np.argsort(keys)
    starts = order[np.searchsorted(keys[order], sought)]
    edges = np.sort(half_edges(triangles), axis=1)
    keys = edges[:, 0] * size + edges[:, 1]
    order = np.argsort(keys, kind="stable")
    _, first, counts = np.unique(keys[order], return_index=True, return_counts=True)
    pairs, other = first[counts == 2], np.full(len(keys), -1)  # -1 at a border, and where more than two meet
    other[order[pairs]], other[order[pairs + 1]] = order[pairs + 1] // 3, order[pairs] // 3
    points, across = flypapered.points(x), other.reshape(-1, 3)
    seen = front = np.arange(len(flypapered)) * len(triangles) + starts
    while len(front):
        of, face = np.repeat(front // len(triangles), 3), across[front % len(triangles)].ravel()
        of, face = of[face >= 0], face[face >= 0]
        closer = np.linalg.norm(centres[face] - points[of], axis=1) - radii[face] <= radius
        ahead = np.einsum("kd,kd->k", unit[face], unit[starts[of]]) > FACES_AWAY
        keys = (of * len(triangles) + face)[closer & ahead]
        front = np.setdiff1d(keys, seen)
        seen = np.union1d(seen, front)
    rows = triangles[seen % len(triangles)]
    return np.unique(flypapered.vertices[seen // len(triangles)][:, None] * len(x) + rows)


# Record of flypapered vertices over a run, and the intersections that the policy of a pinch exempts.


if TYPE_CHECKING:
    from clothsim.geometry.intersection.crossings import Crossing


@dataclass(frozen=True)
class PinchRecord:
    """Flypapered vertices so far.

    Parameters
    ----------
    vertices : tuple of int
        Rows of x of all that were ever flypapered.
    most, now : int
        The most in one step, and those of the last one.
    steps : int
        Steps with any.
    released : int
        Releases.
    first_time, last_time : float or None
        Ends of the first and of the last step with any [s].
    first_position : (3,) tuple of float or None
        Their mean position at the end of the first one, in the coordinates of the scene [m].
    exempt_states : int
        Checked states in which triangles of flypapered vertices intersect.
    exempt_pairs : int
        The most such pairs of triangles in one state.
    """

    vertices: tuple[int, ...] = ()
    most: int = 0
    now: int = 0
    steps: int = 0
    released: int = 0
    first_time: float | None = None
    last_time: float | None = None
    first_position: tuple[float, ...] | None = None
    exempt_states: int = 0
    exempt_pairs: int = 0

    def after(self, world: World, before: State, state: State, found: "Sequence[Crossing]") -> Self:
        """Return the record after one more step from `before` to `state`, whose intersections are `found`."""
        was, now = (flypapered_in(each.memory).vertices for each in (before, state))
        exempt = sum(len(each.pairs) for each in found if each.role == "carried")
        more = replace(
            self,
            vertices=tuple(int(row) for row in np.union1d(self.vertices, now)),
            most=max(self.most, len(now)),
            now=len(now),
            released=self.released + len(np.setdiff1d(was, now)),
            exempt_states=self.exempt_states + (exempt > 0),
            exempt_pairs=max(self.exempt_pairs, exempt),
        )
        if not len(now):
            return more
        more = replace(more, steps=self.steps + 1, last_time=state.time)
        if self.first_time is not None:
            return more
        mean = state.positions[now].mean(axis=0) + world.origin
        return replace(more, first_time=state.time, first_position=tuple(float(each) for each in mean))

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of the certificate."""
        counts = {name: value for name, value in asdict(self).items() if name != "vertices"}
        exempt = "pairs of triangles of carried vertices, with bodies and with one another, are exempt from contact"
        return {"policy": "carry", "vertices": len(self.vertices), **counts, "exempt": exempt}


def record_from(fields: Mapping[str, Any]) -> PinchRecord:
    """Return the record in a checkpoint."""
    plain: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value for name, value in fields.items()}
    return PinchRecord(**plain)


def exempted(found: "Sequence[Crossing]", surfaces: Sequence[SurfaceRows], vertices: Ints) -> "tuple[Crossing, ...]":
    """Separate the intersections of flypapered vertices (k,), rows of x: their role is "carried".

    With a body, those of triangles with a flypapered vertex; among cloth, those of two such triangles.
    """
    by_name = {s.name: np.asarray(np.isin(s.triangles, vertices).any(axis=1)) for s in surfaces}
    separated = []
    for crossing in found:
        exempt = by_name[crossing.first][crossing.pairs[:, 0]]
        if crossing.role == "cloth":
            exempt = exempt & by_name[crossing.second][crossing.pairs[:, 1]]
        for role, chosen in ((crossing.role, ~exempt), ("carried", exempt)):
            if chosen.any():
                separated.append(replace(crossing, pairs=crossing.pairs[chosen], role=role))
    return tuple(separated)
