"""Body models from arrays and from .npz files with the keys of SMPL; pickled data is never read."""

import tokenize
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
UNREADABLE = (
    OSError, ValueError, EOFError, MemoryError, RuntimeError, OverflowError, SyntaxError, tokenize.TokenError,
    zipfile.BadZipFile, zlib.error, NotImplementedError,
)  # fmt: skip
"""Exceptions that numpy raises for a broken or a pickled file."""
SUM_ERROR = 1e-3
"""Largest deviation of a row sum from 1, as single precision and rounded files leave; rows are then normalised."""


def read_body_model(path: str | Path) -> BodyModel:
    """Read a body model from an .npz file with the keys of SMPL; other keys are ignored.

    Parameters
    ----------
    path : str or Path
        File with v_template (n, 3) [m], shapedirs (n, 3, k) [m], posedirs (n, 3, 9 (j - 1)) [m], J_regressor (j, n),
        weights (n, j), kintree_table (2, j) (names of the parents over names of the joints) and f (m, 3).

    Raises
    ------
    TransferError
        The file is missing, is no .npz file, lacks a key, holds pickled data or arrays of inconsistent shapes.

    Examples
    --------
    >>> from transfer.body_file import read_body_model
    >>> read_body_model("missing.npz")
    Traceback (most recent call last):
    transfer.errors.TransferError: There is no file missing.npz.
    """
    name = Path(path).name
    if Path(path).exists() and not Path(path).is_file():
        raise TransferError(f"{name} is no regular file.")
    try:
        file = np.load(path, allow_pickle=False)
    except FileNotFoundError as error:
        raise TransferError(f"There is no file {name}.") from error
    except UNREADABLE as error:
        raise TransferError(
            f"{name} is no .npz file of plain arrays.", "Convert pickled files (.pkl), which may run code, to .npz."
        ) from error
    if not isinstance(file, np.lib.npyio.NpzFile):
        raise TransferError(f"{name} holds one array, not a body model.", "Give an .npz file.")
    with file:
        lacking = [key for key in KEYS if key not in file.files]
        if lacking:
            raise TransferError(f"{name} has no {lacking[0]!r}.", f"A body model has {', '.join(KEYS)}.")
        return body_model({key: _entry(file, key, name) for key in KEYS})


def body_model(arrays: Mapping[str, ArrayLike]) -> BodyModel:
    """Make a body model from arrays.

    Parameters
    ----------
    arrays : mapping of str to array_like
        Arrays under the keys of `read_body_model`.

    Raises
    ------
    TransferError
        A key is missing, or an array has another shape or type, or a value that is not finite.

    Examples
    --------
    One triangle on one joint at the origin, without shape or pose blend shapes:

    >>> import numpy as np
    >>> from transfer.body_file import body_model
    >>> body = body_model({
    ...     "v_template": np.eye(3), "shapedirs": np.zeros((3, 3, 1)), "posedirs": np.zeros((3, 3, 0)),
    ...     "J_regressor": np.full((1, 3), 1 / 3), "weights": np.ones((3, 1)),
    ...     "kintree_table": np.array([[-1], [0]]), "f": np.array([[0, 1, 2]]),
    ... })
    >>> body.vertices(translation=(0, 0, 1))[2].tolist()
    [0.0, 0.0, 2.0]
    """
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
        _normalized_rows(_floats(arrays, "J_regressor", (j, n)), "J_regressor", below_zero=True),
        _normalized_rows(_floats(arrays, "weights", (n, j)), "weights", below_zero=False),
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
    """Finite float64 array of `shape` (None: any length); TransferError otherwise."""
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


def _normalized_rows(rows: Floats, key: str, *, below_zero: bool) -> Floats:
    """Rows divided by their sums, which must be 1 within SUM_ERROR; negative entries only if `below_zero`."""
    sums = rows.sum(axis=1)
    bad = np.flatnonzero(np.abs(sums - 1) > SUM_ERROR)
    if bad.size:
        raise TransferError(f"{key}[{bad[0]}] sums to {sums[bad[0]]:.6g}, not to 1.")
    if not below_zero and (rows < 0).any():
        i, k = np.argwhere(rows < 0)[0]
        raise TransferError(f"{key}[{i}, {k}] is {rows[i, k]:g}, below 0.")
    return np.asarray(rows / sums[:, None], np.float64)


def _parents(table: NDArray) -> Ints:
    """Row of each joint's parent, (j,), -1 for the root, from a table of names: parents over joints."""
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
                f"kintree_table gives joint {k} the parent {name}, which does not precede it.",
                "Sort the joints so that parents come first.",
            )
        parents.append(-1 if name == -1 else rows[name])
    if parents[0] != -1 or parents.count(-1) != 1:
        raise TransferError(f"kintree_table has {parents.count(-1)} roots.", "Only the first joint has no parent.")
    return np.array(parents, np.int64)
