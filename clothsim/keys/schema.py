"""Schema of a scene: type, default, unit, range and meaning of every key.

A section is a frozen dataclass whose fields are annotated with a `Key`; it is the one source of the scene's checks, of
`clothsim keys`, of the JSON schema and of the reference page. Plain dataclasses rather than pydantic or msgspec: half
of the values are "a number, key frames, an array, a table by cloth or a function", whose errors no library words; the
import costs nothing (pydantic: 57 ms and more); and no dependency is added.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from functools import cache
from types import UnionType
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, Union, get_args, get_origin

from clothsim.base.arrays import Floats

FUNCTION = "function"
"""The key under which the text of a scene has the name of a Python function."""

if TYPE_CHECKING:
    Table: TypeAlias = Any
else:
    Table = Mapping[str, Any]
    """Keys of a nested section, which is made of them."""
Vector: TypeAlias = Sequence[float] | Floats
OverTime: TypeAlias = float | Sequence[Sequence[float]] | Callable[[float], float]
"""A number, key frames [[t0, v0], [t1, v1], ...] or a function of the time [s]."""
OverCloth: TypeAlias = float | Sequence[float] | Floats | Mapping[str, Any] | str
"""A number, an array by triangle or by vertex, a NumPy file of one, or a table by cloth or panel."""
OverTimeByCloth: TypeAlias = float | Sequence[Sequence[float]] | Callable[[float], float] | Mapping[str, Any]
CurveTable: TypeAlias = Sequence[Sequence[float]] | Floats | str
"""Rows of [strain, stress], or a NumPy file of them."""
Selection: TypeAlias = (
    Literal["corners", "left", "right", "top", "bottom", "boundary"] | Sequence[int] | Mapping[str, Any]
)

_WORDS: tuple[tuple[Any, str], ...] = (
    (Vector, "3 numbers"),
    (OverTime, "number, key frames or function"),
    (OverCloth, "number, array, .npy file or table by cloth"),
    (OverTimeByCloth, "number, key frames, function or table by cloth"),
    (CurveTable, "rows of [strain, stress] or .npy file"),
    (
        Selection,
        '"corners" | "left" | "right" | "top" | "bottom" | "boundary", vertex numbers, { box = [lo, hi] } or'
        " { panel = name }",
    ),
)


@dataclass(frozen=True)
class Key:
    """Meaning, unit and range of a key.

    Parameters
    ----------
    meaning : str
        One sentence.
    unit : str
        SI unit; "1" for a pure number, "-" where there is nothing to measure.
    above, below, least, most : float, optional
        Bounds of a number, or of each number of a list; `above` and `below` are exclusive.
    length : int, optional
        Number of entries of a list.
    tables : tuple of type
        Sections that a nested table, or each table of a list, may be.
    shown : str
        The default in words where it depends on the scene.
    """

    meaning: str
    unit: str = "-"
    above: float | None = None
    below: float | None = None
    least: float | None = None
    most: float | None = None
    length: int | None = None
    tables: tuple[type, ...] = ()
    shown: str = ""

    @property
    def range(self) -> str:
        """The bounds as text, empty where there are none: "above 0", "from 0 to 1"."""
        if self.least is not None and self.most is not None:
            return f"from {self.least:,g} to {self.most:,g}"
        low = f"above {self.above:g}" if self.above is not None else ""
        low = f"at least {self.least:,g}" if self.least is not None else low
        high = f"below {self.below:g}" if self.below is not None else ""
        high = f"at most {self.most:,g}" if self.most is not None else high
        return " and ".join(filter(None, [low, high]))

    def contains(self, number: float) -> bool:
        """True for a number within the bounds."""
        open_ends = (self.above is None or number > self.above) and (self.below is None or number < self.below)
        return open_ends and (self.least is None or number >= self.least) and (self.most is None or number <= self.most)


@dataclass(frozen=True)
class SceneKey:
    """A key of a section.

    Parameters
    ----------
    name : str
        Name in the scene file.
    field : str
        Name of the dataclass field: `name`, with an underscore where that is a word of Python.
    annotation : Any
        Type of the value.
    default : Any
        Default value; MISSING where the key must be given, None where it depends on the scene.
    key : Key
        Unit, range and meaning.
    """

    name: str
    field: str
    annotation: Any
    default: Any
    key: Key

    @property
    def required(self) -> bool:
        """True where a scene must give the key."""
        return self.default is MISSING


@cache
def keys_of(section: type) -> Mapping[str, SceneKey]:
    """The keys of a section, by their names in a scene file."""
    keys = {}
    for field in fields(section):
        if not hasattr(field.type, "__metadata__"):  # arrays beside the keys
            continue
        annotation, key = get_args(field.type)[:2]
        name = field.name.rstrip("_")
        keys[name] = SceneKey(name, field.name, annotation, field.default, key)
    return keys


def members(annotation: Any) -> tuple[Any, ...]:
    """The types of a union, without None; the type itself where it is not a union."""
    if get_origin(annotation) not in (Union, UnionType):
        return (annotation,)
    return tuple(part for part in get_args(annotation) if part is not type(None))


def choices(annotation: Any) -> tuple[str, ...]:
    """The words of a key that takes one of several."""
    parts = (part for part in members(annotation) if get_origin(part) is Literal)
    return tuple(word for part in parts for word in get_args(part))


def listed_choices(annotation: Any) -> tuple[str, ...]:
    """The words of a key that takes a list of them."""
    lists = (get_args(part)[0] for part in members(annotation) if get_origin(part) is Sequence)
    return tuple(word for entry in lists for word in choices(entry))


def type_in_words(annotation: Any, key: Key) -> str:
    """The type of a value: "number", "3 numbers", '"right" | "delaunay"', "list of tables"."""
    for alias, words in _WORDS:
        if members(annotation) == members(alias):
            return words
    several = choices(annotation)
    parts = [" | ".join(f'"{word}"' for word in several)] if several else []
    parts += [text for part in members(annotation) if (text := _one_in_words(part, key))]
    *first, last = dict.fromkeys(parts or ["any"])  # an effect of a user's own may have no annotations
    return f"{', '.join(first)} or {last}" if first else last


def _one_in_words(part: Any, key: Key) -> str:
    origin = get_origin(part) or part
    if origin is Sequence:
        if words := listed_choices(part):
            return "list of " + " | ".join(f'"{word}"' for word in words)
        names = {int: "whole numbers", float: "numbers", str: "texts"}
        entries = names.get(get_args(part)[0], "tables" if key.tables else "rows")
        return f"{key.length} {entries}" if key.length else f"list of {entries}"
    kinds = {float: "number", int: "whole number", bool: "true or false", str: "text", Mapping: "table"}
    return kinds.get(origin, "function" if origin is Callable else "")
