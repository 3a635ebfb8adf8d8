"""Table of effects: the names of a scene and the functions that build them.

A new effect is one file and one line here. A builder takes the world and, by keyword, the keys of the effect in a
scene. It returns an Energy; or Off with the reason why there is nothing to do; or, where it constrains vertices, the
world and a Constraint. A module is imported only when a scene names its effect.
"""

import importlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Effect:
    """An effect of the table.

    Parameters
    ----------
    builder : str
        Module and function that build it, "module:function".
    summary : str
        A few words on what it is.
    """

    builder: str
    summary: str

    def load(self) -> Callable[..., Any]:
        """Import the builder."""
        module, function = self.builder.split(":")
        return getattr(importlib.import_module(module), function)

    def keys(self) -> dict[str, Any]:
        """The keys of a scene with their defaults: the builder's keywords."""
        return {key: default for key, default in self._keywords().items() if key not in SUPPLIED}

    @property
    def sees_others(self) -> bool:
        """True where the builder looks at the effects built before it."""
        return not {"contacts", "built"}.isdisjoint(self._keywords())

    def build(self, world: Any, keys: Mapping[str, Any], supplied: Mapping[str, Any]) -> Any:
        """Call the builder.

        Parameters
        ----------
        world : World
            Cloths and bodies.
        keys : dict
            Keys of the scene.
        supplied : dict
            Values of SUPPLIED, passed where the builder has a keyword of the name.

        Returns
        -------
        Energy, Off, or (World, Constraint)
        """
        own = self._keywords()
        return self.load()(world, **keys, **{key: value for key, value in supplied.items() if key in own})

    def _keywords(self) -> dict[str, Any]:
        parameters = inspect.signature(self.load()).parameters.values()
        return {p.name: p.default for p in parameters if p.kind is p.KEYWORD_ONLY}


SUPPLIED = ("backend", "contacts", "built")
"""Keywords of builders that no scene gives: the backend of [contact], the names of the contacts that are on, and the
energies built so far, by name."""


EFFECTS = {
    "pins": Effect("clothsim.energies.pins:pins", "fixed vertices, or in prescribed motion"),
    "inertia": Effect("clothsim.energies.inertia:inertia", "mass times acceleration"),
    "membrane": Effect("clothsim.energies.membrane:membrane", "stretch and shear"),
    "fibres": Effect("clothsim.energies.fibres:fibres", "stiffness along warp and weft"),
    "strain_limit": Effect("clothsim.energies.strain_limit:strain_limit", "upper limit of the stretches"),
    "bending": Effect("clothsim.energies.bending:bending", "resistance to curvature"),
    "rest_angle": Effect("clothsim.energies.rest_angle:rest_angle", "creases and pleats: rest angles of hinges"),
    "gravity": Effect("clothsim.energies.gravity:gravity", "weight"),
    "springs": Effect("clothsim.energies.springs:springs", "springs, tethers and soft pins to points"),
    "pressure": Effect("clothsim.energies.pressure:pressure", "pressure of a fluid along the normals"),
    "air": Effect("clothsim.energies.air:air", "drag and lift in still air or wind"),
    "damping": Effect("clothsim.energies.damping:damping", "damping of velocity, strain rate and bending rate"),
    "body_contact": Effect("clothsim.contact.body_contact:body_contact", "cloth against bodies"),
    "self_contact": Effect("clothsim.contact.self_contact:self_contact", "cloth against cloth"),
    "seams": Effect("clothsim.energies.seams:seams", "borders joined over time"),
    "plastic_bending": Effect(
        "clothsim.energies.plastic_bending:plastic_bending", "plastic folds beyond a yield angle"
    ),
    "friction": Effect("clothsim.contact.friction:friction", "Coulomb friction of contacts"),
}

CONTACTS = ("body_contact", "self_contact")
