"""Named panels of a mesh in memory: triangles by name, checked, and as two arrays for the text of a scene."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from clothsim.base.arrays import Ints
from clothsim.base.errors import InputError

PANELS, PANEL_OF = "panels", "panel_of"
"""Names of the panels, and the number of the panel of each triangle, -1 for none."""


def checked_groups(where: str, groups: Mapping[str, ArrayLike], n_triangles: int) -> dict[str, Ints]:
    """Read-only triangles of each panel.

    Raises
    ------
    InputError
        For what is no table of whole numbers, a triangle out of range, and one in two panels.
    """
    if not isinstance(groups, Mapping):
        raise InputError(f"{where} is of the type {type(groups).__name__}.", "Give a table of triangles by name.")
    taken = np.full(n_triangles, -1)
    found = {}
    for number, (name, given) in enumerate(groups.items()):
        if not isinstance(name, str) or not name or not name.isprintable():
            raise InputError(f"{where} has the name {name!r}, which cannot be printed.", "Give a word.")
        rows = np.array(given)
        if rows.ndim != 1 or (rows.size and rows.dtype.kind not in "iu"):
            raise InputError(f"{where}.{name} must be a list of whole numbers.", "They count triangles from 0.")
        rows = rows.astype(np.int64)
        outside = np.flatnonzero((rows < 0) | (rows >= n_triangles))
        if outside.size:
            raise InputError(
                f"{where}.{name}[{outside[0]}] is {rows[outside[0]]}, but there are {n_triangles} triangles.",
                "They count from 0.",
            )
        twice = rows[taken[rows] >= 0]
        if twice.size:
            other = list(groups)[taken[twice[0]]]
            raise InputError(f"{where}: triangle {twice[0]} is in {other} and in {name}.", "Give each one panel.")
        taken[rows] = number
        rows.setflags(write=False)
        found[name] = rows
    return found


def panel_arrays(groups: Mapping[str, Ints], n_triangles: int) -> dict[str, Any]:
    """Arrays of the panels, which `groups_of` reads back."""
    panel_of = np.full(n_triangles, -1)
    for number, rows in enumerate(groups.values()):
        panel_of[rows] = number
    return {PANELS: np.array(list(groups)), PANEL_OF: panel_of}


def groups_of(arrays: Mapping[str, Any]) -> dict[str, Ints]:
    """Triangles of each panel, in ascending order."""
    panel_of = arrays[PANEL_OF]
    return {str(name): np.flatnonzero(panel_of == number) for number, name in enumerate(arrays[PANELS])}
