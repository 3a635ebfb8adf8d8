"""Named fabrics of scenes, of a cloth and of its panels; `fabric_table` has the sources of their values."""

import difflib
from collections.abc import Collection, Mapping
from fnmatch import fnmatchcase
from typing import Any

from clothsim.base.errors import InputError
from clothsim.keys.fabric import Fabric
from clothsim.keys.fabric_table import TABLE

FABRICS = {name: named.fabric for name, named in TABLE.items()}


def fabric_named(where: str, name: Any) -> Fabric:
    """The fabric of a name.

    Parameters
    ----------
    where : str
        Dotted name of the value, for messages.
    name : str
        A name of FABRICS.

    Raises
    ------
    InputError
        For an unknown name, with the nearest known one.

    Examples
    --------
    >>> fabric_named("cloth.fabric", "cotton").density
    0.15
    """
    if isinstance(name, str) and name in FABRICS:
        return FABRICS[name]
    close = difflib.get_close_matches(str(name), FABRICS, n=1, cutoff=0.6)
    known = f"Known: {', '.join(FABRICS)}."
    raise InputError(f"{where} is {name!r}.", f"Did you mean {close[0]!r}? {known}" if close else known)


def fabrics_of(where: str, panels: Collection[str], given: Mapping[str, Any]) -> dict[str, Fabric]:
    """The fabric of each panel that has one of its own.

    Parameters
    ----------
    where : str
        Dotted name of the table, for messages.
    panels : collection of str
        Names of all panels.
    given : mapping
        Named fabric by panel; a name with `*` or `?` stands for all panels that it matches and that are not named
        themselves.

    Raises
    ------
    InputError
        For an unknown fabric, a name that is of no panel, and two that match one panel with different fabrics.

    Examples
    --------
    >>> found = fabrics_of("cloth.fabric_of", ["front", "cuff_l", "cuff_r"], {"cuff*": "denim", "cuff_l": "wool"})
    >>> {panel: fabric.name for panel, fabric in found.items()}
    {'cuff_l': 'wool', 'cuff_r': 'denim'}
    """
    if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
        raise InputError(f"{where} must be a table of fabrics by panel, not {given!r}.", 'As {"collar": "denim"}.')
    found: dict[str, Fabric] = {}
    for name, value in given.items():
        fabric = fabric_named(f"{where}.{name}", value)
        matched = [name] if name in panels else [panel for panel in panels if fnmatchcase(panel, name)]
        if not matched:
            close = difflib.get_close_matches(name, panels, n=1, cutoff=0.6)
            known = f"Panels: {', '.join(panels)}." if panels else "The mesh names no panel or group."
            hint = f"Did you mean {close[0]!r}? {known}" if close else known
            raise InputError(f"{where} names the panel {name!r}.", hint)
        for panel in matched:
            if panel != name and panel in given:
                continue
            if found.get(panel, fabric) != fabric:
                raise InputError(
                    f"{where} gives the panel {panel} the fabrics {found[panel].name} and {fabric.name}.",
                    "Name the panel itself too.",
                )
            found[panel] = fabric
    return {panel: found[panel] for panel in panels if panel in found}
