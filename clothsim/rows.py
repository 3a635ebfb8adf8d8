"""Some rows of an array, ascending: where none between them is left out, they are a slice, and nothing is gathered."""

from typing import TypeAlias

from clothsim.arrays import Floats, Ints

Rows: TypeAlias = slice | Ints
"""What an array is indexed with."""


def as_rows(rows: Ints) -> Rows:
    """The same rows (k,), which ascend, as a slice where they follow one another."""
    if len(rows) and rows[-1] - rows[0] + 1 == len(rows):
        return slice(int(rows[0]), int(rows[-1]) + 1)
    return rows


def taken(x: Floats, rows: Rows) -> Floats:
    """These rows of x: a view of it where they are a slice. `take` costs a quarter of what indexing does."""
    return x[rows] if isinstance(rows, slice) else x.take(rows, axis=0)
