"""Untangling of cloth from itself and from a body: intersection contours shrink until the exact check finds no pair.

In each round, for each intersection contour, the surface whose region is to pass through the other is chosen
(`contours`; Baraff, Witkin & Kass 2003), and the ends of its edges just inside the contour are drawn through what they
pierce; contours without a region shrink along the gradient of their length (`contour_gradients`; Volino &
Magnenat-Thalmann 2006). The sheets take the smallest smooth motion that does so
(`displacement_targets`).

An attempt ends where the intersecting pairs do not fall; the next starts again with shorter steps.
"""

from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_points, as_triangles
from clothsim.base.errors import InputError
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs, intersection_points
from clothsim.geometry.untangling.contours import FilledMesh, Flags, make_mesh
from clothsim.geometry.untangling.displacement_targets import NO_TARGETS, SheetOperators, displacement_targets
from clothsim.mesh.cloth import triangle_planes

ATTEMPTS = ((0.4, 2.5), (0.2, 1.5), (0.2, 2.5), (0.1, 1.5), (0.1, 2.5))
"""Of each attempt: the longest displacement target, over the mean edge, and the largest factor of its spread."""
PATIENCE = 25
"""Rounds without fewer pairs, after which an attempt ends."""
GROWTH, FEW = 1.5, 20
"""Growth of the number of pairs, as a factor and a number, at which an attempt ends."""
WIDENING = 5
"""Rounds in which the spread of the motion grows by its first value: what takes long is not a local matter."""
RELAXATIONS, SHORTEST = 30, 0.04
"""Largest number of steps that relieve strain at the end, and the smallest fraction of one."""


@dataclass(frozen=True)
class Untangled:
    """Result of `untangle`.

    Parameters
    ----------
    positions : (n, 3) float64
        Positions with the fewest intersecting pairs that were found [m]: none where `free`.
    pairs_before, pairs : int
        Intersecting pairs at the start and in `positions`, by the exact check.
    rounds : int
        Rounds that were made.
    end : str
        "free"; "stalled" where no step makes the pairs fewer; "rounds" where all rounds were made.
    where : (3,) float64 or None
        A point of an intersection that is left [m].
    """

    positions: Floats
    pairs_before: int
    pairs: int
    rounds: int
    end: str
    where: Floats | None

    @property
    def free(self) -> bool:
        """True where no pair intersects."""
        return self.end == "free"


@dataclass
class UntanglingState:
    """Positions (n, 3) [m], their intersecting pairs, and the vertices inside (n,) of the round before."""

    x: Floats
    own: Ints
    with_body: Ints
    inside: Flags

    @property
    def count(self) -> int:
        """Number of intersecting pairs."""
        return len(self.own) + len(self.with_body)


@dataclass(frozen=True)
class UntanglingSearch:
    """Rounds from positions x: sheet, mesh, body (positions, triangles behind those of the cloth), layers, gap [m].

    relieves: True where strain beyond the limits is relieved also where nothing intersects.
    """

    x: Floats
    sheet: SheetOperators
    mesh: FilledMesh
    obstacle: Floats
    solid: Ints
    layers: Ints | None
    gap: float
    relieves: bool

    def run(self, edge: float, rounds: int) -> Untangled:
        """Rounds until nothing intersects; where the pairs do not fall, again from the start with shorter steps."""
        start = best = self.examine(self.x, np.zeros(len(self.x), bool))
        if not start.count:
            return Untangled(self.relaxed(self.x) if self.relieves else self.x, 0, 0, 0, "free", None)
        done = 0
        for reach, widest in ATTEMPTS:
            state, fewest, since = start, start.count, 0
            while done < rounds and since < PATIENCE and state.count <= GROWTH * fewest + FEW:
                state, done = self.advance(state, reach * edge, min(1 + done / WIDENING, widest)), done + 1
                since = 0 if state.count < fewest else since + 1
                fewest = min(fewest, state.count)
                best = state if state.count < best.count else best
                if not state.count:
                    return Untangled(self.relaxed(state.x), start.count, 0, done, "free", None)
        end = "rounds" if done == rounds else "stalled"
        return Untangled(best.x, start.count, best.count, done, end, self.point(best))

    def examine(self, x: Floats, inside: Flags) -> UntanglingState:
        """The intersecting pairs at x."""
        everything, faces = np.concatenate([x, self.obstacle]), self.mesh.triangles
        with_body = intersecting_pairs(everything, faces, self.solid)
        return UntanglingState(x, intersecting_pairs(everything, faces), with_body, inside)

    def advance(self, state: UntanglingState, step: float, wider: float) -> UntanglingState:
        """The state after a round whose targets are at most `step` long [m]; wider: factor of their spread."""
        everything, pairs = np.concatenate([state.x, self.obstacle]), (state.own, state.with_body)
        targets, inside = displacement_targets(
            everything, self.mesh, self.solid, pairs, state.inside, self.layers, self.gap, step
        )
        return self.examine(
            state.x + self.sheet.displacement(state.x, replace(targets, spread=wider * targets.spread)), inside
        )

    def relaxed(self, x: Floats) -> Floats:
        """Positions with less strain beyond the limits that are free too."""
        fraction = 1.0
        for _ in range(RELAXATIONS):
            moved = self.sheet.displacement(x, NO_TARGETS)
            if not moved.any():
                break
            while fraction > SHORTEST and self.examine(x + fraction * moved, np.zeros(0, bool)).count:
                fraction *= 0.5
            if fraction <= SHORTEST:
                break
            x = x + fraction * moved
        return x

    def point(self, state: UntanglingState) -> Floats:
        """A point of the first pair [m]."""
        everything, faces = np.concatenate([state.x, self.obstacle]), self.mesh.triangles
        pairs, other = (state.own, faces) if len(state.own) else (state.with_body, self.solid)
        return np.asarray(intersection_points(everything, faces, other, pairs[:1])[0], np.float64)


ROUNDS = 300
"""Largest number of rounds."""


def untangle(
    positions: Floats,
    triangles: Ints,
    rest_positions: Floats | None = None,
    *,
    material: Floats | None = None,
    body: tuple[Floats, Ints] | None = None,
    fixed: Flags | None = None,
    layers: Ints | None = None,
    gap: float | None = None,
    limits: tuple[float, float] | None = None,
    rounds: int = ROUNDS,
) -> Untangled:
    """Free cloth of intersections with itself and with a body.

    Parameters
    ----------
    positions : (n, 3) array
        Positions of all cloths [m].
    triangles : (m, 3) int array
        Their triangles.
    rest_positions : (n, 3) array, optional
        Rest shape, whose strain is bounded [m]; None: `positions`.
    material : (m, 3, 2) array, optional
        Flat rest shape of each triangle [m], in place of that of the rest positions.
    body : (positions (k, 3), triangles (l, 3)), optional
        Closed body, wound outwards, which does not move.
    fixed : (n,) bool array, optional
        Vertices that do not move.
    layers : (n,) int array, optional
        Layer of each vertex, larger farther out; where two layers intersect, that decides which side each belongs on.
        Triangles are then wound outwards.
    gap : float, optional
        Distance to which what pierces is drawn beyond what it pierced [m]; None: a tenth of the median edge.
    limits : (float, float), optional
        Principal stretches to which triangles are brought back, also where nothing intersects; None: .6 to 1.3, wider
        where the start is.
    rounds : int
        Largest number of rounds.

    Examples
    --------
    >>> from clothsim.mesh.generators.shapes import rectangle
    >>> points, triangles = rectangle(size=(1.0, 1.0), cells=(8, 8))
    >>> points[40, 2] = 0.01
    >>> both = np.concatenate([points, points * [0.9, 0.9, 0] + [0, 0, 0.005]])
    >>> result = untangle(both, np.concatenate([triangles, triangles + 81]))
    >>> result.pairs_before > 0, result.end, result.pairs
    (True, 'free', 0)
    """
    x, faces, fixed, obstacle, solid = _checked(positions, triangles, fixed, layers, body)
    rest = x if rest_positions is None else as_points("rest_positions", rest_positions)
    shape = triangle_planes(rest, faces) if material is None else np.asarray(material, np.float64)
    sheet = SheetOperators(x, faces, shape, fixed, limits)
    mesh = make_mesh(faces, sheet.areas, len(x))
    step = float(np.median(np.linalg.norm(shape - np.roll(shape, 1, axis=1), axis=2)))
    apart = 0.1 * step if gap is None else float(gap)
    search = UntanglingSearch(x, sheet, mesh, obstacle, solid, layers, apart, limits is not None)
    return search.run(step, rounds)


def _checked(
    positions: Floats, triangles: Ints, fixed: Flags | None, layers: Ints | None, body: tuple[Floats, Ints] | None
) -> tuple[Floats, Ints, Flags, Floats, Ints]:
    """Positions, triangles, fixed vertices, the body's positions, and its triangles numbered behind the cloth."""
    x = as_points("positions", positions)
    faces = as_triangles("triangles", triangles, len(x))
    fixed = np.zeros(len(x), bool) if fixed is None else np.asarray(fixed, bool)
    for name, values in (("fixed", fixed), ("layers", layers)):
        if values is not None and np.shape(values) != (len(x),):
            raise InputError(f"{name} must have shape ({len(x)},), not {np.shape(values)}.")
    if body is None:
        return x, faces, fixed, np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    obstacle = as_points("body positions", body[0])
    return x, faces, fixed, obstacle, as_triangles("body triangles", body[1], len(obstacle)) + len(x)
