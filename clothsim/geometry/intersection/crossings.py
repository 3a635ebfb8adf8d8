"""Intersecting pairs of a scene's surfaces, by the names of its cloths and bodies."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.geometry.centre_lines import found_by_rods
from clothsim.geometry.intersection.intersecting_pairs import LIMIT, intersecting_pairs, intersection_points
from clothsim.geometry.intersection.proved_separations import ProvedSeparations


class CheckedSurface(Protocol):
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
    """Intersections of a cloth with itself, another cloth or a body, or of a rigid body with a body.

    Attributes
    ----------
    first, second : str
        Names of the two surfaces.
    role : str
        "cloth" or "body", of the second; "rigid" where both are bodies.
    pairs : (p, 2) int array
        The triangles of each surface, counted in it from 0.
    position : (3,) array
        A point near the first pair [m].
    parts : tuple of str
        What is counted of each surface: triangles, or the edges of a rod.
    """

    first: str
    second: str
    role: str
    pairs: Ints
    position: Floats
    parts: tuple[str, str] = ("triangle", "triangle")

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
            return f"{self.parts[0]}s {i} and {j} of {self.first} intersect near ({at}) m"
        return f"{self.parts[0]} {i} of {self.first} intersects {self.parts[1]} {j} of {self.second} near ({at}) m"


def crossings(
    x: Floats, parts: Sequence[CheckedSurface], limit: int = LIMIT, proofs: ProvedSeparations | None = None
) -> tuple[Crossing, ...]:
    """All intersections of cloths with bodies, with themselves and with each other, and of rigid bodies with bodies.

    Other bodies are never checked against each other. There are two searches, and one for each rigid body.

    Parameters
    ----------
    x : (N, 3) array
        Positions of all vertices [m].
    parts : sequence of CheckedSurface
        Cloths, then bodies.
    limit : int
        Number of triangle pairs at which a search ends.
    proofs : ProvedSeparations, optional
        Of the last state; they become those of x. Pairs whose proof holds are not tested; the result is the same.

    Returns
    -------
    tuple of Crossing
        One for each pair of surfaces that intersect, in their order.

    Examples
    --------
    >>> import numpy as np
    >>> from types import SimpleNamespace
    >>> x = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, -1], [1, 1, 1], [9, 9, 0]])
    >>> sheet = SimpleNamespace(name="sheet", role="cloth", triangles=np.array([[0, 1, 2]]))
    >>> peg = SimpleNamespace(name="peg", role="body", triangles=np.array([[3, 4, 5]]))
    >>> [crossing.summary for crossing in crossings(x, [sheet, peg])]
    ['sheet and peg intersect']
    """
    cloths = [part for part in parts if part.role == "cloth"]
    bodies = [part for part in parts if part.role == "body"]
    found = _between(x, cloths, None, limit, proofs) + _between(x, cloths, bodies, limit, proofs)
    rigid = [part for part in bodies if getattr(part, "rigid", False)]
    for number, one in enumerate(rigid):
        others = [part for part in bodies if part not in rigid[: number + 1]]
        found += [replace(each, role="rigid") for each in _between(x, [one], others, limit, proofs)]
    lines: Sequence[Any] = parts
    for a, b, pairs in found_by_rods(x, lines):
        at = x[lines[a].edges[pairs[0, 0]]].mean(axis=0)
        what = ("edge", "edge" if len(getattr(lines[b], "edges", ())) else "triangle")
        found.append(Crossing(lines[a].name, lines[b].name, lines[b].role, pairs, at, what))
    if proofs is not None:
        proofs.end_state()
    order = {part.name: k for k, part in enumerate(parts)}
    return tuple(sorted(found, key=lambda each: (order[each.first], order[each.second])))


def _between(
    x: Floats,
    cloths: Sequence[CheckedSurface],
    bodies: Sequence[CheckedSurface] | None,
    limit: int,
    proofs: ProvedSeparations | None,
) -> list[Crossing]:
    """Crossings of the cloths with bodies; None: with themselves and each other."""
    cloths = [part for part in cloths if len(part.triangles)]  # no rods
    others = cloths if bodies is None else bodies
    if not cloths or not others:
        return []
    first, starts = _together(cloths)
    second, other_starts = (first, starts) if bodies is None else _together(others)
    search = intersecting_pairs if proofs is None else proofs.intersecting_pairs
    pairs = search(x, first, None if bodies is None else second, limit)
    if not len(pairs):
        return []
    owners = np.column_stack(
        [
            np.searchsorted(starts, pairs[:, 0], side="right") - 1,
            np.searchsorted(other_starts, pairs[:, 1], side="right") - 1,
        ]
    )
    found = []
    for a, b in np.unique(owners, axis=0):
        chosen = pairs[(owners == (a, b)).all(axis=1)]
        position = intersection_points(x, first, second, chosen[:1])[0]
        local = chosen - [starts[a], other_starts[b]]
        found.append(Crossing(cloths[a].name, others[b].name, others[b].role, local, position))
    return found


def _together(parts: Sequence[CheckedSurface]) -> tuple[Ints, Ints]:
    """Triangles of all parts, and the first of each."""
    counts = [len(part.triangles) for part in parts]
    return np.concatenate([part.triangles for part in parts]), np.cumsum([0, *counts[:-1]])
