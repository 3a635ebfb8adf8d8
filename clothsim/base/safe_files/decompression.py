"""Decompression within a bound, for a library that decompresses what a file says."""

import lzma
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType, SimpleNamespace

from clothsim.base.errors import InputError


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
