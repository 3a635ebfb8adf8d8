"""THE table of effects: a name in a scene and the function that builds it. A new effect is one file and one line here.

A builder takes the world and, by keyword, what the scene says of that effect: its keywords are the scene's keys.
It returns an Energy; or Off with the reason why there is nothing to do; or, where it holds vertices, the world and a
Constraint. A module is imported only when a scene names its effect.
"""

import importlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Effect:
    """Where an effect's builder is ("module:function") and what it does, in a few words."""

    builder: str
    summary: str

    def load(self) -> Callable[..., Any]:
        """Import the builder."""
        module, function = self.builder.split(":")
        return getattr(importlib.import_module(module), function)

    def keys(self) -> dict[str, Any]:
        """The keys that a scene may give, with their defaults."""
        return {key: default for key, default in self._keywords().items() if key not in SUPPLIED}

    @property
    def sees_others(self) -> bool:
        """True where the builder looks at the effects built before it."""
        return not {"contacts", "built"}.isdisjoint(self._keywords())

    def build(self, world: Any, keys: Mapping[str, Any], supplied: Mapping[str, Any]) -> Any:
        """Call the builder with the scene's keys, and with those of `supplied` (see SUPPLIED) that it has."""
        own = self._keywords()
        return self.load()(world, **keys, **{key: value for key, value in supplied.items() if key in own})

    def _keywords(self) -> dict[str, Any]:
        parameters = inspect.signature(self.load()).parameters.values()
        return {p.name: p.default for p in parameters if p.kind is p.KEYWORD_ONLY}


SUPPLIED = ("backend", "contacts", "built")
"""Keywords of builders that no scene gives: the backend of [contact], the names of the contacts that are on, and the
energies that are on so far, by name."""


EFFECTS = {
    "pins": Effect("clothsim.energies.pins:pins", "vertices held or carried"),
    "inertia": Effect("clothsim.energies.inertia:inertia", "mass times acceleration"),
    "membrane": Effect("clothsim.energies.membrane:membrane", "stretch and shear"),
    "fibres": Effect("clothsim.energies.fibres:fibres", "threads along warp and weft"),
    "strain_limit": Effect("clothsim.energies.strain_limit:strain_limit", "stretches stay below a limit"),
    "bending": Effect("clothsim.energies.bending:bending", "resistance to folding"),
    "rest_angle": Effect("clothsim.energies.rest_angle:rest_angle", "creases and pleats, folded at rest"),
    "gravity": Effect("clothsim.energies.gravity:gravity", "weight"),
    "springs": Effect("clothsim.energies.springs:springs", "vertices tied to places: springs, tethers, soft pins"),
    "pressure": Effect("clothsim.energies.pressure:pressure", "a fluid that pushes along the normals"),
    "air": Effect("clothsim.energies.air:air", "drag and lift in still air or wind"),
    "damping": Effect("clothsim.energies.damping:damping", "drag on velocity, strain and folding"),
    "body_contact": Effect("clothsim.contact.body_contact:body_contact", "cloth against bodies"),
    "self_contact": Effect("clothsim.contact.self_contact:self_contact", "cloth against cloth"),
    "seams": Effect("clothsim.energies.seams:seams", "borders pulled together over time, then held"),
    "plastic_bending": Effect("clothsim.energies.plastic_bending:plastic_bending", "folds beyond a yield angle stay"),
    "friction": Effect("clothsim.contact.friction:friction", "resistance of contacts to sliding"),
}

CONTACTS = ("body_contact", "self_contact")
