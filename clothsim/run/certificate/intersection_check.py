"""Exact intersection check of a state: its surfaces and exclusions. It shares no code with contact."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.mesh.world_surfaces import Surface

if TYPE_CHECKING:
    from clothsim.geometry.intersection.crossings import Crossing
    from clothsim.geometry.intersection.proved_separations import ProvedSeparations
    from clothsim.solve.stepping.state import State

_EFFECT = {"body": "body_contact", "cloth": "self_contact", "rigid": "body_contact"}
"""Effect that keeps cloth from intersecting a body or cloth, and rigid bodies from bodies."""

_ORIGIN = np.zeros(3)


@dataclass(frozen=True)
class IntersectionCheck:
    """Surfaces to check, and the pairs that a scene keeps free of intersections.

    All pairs of cloths, of cloth and body, and of rigid bodies and bodies are checked, whatever effects are on.

    Parameters
    ----------
    surfaces : tuple of Surface
        Cloths and bodies of the scene.
    on : frozenset of str
        Contact effects that are on.
    excluded : frozenset of frozenset of str
        Pairs of names that the scene excludes from contact.
    proofs : ProvedSeparations, optional
        Separations proved at the last state; None: each state is searched in full.
    """

    surfaces: tuple[Surface, ...]
    on: frozenset[str]
    excluded: frozenset[frozenset[str]]
    proofs: "ProvedSeparations | None" = None

    @property
    def bodies(self) -> bool:
        """True where the scene has a body."""
        return any(surface.role == "body" for surface in self.surfaces)

    @property
    def rigid(self) -> bool:
        """True where the scene has a rigid body that forces move."""
        return any(surface.rigid for surface in self.surfaces)

    def crossings(self, x: Floats, origin: Floats = _ORIGIN) -> "tuple[Crossing, ...]":
        """Find all intersections in x (N, 3) [m], which is relative to `origin` (3,)."""
        from clothsim.geometry.intersection.crossings import (
            crossings,  # kernels: a process that runs nothing does not load them
        )

        found = crossings(x, self.surfaces, proofs=self.proofs)
        return tuple(replace(crossing, position=crossing.position + origin) for crossing in found)

    def crossings_of(self, state: "State", origin: Floats) -> "tuple[Crossing, ...]":
        """Find all intersections in a state; those of vertices carried through a pinch have the role "carried"."""
        found = self.crossings(state.positions, origin)
        if not found or "contact.pinch" not in state.memory:
            return found
        from clothsim.solve.pinch.carried import (
            carried_in,  # runs without the policy do not import it
            exempted,
        )

        return exempted(found, self.surfaces, carried_in(state.memory).vertices)

    def kind(self, crossing: "Crossing") -> str:
        """Return the kind of a crossing.

        "cloth_body", "cloth_cloth", "rigid" of a rigid body, "excluded" by the scene, "carried" in a pinch.
        """
        if frozenset((crossing.first, crossing.second)) in self.excluded:
            return "excluded"
        if crossing.role in ("carried", "rigid"):
            return crossing.role
        return f"cloth_{crossing.role}"

    def violations(self, found: "Sequence[Crossing]") -> "list[Crossing]":
        """Return the crossings that an effect of the scene should have prevented."""
        return [each for each in found if _EFFECT.get(each.role) in self.on and self.kind(each) != "excluded"]

    def coverage(self, complete: bool = True) -> dict[str, str]:
        """Return a description of the checked pairs, for the certificate; complete: of all states."""
        checked = "checked at every step" if complete else "checked at every step since the run was resumed"
        kinds = {"cloth_body": checked if self.bodies else "no body", "cloth_cloth": checked}
        return kinds | ({"rigid": checked} if self.rigid else {})


def intersection_check_of(
    surfaces: Sequence[Surface],
    effects: Mapping[str, Any],
    on: Collection[str],
    proofs: "ProvedSeparations | None" = None,
) -> IntersectionCheck:
    """Make the check of a scene.

    Parameters
    ----------
    surfaces : sequence of Surface
        Cloths and bodies.
    effects : mapping
        The scene's; `exclude` of a contact lists pairs of names.
    on : collection of str
        Effects that are on.
    proofs : ProvedSeparations, optional
        For the states of a run, one after another.
    """
    pairs = [pair for name in _EFFECT.values() if name in effects for pair in effects[name].exclude]
    acting = frozenset(_EFFECT.values()) & set(on)
    return IntersectionCheck(tuple(surfaces), acting, frozenset(map(frozenset, pairs)), proofs)
