"""Table of effects: the names of a scene and the functions that build them.

A new effect is one file and one line here. A builder takes the world and the keys of the effect in a scene, which are
checked, and returns an Energy; or `Off` with the reason why there is nothing to do; or, where it constrains vertices,
the world and a Constraint. A module is imported only when a scene names its effect. `docs/extending.md` has an example.
"""

import importlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass
from functools import cached_property
from typing import Any

from clothsim.base.errors import InputError
from clothsim.keys.schema import keys_of
from clothsim.keys.typed_effects import EffectKeys, is_builder, keys_of_builder, takes_keys


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
    section : str or type
        The class of its keys: a name in `clothsim.keys.typed_effects`, or "module:class". Left out: the class by which
        the builder annotates its second argument, or one made of the builder's keywords.
    """

    builder: str | Callable[..., Any]
    summary: str
    section: str | type[EffectKeys] = ""

    def load(self) -> Callable[..., Any]:
        """Import the builder."""
        return self.builder if callable(self.builder) else _import_named(self.builder)

    @cached_property
    def keys_class(self) -> type[EffectKeys]:
        """The class of the keys; of those with a `section` nothing else is imported."""
        if isinstance(self.section, type):
            return self.section
        if not self.section:
            return keys_of_builder(self.load())
        name = self.section if ":" in self.section else f"clothsim.keys.typed_effects:{self.section}"
        found: type[EffectKeys] = _import_named(name)
        return found

    def example(self) -> Any:
        """The `EXAMPLE` beside the builder, for tests; one of default keys if there is none."""
        own = getattr(importlib.import_module(self.load().__module__), "EXAMPLE", None)
        return own or importlib.import_module("clothsim.physics.energies.example").Example()

    def keys(self) -> dict[str, Any]:
        """The keys of a scene with their defaults; `inspect.Parameter.empty` for one that must be given."""
        known = keys_of(self.keys_class)
        return {name: inspect.Parameter.empty if key.default is MISSING else key.default for name, key in known.items()}

    @property
    def sees_others(self) -> bool:
        """True if the builder looks at the effects built before it."""
        return not {"contacts", "built"}.isdisjoint(inspect.signature(self.load()).parameters)

    def build(self, world: Any, keys: EffectKeys, supplied: Mapping[str, Any]) -> Any:
        """Call the builder.

        Parameters
        ----------
        world : World
            Cloths and bodies.
        keys : EffectKeys
            Keys of the scene.
        supplied : dict
            Values of SUPPLIED, passed where the builder has a keyword of the name.

        Returns
        -------
        Energy, Off, or (World, Constraint)
        """
        builder = self.load()
        own = inspect.signature(builder).parameters
        more = {key: value for key, value in supplied.items() if key in own}
        return builder(world, keys, **more) if takes_keys(builder) else builder(world, **keys.as_table(), **more)


def _import_named(text: str) -> Any:
    """What "module:name" names; a leading dot stands for `clothsim.physics`."""
    module, name = text.split(":")
    return getattr(importlib.import_module(module, "clothsim.physics"), name)


EFFECTS = {
    "pins": Effect(".energies.pins:pins", "vertices fixed or on a prescribed motion", "Pins"),
    "inertia": Effect(".energies.inertia:inertia", "mass times acceleration", "Inertia"),
    "membrane": Effect(".energies.membrane:membrane", "stretch and shear", "Membrane"),
    "fibres": Effect(".energies.fibres:fibres", "threads along warp and weft", "Fibres"),
    "strain_limit": Effect(".energies.strain_limit:strain_limit", "upper limits of the stretches", "StrainLimit"),
    "bending": Effect(".energies.bending:bending", "resistance to folding", "Bending"),
    "rest_angle": Effect(".energies.rest_angle:rest_angle", "creases and pleats with a rest angle", "RestAngle"),
    "gravity": Effect(".energies.gravity:gravity", "weight", "Gravity"),
    "springs": Effect(".energies.springs:springs", "springs, tethers and soft pins to positions in space", "Springs"),
    "targets": Effect(".energies.targets:targets", "soft targets of every vertex in each frame", "Targets"),
    "elastic_bands": Effect(".energies.elastic_bands:elastic_bands", "elastic along edges", "ElasticBands"),
    "cords": Effect(".energies.cords:cords", "cords that slide through edges", "Cords"),
    "stiffeners": Effect(".energies.stiffeners:stiffeners", "rods sewn along edges", "Stiffeners"),
    "pressure": Effect(".energies.pressure:pressure", "fluid pressure along the normals", "Pressure"),
    "air": Effect(".energies.air:air", "drag and lift in still air or wind", "Air"),
    "damping": Effect(".energies.damping:damping", "damping of velocity, strain rate and bending rate", "Damping"),
    "body_contact": Effect(".contact.body_contact:body_contact", "cloth against bodies", "BodyContact"),
    "self_contact": Effect(".contact.self_contact:self_contact", "cloth against cloth", "SelfContact"),
    "seams": Effect(".energies.seams:seams", "borders drawn together over time, then joined", "Seams"),
    "closures": Effect(".energies.closures:closures", "zips and buttons, closed and opened over time", "Closures"),
    "plastic_bending": Effect(
        ".energies.plastic_bending:plastic_bending", "permanent folds beyond a yield", "PlasticBending"
    ),
    "friction": Effect(".contact.friction_coefficients:friction", "resistance of contacts to sliding", "Friction"),
}

CONTACTS = ("body_contact", "self_contact")


def register_effect(name: str, builder: Callable[..., Any], summary: str = "") -> None:
    """Add a custom effect to the table, for the scenes of this process.

    Parameters
    ----------
    name : the effect's name in scenes, a Python identifier that the table does not have.
    builder : `builder(world, *, key=default, ...)` returns an Energy or `Off`; its keywords are the scene's keys. Or
        `builder(world, keys: Keys)`, Keys a frozen dataclass of `EffectKeys` with types, units and ranges.
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
        raise InputError(f"{name!r} cannot name an effect.", "Use letters, digits and underscores.")
    if name in EFFECTS:
        raise InputError(f"There is already an effect {name!r}.", f"Use another name than {', '.join(EFFECTS)}.")
    if not is_builder(builder):
        raise InputError(
            f"The builder of the effect {name!r} must take the world and keywords, not {builder!r}.",
            "Write def builder(world, *, strength=1.0), or def builder(world, keys: MyKeys).",
        )
    summary = summary or (inspect.getdoc(builder) or name).splitlines()[0]
    EFFECTS[name] = Effect(builder, summary, keys_of_builder(builder, name))
