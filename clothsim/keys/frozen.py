"""Read-only tables: what a scene is given, as values that cannot be changed and that hash by content."""

from collections.abc import Mapping
from typing import Any, NoReturn

import numpy as np


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
