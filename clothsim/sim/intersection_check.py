"""Which surfaces of a scene are judged, and the exact test of a frame: it shares no code with contact."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from clothsim.arrays import Floats
from clothsim.io.run_surfaces import Surface

if TYPE_CHECKING:
    from clothsim.intersection.crossings import Crossing

_EFFECT = {"body": "body_contact", "cloth": "self_contact"}
"""What keeps a cloth from intersecting a body or cloth."""


@dataclass(frozen=True)
class IntersectionCheck:
    """surfaces: the scene's; on: its contact effects that are on; excluded: pairs of names that it leaves out."""

    surfaces: tuple[Surface, ...]
    on: frozenset[str]
    excluded: frozenset[frozenset[str]]

    @property
    def cloth_cloth(self) -> bool:
        """Whether cloth must not intersect cloth."""
        return "self_contact" in self.on

    @property
    def bodies(self) -> bool:
        """Whether there is a body."""
        return any(surface.role == "body" for surface in self.surfaces)

    def crossings(self, x: Floats, cloth_cloth: bool | None = None, limit: int = 1) -> "tuple[Crossing, ...]":
        """What intersects in x (N, 3) [m]; cloth_cloth: whether cloth is tested with cloth, None: where it must be."""
        tested = self.cloth_cloth if cloth_cloth is None else cloth_cloth
        if not (self.bodies or tested):
            return ()
        from clothsim.intersection.crossings import crossings  # kernels: only where there is something to judge

        return crossings(x, self.surfaces, tested, self.excluded, limit)

    def violations(self, found: "Sequence[Crossing]") -> "list[Crossing]":
        """Those crossings that an effect of the scene promised to prevent."""
        return [crossing for crossing in found if _EFFECT[crossing.role] in self.on]

    def coverage(self) -> dict[str, str]:
        """What was tested, for the certificate."""
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
    """The judge of a scene with `surfaces`; effects: {name: keys} as the scene names them; on: those that are on."""
    pairs = [pair for name in _EFFECT.values() for pair in effects.get(name, {}).get("exclude", ())]
    return IntersectionCheck(tuple(surfaces), frozenset(_EFFECT.values()) & set(on), frozenset(map(frozenset, pairs)))
