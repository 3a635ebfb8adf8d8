"""Search for positions without intersections: rounds of smallest motions, checked exactly after each.

An attempt ends where the intersecting pairs do not fall; the next starts again with shorter steps.
"""

from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs, intersection_points
from clothsim.geometry.untangling.motion import NO_WISHES, Sheet
from clothsim.geometry.untangling.regions import Flags, Mesh
from clothsim.geometry.untangling.wishes import wishes_of

ATTEMPTS = ((0.4, 2.5), (0.2, 1.5), (0.2, 2.5), (0.1, 1.5), (0.1, 2.5))
"""Of each attempt: the longest wished displacement, over the mean edge, and the largest factor of its spread."""
PATIENCE = 25
"""Rounds without fewer pairs, after which an attempt ends."""
GROWTH, FEW = 1.5, 20
"""Growth of the number of pairs, as a factor and a number, at which an attempt ends."""
WIDENING = 5
"""Rounds in which the spread of the motion grows by its first value: what takes long is no local matter."""
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
class State:
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
class Search:
    """Rounds from positions x: sheet, mesh, body (positions, triangles behind those of the cloth), layers, gap [m].

    relieves: True where strain beyond the limits is relieved also where nothing intersects.
    """

    x: Floats
    sheet: Sheet
    mesh: Mesh
    obstacle: Floats
    solid: Ints
    layers: Ints | None
    gap: float
    relieves: bool

    def run(self, edge: float, rounds: int) -> Untangled:
        """Rounds until nothing intersects; where the pairs do not fall, again from the start with shorter steps."""
        start = best = self.at(self.x, np.zeros(len(self.x), bool))
        if not start.count:
            return Untangled(self.relaxed(self.x) if self.relieves else self.x, 0, 0, 0, "free", None)
        done = 0
        for reach, widest in ATTEMPTS:
            state, fewest, since = start, start.count, 0
            while done < rounds and since < PATIENCE and state.count <= GROWTH * fewest + FEW:
                state, done = self.moved(state, reach * edge, min(1 + done / WIDENING, widest)), done + 1
                since = 0 if state.count < fewest else since + 1
                fewest = min(fewest, state.count)
                best = state if state.count < best.count else best
                if not state.count:
                    return Untangled(self.relaxed(state.x), start.count, 0, done, "free", None)
        end = "rounds" if done == rounds else "stalled"
        return Untangled(best.x, start.count, best.count, done, end, self.point(best))

    def at(self, x: Floats, inside: Flags) -> State:
        """The intersecting pairs at x."""
        everything, faces = np.concatenate([x, self.obstacle]), self.mesh.triangles
        with_body = intersecting_pairs(everything, faces, self.solid)
        return State(x, intersecting_pairs(everything, faces), with_body, inside)

    def moved(self, state: State, step: float, wider: float) -> State:
        """The state after a round whose wishes are at most `step` long [m]; wider: factor of their spread."""
        everything, pairs = np.concatenate([state.x, self.obstacle]), (state.own, state.with_body)
        wishes, inside = wishes_of(everything, self.mesh, self.solid, pairs, state.inside, self.layers, self.gap, step)
        return self.at(
            state.x + self.sheet.displacement(state.x, replace(wishes, spread=wider * wishes.spread)), inside
        )

    def relaxed(self, x: Floats) -> Floats:
        """Positions with less strain beyond the limits that are free too."""
        fraction = 1.0
        for _ in range(RELAXATIONS):
            moved = self.sheet.displacement(x, NO_WISHES)
            if not moved.any():
                break
            while fraction > SHORTEST and self.at(x + fraction * moved, np.zeros(0, bool)).count:
                fraction *= 0.5
            if fraction <= SHORTEST:
                break
            x = x + fraction * moved
        return x

    def point(self, state: State) -> Floats:
        """A point of the first pair [m]."""
        everything, faces = np.concatenate([state.x, self.obstacle]), self.mesh.triangles
        pairs, other = (state.own, faces) if len(state.own) else (state.with_body, self.solid)
        return np.asarray(intersection_points(everything, faces, other, pairs[:1])[0], np.float64)
