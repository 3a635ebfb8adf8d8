"""Checks of shape, type and finiteness at the borders of the package; each error names the array and the index."""

import operator
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clothsim.base.errors import InputError
from clothsim.base.file_writing import refuse_replacing, replacing

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def as_finite(name: str, values: ArrayLike) -> Floats:
    """Return `values` as a finite float64 array of any shape; InputError names the first bad index."""
    return _finite(name, _as_floats(name, values))


def as_vector(name: str, values: ArrayLike, length: int = 3) -> Floats:
    """Return `values` as a finite float64 vector of `length`; InputError names it otherwise.

    >>> as_vector("wind", [1, 0, 0])
    array([1., 0., 0.])
    """
    vector = _as_floats(name, values)
    if vector.shape != (length,):
        raise InputError(f"{name} must be {length} numbers, not an array of shape {vector.shape}.")
    return _finite(name, vector)


def as_points(name: str, values: ArrayLike, dimension: int = 3) -> Floats:
    """Return `values` as a finite, C-contiguous (n, dimension) float64 array; InputError names the first bad row."""
    points = _as_floats(name, values)
    if points.ndim != 2 or points.shape[1] != dimension:
        raise InputError(f"{name} must have shape (n, {dimension}), not {points.shape}.")
    return _finite(name, np.ascontiguousarray(points))


def as_triangles(name: str, values: ArrayLike, n_vertices: int) -> Ints:
    """Return `values` as (m, 3) int64 with entries in 0..n_vertices-1; InputError names the first bad row."""
    try:
        raw = _plain(values)
        if raw.dtype.kind == "b":
            raise TypeError("they are booleans")
        with np.errstate(invalid="ignore"):  # NaN: compared below
            triangles = np.ascontiguousarray(raw, dtype=np.int64)
    except (ValueError, TypeError) as error:
        raise InputError(f"{name} must be whole numbers: {error}.") from error
    if raw.size and not np.array_equal(raw, triangles):
        raise InputError(
            f"{name} must be whole numbers.", "They are vertex numbers, counted from 0; positions come first."
        )
    if triangles.ndim != 2 or triangles.shape[1] != 3:
        raise InputError(f"{name} must have shape (m, 3), not {triangles.shape}.")
    bad = np.flatnonzero(((triangles < 0) | (triangles >= n_vertices)).any(axis=1))
    if bad.size:
        row = bad[0]
        raise InputError(f"{name}[{row}] = {triangles[row].tolist()} names a vertex outside 0..{n_vertices - 1}.")
    return triangles


def as_number(name: str, value: float) -> float:
    """Return `value` as a float; InputError for text, a truth value, or an integer too large for a float."""
    try:
        if isinstance(value, str | bytes | bool):
            raise TypeError
        return float(value)
    except (ValueError, TypeError) as error:
        raise InputError(f"{name} must be a number, not {value!r}.") from error
    except OverflowError as error:
        raise InputError(f"{name} must be within the range of a float.") from error


def as_positive(name: str, value: float, zero: bool = False) -> float:
    """Return `value` as a finite float above zero (or at zero, where `zero` is True); InputError otherwise."""
    number = as_number(name, value)
    if not np.isfinite(number) or number < 0 or (number == 0 and not zero):
        raise InputError(f"{name} must be {'at least' if zero else 'above'} 0, not {value!r}.")
    return number


def as_count(name: str, value: int, least: int = 1, most: int = 4096) -> int:
    """Return one whole number from `least` to `most`; the bound keeps a typing error from filling the memory."""
    try:
        number = operator.index(value)
    except TypeError as error:
        raise InputError(f"{name} must be a whole number, not {value!r}.") from error
    if isinstance(value, bool) or not least <= number <= most:
        raise InputError(f"{name} must be a whole number from {least} to {most}, not {value!r}.")
    return number


def _as_floats(name: str, values: ArrayLike) -> Floats:
    try:
        return np.asarray(_plain(values), dtype=np.float64)
    except (ValueError, TypeError, OverflowError) as error:
        rows = values if isinstance(values, list | tuple) else ()
        sizes = [len(row) if isinstance(row, list | tuple | np.ndarray) else None for row in rows]
        k = next((k for k, size in enumerate(sizes) if size != sizes[0]), None)
        if k is not None:
            own, first = ("is a number" if size is None else f"has {size} entries" for size in (sizes[k], sizes[0]))
            raise InputError(f"{name} has rows of different lengths: {name}[{k}] {own}, the first {first}.") from error
        raise InputError(f"{name} must be numbers: {error}.") from error


def _plain(values: ArrayLike) -> NDArray[np.generic]:
    """An array of `values`; TypeError where a conversion would drop an imaginary part or a mask without a word."""
    if np.ma.is_masked(values):
        raise TypeError("some are masked")
    array = np.asarray(values)
    if array.dtype.kind == "c":
        raise TypeError("they are complex")
    return array


def _finite(name: str, values: Floats) -> Floats:
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        index = f"[{', '.join(str(i) for i in bad[0])}]" if values.ndim else ""
        raise InputError(f"{name}{index} is {values[tuple(bad[0])]}, not a finite number.")
    return values


def write_arrays(path: Path, arrays: Mapping[str, Any], overwrite: bool = False) -> Path:
    """Write arrays by name as .npz, whole or not at all; returns the path.

    InputError where there is such a file, without `overwrite`.
    """
    refuse_replacing([path], overwrite)
    with replacing(path) as beside, beside.open("wb") as target:
        np.savez_compressed(target, **arrays)
    return path
