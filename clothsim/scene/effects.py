"""Table of effects: the names of a scene and the functions that build them.

A new effect is one file and one line here. A builder takes the world and, by keyword, the keys of the effect in a
scene. It returns an Energy; or `Off` with the reason why there is nothing to do; or, where it constrains vertices, the
world and a Constraint. A module is imported only when a scene names its effect. `docs/extending.md` has an example.
"""

import importlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from clothsim.base.errors import InputError


@dataclass(frozen=True)
class Effect:
    """An effect of the table.

    Parameters
    ----------
    builder : str or function
        The function that builds it, or "module:function", imported when it is first needed; a leading dot stands for
        `clothsim.physics`.
    summary : str
        A few words on what it is.
    """

    builder: str | Callable[..., Any]
    summary: str

    def load(self) -> Callable[..., Any]:
        """Import the builder."""
        if callable(self.builder):
            return self.builder
        module, function = self.builder.split(":")
        return getattr(importlib.import_module(module, "clothsim.physics"), function)

    def example(self) -> Any:
        """The `EXAMPLE` beside the builder, for tests; one of default keys where there is none."""
        own = getattr(importlib.import_module(self.load().__module__), "EXAMPLE", None)
        return own or importlib.import_module("clothsim.physics.energies.example").Example()

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


SUPPLIED = ("contacts", "built")
"""Keywords of builders that no scene gives: the names of the contacts that are on, and the energies built so far, by
name."""


EFFECTS = {
    "pins": Effect(".energies.pins:pins", "vertices fixed or on a prescribed motion"),
    "inertia": Effect(".energies.inertia:inertia", "mass times acceleration"),
    "membrane": Effect(".energies.membrane:membrane", "stretch and shear"),
    "fibres": Effect(".energies.fibres:fibres", "threads along warp and weft"),
    "strain_limit": Effect(".energies.strain_limit:strain_limit", "upper limits of the stretches"),
    "bending": Effect(".energies.bending:bending", "resistance to folding"),
    "rest_angle": Effect(".energies.rest_angle:rest_angle", "creases and pleats with a rest angle"),
    "gravity": Effect(".energies.gravity:gravity", "weight"),
    "springs": Effect(".energies.springs:springs", "springs, tethers and soft pins to positions in space"),
    "pressure": Effect(".energies.pressure:pressure", "fluid pressure along the normals"),
    "air": Effect(".energies.air:air", "drag and lift in still air or wind"),
    "damping": Effect(".energies.damping:damping", "damping of velocity, strain rate and bending rate"),
    "body_contact": Effect(".contact.body_contact:body_contact", "cloth against bodies"),
    "self_contact": Effect(".contact.self_contact:self_contact", "cloth against cloth"),
    "seams": Effect(".energies.seams:seams", "borders drawn together over time, then joined"),
    "plastic_bending": Effect(".energies.plastic_bending:plastic_bending", "permanent folds beyond a yield"),
    "friction": Effect(".contact.friction_coefficients:friction", "resistance of contacts to sliding"),
}

CONTACTS = ("body_contact", "self_contact")


def register_effect(name: str, builder: Callable[..., Any], summary: str = "") -> None:
    """Add an own effect to the table, for the scenes of this process.

    Parameters
    ----------
    name : the effect's name in scenes, a Python identifier that the table does not have.
    builder : `builder(world, *, key=default, ...)` returns an Energy or `Off`; its keywords are the scene's keys.
    summary : one line on the effect; by default the first line of the builder's docstring.

    Raises
    ------
    InputError : where the name is taken or no identifier, or the builder cannot be called with a world alone.

    Examples
    --------
    >>> from clothsim.physics.energies.base import Off
    >>> def tickle(world, *, strength=0.0):
    ...     return Off("strength is 0")
    >>> register_effect("tickle", tickle, "a gentle force")
    >>> EFFECTS["tickle"].keys()
    {'strength': 0.0}
    >>> del EFFECTS["tickle"]
    """
    if not isinstance(name, str) or not name.isidentifier():
        raise InputError(f"{name!r} cannot name an effect.", "Take letters, digits and underscores.")
    if name in EFFECTS:
        raise InputError(f"There is already an effect {name!r}.", f"Take another name than {', '.join(EFFECTS)}.")
    if not _takes_a_world_and_keywords(builder):
        raise InputError(
            f"The builder of the effect {name!r} must take the world and keywords, not {builder!r}.",
            "Write def builder(world, *, strength=1.0).",
        )
    EFFECTS[name] = Effect(builder, summary or (inspect.getdoc(builder) or name).splitlines()[0])


def _takes_a_world_and_keywords(builder: Any) -> bool:
    """True for a callable of one positional argument whose keywords all have defaults."""
    try:
        parameters = inspect.signature(builder).parameters.values()
    except (TypeError, ValueError):  # nothing that can be called, or a class of C without a signature
        return False
    positional = [p for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    required = [p for p in parameters if p.kind is p.KEYWORD_ONLY and p.default is p.empty and p.name not in SUPPLIED]
    return len(positional) == 1 and not required
