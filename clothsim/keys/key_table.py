"""A section of a scene as a frozen dataclass: checked when it is made, turned into the table of a scene file."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

from clothsim.keys.keys import refuse_unknown, table
from clothsim.keys.schema import keys_of
from clothsim.keys.value_checks import check_value, refuse_missing


@dataclass(frozen=True, kw_only=True)
class KeyTable:
    """Keys of a section with their defaults; `section` is its dotted name in messages. Nested tables are sections."""

    section: ClassVar[str] = ""

    def __new__(cls, *_: Any, **keys: Any) -> Self:
        """Remember which keys were given."""
        made = super().__new__(cls)
        object.__setattr__(made, "_given", tuple(name.rstrip("_") for name in keys))
        return made

    def __post_init__(self) -> None:
        for known in keys_of(type(self)).values():
            value = getattr(self, known.field)
            if value is not known.default:
                object.__setattr__(self, known.field, check_value(f"{self.section}.{known.name}", value, known))

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
        keys, known = table(where, given), keys_of(cls)
        refuse_unknown(where, keys, known)
        refuse_missing(where, keys, cls)
        values = {name: check_value(f"{where}.{name}", value, known[name]) for name, value in keys.items()}
        fixed = _fixed(cls)  # such as the kind of a wind
        return cls(**{known[name].field: value for name, value in values.items() if known[name].field not in fixed})

    def with_keys(self, **changed: Any) -> Self:
        """A copy with other values of some fields, which count as given; the other keys are given or not as here."""
        keys = {known.field for known in keys_of(type(self)).values()}
        kept = {
            field.name: getattr(self, field.name)
            for field in fields(self)
            if field.init and (field.name not in keys or field.name.rstrip("_") in self.given)
        }
        return type(self)(**kept | changed)

    def as_table(self) -> dict[str, Any]:
        """The keys as a scene file has them: those that were given."""
        known = keys_of(type(self))
        fixed = [name for name, key in known.items() if key.field in _fixed(type(self))]
        return {name: as_tables(getattr(self, known[name].field)) for name in (*fixed, *self.given)}


def as_tables(value: Any) -> Any:
    """A value with every section in it as a table."""
    if isinstance(value, KeyTable):
        return value.as_table()
    if isinstance(value, list | tuple):
        return type(value)(as_tables(entry) for entry in value)
    return {key: as_tables(entry) for key, entry in value.items()} if isinstance(value, Mapping) else value


def _fixed(section: type[KeyTable]) -> set[str]:
    """Fields that have one value."""
    return {field.name for field in fields(section) if not field.init}
