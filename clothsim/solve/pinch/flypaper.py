"""Flypapered vertices: cloth vertices that follow a triangle of a body while two parts close on them; their record.

Also how they follow it with the choices of a step held, and the derivative of that (`HeldChoices`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.triangles import half_edges
from clothsim.mesh.world import SurfaceRows, World
from clothsim.physics.contact.candidate_subsets import ExclusionMask
from clothsim.physics.energies.base import Constraint, Prescribed
from clothsim.solve.pinch.pinch_gaps import frames, normals
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
    """Dirichlet positions of flypapered vertices: those of their triangles at the time, and their offsets.

    Parameters
    ----------
    world : World
        Meshes.
    flypapered : Flypapered
        The vertices.
    exclusion : ExclusionMask
        Pairs that have no contact meanwhile.
    limit, widening : float
        Gap below which they were found [m], and its factor on that of the scene.
    ahead : float
        End of the step for which they were found [s]; a retry of it may end sooner.
    """

    world: World
    flypapered: Flypapered
    exclusion: ExclusionMask
    limit: float
    widening: float
    ahead: float

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


# How flypapered vertices follow their triangles where the choices of a step are held: the map, and its adjoint.
#
# With the rows of F the tangents and the normal of the triangle, a vertex v is at p = sum w_c x_c + F' o at the end. A
# new one has the weights w of its closest point, or of the far point across the gap, and o = F (v - sum w_c x_c) at the
# start; one that is known has those of the step before, raised along the normal. The adjoint takes derivatives along
# the imaginary axis: exact to round-off, whatever their step.


EASE = 0.25
"""Largest displacement of a vertex along the normal in a step before its release, in units of the limit."""
TO_LIMITS, TO_MIDDLE = 2, 3
"""Rises to twice the limit, and to the middle of the gap; others are -1, 0 and 1 times EASE limit."""
SAME = 1e-9
"""Relative difference of two lengths below which they are one."""
IMAGINARY = 1e-30
"""Imaginary displacement [m] of a derivative."""


def line_meets(points: Floats, along: Floats, corners: Floats) -> tuple[Floats, Floats]:
    """Return t (k,), at which lines p + t d (k, 3) meet the planes of triangles (k, 3, 3), and weights there (k, 3)."""
    e, f, r = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], corners[:, 0] - points
    n, q = np.cross(e, f), np.cross(along, r)
    facing = (along * n).sum(axis=1)
    v, w = -(f * q).sum(axis=1) / facing, (e * q).sum(axis=1) / facing
    return (r * n).sum(axis=1) / facing, np.stack([1.0 - v - w, v, w], axis=1)


@dataclass(frozen=True)
class HeldChoices:
    """What was chosen in a step with flypapered vertices, held where positions vary.

    Parameters
    ----------
    flypapered : Flypapered
        The vertices in that step.
    before : (k,) int array
        Row of each among those flypapered before; -1: new.
    of_far : (k,) bool array
        True for new ones that the far side of the gap holds.
    corners : (k, 3) bool array
        Corners of the triangle, edge or vertex with the closest point of a new one.
    rises : (k,) int array
        Of the known: in units of EASE limit, TO_LIMITS or TO_MIDDLE.
    across : (k, 3) int array
        Rows of x of the triangle on the other side of the gap of TO_MIDDLE.
    at_end : (k,) bool array
        True where that gap is the one ahead.
    """

    flypapered: Flypapered
    before: Ints
    of_far: np.ndarray
    corners: np.ndarray
    rises: Ints
    across: Ints
    at_end: np.ndarray

    @classmethod
    def of(cls, start: State, held: FlypaperedPositions) -> Self:
        """Find the choices of the step from `start` with these vertices."""
        now, known, limit, faces = held.flypapered, flypapered_in(start.memory), held.limit, held.world.body_triangles
        at = start.positions, with_bodies(held.world, start.positions, held.ahead)
        x, row = at[0], np.full(len(at[0]), -1)
        row[known.vertices] = np.arange(len(known))
        before = row[now.vertices]
        far_points = np.einsum("kc,kcd->kd", now.far_weights, x[now.far])
        distances = (np.linalg.norm(x[now.vertices] - each, axis=1) for each in (now.points(x), far_points))
        of_far = (before < 0) & np.greater(*distances)
        corners = np.where(of_far[:, None], now.far_weights, now.weights) > 0.0
        rises, across, at_end = np.zeros(len(now), np.int64), now.triangles.copy(), np.zeros(len(now), bool)
        heights = now.offsets[:, 2]
        rise = np.where(before >= 0, heights - np.append(known.offsets[:, 2], 0.0)[before], 0.0)
        eased = np.abs(np.abs(rise) - EASE * limit) <= SAME * limit
        rises[eased] = np.sign(rise[eased])
        moved = ~eased & (np.abs(rise) > SAME * limit)
        rises[moved] = np.where(np.abs(heights[moved] - 2.0 * limit) <= SAME * limit, TO_LIMITS, TO_MIDDLE)
        for k in np.flatnonzero(rises == TO_MIDDLE):
            least = np.inf
            for end, positions in enumerate(at):
                own, corners_there = now.only(np.array([k])), positions[faces]
                with np.errstate(divide="ignore", invalid="ignore"):
                    gaps, there = line_meets(own.points(positions), normals(positions, own.triangles), corners_there)
                off = np.where(there.min(axis=1) >= -SAME, np.abs(gaps - 2.0 * heights[k]), np.inf)
                if np.nanmin(off) < least:
                    least, across[k], at_end[k] = np.nanmin(off), faces[np.nanargmin(off)], bool(end)
        return cls(now, before, of_far, corners, rises, across, at_end)

    @property
    def rows(self) -> Ints:
        """Rows of x of each vertex, its triangle, the far one and that across, (k, 10)."""
        own = self.flypapered
        return np.hstack([own.vertices[:, None], own.triangles, own.far, self.across])

    def inputs(self, start: Floats, ahead: Floats, end: Floats, known: Flypapered, limit: float) -> tuple[Floats, ...]:
        """What `follow` takes, from positions (N, 3) at the start, with the bodies ahead and at the end [m]."""
        own, rows = self.flypapered, self.rows
        known = known if len(known) else own  # -1 is a row of any
        whole = start[rows], ahead[rows[:, 1:]], end[own.triangles], known.weights[self.before]
        return *whole, known.offsets[self.before], np.full((len(own), 1), limit)

    def follow(
        self, start: Floats, ahead: Floats, end: Floats, weights: Floats, offsets: Floats, limit: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Return weights, offsets and positions at the end, (k, 3) each.

        Parameters
        ----------
        start : (k, 10, 3) array
            The vertex, the corners of its triangle, of the far one and of that across, at the start of the step [m].
        ahead : (k, 9, 3) array
            Those corners ahead [m].
        end : (k, 3, 3) array
            Corners of its triangle at the end [m].
        weights, offsets : (k, 3) array
            Of the step before.
        limit : (k, 1) array
            Gap below which a pinch closes [m].
        """
        new, of_far = self.before < 0, self.of_far
        vertex, own = start[:, 0], start[:, 1:4]
        if new.any():
            near = np.where(of_far[:, None, None], start[:, 4:7], own)
            near_ahead = np.where(of_far[:, None, None], ahead[:, 3:6], ahead[:, :3])
            found = closest_weights(vertex, near, self.corners)
            points = np.einsum("kc,kcd->kd", found, near_ahead)
            found = np.where(
                of_far[:, None], line_meets(points, triangle_frames(near_ahead)[:, 2], ahead[:, :3])[1], found
            )
            offset = np.einsum("kad,kd->ka", triangle_frames(own), vertex - np.einsum("kc,kcd->kd", found, own))
            weights = np.where(new[:, None], found, weights)
            offsets = np.where(new[:, None], offset, offsets)
        heights = offsets[:, 2] + np.where(np.abs(self.rises) == 1, self.rises * EASE, 0.0) * limit[:, 0]
        heights = np.where(self.rises == TO_LIMITS, 2.0 * limit[:, 0], heights)
        if (self.rises == TO_MIDDLE).any():
            at_end = self.at_end[:, None, None]
            here, across = np.where(at_end, ahead[:, :3], own), np.where(at_end, ahead[:, 6:], start[:, 7:])
            gaps = line_meets(np.einsum("kc,kcd->kd", weights, here), triangle_frames(here)[:, 2], across)[0]
            heights = np.where(self.rises == TO_MIDDLE, 0.5 * gaps, heights)
        offsets = np.column_stack([offsets[:, :2], heights])
        places = np.einsum("kc,kcd->kd", weights, end) + np.einsum("ka,kad->kd", offsets, triangle_frames(end))
        return weights, offsets, places

    def placed(self, start: Floats, ahead: Floats, end: Floats, known: Flypapered, limit: float) -> Flypapered:
        """Return the vertices of the step as they follow; arguments as of `inputs`."""
        weights, offsets, _ = self.follow(*self.inputs(start, ahead, end, known, limit))
        return replace(self.flypapered, weights=weights, offsets=offsets)

    def adjoint(self, inputs: tuple[Floats, ...], by: tuple[Floats, Floats, Floats]) -> tuple[Floats, ...]:
        """Return dL by the `inputs`, each in its shape, from dL by the three results of `follow`, (k, 3) each."""
        found = tuple(np.zeros(each.shape) for each in inputs)
        seen = 0 if (self.before < 0).any() or (self.rises == TO_MIDDLE).any() else 2  # then start and ahead
        for number, array in tuple(enumerate(inputs))[seen:]:
            for entry in np.ndindex(array.shape[1:]):
                varied = [each.astype(complex) for each in inputs]
                varied[number][:, *entry] += 1j * IMAGINARY
                results = self.follow(*varied)
                parts = (a * (b.imag / IMAGINARY) for a, b in zip(by, results, strict=True))
                found[number][:, *entry] = sum(part.sum(axis=1) for part in parts)
        return found


def triangle_frames(corners: Floats) -> Floats:
    """Frames (k, 3, 3) of triangles (k, 3, 3), as of `frames`; also of complex ones."""
    edge, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    tangent, normal = (
        each / np.sqrt((each * each).sum(axis=1, keepdims=True)) for each in (edge, np.cross(edge, other))
    )
    return np.stack([tangent, np.cross(normal, tangent), normal], axis=1)


def closest_weights(points: Floats, corners: Floats, acting: np.ndarray) -> Floats:
    """Weights (k, 3) of the point closest to p (k, 3) in the span of the `acting` corners ((k, 3) bool) of triangles.

    They minimise |sum w_c (x_c - p)|^2 with sum w_c = 1.
    """
    arms, both = corners - points[:, None], acting[:, :, None] & acting[:, None]
    products = np.einsum("kcd,ked->kce", arms, arms)
    scale = np.einsum("kcc->k", products).real[:, None, None]
    matrix = np.zeros((len(points), 4, 4), arms.dtype)
    matrix[:, :3, :3] = np.where(both, products / scale, np.eye(3))
    matrix[:, :3, 3] = matrix[:, 3, :3] = acting
    right = np.zeros((len(points), 4, 1), arms.dtype)
    right[:, 3] = 1.0
    return np.asarray(np.linalg.solve(matrix, right)[:, :3, 0])


# Patch of the body that is the own one of a flypapered vertex.

OWN_PATCH = 2.5
"""Radius of the patch about a supporting triangle with which contact goes on, in longest cloth edges."""
FACES_AWAY = -0.3
"""Cosine of the normals from which on a triangle does not belong to the patch of a supporting triangle."""


def median_and_longest_edge(world: World, x: Floats) -> tuple[float, float]:
    """Median and largest length of the cloth edges at x [m]."""
    lengths = np.linalg.norm(x[world.edges[:, 1]] - x[world.edges[:, 0]], axis=1)
    return float(np.median(lengths)), float(lengths.max())


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
