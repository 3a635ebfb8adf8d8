"""A section of a scene as a frozen dataclass: checked when it is made, read from and written as the table of a file."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from functools import cache, wraps
from typing import Any, ClassVar, NoReturn, Self, TypeVar

import numpy as np

from clothsim.base.errors import InputError
from clothsim.base.inputs import as_table
from clothsim.keys.schema import keys_of
from clothsim.keys.value_checks import check_value, refuse_missing, refuse_unknown_key


class Locked:
    """What holds only values that cannot be changed: `frozen` leaves it as it is."""

    __slots__ = ()


class FrozenTable(dict[str, Any], Locked):
    """A table that refuses changes; it hashes by content, and compares and prints as a dict does.

    Examples
    --------
    >>> table = frozen({"acceleration": [0.0, 0.0, -9.81]})
    >>> table["acceleration"]
    (0.0, 0.0, -9.81)
    >>> hash(table) == hash(frozen({"acceleration": np.array([0.0, 0.0, -9.81])}))
    True
    >>> table["acceleration"] = (0.0, 0.0, 0.0)
    Traceback (most recent call last):
    TypeError: A scene cannot be changed: make another one with the values that you want.
    """

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(content_of(self))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Mapping) and content_of(self) == content_of(other)

    def __ne__(self, other: object) -> bool:
        return not self == other

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError("A scene cannot be changed: make another one with the values that you want.")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return frozen, (dict(self),)  # arrays come back from a pickle unlocked

    def __copy__(self) -> "FrozenTable":
        return self

    def __deepcopy__(self, memo: Any) -> "FrozenTable":
        return self


def frozen(value: Any) -> Any:
    """A read-only copy: tables as `FrozenTable`, lists as tuples, arrays locked; sections and the rest stay."""
    if isinstance(value, Locked):
        return value
    if isinstance(value, Mapping):
        return FrozenTable({key: frozen(inner) for key, inner in value.items()})
    if isinstance(value, list | tuple):
        return tuple(frozen(inner) for inner in value)
    if isinstance(value, np.ndarray) and (value.flags.writeable or value.base is not None):
        copy = value.copy()
        copy.setflags(write=False)
        return copy
    return value.item() if isinstance(value, np.generic) else value


def content_of(value: Any) -> Any:
    """What a value is compared and hashed by: tables as sets of their entries, lists and arrays as tuples."""
    if isinstance(value, Mapping):
        return frozenset((key, content_of(inner)) for key, inner in value.items())
    if isinstance(value, np.ndarray):
        value = value.tolist()
    return tuple(content_of(inner) for inner in value) if isinstance(value, list | tuple) else value


@dataclass(frozen=True, kw_only=True)
class KeyTable(Locked, Mapping[str, Any]):
    """Keys of a section with their defaults; `section` is its dotted name in messages. Nested tables are sections.

    Attributes have every key; as a mapping it is the table of a scene file, of the keys that were given alone. Sections
    of one kind whose tables are equal are equal, and equal to such a table.
    """

    section: ClassVar[str] = ""
    composed_of: ClassVar[tuple[type["KeyTable"], ...]] = ()
    """Of a section that `composed` made."""

    def __init_subclass__(cls) -> None:
        """Keep these methods, which a dataclass would make of all fields."""
        for name in ("__eq__", "__hash__", "__repr__"):
            if name not in cls.__dict__:
                setattr(cls, name, getattr(KeyTable, name))

    def __new__(cls, *others: Any, **keys: Any) -> Self:
        """Remember which keys were given; of all, as by `dataclasses.replace`, those that are not at their defaults.

        InputError for what `__init__` does not take, in place of Python's TypeError.
        """
        made = super().__new__(cls)
        _refuse_arguments(cls, others, keys)
        given = [name for name, value in keys.items() if value is not None]
        known = {key.field: key.default for key in keys_of(cls).values()}
        if len(known) > 1 and known.keys() - _fixed_fields(cls) <= keys.keys():
            defaults = {name: known.get(name) for name in given}
            given = [
                name
                for name, default in defaults.items()
                if keys[name] is not default and not (type(keys[name]) is type(default) and bool(keys[name] == default))
            ]
        object.__setattr__(made, "_given", tuple(name.rstrip("_") for name in given))
        return made

    def __post_init__(self) -> None:
        for known in keys_of(type(self)).values():
            value = getattr(self, known.field)
            if value is not known.default:
                checked = check_value(f"{self.section}.{known.name}", value, known)
                object.__setattr__(self, known.field, frozen(checked))

    def __getitem__(self, key: str) -> Any:
        return self._table[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._table)

    def __len__(self) -> int:
        return len(self._table)

    def __bool__(self) -> bool:
        return True  # also where no key was given

    def __eq__(self, other: object) -> bool:
        if isinstance(other, KeyTable) and other.section != self.section:
            return False
        return isinstance(other, Mapping) and content_of(self) == content_of(other)

    def __hash__(self) -> int:
        return hash(content_of(self))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self.items())})"

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (type(self).composed_of or type(self), self._fields_given(), self._table)

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: Any) -> Self:
        return self

    @property
    def _table(self) -> FrozenTable:
        """The table of the scene file that gives the section."""
        if "_written" not in self.__dict__:
            object.__setattr__(self, "_written", frozen(self.as_table()))
        return self.__dict__["_written"]

    @property
    def given(self) -> tuple[str, ...]:
        """Names of the keys that were given, whatever their values: those that a scene file has."""
        known = keys_of(type(self))
        return tuple(name for name in self._given if name in known)  # type: ignore[attr-defined]

    @classmethod
    def parsed(cls, where: str, given: Any) -> Self:
        """The section that a table of keys gives.

        Parameters
        ----------
        where : str
            Dotted name of the table, for messages.
        given : Any
            Table of the scene.

        Raises
        ------
        InputError
            For an unknown or missing key, or a value of another type or out of range.
        """
        if type(given) is cls:
            return given
        keys = as_table(where, given)
        refuse_unknown_key(where, keys, keys_of(cls))
        refuse_missing(where, keys, cls)
        return cls.of_known_keys(where, keys)

    @classmethod
    def of_known_keys(cls, where: str, keys: Mapping[str, Any]) -> Self:
        """The section of a table whose keys it has. InputError for a value of another type or out of range."""
        known = keys_of(cls)
        values = {name: check_value(f"{where}.{name}", value, known[name]) for name, value in keys.items()}
        fixed = _fixed_fields(cls)  # such as the kind of a wind
        made = cls(**{known[name].field: value for name, value in values.items() if known[name].field not in fixed})
        object.__setattr__(made, "_given", tuple(name for name in keys if known[name].field not in fixed))
        object.__setattr__(made, "_written", frozen(dict(keys)))
        return made

    def with_keys(self, **changed: Any) -> Self:
        """A copy with other values of some fields, which count as given; the other keys are given or not as here."""
        return type(self)(**self._fields_given() | changed)

    def _fields_given(self) -> dict[str, Any]:
        """The fields of the keys that were given, and those that are not keys."""
        keys = {known.field for known in keys_of(type(self)).values()}
        return {
            field.name: getattr(self, field.name)
            for field in fields(self)
            if field.init and (field.name not in keys or field.name.rstrip("_") in self.given)
        }

    def as_table(self) -> dict[str, Any]:
        """The keys as a scene file has them: those that were given."""
        known = keys_of(type(self))
        fixed = [name for name, key in known.items() if key.field in _fixed_fields(type(self))]
        return {name: as_tables(getattr(self, known[name].field)) for name in (*fixed, *self.given)}


Section = TypeVar("Section", bound=KeyTable)
Result = TypeVar("Result")


@cache
def composed(parts: tuple[type[KeyTable], ...]) -> type[KeyTable]:
    """The section with the keys of several, such as a cloth and its generator; of equal keys the last one counts."""
    first, *others = parts
    if not others:
        return first
    names = {"composed_of": parts, "section": first.section, "__doc__": first.__doc__, "__module__": first.__module__}
    return dataclass(frozen=True, kw_only=True)(type(first.__name__, tuple(reversed(parts)), names))


def by_keywords(kind: type[Section]) -> Callable[[Callable[[Section], Result]], Callable[..., Result]]:
    """Decorator of a function of a section, which is called with the section's keys.

    Parameters
    ----------
    kind : type
        The section. Its own keys may be given in their order, all by name; its defaults and checks are the function's.

    Examples
    --------
    >>> from clothsim.keys.generator_keys import Disk
    >>> @by_keywords(Disk)
    ... def area(keys):
    ...     return round(3.14159 * keys.radius**2, 3)
    >>> area(1.0), area(cells=3)
    (3.142, 0.785)
    """
    order = [name for name in kind.__annotations__ if name in keys_of(kind)]

    def decorated(function: Callable[[Section], Result]) -> Callable[..., Result]:
        @wraps(function)
        def called(*values: Any, **keys: Any) -> Result:
            by_order = dict(zip(order, values, strict=False))
            if len(values) > len(order) or by_order.keys() & keys.keys():
                given = f"{len(values)} values by their order"
                raise InputError(
                    f"{function.__name__}: {given} and {', '.join(keys) or 'none'} by name, of {', '.join(order)}.",
                    "Give each key once.",
                )
            return function(kind(**by_order, **keys))

        return called

    return decorated


def _restored(
    kind: type[KeyTable] | tuple[type[KeyTable], ...], given: Mapping[str, Any], written: FrozenTable
) -> KeyTable:
    """A section from its pickle."""
    made = (composed(kind) if isinstance(kind, tuple) else kind)(**given)
    object.__setattr__(made, "_given", tuple(name.rstrip("_") for name in given))
    object.__setattr__(made, "_written", written)
    return made


def as_tables(value: Any) -> Any:
    """A value with every section in it as a table."""
    if isinstance(value, KeyTable):
        return value.as_table()
    if isinstance(value, list | tuple):
        return type(value)(as_tables(entry) for entry in value)
    return {key: as_tables(entry) for key, entry in value.items()} if isinstance(value, Mapping) else value


def _refuse_arguments(cls: type[KeyTable], others: Sequence[Any], keys: Mapping[str, Any]) -> None:
    """InputError for a keyword that is not a field, too many values without one, and for a field that is missing."""
    taken = [field for field in fields(cls) if field.init]
    first = [field for field in taken if not field.kw_only]
    where = f"clothsim.{cls.__name__}"
    names = [field.name for field in taken]
    refuse_unknown_key(where, keys, names)
    if len(others) > len(first):
        example = ""
        if named := next((each for each in taken if each.kw_only), None):
            default = "..." if named.default is MISSING or named.default is None else repr(named.default)
            example = f"{named.name}={default}"
        raise InputError(
            f"{where} takes its keys by name: {others[len(first)]!r} has none.", f"Write {where}({example})."
        )
    given = {field.name for field in first[: len(others)]} | keys.keys()
    for each in taken:
        if each.default is MISSING and each.default_factory is MISSING and each.name not in given:
            raise InputError(f"{where} needs {each.name}.", f"Write {where}({each.name}=...).")


def _fixed_fields(section: type[KeyTable]) -> set[str]:
    """Fields that have one value."""
    return {field.name for field in fields(section) if not field.init}
