"""Exact intersection check of a frame: its surfaces and exclusions. It shares no code with contact."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from clothsim.arrays import Floats
from clothsim.io.run_surfaces import Surface

if TYPE_CHECKING:
    from clothsim.intersection.crossings import Crossing

_EFFECT = {"body": "body_contact", "cloth": "self_contact"}
"""Effect that keeps cloth from intersecting a body or cloth."""


@dataclass(frozen=True)
class IntersectionCheck:
    """Surfaces to check, and the pairs that a scene requires to be free of intersections.

    Parameters
    ----------
    surfaces : tuple of Surface
        Cloths and bodies of the scene.
    on : frozenset of str
        Contact effects that are on.
    excluded : frozenset of frozenset of str
        Pairs of names that are not checked.
    """

    surfaces: tuple[Surface, ...]
    on: frozenset[str]
    excluded: frozenset[frozenset[str]]

    @property
    def cloth_cloth(self) -> bool:
        """True where cloth must not intersect cloth."""
        return "self_contact" in self.on

    @property
    def bodies(self) -> bool:
        """True where the scene has a body."""
        return any(surface.role == "body" for surface in self.surfaces)

    def crossings(self, x: Floats, cloth_cloth: bool | None = None, limit: int = 1) -> "tuple[Crossing, ...]":
        """Find the intersections in x (N, 3) [m], at most `limit` pairs of triangles for two surfaces.

        cloth_cloth: True tests cloth with cloth; None tests it where it must be free of intersections.
        """
        tested = self.cloth_cloth if cloth_cloth is None else cloth_cloth
        if not (self.bodies or tested):
            return ()
        from clothsim.intersection.crossings import crossings  # kernels: imported only where something is checked

        return crossings(x, self.surfaces, tested, self.excluded, limit)

    def violations(self, found: "Sequence[Crossing]") -> "list[Crossing]":
        """Return the crossings that an effect of the scene should have prevented."""
        return [crossing for crossing in found if _EFFECT[crossing.role] in self.on]

    def coverage(self) -> dict[str, str]:
        """Return a description of the checked pairs, for the certificate."""
        tested = "tested at every frame"
        if self.excluded:
            tested += " but for excluded pairs"
        return {
            "cloth_body": tested if self.bodies else "no body",
            "cloth_cloth": tested if self.cloth_cloth else "not requested",
        }


def intersection_check_of(
    surfaces: Sequence[Surface], effects: Mapping[str, Mapping[str, Any]], on: Collection[str]
) -> IntersectionCheck:
    """Make the check of a scene.

    Parameters
    ----------
    surfaces : sequence of Surface
        Cloths and bodies.
    effects : mapping
        {name: keys} as the scene gives them; `exclude` lists pairs of names.
    on : collection of str
        Effects that are on.
    """
    pairs = [pair for name in _EFFECT.values() for pair in effects.get(name, {}).get("exclude", ())]
    return IntersectionCheck(tuple(surfaces), frozenset(_EFFECT.values()) & set(on), frozenset(map(frozenset, pairs)))
