"""Pieces of a garment: which are simulated, which follow, which are stitched to another, and which is worn over which.

Real garments are many connected components: buttons, zips and patch pockets that lie on a panel or are sunk into it,
straps that overlap with it at their ends, a lining that coincides with the outer side. What lies on another piece
follows it, in the frames of its triangles or rigid; what touches it only in part is simulated, and stitched there.
"""

from collections import Counter
from dataclasses import dataclass, replace

import igl
import numpy as np
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.base.triangles import barycentric, triangle_areas
from clothsim.engine import components


@dataclass(frozen=True)
class EmbeddedVertices:
    """A piece bound to triangles of its host.

    Parameters
    ----------
    vertices : (k,) int64
        Its vertices in the whole garment.
    corners : (k, 3) int64
        Triangle of the host of each, as rows of the simulated positions.
    weights : (k, 3) float64
        Barycentric coordinates of the closest point.
    offsets : (k, 3) float64
        Vector from there in the frame of the triangle [m].
    shape : (k, 3) or (0, 3) float64
        Rest shape of a piece that stays rigid [m].
    """

    vertices: Ints
    corners: Ints
    weights: Floats
    offsets: Floats
    shape: Floats

    def on_one_side(self, clearance: float) -> "EmbeddedVertices":
        """A copy whose vertices are all on the side of the host on which most are, `clearance` [m] from it at least."""
        height = self.offsets[:, 2]
        side = -1.0 if np.count_nonzero(height < 0) > len(height) / 2 else 1.0
        moved = self.offsets.copy()
        moved[:, 2] = side * np.maximum(side * height, clearance)
        return replace(self, offsets=moved)

    def positions_on(self, positions: Floats) -> Floats:
        """Return the positions (k, 3) on the host at `positions (n, 3)` [m]."""
        points = np.einsum("ij,ijk->ik", self.weights, positions[self.corners])
        free = points + np.einsum("ijk,ij->ik", _frames(positions[self.corners]), self.offsets)
        if not len(self.shape):
            return free
        # the shape moved rigidly onto these targets (Kabsch 1976)
        middle, goal = self.shape.mean(axis=0), free.mean(axis=0)
        U, _, Vt = np.linalg.svd((self.shape - middle).T @ (free - goal))
        sign = np.sign(np.linalg.det(U @ Vt))
        return (self.shape - middle) @ (U * [1, 1, sign]) @ Vt + goal


def embed(
    whole: Floats, own: Ints, corners: Ints, simulated: Ints, closest: Floats, is_rigid: bool
) -> EmbeddedVertices:
    """Return the vertices `own` of the `whole` (n, 3) bound to triangles `corners` (k, 3) of the `simulated` vertices.

    closest (k, 3): their closest points there [m].
    """
    triangles = whole[simulated][corners]
    weights = barycentric(triangles, closest)
    points = np.einsum("ij,ijk->ik", weights, triangles)
    offsets = np.einsum("ijk,ik->ij", _frames(triangles), whole[own] - points)
    return EmbeddedVertices(own, corners, weights, offsets, whole[own] if is_rigid else np.zeros((0, 3)))


def completed(positions: Floats, vertices: Ints, embedded: tuple[EmbeddedVertices, ...]) -> Floats:
    """Return the positions of the whole garment, of simulated `vertices` at `positions` and of embedded ones."""
    size = max([vertices.max(initial=-1), *(piece.vertices.max() for piece in embedded)]) + 1
    whole = np.zeros((size, 3))
    whole[vertices] = positions
    for piece in embedded:
        whole[piece.vertices] = piece.positions_on(positions)
    return whole


def _frames(corners: Floats) -> Floats:
    """Orthonormal frames (k, 3, 3) of triangles (k, 3, 3), in rows: along the first edge, in the plane, normal."""
    along = corners[:, 1] - corners[:, 0]
    normal = np.cross(along, corners[:, 2] - corners[:, 0])
    along, normal = (v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-300) for v in (along, normal))
    return np.stack([along, np.cross(normal, along), normal], axis=1)


SMALL = 0.2
"""Area of a small piece over that of the largest one."""
LYING, TOUCHING, NEAR = 0.01, 0.005, 0.05
"""Distances [m]: a small piece with MOSTLY all vertices within LYING lies on another; vertices within TOUCHING are
stitched; a small piece within NEAR that touches nothing follows."""
MOSTLY = 0.7
"""Fraction of its vertices that are near, for a piece to lie on another: a flat pocket on a curved front."""
JOINED = 0.15
"""Fraction of the vertices of a small piece that lie on each of the pieces that it joins."""
COINCIDENT = 0.0005
"""A piece all of whose vertices are within that distance of another is its second side [m]."""
CLEARANCE = 0.0005
"""Least distance from its host, on one side, of a piece that lies on it and is not rigid [m]."""
RIGID = 0.04
"""Extent below which a piece that follows is rigid, as a button is [m]."""


MOST = 1000
"""Pieces above which a mesh is not divided: it is a triangle soup, which the mesh check names."""


@dataclass(frozen=True)
class Division:
    """Garment divided into what is simulated and what follows.

    Parameters
    ----------
    vertices : (k,) int64
        Simulated vertices in the numbering of the whole.
    whole : (m, 3) int64
        Triangles of the whole garment.
    rows : (j,) int64
        Those that are simulated.
    embedded : tuple of EmbeddedVertices
        Pieces that follow the simulated ones.
    stitched : tuple of (i,) int64
        Vertices of each stitched piece that touch another, in the numbering of `vertices`.
    notes : tuple of str
        What was done with which pieces.
    """

    vertices: Ints
    whole: Ints
    rows: Ints
    embedded: tuple[EmbeddedVertices, ...] = ()
    stitched: tuple[Ints, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def triangles(self) -> Ints:
        """Simulated triangles (j, 3) in the numbering of `vertices`."""
        return np.searchsorted(self.vertices, self.whole[self.rows])

    def complete(self, positions: Floats) -> Floats:
        """Positions (n, 3) of the whole garment where the simulated vertices are at `positions (k, 3)` [m]."""
        return completed(positions, self.vertices, self.embedded) if self.embedded else positions

    def as_dict(self) -> dict[str, int]:
        """Entry in summary.json."""
        return {"following": len(self.embedded), "stitched": len(self.stitched)}


UNDIVIDED = Division(np.zeros(0, np.int64), np.zeros((0, 3), np.int64), np.zeros(0, np.int64))
"""A garment all of whose pieces are simulated, none of them stitched."""
WORDS = {
    "second side": "coincide with another piece: its second side, which follows it",
    "lying": "lie on another piece and follow it: they are not simulated, nor checked for intersections",
    "near": "touch nothing and would fall off: they follow the nearest piece",
    "joined": "are held by a smaller one that lies on them and on another",
    "stitched": "are stitched where they touch another piece",
}


def divided(positions: Floats, triangles: Ints) -> Division:
    """Return the division of the garment with `positions (n, 3)` [m] and `triangles (m, 3)`, every vertex in one.

    Pieces are taken from the largest; each is compared with those before it that are simulated.
    """
    label = components(triangles, len(positions))
    of_triangle = label[triangles[:, 0]]
    corners = positions[triangles]
    areas = triangle_areas(corners)
    total = np.bincount(of_triangle, areas)
    if len(total) == 1 or len(total) > MOST:
        return UNDIVIDED
    order = np.argsort(-total, kind="stable")
    simulated, surface = of_triangle == order[0], _Surface(positions, triangles[of_triangle == order[0]])
    found: list[tuple[str, Ints, Ints, Floats]] = []
    for piece in order[1:]:
        own = np.flatnonzero(label == piece)
        distance, host, closest = surface.nearest(positions[own])
        if distance.max() <= COINCIDENT:
            fate = "second side"
        elif total[piece] >= SMALL * total[order[0]] or distance.min() > NEAR:
            fate = "simulated"
        elif np.quantile(distance, MOSTLY) <= LYING and distance.max() <= NEAR:
            fate = "lying"
        else:
            fate = "stitched" if np.count_nonzero(distance <= TOUCHING) > 1 else "near"
        if fate != "simulated":
            found.append((fate, own[distance <= TOUCHING] if fate == "stitched" else own, host, closest))
        if fate == "lying":
            # a small piece joins those on which it lies, as a buckle strap and bib: the vertices of all but one
            below = label[host[:, 0]]
            pieces, counts = np.unique(below, return_counts=True)
            pieces = pieces[np.argsort(-counts, kind="stable")][: np.count_nonzero(counts >= JOINED * len(host))]
            found += [("joined", np.unique(host[below == each]), host, closest) for each in pieces[1:]]
        if fate in ("simulated", "stitched"):
            simulated |= of_triangle == piece
            surface = _Surface(positions, triangles[simulated])
    return _division(positions, triangles, np.flatnonzero(simulated), found) if found else UNDIVIDED


class _Surface:
    """Surface with a tree for nearest points."""

    def __init__(self, positions: Floats, triangles: Ints) -> None:
        self.positions, self.triangles, self.boxes = np.ascontiguousarray(positions), triangles, igl.AABB()
        self.boxes.init(self.positions, self.triangles)

    def nearest(self, points: Floats) -> tuple[Floats, Ints, Floats]:
        """Distances (k,) [m], nearest triangles (k, 3) and points (k, 3)."""
        squared, rows, closest = self.boxes.squared_distance(
            self.positions, self.triangles, np.ascontiguousarray(points)
        )
        corners = self.triangles[np.asarray(rows, np.int64).ravel()]
        return np.sqrt(np.ravel(squared)), corners, np.array(closest, np.float64).reshape(-1, 3)


def _division(positions: Floats, triangles: Ints, rows: Ints, found: list[tuple[str, Ints, Ints, Floats]]) -> Division:
    vertices = np.unique(triangles[rows])
    embedded, stitched = [], []
    for fate, own, host, closest in found:
        if fate in ("stitched", "joined"):
            stitched.append(np.searchsorted(vertices, own))
            continue
        is_rigid = fate != "second side" and bool(np.ptp(positions[own], axis=0).max() < RIGID)
        piece = embed(positions, own, np.searchsorted(vertices, host), vertices, closest, is_rigid)
        embedded.append(piece.on_one_side(CLEARANCE) if fate == "lying" and not is_rigid else piece)
    count = Counter(fate for fate, *_ in found)
    notes = tuple(f"{count[fate]} of its pieces {words}" for fate, words in WORDS.items() if count[fate])
    return Division(vertices, triangles, rows, tuple(embedded), tuple(stitched), notes)


OVERLAP = 0.02
"""Distance within which vertices of two pieces overlap [m]."""
CLEARLY = 0.7
"""Least fraction of the overlapping vertices of a piece that are farther out, for it to be the outer one."""
MOST_LAYERED = 50
"""Pieces, the largest by number of vertices, that are ordered."""


def layers_of(positions: Floats, triangles: Ints, distances: Floats) -> Ints:
    """Return the layer of each vertex, (n,): larger farther out; the same for pieces that no overlap orders.

    positions (n, 3): of the garment as it is worn [m]; distances (n,): of its vertices from the body [m], negative
    inside it.
    """
    piece = components(triangles, len(positions))
    largest = np.argsort(-np.bincount(piece), kind="stable")[:MOST_LAYERED]
    rows = [np.flatnonzero(piece == number) for number in largest]
    trees = [cKDTree(positions[own]) for own in rows]
    over: list[tuple[int, int]] = []
    for a in range(len(rows)):
        for b in range(len(rows)):
            if a == b:
                continue
            gap, nearest = trees[b].query(positions[rows[a]], distance_upper_bound=OVERLAP)
            met = np.flatnonzero(np.isfinite(gap))
            if len(met):
                farther = distances[rows[a][met]] > distances[rows[b][nearest[met]]]
                if farther.mean() >= CLEARLY:
                    over.append((a, b))
    # both ways: two pieces that cross are not ordered
    over = [pair for pair in over if pair[::-1] not in over]
    level = np.zeros(len(rows), np.int64)
    for _ in rows:  # a circle of pieces, each over the next, ends here
        for a, b in over:
            level[a] = max(level[a], min(level[b] + 1, len(rows)))
    layer = np.zeros(len(positions), np.int64)
    for own, number in zip(rows, level, strict=True):
        layer[own] = number
    return layer
