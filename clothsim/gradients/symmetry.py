"""Mirror symmetry of a panel: its numbers tied in pairs, as a matrix from independent changes to all of them."""

from collections.abc import Sequence

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.gradients.pattern_numbers import PatternNumber, PatternNumbers

ALIKE = 1e-3
"""Distance of a point from the mirror image of another, as a fraction of the width, below which they are a pair."""


def mirrored(numbers: PatternNumbers, paths: Sequence[str]) -> Floats:
    """Return the matrix (k, r) from r independent changes to those of k numbers, panels mirrored about their middle.

    x of a pair changes by opposite, y by equal amounts; x of a point on the axis stays; widths, heights and flares are
    free.

    Raises
    ------
    InputError
        For a point whose mirror image is no vertex or control point among the numbers.
    """
    found = [numbers.number(path) for path in paths]
    columns, done = list[Floats](), set[int]()
    for i, number in enumerate(found):
        if i in done:
            continue
        column = np.zeros(len(paths))
        column[i] = 1.0
        if not number.extent:
            j = _partner(numbers, found, i, paths[i])
            done.add(j)
            if j == i and number.axis == 0:
                continue
            column[j] = -1.0 if number.axis == 0 else 1.0
        columns.append(column)
    return np.column_stack(columns) if columns else np.zeros((len(paths), 0))


def _partner(numbers: PatternNumbers, found: Sequence[PatternNumber], i: int, path: str) -> int:
    """Row of the number with the mirror image."""
    low, sides = numbers.extent(found[i].panels[0])
    image = numbers.point(found[i])
    image[0] = 2 * (low[0] + sides[0] / 2) - image[0]
    for j, other in enumerate(found):
        same = not other.extent and other.panels == found[i].panels and other.axis == found[i].axis
        alike = same and (other.vertex < 0) == (found[i].vertex < 0)
        if alike and np.abs(numbers.point(other) - image).max() < ALIKE * sides[0]:
            return j
    raise InputError(
        f"{path} has no mirror image among the free numbers.", "Free its partner, or leave out --symmetric."
    )
