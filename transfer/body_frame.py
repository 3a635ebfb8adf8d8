"""Upright, front-facing frame of a human body, from level sets of its height.

The vertical axis is the one of y and z along which the body begins with two loops of similar length, the legs, and
ends with one, the head. The lateral axis is the normal of the vertical plane in which the body is most nearly its own
mirror image, and the front is where the feet point. In a stride the line from leg to leg and the arms mislead: there
the plane is looked for about the direction of the feet, by head and shoulders alone. No coordinate axis enters but in
the choice of y or z: a body that is turned about its vertical axis gets the frame turned alike.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError, cKDTree

from transfer.errors import TransferError
from transfer.triangle_surface import Floats, Ints, as_surface, unit


@dataclass(frozen=True)
class LevelSet:
    """Level set of a field.

    Attributes
    ----------
    starts, ends : ndarray (s, 3)
        Ends of its segments, one for each triangle that it crosses [m].
    triangles : ndarray (s,)
        Those triangles.
    """

    starts: Floats
    ends: Floats
    triangles: Ints

    @property
    def lengths(self) -> Floats:
        """Length of each segment, (s,) [m]."""
        return np.asarray(np.linalg.norm(self.ends - self.starts, axis=1))

    @property
    def centre(self) -> Floats:
        """Centroid of the curve, (3,) [m]."""
        lengths = self.lengths
        return np.asarray(lengths @ (self.starts + self.ends) / (2.0 * lengths.sum()))

    @property
    def radius(self) -> float:
        """Root mean square distance of the curve from its centroid [m]."""
        lengths = self.lengths
        squared = (((self.starts + self.ends) / 2.0 - self.centre) ** 2).sum(axis=1)
        return float(np.sqrt(lengths @ squared / lengths.sum()))

    def only(self, chosen: NDArray[np.bool_]) -> "LevelSet":
        """The level set of the segments where `chosen` (s,) is true."""
        return LevelSet(self.starts[chosen], self.ends[chosen], self.triangles[chosen])


def level_set(positions: Floats, triangles: Ints, field: Floats, level: float) -> LevelSet:
    """Curve on which the piecewise linear `field` (n,) has the value `level`; without segments where none has."""
    values = field[triangles] - level
    a, b, c = values.T  # a reduction over axis 1 takes ten times as long
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    crossed = np.flatnonzero(np.isfinite(low) & np.isfinite(high) & (low <= 0) & (high > 0))
    corners, values = triangles[crossed], values[crossed]
    above = values > 0
    single = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), above.argmin(axis=1))
    rows = np.arange(len(crossed))
    ends = []
    for offset in (1, 2):
        other = (single + offset) % 3
        at, to = values[rows, single], values[rows, other]
        t = (at / (at - to))[:, None]
        ends.append((1.0 - t) * positions[corners[rows, single]] + t * positions[corners[rows, other]])
    return LevelSet(ends[0], ends[1], crossed)


def loops(ring: LevelSet, triangles: Ints) -> list[LevelSet]:
    """Connected pieces of a level set, the longest first."""
    crossed = triangles[ring.triangles]
    other = crossed[:, [1, 2, 0]]
    keys = np.minimum(crossed, other) * (crossed.max(initial=0) + 1) + np.maximum(crossed, other)
    numbers = np.unique(keys, return_inverse=True)[1].reshape(-1, 3)
    # A segment's triangle shares an edge with the next one; three edges a triangle, of which the curve crosses two.
    count, width = len(crossed), int(numbers.max(initial=-1)) + 1
    incidence = csr_array((np.ones(3 * count), (np.repeat(np.arange(count), 3), numbers.ravel())), shape=(count, width))
    _, labels = connected_components(incidence @ incidence.T, directed=False)
    pieces = [ring.only(labels == label) for label in range(int(labels.max(initial=-1)) + 1)]
    return sorted(pieces, key=lambda piece: -float(piece.lengths.sum()))


def girth(ring: LevelSet) -> float:
    """Length of a tape about a ring: perimeter of its convex hull in its plane of least squares [m]."""
    points = np.concatenate([ring.starts, ring.ends])
    if len(points) < 6:
        return 0.0
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][:2]
    flat = (points - points.mean(axis=0)) @ axes.T
    try:
        return float(ConvexHull(flat).area)  # in two dimensions scipy's `area` is the perimeter
    except QhullError:
        return 0.0


LEGS = (0.06, 0.10, 0.15, 0.20, 0.25, 0.30)
"""Heights of the sections through both legs, as fractions of the height."""
HEAD = (0.88, 0.92, 0.96)
"""Heights of the sections through the head."""
SIMILAR = 0.6
"""Least ratio of the lengths of two loops that are a pair of legs."""
SAMPLED, COARSELY, TURNS = 1500, 300, 61
"""Vertices compared with their mirror image, those for the first choice, and mirror planes tried for that within WIDEST
of the line from leg to leg."""
WIDEST = np.radians(40.0)
FOOT, ANKLE = 0.03, (0.06, 0.10)
"""Height below which a foot lies, and heights of the ankle above it, as fractions of the height."""
STRIDE = np.radians(30.0)
"""Angle of the feet to the front of the mirror plane from which on the body is in a stride."""
SHOULDERS = 0.78
"""Height above which a body in a stride is its own mirror image, as a fraction of the height."""
SHORTEST_FOOT = 0.01
"""Least offset of the feet from the ankles, as a fraction of the height: below, the body has no front."""


@dataclass(frozen=True)
class BodyFrame:
    """Frame of a body.

    Attributes
    ----------
    origin : ndarray (3,)
        Point on the ground midway between the legs [m].
    axes : ndarray (3, 3)
        Rows: unit vectors to the body's left, up, and to its front; right-handed.
    height : float
        From the soles to the crown [m].
    """

    origin: Floats
    axes: Floats
    height: float

    @property
    def left(self) -> Floats:
        """Unit vector to the body's left, (3,)."""
        return self.axes[0]

    @property
    def up(self) -> Floats:
        """Unit vector upward, (3,)."""
        return self.axes[1]

    @property
    def front(self) -> Floats:
        """Unit vector to the body's front, (3,)."""
        return self.axes[2]

    def local(self, points: Floats) -> Floats:
        """Coordinates (k, 3) [m] along left, up and front of points (k, 3)."""
        return (points - self.origin) @ self.axes.T

    def world(self, points: Floats) -> Floats:
        """Points (k, 3) [m] of coordinates (k, 3) along left, up and front."""
        return points @ self.axes + self.origin


def body_frame(positions: ArrayLike, triangles: ArrayLike, up: ArrayLike | None = None) -> BodyFrame:
    """Find the frame of a standing body.

    Parameters
    ----------
    positions : array_like (n, 3)
        Vertices [m].
    triangles : array_like (m, 3)
    up : array_like (3,), optional
        Vertical axis; None: y or z.

    Raises
    ------
    TransferError
        The surface does not stand on two legs with one head, or its feet point nowhere.

    Examples
    --------
    >>> from transfer.body_frame import body_frame
    >>> import numpy as np
    >>> body_frame(np.eye(3), [[0, 1, 2]])  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    transfer.errors.TransferError: the surface has no two legs and one head along y or z. ...
    """
    points, faces = as_surface("body", positions, triangles)
    points = points[np.unique(faces)]
    faces = np.unique(faces, return_inverse=True)[1].reshape(-1, 3)
    candidates = np.eye(3)[[1, 2]] if up is None else np.asarray(up, np.float64).reshape(1, 3)
    scored = [(legs_score(points, faces, axis), axis) for axis in candidates]
    score, axis = max(scored, key=lambda one: one[0])
    if score < 0.5:
        named = "y or z" if up is None else "the given vertical axis"
        raise TransferError(f"the surface has no two legs and one head along {named}.", "Give a standing body.")
    heights = points @ axis
    floor, height = float(heights.min()), float(np.ptp(heights))
    across, middle = from_leg_to_leg(points, faces, axis, floor, height)
    lateral = mirror_normal(points, axis, across, middle)
    toes = toe_direction(points, faces, axis, floor, height)
    if toes.any() and abs(toes @ lateral) > np.sin(STRIDE):
        upper = points[heights > floor + SHOULDERS * height]
        lateral = mirror_normal(upper, axis, np.cross(axis, toes), upper.mean(axis=0))
    forward = np.cross(axis, lateral)
    ahead = foot_direction(points, faces, axis, lateral, middle, floor, height) @ forward
    if abs(ahead) < SHORTEST_FOOT * height:
        raise TransferError("the feet of the body point nowhere.", "Give markers.")
    front = np.sign(ahead) * forward
    left = np.cross(axis, front)
    origin = middle + (floor - middle @ axis) * axis
    return BodyFrame(origin, np.stack([left, axis, front]), height)


def legs_score(points: Floats, triangles: Ints, axis: Floats) -> float:
    """Fraction of the sections below with a pair of similar loops, times that of those above with one main loop."""
    heights = points @ axis
    floor, height = heights.min(), np.ptp(heights)
    if height == 0:
        return 0.0
    pairs, heads = [], []
    for fraction in (*LEGS, *HEAD):
        pieces = loops(level_set(points, triangles, heights, floor + fraction * height), triangles)
        first, second, third = [*(float(piece.lengths.sum()) for piece in pieces), 0.0, 0.0, 0.0][:3]
        if fraction in LEGS:
            pairs.append(second > SIMILAR * first and third < second / 2)
        else:
            heads.append(first > 0 and second < SIMILAR * first)
    return float(np.mean(pairs) * np.mean(heads))


def from_leg_to_leg(
    points: Floats, triangles: Ints, axis: Floats, floor: float, height: float
) -> tuple[Floats, Floats]:
    """Horizontal unit vector from one leg to the other, (3,), and the point midway between them, (3,)."""
    differences: list[Floats] = []
    middles: list[Floats] = []
    for fraction in LEGS:
        pieces = loops(level_set(points, triangles, points @ axis, floor + fraction * height), triangles)
        if len(pieces) < 2:
            continue
        one, other = pieces[0].centre, pieces[1].centre
        difference = other - one
        turned = not differences or difference @ differences[0] >= 0
        differences.append(difference if turned else -difference)
        middles.append((one + other) / 2.0)
    mean = np.mean(differences, axis=0)
    return unit((mean - mean @ axis * axis)[None])[0], np.mean(middles, axis=0)


def mirror_normal(points: Floats, axis: Floats, across: Floats, middle: Floats) -> Floats:
    """Normal (3,) of the vertical plane through the body's middle with the best mirror image, near `across`."""
    some, sampled = (points[:: max(1, len(points) // count)] for count in (COARSELY, SAMPLED))
    other = np.cross(axis, across)
    centre = (points.max(axis=0) + points.min(axis=0)) / 2.0
    centre = middle + (centre - middle) @ axis * axis
    tree = cKDTree(points)

    def asymmetry(of: Floats, angle: float) -> float:
        """Mean distance of the mirror image of points from the body [m], over the best offsets of the plane."""
        normal = np.cos(angle) * across + np.sin(angle) * other
        offsets = (of - centre) @ normal
        return float(np.minimum(tree.query(of - 2.0 * offsets[:, None] * normal)[0], 0.1).mean())

    best, step = 0.0, 2.0 * WIDEST / (TURNS - 1)
    angles = np.linspace(-WIDEST, WIDEST, TURNS)
    for of in (some, sampled, sampled):
        values = [asymmetry(of, angle) for angle in angles]
        best = float(angles[int(np.argmin(values))])
        angles = np.linspace(best - step, best + step, 9)
        step /= 4.0
    return np.cos(best) * across + np.sin(best) * other


def toe_direction(points: Floats, triangles: Ints, axis: Floats, floor: float, height: float) -> Floats:
    """Horizontal unit vector (3,) in which both feet point, each from its own ankle; zeros where they differ."""
    heights, found = points @ axis, []
    low = points[heights < floor + FOOT * height]
    pieces = loops(level_set(points, triangles, heights, floor + float(np.mean(ANKLE)) * height), triangles)[:2]
    if len(pieces) < 2 or not len(low):
        return np.zeros(3)
    ankles = np.stack([piece.centre for piece in pieces])
    nearest = np.linalg.norm(low[:, None] - ankles, axis=2).argmin(axis=1)
    for number, ankle in enumerate(ankles):
        own = low[nearest == number]
        if not len(own):
            return np.zeros(3)
        offset = (own.max(axis=0) + own.min(axis=0)) / 2.0 - ankle
        offset = offset - offset @ axis * axis
        if np.linalg.norm(offset) < SHORTEST_FOOT * height:
            return np.zeros(3)
        found.append(unit(offset[None])[0])
    mean = (found[0] + found[1]) / 2.0
    return unit(mean[None])[0] if np.linalg.norm(mean) > np.cos(STRIDE) else np.zeros(3)


def foot_direction(
    points: Floats, triangles: Ints, axis: Floats, lateral: Floats, middle: Floats, floor: float, height: float
) -> Floats:
    """Mean offset (3,) [m] of the feet's middle from the ankles' axes."""
    heights, side = points @ axis, (points - middle) @ lateral
    offsets = []
    for sign in (-1.0, 1.0):
        low = points[(heights < floor + FOOT * height) & (sign * side > 0)]
        if len(low) == 0:
            continue
        foot = (low.max(axis=0) + low.min(axis=0)) / 2.0
        rings = [level_set(points, triangles, heights, floor + fraction * height) for fraction in ANKLE]
        rings = [ring.only(np.asarray(sign * ((ring.starts - middle) @ lateral) > 0)) for ring in rings]
        centres = [ring.centre for ring in rings if len(ring.starts)]
        if centres:
            offsets.append(foot - np.mean(centres, axis=0))
    return np.mean(offsets, axis=0) if offsets else np.zeros(3)
