"""NumPy archives (.npz) of plain arrays whose headers are checked before an array is allocated."""

import zipfile
from pathlib import Path

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from clothsim.base.errors import InputError
from clothsim.base.safe_files.numpy_file import MOST_HEADER

MOST_UNPACKED = 4 << 30
"""Largest size of an array of an archive [bytes]."""


def read_arrays(path: Path, names: list[str]) -> dict[str, NDArray]:
    """The arrays of real numbers of these names that an archive has; others, also pickled ones, are not touched.

    Raises
    ------
    InputError
        There is no such file, it is no archive, or one of the arrays is pickled, broken or too large.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            there = {entry.filename: entry for entry in archive.infolist()}
            return {name: _array(path, archive, there[f"{name}.npy"]) for name in names if f"{name}.npy" in there}
    except FileNotFoundError as error:
        raise InputError(f"There is no file {path.name}.") from error
    except InputError:
        raise
    except Exception as error:  # zipfile and NumPy's header raise a dozen types of errors
        reason = " ".join(str(error).split())[:80] or type(error).__name__
        raise InputError(
            f"{path.name} is no .npz file of plain arrays ({reason}).", "Save it with numpy.savez."
        ) from error


def _array(path: Path, archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> NDArray:
    name = entry.filename.removesuffix(".npy")
    with archive.open(entry) as content:
        version = npy.read_magic(content)
        reader = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, order, dtype = reader(content, max_header_size=MOST_HEADER)
        if dtype.hasobject or dtype.kind not in "iuf":
            raise InputError(
                f"{name!r} of {path.name} is no array of numbers: pickled data is not read.", "Save it as numbers."
            )
        size = int(np.prod(shape, dtype=object)) * dtype.itemsize
        if size > MOST_UNPACKED or size > entry.file_size or min(shape, default=0) < 0:
            raise InputError(f"{name!r} of {path.name} says {shape}, more than it holds or than is read.")
        data = content.read(size)
    if len(data) < size:
        raise InputError(f"{name!r} of {path.name} is cut off.", "Copy it again.")
    return np.frombuffer(data, dtype).reshape(shape, order="F" if order else "C")
