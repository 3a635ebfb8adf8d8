"""Pre-flight check of a motion: times at which parts of a body meet, or a joint turns too far in a step.

The parts are the trunk with the head, the arms and the legs, each with the triangles of the vertices that follow its
joints most. Of two parts only what is apart in the first pose is looked at, for an upper arm always meets the trunk;
under cloth, as in an armpit, also the vertices there whose gap along their normal closes, which pinches the cloth.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import igl
import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.files.characters.character import Character
from clothsim.files.characters.skeleton import Pose, joint_roles, orthonormal
from transfer.triangle_surface import vertex_normals

APART = 0.035
"""Vertices of a part nearer than this to another part in the first pose are adjacent to it [of the body's height]."""
MOST_DEGREES = 10.0
"""Angle of a joint in a step above which the chord of the step cuts more than .4 % of a limb [degrees]."""
LIMB_ROOTS = {
    "left arm": "left_shoulder",
    "right arm": "right_shoulder",
    "left leg": "left_hip",
    "right leg": "right_hip",
}
"""First joint of each limb."""


@dataclass(frozen=True)
class Meeting:
    """Times in a row at which two parts of a body come too near.

    Attributes
    ----------
    parts : (str, str)
    start, end : float
        First and last of the times [s].
    times : int
        Number of times looked at.
    nearest : float
        Smallest distance [m]: negative by the depth where they interpenetrate.
    at : float
        Time of it [s].
    place : (3,) ndarray [m]
        Vertex of the first part there.
    vertices : int
        Of a fold that closes: vertices under cloth whose gap along their normal does; else 0.
    """

    parts: tuple[str, str]
    start: float
    end: float
    times: int
    nearest: float
    at: float
    place: Floats
    vertices: int = 0


@dataclass(frozen=True)
class FastTurn:
    """Largest turn of a joint in a step.

    Attributes
    ----------
    joint : str
    degrees : float
        In a step.
    at : float
        Time at which the step begins [s].
    steps : int
        Number of steps in which a joint turns by more than MOST_DEGREES.
    """

    joint: str
    degrees: float
    at: float
    steps: int


@dataclass(frozen=True, eq=False)
class PartPair:
    """Vertices of a part that are apart from another in the first pose, and triangles of that other.

    Attributes
    ----------
    names : (str, str)
    vertices : (k,) ndarray
    triangles : (m, 3) ndarray
    """

    names: tuple[str, str]
    vertices: Ints
    triangles: Ints

    def distance(self, points: Floats) -> tuple[float, int]:
        """Smallest signed distance [m] of the vertices to the other part, and the vertex; `points` (n, 3) [m]."""
        signed, _ = self.closest(points)
        k = int(np.argmin(signed))
        return float(signed[k]), int(self.vertices[k])

    def boxes_apart(self, points: Floats) -> float:
        """A lower bound of the distance [m]: that of the boxes about vertices and triangles, 0 where they meet."""
        own, other = points[self.vertices], points[self.triangles.ravel()]
        between = np.maximum(own.min(axis=0) - other.max(axis=0), other.min(axis=0) - own.max(axis=0))
        return float(np.linalg.norm(np.maximum(between, 0.0)))

    def closest(self, points: Floats) -> tuple[Floats, Floats]:
        """Signed distances (k,) of the vertices to the other part, and the closest points there (k, 3) [m]."""
        own, tree = np.ascontiguousarray(points[self.vertices]), igl.AABB()
        tree.init(points, self.triangles)
        squared, _, closest = tree.squared_distance(points, self.triangles, own)
        distance = np.sqrt(np.asarray(squared).ravel())
        inside = np.asarray(igl.fast_winding_number(points, self.triangles, own)).ravel() > 0.5
        return np.where(inside, -distance, distance), np.asarray(closest, np.float64).reshape(-1, 3)


def vertices_of_parts(character: Character) -> dict[str, Ints]:
    """Vertices of each part: "trunk", "left arm", ...; only those whose joints are found by their names."""
    names, parents = character.skeleton.names, character.skeleton.parents.tolist()
    roles = joint_roles(names, parents)
    part_of = np.array(["trunk"] * len(names), object)
    for part, root in LIMB_ROOTS.items():
        if root in roles:
            for j in range(len(names)):
                if j == roles[root] or (parents[j] >= 0 and part_of[parents[j]] == part):
                    part_of[j] = part
    follows = part_of[character.joints[character.weights.argmax(axis=1)]]
    return {part: np.flatnonzero(follows == part) for part in ("trunk", *LIMB_ROOTS) if (follows == part).any()}


def part_pairs(character: Character, first: Floats) -> tuple[PartPair, ...]:
    """Pairs of parts to look at; `first` (n, 3) [m] are the vertices of the first pose."""
    parts = vertices_of_parts(character)
    limit = APART * float(np.ptp(first, axis=0).max())
    pairs = []
    for one, other in combinations(reversed(parts), 2):  # limbs before the trunk
        inside = np.zeros(len(first), bool)
        inside[parts[other]] = True
        triangles = np.ascontiguousarray(character.triangles[inside[character.triangles].all(axis=1)])
        if not len(triangles):
            continue
        near, _ = PartPair((one, other), parts[one], triangles).closest(first)
        apart = parts[one][near > limit]
        if len(apart):
            pairs.append(PartPair((one, other), apart, triangles))
    return tuple(pairs)


def meetings(
    character: Character, pose: Callable[[float], Pose], times: Sequence[float], gap: float
) -> tuple[Meeting, ...]:
    """Meetings of parts nearer than `gap` [m], in the space of the character, at `times` [s] (the first: at rest)."""
    pairs = part_pairs(character, character.vertices(pose(times[0])))
    found: list[Meeting] = []
    open_ones: dict[tuple[str, str], Meeting] = {}
    for time in times:
        points = character.vertices(pose(time))
        for pair in pairs:
            distance, vertex = pair.distance(points) if pair.boxes_apart(points) <= gap else (np.inf, 0)
            last = open_ones.pop(pair.names, None)
            if distance >= gap:
                found += [last] if last else []
                continue
            count = (last.times if last else 0) + 1
            start = last.start if last else time
            if last and last.nearest <= distance:
                distance, at, place = last.nearest, last.at, last.place
            else:
                at, place = time, points[vertex]
            open_ones[pair.names] = Meeting(pair.names, start, time, count, distance, at, place)
    return tuple(sorted([*found, *open_ones.values()], key=lambda meeting: meeting.start))


def closing_folds(
    character: Character, pose: Callable[[float], Pose], times: Sequence[float], gap: float, covered: np.ndarray
) -> tuple[Meeting, ...]:
    """Adjacent vertices of two parts, as in an armpit, whose gap closes below `gap` [m] at one of `times` [s].

    covered (n,): True for vertices under cloth, which alone are looked at. The gap of a vertex is the distance of the
    other part along its normal; it is above `gap` at the first time.
    """
    first = character.vertices(pose(times[0]))
    found: list[Meeting] = []
    for names, near, triangles in _adjacent(character, first, covered):
        rows = near[_gaps(character, first, near, triangles) > gap]
        closed, last = np.zeros(len(rows), bool), None
        for time in times[1:] if len(rows) else ():
            points = character.vertices(pose(time))
            gaps = _gaps(character, points, rows, triangles)
            closed |= gaps < gap
            k = int(gaps.argmin())
            if gaps[k] >= gap:
                continue
            if last is None:
                last = Meeting(names, time, time, 0, np.inf, time, points[rows[k]])
            if gaps[k] < last.nearest:
                last = replace(last, nearest=float(gaps[k]), at=time, place=points[rows[k]])
            last = replace(last, end=time, times=last.times + 1)
        if last is not None:
            found.append(replace(last, vertices=int(closed.sum())))
    return tuple(found)


def _adjacent(character: Character, first: Floats, covered: np.ndarray) -> Iterator[tuple[tuple[str, str], Ints, Ints]]:
    """Names of two parts, the covered vertices of one that are near the other, and the triangles of the other."""
    parts = vertices_of_parts(character)
    limit = APART * float(np.ptp(first, axis=0).max())
    for one, other in combinations(reversed(parts), 2):
        inside = np.zeros(len(first), bool)
        inside[parts[other]] = True
        triangles = np.ascontiguousarray(character.triangles[inside[character.triangles].all(axis=1)])
        own = parts[one][covered[parts[one]]]
        if len(triangles) and len(own):
            near, _ = PartPair((one, other), own, triangles).closest(first)
            yield (one, other), own[near <= limit], triangles


def _gaps(character: Character, points: Floats, rows: Ints, triangles: Ints) -> Floats:
    """Distances (k,) [m] of the triangles from `rows` of the posed points along their normals; inf where none is."""
    if not len(rows):
        return np.zeros(0)
    normals, tree = vertex_normals(points, character.triangles)[rows], igl.AABB()
    tree.init(points, triangles)
    hits, distances, _ = tree.intersect_ray_first(
        points, triangles, np.ascontiguousarray(points[rows]), np.ascontiguousarray(normals)
    )
    return np.where(np.asarray(hits).ravel() >= 0, np.asarray(distances, np.float64).ravel(), np.inf)


def fastest_turn(character: Character, pose: Callable[[float], Pose], times: Sequence[float]) -> FastTurn:
    """The largest turn of a joint in space between two of `times` [s]."""
    axes = [orthonormal(character.skeleton.transforms(pose(time))[:, :3, :3]) for time in times]
    used = np.unique(character.joints)
    angles = []
    for one, other in zip(axes[:-1], axes[1:], strict=True):
        trace = np.einsum("jab,jab->j", one[used], other[used])
        angles.append(np.degrees(np.arccos(np.clip((trace - 1) / 2, -1, 1))))
    turns = np.array(angles).reshape(len(times) - 1, -1)
    if not turns.size:
        return FastTurn(character.skeleton.names[0], 0.0, float(times[0]), 0)
    step, k = divmod(int(turns.argmax()), turns.shape[1])
    fast = int((turns.max(axis=1) > MOST_DEGREES).sum())
    return FastTurn(character.skeleton.names[used[k]], float(turns[step, k]), float(times[step]), fast)
