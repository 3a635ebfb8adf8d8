"""Landmarks and parts of a human body from geodesic distances.

A body is a star of five limbs: its tips (head, hands, feet) are the points farthest from its middle along the surface,
and its bends are where the shortest path along the surface from one tip to the next is farthest from their chord: the
crotch on that from foot to foot, an armpit on that from a hand to the foot on its side. Both survive a change of shape
and, mostly, of pose. An arm is the part nearer to its hand along the surface than its armpit is, whatever its pose;
trunk and legs are cut by horizontal planes.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from transfer.body_frame import BodyFrame, LevelSet, body_frame, girth, level_set
from transfer.errors import TransferError
from transfer.triangle_surface import Floats, Ints, edges_of, largest_component, vertex_components

TIPS = 5


def derive_markers(source: tuple[Floats, Ints], target: tuple[Floats, Ints]) -> Ints:
    """Corresponding vertices of two bodies.

    Tips are matched by their positions in the bounding boxes, bends by the tips that they lie between.

    Parameters
    ----------
    source, target : tuple of ndarray
        Positions (n, 3) [m] and triangles (m, 3) of one connected component.

    Returns
    -------
    ndarray (k, 2)
        (source vertex, target vertex).

    Raises
    ------
    TransferError
        The surface has fewer than five limbs.
    """
    vertices, predecessors, _ = zip(*(tips(*mesh) for mesh in (source, target)), strict=True)
    in_boxes = [in_box(*mesh)[own] for mesh, own in zip((source, target), vertices, strict=True)]
    distance = np.linalg.norm(in_boxes[0][:, None] - in_boxes[1][None], axis=2)
    _, match = linear_sum_assignment(distance)
    markers = [(vertices[0][i], vertices[1][match[i]]) for i in range(TIPS)]
    for i, j in limb_pairs(in_boxes[0]):
        bends = (
            bend(source[0], predecessors[0][i], vertices[0][i], vertices[0][j]),
            bend(target[0], predecessors[1][match[i]], vertices[1][match[i]], vertices[1][match[j]]),
        )
        markers.append(bends)
    pairs = np.array(markers, dtype=np.int64)
    once = [len(np.unique(pairs[:, side])) == len(pairs) for side in (0, 1)]
    return pairs if all(once) else pairs[:TIPS]


def in_box(positions: Floats, triangles: Ints) -> Floats:
    """Positions scaled so that the bounding box is centred at 0 with largest side 1."""
    used = positions[np.unique(triangles)]
    low, high = used.min(axis=0), used.max(axis=0)
    return (positions - (low + high) / 2.0) / (high - low).max()


def tips(positions: Floats, triangles: Ints) -> tuple[Ints, list[Ints], list[Floats]]:
    """Five tips, the head last, and for each the predecessors (n,) and lengths (n,) of the shortest paths to it.

    The head is the tip nearest to the four others.

    Farthest-point sampling among local maxima of the distance from the middle: a knee is none.
    """
    graph = edge_graph(positions, triangles)
    used = np.unique(triangles)
    middle = positions[used].mean(axis=0)
    start = used[np.linalg.norm(positions[used] - middle, axis=1).argmin()]
    from_middle = dijkstra(graph, directed=False, indices=start)
    peaks = np.where(np.isfinite(from_middle), from_middle, -1.0)
    for ends in (edges_of(triangles), edges_of(triangles)[:, ::-1]):
        peaks[ends[from_middle[ends[:, 0]] < from_middle[ends[:, 1]], 0]] = -1.0
    distance = from_middle
    extremes, predecessors, distances = [], [], []
    for _ in range(TIPS):
        extremes.append(int(np.where(peaks > 0, distance, -1.0).argmax()))
        if peaks[extremes[-1]] <= 0 or distance[extremes[-1]] == 0:
            raise TransferError(
                f"the surface has {len(extremes) - 1} limbs where a body has {TIPS}.", "Give the markers."
            )
        own, predecessor = dijkstra(graph, directed=False, indices=extremes[-1], return_predecessors=True)
        predecessors.append(predecessor)
        distances.append(own)
        distance = np.minimum(distance, own)
    order = np.argsort(-np.array(distances)[:, extremes].sum(axis=1))
    return np.array(extremes)[order], [predecessors[k] for k in order], [distances[k] for k in order]


def edge_graph(positions: Floats, triangles: Ints) -> csr_array:
    """Sparse matrix of edge lengths, (n, n) [m]."""
    edges = edges_of(triangles)
    lengths = np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1)
    return csr_array((lengths, (edges[:, 0], edges[:, 1])), shape=(len(positions), len(positions)))


def limb_pairs(points: Floats) -> list[tuple[int, int]]:
    """Three pairs of hands and feet adjacent by angle in the body's widest plane.

    The pairs with the head, the last, are left out: the shortest path past a neck runs in front of one body and
    at the side of the next.
    """
    centred = points - points.mean(axis=0)
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    order = np.argsort(np.arctan2(centred @ axes[1], centred @ axes[0]))
    pairs = [(int(order[k]), int(order[(k + 1) % len(order)])) for k in range(len(order))]
    return [pair for pair in pairs if len(points) - 1 not in pair]


def bend(positions: Floats, predecessors: Ints, tip: int, other: int) -> int:
    """Vertex of the shortest path from `other` to `tip` that is farthest from the straight line between them."""
    path = [other]
    while path[-1] != tip and len(path) <= len(predecessors):
        path.append(int(predecessors[path[-1]]))
    points = positions[path]
    chord = points[-1] - points[0]
    along = (points - points[0]) @ chord / (chord @ chord)
    return path[int(np.linalg.norm(points - points[0] - along[:, None] * chord, axis=1).argmax())]


SECTIONS = 24
"""Sections of the trunk, of a leg and of an arm."""
HAND = 0.22
"""Fraction of the length of an arm that is its hand: no rings are taken there, where fingers branch."""
FOOT = 0.05
"""Height of the lowest section of a leg as a fraction of the height of the crotch."""


@dataclass(frozen=True)
class BodyTube:
    """Sections along a limb or the trunk.

    Attributes
    ----------
    levels : ndarray (k,)
        Increasing parameters: heights [m] of the trunk and the legs, fractions of the length of an arm from its hand.
    centres : ndarray (k, 3)
        Centroids in the body's frame [m].
    extents : ndarray (k, 2)
        Half widths to the side and to the front [m].
    girths : ndarray (k,)
        Tape lengths [m].
    """

    levels: Floats
    centres: Floats
    extents: Floats
    girths: Floats

    def at(self, levels: Floats, values: Floats) -> Floats:
        """`values` (k, ...) interpolated at `levels`; constant beyond the ends."""
        columns = values.reshape(len(values), -1).T
        result = np.stack([np.interp(levels, self.levels, column) for column in columns], axis=-1)
        return result.reshape(np.shape(levels) + values.shape[1:])


@dataclass(frozen=True)
class BodyParts:
    """Parts of a body in its frame.

    Attributes
    ----------
    frame : BodyFrame
    landmarks : dict of str to float
        Heights of crotch, armpit, neck and crown above the ground [m].
    trunk : BodyTube
    legs, arms : tuple of BodyTube
        Left, right.
    hands : ndarray (2, n)
        Distance of each vertex from either hand along the surface as a fraction of that of the armpit.
    tips : ndarray (2, 3)
        Finger tips in the body's frame [m].
    """

    frame: BodyFrame
    landmarks: dict[str, float]
    trunk: BodyTube
    legs: tuple[BodyTube, BodyTube]
    arms: tuple[BodyTube, BodyTube]
    hands: Floats
    tips: Floats


def body_parts(positions: Floats, triangles: Ints, up: Floats | None = None) -> BodyParts:
    """Find the parts of the largest component of a standing body, (n, 3) and (m, 3).

    TransferError where it does not stand on two legs, or has other than two arms.
    """
    labels = vertex_components(triangles, len(positions))
    faces = triangles[labels[triangles[:, 0]] == largest_component(triangles, labels)]
    frame = body_frame(positions, faces, up)
    local = frame.local(positions)
    extremes, predecessors, distances = tips(local, faces)
    order = np.argsort(local[extremes, 1])  # feet, hands, head
    by_side = [order[k : k + 2][np.argsort(-local[extremes[order[k : k + 2]], 0])] for k in (0, 2)]
    (foot, other_foot), both_hands = by_side
    crotch = local[bend(local, predecessors[foot], extremes[foot], extremes[other_foot]), 1]
    pits = [
        bend(local, predecessors[hand], extremes[hand], extremes[sole])
        for hand, sole in zip(both_hands, (foot, other_foot), strict=True)
    ]
    # One length for both arms: where they are level the bend is a broad one and lies now here, now there.
    reach = np.mean([distances[hand][pit] for hand, pit in zip(both_hands, pits, strict=True)])
    hands = np.stack([distances[hand] / reach for hand in both_hands])
    armpit = float(np.mean(local[pits, 1]))
    body = faces[(hands[:, faces] > 1.0).any(axis=2).all(axis=0)]
    crown = frame.height
    neck = neck_height(local, body, armpit, crown)
    landmarks = {"crotch": float(crotch), "armpit": armpit, "neck": neck, "crown": crown}
    trunk = tube_of(local, body, local[:, 1], np.linspace(crotch + 0.01 * crown, 0.99 * crown, SECTIONS))
    heights = np.linspace(FOOT * crotch, 0.97 * crotch, SECTIONS)
    legs = tuple(
        tube_of(local, faces[(sign * local[faces, 0] > 0).all(axis=1)], local[:, 1], heights) for sign in (1, -1)
    )
    fractions = np.linspace(HAND, 1.0, SECTIONS)
    arms = tuple(tube_of(local, faces, along, fractions) for along in hands)
    return BodyParts(
        frame, landmarks, trunk, (legs[0], legs[1]), (arms[0], arms[1]), hands, local[extremes[both_hands]]
    )


def neck_height(local: Floats, body: Ints, armpit: float, crown: float) -> float:
    """Height of the least girth between the armpits and the head's middle [m]."""
    heights = np.linspace(armpit + 0.3 * (crown - armpit), armpit + 0.75 * (crown - armpit), 24)
    girths = [girth(level_set(local, body, local[:, 1], height)) for height in heights]
    return float(heights[int(np.argmin(girths))])


def tube_of(local: Floats, triangles: Ints, field: Floats, levels: Floats) -> BodyTube:
    """Sections of the triangles at `levels` (k,) of `field` (n,), smoothed by their neighbours."""
    rings = [(level, level_set(local, triangles, field, level)) for level in levels]
    kept = [(level, ring) for level, ring in rings if len(ring.starts) > 2]
    centres = smoothed(np.stack([ring.centre for _, ring in kept]))
    extents = smoothed(np.stack([half_widths(ring) for _, ring in kept]))
    girths = smoothed(np.array([girth(ring) for _, ring in kept]))
    return BodyTube(np.array([level for level, _ in kept]), centres, extents, girths)


def half_widths(ring: LevelSet) -> Floats:
    """Half of the ring's extents to the side and to the front, (2,) [m]."""
    points = np.concatenate([ring.starts, ring.ends])
    return np.asarray(np.ptp(points, axis=0)[[0, 2]] / 2.0)


def smoothed(values: Floats) -> Floats:
    """Means of three neighbours of `values` (k, ...), with the ends unchanged."""
    result = values.copy()
    result[1:-1] = (values[:-2] + 2.0 * values[1:-1] + values[2:]) / 4.0
    return result
