"""Rows of arrays, and points and vectors of three numbers inside compiled kernels."""

from typing import TypeAlias

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel, natural, part

Rows: TypeAlias = slice | Ints
"""Index of rows: a slice where they are contiguous, so that nothing is copied."""


def as_rows(rows: Ints) -> Rows:
    """Return the same rows (k,), ascending, as a slice where they are contiguous."""
    if len(rows) and rows[-1] - rows[0] + 1 == len(rows):
        return slice(int(rows[0]), int(rows[-1]) + 1)
    return rows


def taken(x: Floats, rows: Rows) -> Floats:
    """Return these rows of x: a view for a slice, else a copy. `take` costs a quarter of what indexing does."""
    return x[rows] if isinstance(rows, slice) else x.take(rows, axis=0)


@part
def four_points(x, elements, e):
    """Points of the four vertices of row e of `elements (m, 4)`, each a tuple of three floats."""
    return row(x, elements[e, 0]), row(x, elements[e, 1]), row(x, elements[e, 2]), row(x, elements[e, 3])


@part
def row(x, i):
    """Row i of `x (n, 3)` as a tuple of three floats."""
    i = natural(i)
    return x[i, 0], x[i, 1], x[i, 2]


@kernel
def equal(x: Floats, y: Floats) -> bool:
    """Return whether two arrays (n, 3) are equal, up to the first difference; NaN equals nothing."""
    if len(x) != len(y):
        return False
    i = 0
    while i < len(x) and x[i, 0] == y[i, 0] and x[i, 1] == y[i, 1] and x[i, 2] == y[i, 2]:
        i += 1
    return i == len(x)


@kernel
def add_to(total: Floats, part: Floats) -> float:
    """Add `part` (m, 3) to the first rows of `total` in place; return its largest absolute component, 0 without any."""
    a = b = c = 0.0  # three chains of comparisons, which do not wait for one another
    for i in range(len(part)):
        total[i, 0] += part[i, 0]
        total[i, 1] += part[i, 1]
        total[i, 2] += part[i, 2]
        a, b, c = max(a, abs(part[i, 0])), max(b, abs(part[i, 1])), max(c, abs(part[i, 2]))
    return max(a, b, c)


Vector = tuple[float, float, float]


@part
def minus(a: Vector, b: Vector) -> Vector:
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@part
def plus(a: Vector, b: Vector) -> Vector:
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@part
def times(factor: float, a: Vector) -> Vector:
    """factor a."""
    return factor * a[0], factor * a[1], factor * a[2]


@part
def dot(a: Vector, b: Vector) -> float:
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@part
def cross(a: Vector, b: Vector) -> Vector:
    """a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@part
def length(a: Vector) -> float:
    """|a|."""
    return np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@part
def unit(a: Vector) -> Vector:
    """a / |a|; 0 stays 0."""
    size = length(a)
    return (a[0] / size, a[1] / size, a[2] / size) if size > 0.0 else (0.0, 0.0, 0.0)


@kernel
def lengths(vectors: Floats) -> Floats:
    """Length of each of `vectors (n, 3)`, (n,); a fifth of the time of `np.linalg.norm`, and its bits."""
    found = np.empty(len(vectors))
    for i in range(len(vectors)):
        found[i] = length(row(vectors, i))
    return found


def dots(a: Floats, b: Floats) -> Floats:
    """Scalar products (p,) of rows (p, 3)."""
    return np.asarray(np.einsum("pc,pc->p", a, b), np.float64)
