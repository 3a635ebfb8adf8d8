"""Reading of untrusted files: regular ones of bounded size, plain NumPy arrays, bounded decompression."""

import lzma
import math
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from math import prod
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import IO, TypeVar

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from clothsim.base.errors import InputError

MOST_BYTES = 1 << 31


def read_regular_file(path: str | Path, most: int = MOST_BYTES, remedy: str = "") -> bytes:
    """The bytes of a file.

    A pipe that nobody writes to would be waited for without end, and a device (/dev/zero) has none.

    remedy: what to do where there is no file. InputError: it is missing, no regular file, too large, or cannot be
    opened.
    """
    file = Path(path)
    try:
        size = file.stat().st_size
        if not file.is_file():
            what = "a directory" if file.is_dir() else "a pipe or a device"
            raise InputError(f"{file} is {what}, not a file.", "Name a regular file.")
        if size > most:
            raise InputError(f"{file} has {size / 1e9:,.3g} GB, more than the {most / 1e9:.2g} GB that are read.")
        return file.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"There is no file {file}.", remedy) from error
    except (OSError, ValueError) as error:
        raise InputError(f"{file} cannot be opened ({getattr(error, 'strerror', None) or error}).") from error


MOST_HEADER = 10_000
"""Longest header [bytes]; NumPy evaluates it as a Python literal."""


def read_numbers(path: str | Path) -> NDArray[np.number]:
    """The array of a .npy file.

    InputError: it is missing, no NumPy file, holds no real numbers, or fewer than its header says; its name is in the
    sentence.
    """
    content = BytesIO(read_regular_file(path))
    try:
        shape, _, dtype = _header(content)
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
        raise InputError(f"{path} is not a NumPy file of numbers ({reason}).", "Write it with numpy.save.") from error


MOST_UNPACKED = 4 << 30
"""Largest size of an array of an archive [bytes]."""


def read_arrays(path: Path, names: list[str], most: int = MOST_UNPACKED) -> dict[str, NDArray]:
    """The arrays of real numbers of these names that an archive has; others, also pickled ones, are not touched.

    most: largest size of one of them [bytes].

    InputError: there is no such file, it is not an archive, or one of the arrays is pickled, broken or too large.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            there = {entry.filename: entry for entry in archive.infolist()}
            return {name: _array(path, archive, there[f"{name}.npy"], most) for name in names if f"{name}.npy" in there}
    except FileNotFoundError as error:
        raise InputError(f"There is no file {path.name}.") from error
    except InputError:
        raise
    except Exception as error:  # zipfile and NumPy's header raise a dozen types of errors
        reason = " ".join(str(error).split())[:80] or type(error).__name__
        raise InputError(
            f"{path.name} is not an .npz file of plain arrays ({reason}).", "Save it with numpy.savez."
        ) from error


def _header(content: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, order (True: Fortran's) and type of the numbers that follow."""
    version = npy.read_magic(content)
    if version not in ((1, 0), (2, 0), (3, 0)):
        raise ValueError(f"its version is {version}")
    reader = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    return reader(content, max_header_size=MOST_HEADER)


def _array(path: Path, archive: zipfile.ZipFile, entry: zipfile.ZipInfo, most: int) -> NDArray:
    name = entry.filename.removesuffix(".npy")
    with archive.open(entry) as content:
        shape, order, dtype = _header(content)
        if dtype.hasobject or dtype.kind not in "iuf":
            raise InputError(
                f"{name!r} of {path.name} is not an array of numbers: pickled data is not read.", "Save it as numbers."
            )
        size = int(np.prod(shape, dtype=object)) * dtype.itemsize
        if size > most or size > entry.file_size or min(shape, default=0) < 0:
            raise InputError(f"{name!r} of {path.name} says {shape}, more than it holds or than is read.")
        data = content.read(size)
    if len(data) < size:
        raise InputError(f"{name!r} of {path.name} is truncated.", "Copy it again.")
    return np.frombuffer(data, dtype).reshape(shape, order="F" if order else "C")


class _Bound:
    """Stand-ins for the modules zlib and lzma whose `decompress` stops at a number of bytes in all."""

    def __init__(self, name: str, most: int) -> None:
        self.name = name
        self.most = self.left = most
        self.zlib = SimpleNamespace(decompress=lambda data: self._unpacked(zlib.decompressobj(), data))
        self.lzma = SimpleNamespace(decompress=lambda data: self._unpacked(lzma.LZMADecompressor(), data))

    def _unpacked(self, decompressor: "zlib._Decompress | lzma.LZMADecompressor", data: bytes) -> bytes:
        content = decompressor.decompress(data, self.left + 1)
        self.left -= len(content)
        if self.left < 0:
            raise InputError(
                f"{self.name} unpacks to more than {self.most / 1e6:,.0f} MB, far more than it holds.",
                "Save it uncompressed if it is a mesh.",
            )
        return content


@contextmanager
def bounded_decompression(module: ModuleType, name: str, most: int) -> Iterator[None]:
    """Let the functions of a module that uses `zlib` and `lzma` unpack at most so many bytes within the block.

    InputError where they would unpack more; `name` is that of the file.
    """
    bound = _Bound(name, most)
    before = {library: getattr(module, library) for library in ("zlib", "lzma") if hasattr(module, library)}
    try:
        for library in before:
            setattr(module, library, getattr(bound, library))
        yield
    finally:
        for library, original in before.items():
            setattr(module, library, original)


# Reading budgets: how much a file may promise, counted before it is built.
#
# A few bytes can promise gigabytes: a number of frames, a compressed array, a curve that is flattened finely.


MOST = {
    "numbers": 1 << 24,  # of a motion, frames x joints x 4: 11 minutes of 52 joints at 120 frames a second
    "bytes": 1 << 28,  # that the arrays of a motion unpack to
    "nodes": 10_000,  # of a character's file
    "values": 1 << 26,  # of all accessors of a character's file: overlapping ones and those without bytes too
    "weights": 1 << 26,  # vertices x joints of a character: 500 MB
    "points": 300_000,  # of the outlines of a drawing, after curves are flattened
    "points of a piece": 10_000,
    "panels": 1_000,  # of a sewing pattern; GarmentCode's largest have some 60
    "edges": 20_000,
    "stitches": 20_000,
    "points of a panel": 10_000,
}
"""Largest promise of a file, by what is counted."""

Item = TypeVar("Item")


@dataclass
class Budget:
    """Counts that one file declares, summed up.

    Attributes
    ----------
    name : str
        Name of the file, for the sentence.

    Examples
    --------
    >>> budget = Budget("walk.bvh")
    >>> budget.spend("numbers", 1000, 20, 4)
    >>> budget.spent["numbers"]
    80000
    """

    name: str
    spent: Counter[str] = field(default_factory=Counter)

    def spend(self, what: str, *shape: int) -> None:
        """Count the product of `shape`. InputError where all that was counted so is more than MOST[what]."""
        self.spent[what] += prod(shape)
        if self.spent[what] > MOST[what]:
            size = " x ".join(f"{each:,}" for each in shape)
            raise InputError(
                f"{self.name} declares more than the {MOST[what]:,} {what} that are read ({size} at once).",
                "Cut it into smaller files, or export it more coarsely.",
            )

    def counted(self, items: Iterable[Item], *kinds: str) -> Iterator[Item]:
        """The items, each counted as one of every kind of `kinds` before it is handed on."""
        for item in items:
            for what in kinds:
                self.spend(what, 1)
            yield item
