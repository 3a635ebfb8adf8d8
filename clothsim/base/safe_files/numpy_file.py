"""NumPy files (.npy) of real numbers whose header promises no more than the file holds."""

import math
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from clothsim.base.errors import InputError
from clothsim.base.safe_files.regular_file import read_regular_file

MOST_HEADER = 10_000
"""Longest header [bytes]; NumPy evaluates it as a Python literal."""


def read_numbers(path: str | Path) -> NDArray[np.number]:
    """The array of a .npy file.

    Raises
    ------
    InputError
        It is missing, no NumPy file, holds no real numbers, or fewer than its header says; its name is in the sentence.
    """
    content = BytesIO(read_regular_file(path))
    try:
        version = npy.read_magic(content)
        if version not in ((1, 0), (2, 0), (3, 0)):
            raise ValueError(f"its version is {version}")
        reader = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, _, dtype = reader(content, max_header_size=MOST_HEADER)
        if dtype.hasobject or dtype.kind not in "iuf":
            raise InputError(f"{path} holds no real numbers.", "Save an array of floats or integers.")
        left = len(content.getvalue()) - content.tell()
        if math.prod(shape) * dtype.itemsize != left or min(shape, default=0) < 0:
            raise ValueError(f"its header says {shape} of {dtype}, behind it are {left:,} bytes")
        content.seek(0)
        return np.asarray(npy.read_array(content, allow_pickle=False))
    except InputError:
        raise
    except (
        Exception
    ) as error:  # besides ValueError: TokenError, SyntaxError, MemoryError, RecursionError, OverflowError
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(f"{path} is no NumPy file of numbers ({reason}).", "Write it with numpy.save.") from error
