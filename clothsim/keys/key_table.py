"""A section of a scene as a frozen dataclass: checked when it is made, turned into the table of a scene file."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

import numpy as np

from clothsim.base.inputs import table
from clothsim.keys.keys import refuse_unknown
from clothsim.keys.schema import keys_of
from clothsim.keys.value_checks import check_value, refuse_missing


@dataclass(frozen=True, kw_only=True)
class KeyTable:
    """Keys of a section with their defaults; `section` is its dotted name in messages."""

    section: ClassVar[str] = ""

    def __post_init__(self) -> None:
        for known in keys_of(type(self)).values():
            value = getattr(self, known.field)
            if value is not known.default:
                plain = check_value(f"{self.section}.{known.name}", as_tables(value), known)
                if isinstance(plain, int | float):
                    object.__setattr__(self, known.field, plain)

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
        return cls(**{known[name].field: check_value(f"{where}.{name}", value, known[name])
                      for name, value in keys.items()})  # fmt: skip

    def as_table(self) -> dict[str, Any]:
        """The keys as a scene file has them; those at their defaults are left out."""
        fixed = {field.name for field in fields(self) if not field.init}
        values = ((known, getattr(self, known.field)) for known in keys_of(type(self)).values())
        return {
            known.name: as_tables(value)
            for known, value in values
            if known.field in fixed or not _alike(value, known.default)
        }


def as_tables(value: Any) -> Any:
    """A value with every section in it as a table."""
    if isinstance(value, KeyTable):
        return value.as_table()
    if isinstance(value, list | tuple):
        return type(value)(as_tables(entry) for entry in value)
    return {key: as_tables(entry) for key, entry in value.items()} if isinstance(value, Mapping) else value


def _alike(value: Any, default: Any) -> bool:
    if value is default:
        return True
    plain = not isinstance(value, np.ndarray) and type(value) is type(default)
    return plain and not callable(value) and bool(value == default)
