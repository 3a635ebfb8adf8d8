"""Garments checked on their bodies: the exact test, what is inside a body, and the part of the body where it is."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.geometry.held_inside import is_inside
from clothsim.geometry.intersection.crossings import Crossing, crossings
from clothsim.mesh.generators.mannequin.generator import JOINTS, template
from clothsim.mesh.topology import components
from clothsim.mesh.world import World


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predicted garment on its body.

    Attributes
    ----------
    cloth : (n, 3) ndarray
        All cloths one after the other [m].
    bodies : tuple of (b, 3) ndarray
        [m].
    crossings : tuple of Crossing
        All intersections, by the exact test.
    place : str
        Where most of the pairs are; "" without intersections.
    inside : int
        Number of vertices of pieces whose first vertex is inside a body.
    """

    cloth: Floats
    bodies: tuple[Floats, ...]
    crossings: tuple[Crossing, ...]
    place: str
    inside: int

    @property
    def clean(self) -> bool:
        """True where nothing intersects and no piece is inside a body."""
        return not self.crossings and not self.inside

    @property
    def pairs(self) -> int:
        """Number of pairs of triangles that intersect."""
        return sum(len(each.pairs) for each in self.crossings)

    @property
    def verdict(self) -> str:
        """Text: "free of intersections", or "12 pairs of triangles intersect, at the left upper arm"."""
        held = f"{self.inside:,} of {len(self.cloth):,} vertices are inside a body"
        if not self.crossings:
            return held if self.inside else "free of intersections"
        found = f"{self.pairs:,} {'pair' if self.pairs == 1 else 'pairs'} of triangles intersect, {self.place}"
        return f"{found}; {held}" if self.inside else found


@dataclass(frozen=True, eq=False)
class CheckedSurfaces:
    """Surfaces of a scene, whose positions are checked.

    Attributes
    ----------
    cloths, bodies : tuple of SimpleNamespace
        Name, role, and triangles as rows of the positions of all cloths and bodies.
    mannequin : bool
        True where the first body is the package's mannequin, whose parts have names.
    """

    cloths: tuple[Any, ...]
    bodies: tuple[Any, ...]
    mannequin: bool

    @classmethod
    def of_world(cls, world: World, mannequin: bool) -> "CheckedSurfaces":
        """The surfaces of the cloths and bodies of a world."""
        surfaces: list[Any] = [*world.cloths, *world.bodies]
        roles = ["cloth"] * len(world.cloths) + ["body"] * len(world.bodies)
        begins = np.cumsum([0, *(len(each.positions) for each in surfaces)])
        parts = [
            SimpleNamespace(name=each.name, role=role, triangles=each.triangles + first)
            for each, role, first in zip(surfaces, roles, begins, strict=False)
        ]
        return cls(tuple(parts[: len(world.cloths)]), tuple(parts[len(world.cloths) :]), mannequin)

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """The joint that moves each vertex of the first body most; () where it is not a mannequin."""
        if not self.mannequin:
            return ()
        return tuple(JOINTS[j].replace("_", " ") for j in template().weights.argmax(axis=1))

    def check(self, cloth: Floats, bodies: Sequence[Floats]) -> Prediction:
        """The verdict on positions of all cloths (n, 3) and of each body (b, 3) [m]."""
        found = crossings(np.concatenate([cloth, *bodies]), [*self.cloths, *self.bodies])
        # one vertex of a piece tells whether it is inside a body, where the two do not intersect
        pieces = components(np.concatenate([part.triangles for part in self.cloths]), len(cloth))
        held = {
            piece
            for piece, first in zip(*np.unique(pieces, return_index=True), strict=True)
            for part, points in zip(self.bodies, bodies, strict=True)
            if is_inside(cloth[first], points, part.triangles - int(part.triangles.min()))
        }
        return Prediction(cloth, tuple(bodies), found, self._place(found), int(np.isin(pieces, list(held)).sum()))

    def _place(self, found: tuple[Crossing, ...]) -> str:
        """Where most pairs are: the part of the first body that has most, else the first point."""
        if not found:
            return ""
        most = max(found, key=lambda each: len(each.pairs))
        if self.joints and most.role == "body" and most.second == self.bodies[0].name:
            begin = int(self.bodies[0].triangles.min())
            corners = self.bodies[0].triangles[most.pairs[:, 1], 0] - begin
            return f"at the {Counter(self.joints[k] for k in corners).most_common(1)[0][0]}"
        return f"near ({', '.join(f'{value:.2f}' for value in most.position)}) m"
