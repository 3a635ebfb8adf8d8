"""Who intersects whom: the intersecting pairs of triangles of a scene by the names of its cloths and bodies."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Protocol

from clothsim.arrays import Floats, Ints
from clothsim.intersection.intersecting_pairs import LIMIT, intersecting_pairs, intersection_points


class Part(Protocol):
    """A cloth or a body of a scene; `triangles (m, 3)` are rows of x."""

    @property
    def name(self) -> str:
        """Its name, no other's."""

    @property
    def role(self) -> str:
        """ "cloth" or "body"."""

    @property
    def triangles(self) -> Ints:
        """Its triangles in rows of x, (m, 3)."""


@dataclass(frozen=True)
class Crossing:
    """A cloth that intersects itself, another cloth or a body.

    first, second: their names; role: "cloth" or "body", the second's; pairs (p, 2): the triangles, counted in each
    from 0; place (3,) [m]: near the first pair.
    """

    first: str
    second: str
    role: str
    pairs: Ints
    position: Floats

    @property
    def summary(self) -> str:
        """Both names: "cloth and ball intersect" or "cloth intersects itself"."""
        return f"{self.first} " + ("intersects itself" if self.first == self.second else f"and {self.second} intersect")

    @property
    def sentence(self) -> str:
        """The first pair: "triangle 3 of cloth intersects triangle 17 of ball near (0.1, 0.2, 0.3) m"."""
        i, j = self.pairs[0]
        at = ", ".join(f"{value:.4g}" for value in self.position)
        if self.first == self.second:
            return f"triangles {i} and {j} of {self.first} intersect near ({at}) m"
        return f"triangle {i} of {self.first} intersects triangle {j} of {self.second} near ({at}) m"


def crossings(
    x: Floats,
    parts: Sequence[Part],
    cloth_cloth: bool,
    excluded: Collection[frozenset[str]] = (),
    limit: int = LIMIT,
) -> tuple[Crossing, ...]:
    """All that intersects in x (N, 3) [m]: cloths with bodies and, with `cloth_cloth`, with themselves and each other.

    Bodies are never judged among themselves. parts: cloths, then bodies; excluded: pairs of names (one name: with
    itself) that are not judged; limit: the search ends with that many pairs of triangles of two parts.
    """
    found = []
    for one, other in combinations_with_replacement(parts, 2):
        judged = one.role == "cloth" and (other.role == "body" or cloth_cloth)
        if not judged or frozenset((one.name, other.name)) in excluded:
            continue
        pairs = intersecting_pairs(x, one.triangles, None if other is one else other.triangles, limit)
        if len(pairs):
            position = intersection_points(x, one.triangles, other.triangles, pairs[:1])[0]
            found.append(Crossing(one.name, other.name, other.role, pairs, position))
    return tuple(found)
