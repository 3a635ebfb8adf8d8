"""Body models from arrays and from SMPL-like .npz files; pickled data is never read."""

import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from transfer.body_model import BodyModel
from transfer.errors import TransferError
from transfer.triangle_surface import Floats, Ints, as_surface

KEYS = ("v_template", "shapedirs", "posedirs", "J_regressor", "weights", "kintree_table", "f")
NO_PARENT = 2**32 - 1
"""The root's parent in a table of unsigned integers: -1."""
UNREADABLE = (OSError, ValueError, EOFError, MemoryError, RuntimeError, zipfile.BadZipFile, zlib.error)
"""What reading a broken or a pickled file raises."""
SUM_ERROR = 1e-3
"""How far rows of weights may be from sum 1: what single precision and rounded files leave. They are divided by it."""


def read_body_model(path: str | Path) -> BodyModel:
    """The body model of an .npz file with the keys of SMPL; others are left unread.

    v_template (n, 3) [m], shapedirs (n, 3, k), posedirs (n, 3, 9 (j - 1)), J_regressor (j, n), weights (n, j),
    kintree_table (2, j): the parents' names over the joints' names, f (m, 3). TransferError, one sentence, for a file
    that is none, lacks a key, holds pickles or arrays that do not fit together.
    """
    name = Path(path).name
    try:
        file = np.load(path, allow_pickle=False)
    except FileNotFoundError as error:
        raise TransferError(f"There is no file {name}.") from error
    except UNREADABLE as error:
        raise TransferError(
            f"{name} is no .npz file of plain arrays.", "Pickled files (.pkl) are not read: they may run any code."
        ) from error
    if not isinstance(file, np.lib.npyio.NpzFile):
        raise TransferError(f"{name} holds one array, not a body model.", "Give an .npz file.")
    with file:
        lacking = [key for key in KEYS if key not in file.files]
        if lacking:
            raise TransferError(f"{name} has no {lacking[0]!r}.", f"A body model has {', '.join(KEYS)}.")
        return body_model({key: _entry(file, key, name) for key in KEYS})


def body_model(arrays: Mapping[str, ArrayLike]) -> BodyModel:
    """A body model from arrays by the keys of `read_body_model`; TransferError names the one that does not fit."""
    lacking = [key for key in KEYS if key not in arrays]
    if lacking:
        raise TransferError(f"The body model has no {lacking[0]!r}.", f"It needs {', '.join(KEYS)}.")
    template = _floats(arrays, "v_template", (None, 3))
    n = len(template)
    parents = _parents(np.asarray(arrays["kintree_table"]))
    j = len(parents)
    return BodyModel(
        template,
        as_surface("The body model's", template, arrays["f"])[1],
        _floats(arrays, "shapedirs", (n, 3, None)),
        _floats(arrays, "posedirs", (n, 3, 9 * (j - 1))),
        _shares(_floats(arrays, "J_regressor", (j, n)), "J_regressor", below_zero=True),
        _shares(_floats(arrays, "weights", (n, j)), "weights", below_zero=False),
        parents,
    )


def _entry(file: np.lib.npyio.NpzFile, key: str, name: str) -> NDArray:
    try:
        return np.asarray(file[key])
    except UNREADABLE as error:
        raise TransferError(
            f"{key!r} of {name} is no plain array.", "Pickled data is not read: save it as an array of numbers."
        ) from error


def _floats(arrays: Mapping[str, ArrayLike], key: str, shape: tuple[int | None, ...]) -> Floats:
    """The array as float64 of `shape`, None for any length; TransferError where it is another or not finite."""
    raw = np.asarray(arrays[key])
    if raw.dtype.kind not in "fiu":
        raise TransferError(f"{key} must be numbers, not {raw.dtype}.")
    if raw.ndim != len(shape) or any(b is not None and a != b for a, b in zip(raw.shape, shape, strict=True)):
        wanted = ", ".join("any" if b is None else str(b) for b in shape)
        raise TransferError(f"{key} must have shape ({wanted}), not {raw.shape}.")
    values = np.ascontiguousarray(raw, np.float64)
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        raise TransferError(f"{key}{bad[0].tolist()} is not finite.")
    return values


def _shares(rows: Floats, key: str, *, below_zero: bool) -> Floats:
    """The rows divided by their sums, which must be 1 within SUM_ERROR; no entry below 0 unless it may be."""
    sums = rows.sum(axis=1)
    bad = np.flatnonzero(np.abs(sums - 1) > SUM_ERROR)
    if bad.size:
        raise TransferError(f"{key}[{bad[0]}] sums to {sums[bad[0]]:.6g}, not to 1.")
    if not below_zero and (rows < 0).any():
        i, k = np.argwhere(rows < 0)[0]
        raise TransferError(f"{key}[{i}, {k}] is {rows[i, k]:g}, below 0.")
    return np.asarray(rows / sums[:, None], np.float64)


def _parents(table: NDArray) -> Ints:
    """The row of each joint's parent, -1 for the root, from a table of names: parents over joints."""
    if table.dtype.kind not in "iu" or table.ndim != 2 or table.shape[0] != 2 or not table.shape[1]:
        raise TransferError(f"kintree_table must be whole numbers of shape (2, j), not {table.dtype} of {table.shape}.")
    wide = table.astype(np.int64)
    wide[wide == NO_PARENT] = -1
    names = wide[1].tolist()
    rows = {name: k for k, name in enumerate(names)}
    if len(rows) < len(names):
        raise TransferError("kintree_table names a joint twice.")
    parents = []
    for k, name in enumerate(wide[0].tolist()):
        if name != -1 and rows.get(name, k) >= k:
            raise TransferError(
                f"kintree_table gives joint {k} the parent {name}, which does not stand before it.",
                "Sort the joints so that parents come first.",
            )
        parents.append(-1 if name == -1 else rows[name])
    if parents[0] != -1 or parents.count(-1) != 1:
        raise TransferError(f"kintree_table has {parents.count(-1)} roots.", "The first joint alone has no parent.")
    return np.array(parents, np.int64)
