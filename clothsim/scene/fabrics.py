"""Named fabrics of scenes; `fabric_table` has the sources of their values."""

import difflib
from typing import Any

from clothsim.errors import InputError
from clothsim.mesh.fabric import Fabric
from clothsim.scene.fabric_table import TABLE

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
