"""Effects as frozen dataclasses: the keys of each effect with default, unit, range and meaning.

`effects=[clothsim.Gravity(), clothsim.Bending(model="midedge")]` is the same as
`effects={"gravity": {}, "bending": {"model": "midedge"}}`. Each key is declared only here. The table `scene.effects`
names the class, a scene is checked against it, and the builder takes an object of it. Importing this module imports no
effect. For an effect that a user registers, the class is the one that its builder names, or is made from the keywords
of the builder.
"""

import inspect
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, make_dataclass
from typing import Annotated, Any, ClassVar, Literal, Self

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.inputs import shown
from clothsim.keys.effect_tables import (
    SELECT,
    Band,
    Buttons,
    Cord,
    Crease,
    Gust,
    Motion,
    PatternSeams,
    PinGroup,
    Seam,
    Spring,
    Stiffener,
    Vortex,
    Zip,
)
from clothsim.keys.key_table import KeyTable, content_of, frozen
from clothsim.keys.schema import CurveTable, Key, OverCloth, OverTime, OverTimeByCloth, Selection, Table, Vector

AUTO = Literal["auto"]
WARP_ANGLE = Key("Angle of the warp from the cloth's first axis", "degrees")


@dataclass(frozen=True, kw_only=True)
class EffectKeys(KeyTable):
    """The keys of one effect."""

    @property
    def name(self) -> str:
        """The name of the effect in the table."""
        return self.section.removeprefix("effects.")


@dataclass(frozen=True, kw_only=True)
class Pins(EffectKeys):
    """Dirichlet conditions: vertices that are fixed or follow a rigid motion."""

    section: ClassVar[str] = "effects.pins"

    select: Annotated[Selection, SELECT] = ()
    clamp: Annotated[bool, Key("Also hold the direction of the cloth at the pinned edge")] = False
    motion: Annotated[
        Motion | Table | None, Key("Rigid motion of the pinned vertices", tables=(Motion,), shown="none")
    ] = None
    group: Annotated[
        Sequence[PinGroup | Table],
        Key("Groups of pins, each with select, clamp and motion", tables=(PinGroup,)),
    ] = ()


@dataclass(frozen=True, kw_only=True)
class Inertia(EffectKeys):
    """Mass times acceleration; without it a run is quasi-static."""

    section: ClassVar[str] = "effects.inertia"


@dataclass(frozen=True, kw_only=True)
class Membrane(EffectKeys):
    """Stretch and shear of the cloth in its plane."""

    section: ClassVar[str] = "effects.membrane"

    material: Annotated[
        Literal["auto", "neo_hookean", "orthotropic", "measured"],
        Key("Material law; auto: orthotropic if a fabric has a warp, weft or shear stiffness, else isotropic"),
    ] = "auto"
    angle_degrees: Annotated[OverCloth, WARP_ANGLE] = 0.0
    warp: Annotated[CurveTable, Key("Measured curve along the warp: rows of strain and stress", "1, N/m")] = ()
    weft: Annotated[CurveTable, Key("Measured curve along the weft: rows of strain and stress", "1, N/m")] = ()
    shear: Annotated[
        CurveTable, Key("Measured curve in shear: rows of the sine of the angle and stress", "1, N/m")
    ] = ()
    narrowing_warp: Annotated[
        CurveTable,
        Key(
            "Measured narrowing along the warp: rows of strain and of the strain by which the width shrinks",
            "1",
        ),
    ] = ()
    narrowing_weft: Annotated[CurveTable, Key("Measured narrowing along the weft", "1")] = ()
    elements: Annotated[
        Literal["triangles", "pairs"], Key("Constant strain per triangle, or per pair of triangles, which locks less")
    ] = "triangles"
    compression: Annotated[
        float,
        Key("Fraction of the stiffness left in compression; 0.05 for cloth that `clothsim wrinkle` refines", "1",
            above=0, most=1),
    ] = 1.0  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Fibres(EffectKeys):
    """Stiffness of warp and weft in addition to the membrane."""

    section: ClassVar[str] = "effects.fibres"

    warp: Annotated[OverCloth, Key("Stiffness along the warp", "N/m", least=0)] = 0.0
    weft: Annotated[OverCloth, Key("Stiffness along the weft", "N/m", least=0)] = 0.0
    shear: Annotated[OverCloth, Key("Stiffness in shear", "N/m", least=0)] = 0.0
    angle_degrees: Annotated[OverCloth, WARP_ANGLE] = 0.0


@dataclass(frozen=True, kw_only=True)
class StrainLimit(EffectKeys):
    """A barrier that keeps stretches below a limit."""

    section: ClassVar[str] = "effects.strain_limit"

    limit: Annotated[
        OverCloth,
        Key(
            "Largest principal stretch: 1.1 for 10 %; 0: none; fabric: the extension of the fabric along warp and"
            " weft under 490 N/m, or 1.1 if it has none",
            "1",
            least=0,
        ),
    ] = "fabric"
    limit_warp: Annotated[OverCloth, Key("Largest stretch along the warp; 0: none", "1", least=0)] = 0.0
    limit_weft: Annotated[OverCloth, Key("Largest stretch along the weft; 0: none", "1", least=0)] = 0.0
    begins: Annotated[
        float, Key("Fraction of the range from 1 to the limit at which the barrier starts", "1", least=0, below=1)
    ] = 0.5
    stiffness: Annotated[OverCloth, Key("Stiffness of the barrier; 0: that of the fabric", "N/m", least=0)] = 0.0
    angle_degrees: Annotated[OverCloth, WARP_ANGLE] = 0.0


@dataclass(frozen=True, kw_only=True)
class Bending(EffectKeys):
    """Resistance of the cloth to curvature."""

    section: ClassVar[str] = "effects.bending"

    model: Annotated[
        Literal["midedge", "hinge", "quadratic"],
        Key("Curvature per triangle, which converges on any mesh; angles of hinges; or a constant Hessian"),
    ] = "midedge"
    angle_degrees: Annotated[OverCloth, WARP_ANGLE] = 0.0
    short_waves: Annotated[
        float,
        Key(
            "Weight of the bending of waves a few cells long, which averaged curvature loses; 1 restores it",
            "1",
            least=0,
            most=10,
        ),
    ] = 0.0


@dataclass(frozen=True, kw_only=True)
class RestAngle(EffectKeys):
    """Creases and pleats: lines along which the cloth is folded at rest."""

    section: ClassVar[str] = "effects.rest_angle"

    crease: Annotated[Sequence[Crease | Table], Key("Lines with a rest angle", tables=(Crease,))] = ()


@dataclass(frozen=True, kw_only=True)
class Gravity(EffectKeys):
    """Weight of the cloth."""

    section: ClassVar[str] = "effects.gravity"

    acceleration: Annotated[Vector, Key("Acceleration of gravity", "m/s2", length=3)] = (0.0, 0.0, -9.81)


@dataclass(frozen=True, kw_only=True)
class Springs(EffectKeys):
    """Springs, tethers and soft pins from vertices to points."""

    section: ClassVar[str] = "effects.springs"

    spring: Annotated[Sequence[Spring | Table], Key("Springs for groups of vertices", tables=(Spring,))] = ()


@dataclass(frozen=True, kw_only=True)
class Targets(EffectKeys):
    """Soft targets of every vertex in each frame."""

    section: ClassVar[str] = "effects.targets"

    displacements: Annotated[
        Floats | Sequence[Any] | str,
        Key("Displacement from the start in each frame: an array (frames, vertices or 1, 3), or its .npy file", "m"),
    ] = ()
    frames_per_second: Annotated[float, Key("Frame rate of the displacements", "1/s", above=0)] = 25.0
    rate: Annotated[
        float,
        Key("Rate at which the cloth is drawn to its targets: square root of stiffness per mass; 0: none",
            "1/s", least=0),
    ] = 100.0  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class ElasticBands(EffectKeys):
    """Elastic bands sewn along edges of the cloth."""

    section: ClassVar[str] = "effects.elastic_bands"

    band: Annotated[Sequence[Band | Table], Key("Bands along lines of edges", tables=(Band,))] = ()


@dataclass(frozen=True, kw_only=True)
class Cords(EffectKeys):
    """Cords that slide through edges of the cloth."""

    section: ClassVar[str] = "effects.cords"

    cord: Annotated[Sequence[Cord | Table], Key("Cords along lines of edges", tables=(Cord,))] = ()


@dataclass(frozen=True, kw_only=True)
class Stiffeners(EffectKeys):
    """Rods sewn along edges of the cloth: boning, wire, piping, topstitched seams."""

    section: ClassVar[str] = "effects.stiffeners"

    stiffener: Annotated[Sequence[Stiffener | Table], Key("Rods along lines of edges", tables=(Stiffener,))] = ()


@dataclass(frozen=True, kw_only=True)
class Pressure(EffectKeys):
    """Pressure of a fluid along the normals."""

    section: ClassVar[str] = "effects.pressure"

    value: Annotated[OverTimeByCloth, Key("Pressure along the outward normals", "Pa")] = 0.0


@dataclass(frozen=True, kw_only=True)
class Air(EffectKeys):
    """Drag and lift in still air or wind."""

    section: ClassVar[str] = "effects.air"

    density: Annotated[float, Key("Density of the air", "kg/m3", least=0)] = 1.2
    drag: Annotated[OverCloth, Key("Drag coefficient of a triangle that faces the wind", "1", least=0)] = 1.0
    lift: Annotated[OverCloth, Key("Fraction of the drag that acts along the normal alone", "1", least=0, most=1)] = 0.9
    wind: Annotated[
        Vector | Gust | Vortex | Table | Callable[..., Any],
        Key("Velocity of the air; a table with a kind; or in Python a function of points and time", "m/s", length=3,
            tables=(Gust, Vortex)),
    ] = (0.0, 0.0, 0.0)  # fmt: skip
    strength: Annotated[OverTime, Key("Factor of the wind over time", "1")] = 1.0


@dataclass(frozen=True, kw_only=True)
class Damping(EffectKeys):
    """Drag on velocity, on the rate of strain and on the rate of bending."""

    section: ClassVar[str] = "effects.damping"

    rate: Annotated[OverCloth, Key("Mass-proportional damping; it slows a free fall too", "1/s", least=0)] = 1.0
    stiffness: Annotated[float, Key("Stiffness-proportional damping, Rayleigh's beta", "s", least=0)] = 0.0
    strain_rate: Annotated[OverCloth, Key("Viscosity of the sheet in its plane", "N s/m", least=0)] = 0.0


@dataclass(frozen=True, kw_only=True)
class ContactKeys(EffectKeys):
    """The keys of both contacts."""

    d_hat: Annotated[
        float | AUTO, Key("Activation distance of the barrier; auto: from the median cloth edge", "m", above=0)
    ] = "auto"  # fmt: skip
    offset: Annotated[float, Key("Smallest gap, the thickness of contact; d_hat is added to it", "m", least=0)] = 0.0
    stiffness: Annotated[float | AUTO, Key("Stiffness of the barrier; auto: from the loads", "Pa", above=0)] = "auto"
    exclude: Annotated[Sequence[Sequence[str]], Key("Pairs of names of cloths and bodies without contact")] = ()


@dataclass(frozen=True, kw_only=True)
class BodyContact(ContactKeys):
    """Contact of cloth and bodies."""

    section: ClassVar[str] = "effects.body_contact"


@dataclass(frozen=True, kw_only=True)
class SelfContact(ContactKeys):
    """Contact of cloth and cloth."""

    section: ClassVar[str] = "effects.self_contact"


@dataclass(frozen=True, kw_only=True)
class Seams(EffectKeys):
    """Seams: borders that are drawn together over time and then joined."""

    section: ClassVar[str] = "effects.seams"

    seam: Annotated[Sequence[Seam | Table], Key("Seams between two borders", tables=(Seam,))] = ()
    pattern: Annotated[
        PatternSeams | Table | bool,
        Key("Close all seams of sewing patterns that are open as placed: true, or a table", tables=(PatternSeams,)),
    ] = False  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Closures(EffectKeys):
    """Zips and buttons: borders that are closed and opened over time, and never sewn."""

    section: ClassVar[str] = "effects.closures"

    zip: Annotated[Sequence[Zip | Table], Key("Zips between two borders", tables=(Zip,))] = ()
    buttons: Annotated[Sequence[Buttons | Table], Key("Rows of buttons between two borders", tables=(Buttons,))] = ()


@dataclass(frozen=True, kw_only=True)
class PlasticBending(EffectKeys):
    """Permanent folds beyond a yield angle or curvature."""

    section: ClassVar[str] = "effects.plastic_bending"

    yield_angle_degrees: Annotated[float, Key("Yield angle of a hinge; 0: none", "degrees", least=0)] = 0.0
    yield_curvature: Annotated[float, Key("Yield curvature, in place of the angle; 0: none", "1/m", least=0)] = 0.0
    hardening: Annotated[float, Key("Kinematic hardening as a fraction of the bending stiffness", "1", least=0)] = 0.0


@dataclass(frozen=True, kw_only=True)
class Friction(EffectKeys):
    """Coulomb friction of every contact."""

    section: ClassVar[str] = "effects.friction"

    coefficient: Annotated[float, Key("Coefficient of friction of the pairs that are not in pairs", "1", least=0)] = 0.3
    mu_static: Annotated[float | AUTO, Key("Coefficient of contacts that stick; auto: coefficient", "1", least=0)] = (
        "auto"
    )
    mu_kinetic: Annotated[
        float | AUTO, Key("Coefficient of contacts that slide; auto: coefficient, at most mu_static", "1", least=0)
    ] = "auto"  # fmt: skip
    pairs: Annotated[
        Sequence[Sequence[object]],
        Key("Coefficients [[name, name, mu], ...] or [[name, name, mu_static, mu_kinetic], ...] by pair", "1"),
    ] = ()
    elastic_slip: Annotated[
        float | AUTO, Key("Displacement after which a contact slides; auto: 1e-5 of the cloth's size", "m", above=0)
    ] = "auto"  # fmt: skip
    eps_v: Annotated[
        float | AUTO, Key("Speed below which a contact creeps; auto: contacts stick", "m/s", above=0)
    ] = "auto"  # fmt: skip
    iterations: Annotated[
        int, Key("Number of solves per step, each with the contact forces of the one before", "1", least=1)
    ] = 1


TYPED_EFFECTS: dict[str, type[EffectKeys]] = {
    kind.section.removeprefix("effects."): kind
    for kind in (
        Pins, Inertia, Membrane, Fibres, StrainLimit, Bending, RestAngle, Gravity, Springs, Targets, ElasticBands,
        Cords, Stiffeners, Pressure, Air, Damping,
        BodyContact, SelfContact, Seams, Closures, PlasticBending, Friction,
    )
}  # fmt: skip


def effects_by_name(effects: Any) -> Any:
    """Effects by name, from typed effects or a table; anything else is returned unchanged.

    InputError for an entry of the list that is not an effect, and for an effect that is given twice.
    """
    if isinstance(effects, EffectKeys):
        return {effects.name: effects}
    if isinstance(effects, str | Mapping) or not isinstance(effects, Iterable):
        return effects
    named: dict[str, EffectKeys] = {}
    for number, effect in enumerate(effects):  # an iterable of typed effects
        if isinstance(effect, type) and issubclass(effect, EffectKeys):
            raise InputError(f"effects[{number}] is the class {effect.__name__}.", f"Write {effect.__name__}().")
        if not isinstance(effect, EffectKeys):
            raise InputError(
                f"effects[{number}] is {shown(effect)}, which is not an effect.",
                'Write effects=[clothsim.Gravity(), ...] or effects={"gravity": {}, ...}.',
            )
        if effect.name in named:
            raise InputError(f"effects[{number}] gives {effect.name} again.", "Give each effect once.")
        named[effect.name] = effect
    return named


SUPPLIED = ("contacts", "built")
"""Keywords of builders that a scene cannot set: the names of the contacts that are on, and the energies built so far,
by name."""


@dataclass(frozen=True, kw_only=True)
class KeywordKeys(EffectKeys):
    """The keywords of a builder. Only their names are checked; the builder checks their values."""

    def __post_init__(self) -> None:
        """Take every value as it is."""

    @classmethod
    def of_known_keys(cls, where: str, keys: Mapping[str, Any]) -> Self:
        """The section that has the keys of a table."""
        return cls(**{f"{name}_": frozen(value) for name, value in keys.items()})


def signature_of(builder: Callable[..., Any]) -> inspect.Signature:
    """The signature of a builder; annotations that are texts are evaluated if possible."""
    try:
        return inspect.signature(builder, eval_str=True)
    except NameError:  # a name for type checkers alone
        return inspect.signature(builder)


def takes_keys(builder: Callable[..., Any]) -> bool:
    """True for builder(world, keys), False for builder(world, *, key=default)."""
    return len(_positional(builder)) > 1


def keys_of_builder(builder: Callable[..., Any], name: str = "") -> type[EffectKeys]:
    """The class of the keys of an effect `name`; by default it has the name of the builder."""
    if takes_keys(builder):
        return _positional(builder)[1].annotation
    meanings = {}  # and units, of a numpydoc docstring: "rate : float [1/s]" and the indented lines below
    for key, kind, below in re.findall(r"^(\w+) : (.*)((?:\n[ \t]+.+)*)", inspect.getdoc(builder) or "", re.M):
        text = " ".join((below or kind).split())
        unit = re.search(r"\[([^\]]+)\]", f"{kind} {text}")
        meanings[key] = (text.split(". ")[0].rstrip("."), unit[1] if unit else "-")
    declared: list[tuple[Any, ...]] = []
    for key, parameter in signature_of(builder).parameters.items():
        if parameter.kind is parameter.KEYWORD_ONLY and key not in SUPPLIED:
            kind = Any if parameter.annotation is parameter.empty else parameter.annotation
            annotation = Annotated[kind, Key(*meanings.get(key, ("", "-")))]  # type: ignore[valid-type]
            default: tuple[Any, ...] = ()
            if parameter.default is not parameter.empty:
                value = frozen(parameter.default)
                default = (field(default=value if type(value).__hash__ is not None else content_of(value)),)
            declared.append((f"{key}_", annotation, *default))  # no field hides a method of the section
    name = name or getattr(builder, "__name__", "own")
    namespace = {"section": f"effects.{name}"}
    return make_dataclass(name, declared, bases=(KeywordKeys,), namespace=namespace, frozen=True, kw_only=True)


def is_builder(builder: Any) -> bool:
    """True for a callable of a world, or of a world and its keys, whose keywords all have defaults."""
    try:
        positional, parameters = _positional(builder), signature_of(builder).parameters.values()
    except (TypeError, ValueError):  # nothing that can be called, or a class of C without a signature
        return False
    required = [p for p in parameters if p.kind is p.KEYWORD_ONLY and p.default is p.empty and p.name not in SUPPLIED]
    keys = [p.annotation for p in positional[1:]]
    typed = all(isinstance(each, type) and issubclass(each, EffectKeys) for each in keys)
    return bool(positional) and len(keys) <= 1 and typed and not required


def _positional(builder: Callable[..., Any]) -> list[inspect.Parameter]:
    parameters = signature_of(builder).parameters.values()
    return [p for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
