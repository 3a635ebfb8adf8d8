"""Intersecting pairs of a scene's surfaces, by the names of its cloths and bodies."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Protocol

from clothsim.arrays import Floats, Ints
from clothsim.intersection.intersecting_pairs import LIMIT, intersecting_pairs, intersection_points


class Surface(Protocol):
    """A cloth or a body of a scene; `triangles (m, 3)` are rows of x."""

    @property
    def name(self) -> str:
        """Unique name in the scene."""

    @property
    def role(self) -> str:
        """Role in the scene: "cloth" or "body"."""

    @property
    def triangles(self) -> Ints:
        """Triangles as rows of x, (m, 3)."""


@dataclass(frozen=True)
class Crossing:
    """Intersections of a cloth with itself, another cloth or a body.

    Attributes
    ----------
    first, second : str
        Names of the two surfaces.
    role : str
        "cloth" or "body", of the second.
    pairs : (p, 2) int array
        The triangles of each surface, counted in it from 0.
    position : (3,) array
        A point near the first pair [m].
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
    parts: Sequence[Surface],
    cloth_cloth: bool,
    excluded: Collection[frozenset[str]] = (),
    limit: int = LIMIT,
) -> tuple[Crossing, ...]:
    """All intersections of cloths with bodies and, with `cloth_cloth`, with themselves and each other.

    Bodies are never checked against each other.

    Parameters
    ----------
    x : (N, 3) array
        Positions of all vertices [m].
    parts : sequence of Surface
        Cloths, then bodies.
    cloth_cloth : bool
        Check cloths against themselves and each other.
    excluded : collection of frozenset of str
        Pairs of names (one name: with itself) that are not checked.
    limit : int
        Number of triangle pairs of two surfaces at which their search ends.

    Returns
    -------
    tuple of Crossing
        One for each pair of surfaces that intersect.

    Examples
    --------
    >>> import numpy as np
    >>> from types import SimpleNamespace
    >>> x = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, -1], [1, 1, 1], [9, 9, 0]])
    >>> sheet = SimpleNamespace(name="sheet", role="cloth", triangles=np.array([[0, 1, 2]]))
    >>> peg = SimpleNamespace(name="peg", role="body", triangles=np.array([[3, 4, 5]]))
    >>> [crossing.summary for crossing in crossings(x, [sheet, peg], cloth_cloth=True)]
    ['sheet and peg intersect']
    """
    found = []
    for one, other in combinations_with_replacement(parts, 2):
        checked = one.role == "cloth" and (other.role == "body" or cloth_cloth)
        if not checked or frozenset((one.name, other.name)) in excluded:
            continue
        pairs = intersecting_pairs(x, one.triangles, None if other is one else other.triangles, limit)
        if len(pairs):
            position = intersection_points(x, one.triangles, other.triangles, pairs[:1])[0]
            found.append(Crossing(one.name, other.name, other.role, pairs, position))
    return tuple(found)
