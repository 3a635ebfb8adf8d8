"""glTF 2.0 files: JSON chunk, buffers and accessors, each checked against the bytes that are there.

Read by hand (json, struct and NumPy): pygltflib maps the JSON to classes and leaves the accessors, which are the work
here, to its caller.
"""

import base64
import binascii
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_regular_file

DTYPES = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
READ_EXTENSIONS = ("KHR_mesh_quantization", "KHR_materials_", "KHR_texture_", "KHR_lights_", "EXT_texture_")
"""Required extensions that change nothing in what is read, by how their names begin."""
BROKEN = (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError, np.linalg.LinAlgError)
"""Exceptions where the JSON has a value of another type than glTF says."""
LARGEST = 1e12
"""Bound on the numbers of a node's transform: products of a few stay finite."""
MOST_ZEROS = 50_000_000
"""Largest number of values of an accessor without bytes of its own."""


@dataclass(frozen=True)
class GltfFile:
    """JSON of a glTF file and the bytes of its buffers."""

    path: Path
    json: dict[str, Any]
    buffers: tuple[bytes, ...]

    def fault(self, what: str, remedy: str = "Export it again.") -> InputError:
        """An InputError with the name of the file."""
        return InputError(f"{self.path.name}: {what}", remedy)

    def table(self, name: str) -> list[dict[str, Any]]:
        """The tables of a top-level list, "nodes" or "skins"; empty where the file has none."""
        entries = self.json.get(name, [])
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            raise self.fault(f"{name} is no list of tables.")
        return entries

    def entry(self, name: str, index: Any) -> dict[str, Any]:
        """The table `index` of a top-level list. InputError where there is none."""
        entries = self.table(name)
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(entries):
            raise self.fault(f"it names {name}[{index!r}], but has {len(entries)} {name}.")
        return entries[index]

    def array(self, index: Any, width: int) -> NDArray:
        """Values of an accessor, (count, width): integers as they are, normalised integers and floats as float64.

        Parameters
        ----------
        index : int
            Number of the accessor.
        width : int
            Numbers an element, 16 for a matrix (by columns).

        Raises
        ------
        InputError
            The accessor is broken, has another width, or reaches beyond its buffer.
        """
        accessor = self.entry("accessors", index)
        where = f"accessors[{index}]"
        count = self._whole(accessor, "count", where)
        if accessor.get("componentType") not in DTYPES or WIDTHS.get(str(accessor.get("type"))) != width:
            raise self.fault(f"{where} has the type {accessor.get('type')!r} of {accessor.get('componentType')!r}.")
        dtype = np.dtype(DTYPES[accessor["componentType"]]).newbyteorder("<")
        if "bufferView" in accessor:
            start = self._whole(accessor, "byteOffset", where, 0)
            values = self._strided(accessor["bufferView"], start, count, dtype, width, where)
        elif count * width > MOST_ZEROS:
            raise self.fault(f"{where} has {count:,} elements and no bytes.")
        else:
            values = np.zeros((count, width), dtype)
        if "sparse" in accessor:
            values = self._replace_sparse(accessor["sparse"], values, where)
        return self._as_numbers(values, bool(accessor.get("normalized")), where)

    def _as_numbers(self, values: NDArray, normalized: bool, where: str) -> NDArray:
        if values.dtype.kind == "f":
            if not np.isfinite(values).all():
                raise self.fault(f"{where}[{np.argwhere(~np.isfinite(values))[0, 0]}] is not finite.")
            return values.astype(np.float64)
        if normalized:
            return np.maximum(values.astype(np.float64) / np.iinfo(values.dtype).max, -1.0)
        return values.astype(np.int64)

    def _replace_sparse(self, sparse: Any, values: NDArray, where: str) -> NDArray:
        """`values` with the elements that a sparse accessor replaces."""
        try:
            count = self._whole(sparse, "count", f"{where}.sparse")
            given, put = sparse["indices"], sparse["values"]
            kind = np.dtype(DTYPES[given["componentType"]]).newbyteorder("<")
            at = self._strided(given["bufferView"], given.get("byteOffset", 0), count, kind, 1, where)[:, 0]
            new = self._strided(
                put["bufferView"], put.get("byteOffset", 0), count, values.dtype, values.shape[1], where
            )
        except (KeyError, TypeError) as error:
            raise self.fault(f"{where}.sparse is broken ({error}).") from error
        if kind.kind != "u" or (count and at.max() >= len(values)):
            raise self.fault(f"{where}.sparse names an element beyond its {len(values)}.")
        values = values.copy()
        values[at] = new
        return values

    def _strided(self, view_index: Any, start: int, count: int, dtype: np.dtype, width: int, where: str) -> NDArray:
        """`count` elements of a buffer view from its byte `start`, (count, width)."""
        view = self.entry("bufferViews", view_index)
        here = f"bufferViews[{view_index}]"
        if view.get("extensions"):
            raise self.fault(f"{here} is compressed ({', '.join(view['extensions'])}).", "Export it uncompressed.")
        number = self._whole(view, "buffer", here)
        if number >= len(self.buffers):
            raise self.fault(f"{here} names buffers[{number}], but there are {len(self.buffers)}.")
        offset, length = self._whole(view, "byteOffset", here, 0), self._whole(view, "byteLength", here)
        size = dtype.itemsize * width
        stride = self._whole(view, "byteStride", here, 0) or size
        end = start + stride * (count - 1) + size if count else start
        if stride < size or end > length or offset + length > len(self.buffers[number]):
            raise self.fault(f"{where} reaches beyond its {length:,} bytes.")
        if not count:
            return np.zeros((0, width), dtype)
        content = np.frombuffer(self.buffers[number], np.uint8, end - start, offset + start)
        rows = np.lib.stride_tricks.as_strided(content, (count, size), (stride, 1))
        return np.ascontiguousarray(rows).view(dtype)

    def _whole(self, table: Any, key: str, where: str, default: int | None = None) -> int:
        value = table.get(key, default) if isinstance(table, dict) else None
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 1 << 40:
            raise self.fault(f"{where}.{key} is {value!r}, no count.")
        return value

    def numbers(self, table: dict[str, Any], key: str, default: list[float], where: str) -> Floats:
        """Finite numbers of a key, as many as those of `default`."""
        try:
            values = np.asarray(table.get(key, default), np.float64)
        except (TypeError, ValueError) as error:
            raise self.fault(f"{where}.{key} is no list of numbers.") from error
        if values.shape != (len(default),) or not (np.abs(values) < LARGEST).all():
            raise self.fault(f"{where}.{key} must be {len(default)} numbers below {LARGEST:g}.")
        return values


def read_gltf(path: Path) -> GltfFile:
    """Read the JSON and the buffers of a .glb or .gltf file.

    Parameters
    ----------
    path : Path
        The file; buffers of a .gltf file are beside it or below its folder.

    Raises
    ------
    InputError
        It is missing, broken, cut off, of another version, or needs an extension that is not read.
    """
    content = read_regular_file(path)
    text, binary = _chunks(path, content) if content[:4] == b"glTF" else (content, b"")
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path.name} is no glTF file: {_short(error)}.", "Export a .glb or a .gltf.") from error
    if not isinstance(data, dict) or not isinstance(data.get("asset"), dict):
        raise InputError(f"{path.name} is no glTF file: it has no asset.", "Export a .glb or a .gltf.")
    if not str(data["asset"].get("version", "")).startswith("2"):
        raise InputError(f"{path.name} has glTF version {data['asset'].get('version')!r}.", "Export glTF 2.0.")
    file = GltfFile(path, data, ())
    needed = data.get("extensionsRequired", [])
    for name in needed if isinstance(needed, list) else [needed]:
        if not str(name).startswith(READ_EXTENSIONS):
            raise file.fault(f"it needs the extension {name}, which is not read.", "Export it without compression.")
    return GltfFile(path, data, tuple(_buffer(file, k, entry, binary) for k, entry in enumerate(file.table("buffers"))))


def _chunks(path: Path, content: bytes) -> tuple[bytes, bytes]:
    """The JSON and the binary chunk of a .glb file."""
    if len(content) < 20 or struct.unpack_from("<I", content, 8)[0] > len(content):
        raise InputError(f"{path.name} is cut off: it has {len(content):,} bytes.", "Copy it again.")
    version, total = struct.unpack_from("<II", content, 4)
    if version != 2:
        raise InputError(f"{path.name} has glTF version {version}.", "Export glTF 2.0.")
    found: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= total:
        length, kind = struct.unpack_from("<I4s", content, at)
        if at + 8 + length > total:
            raise InputError(f"{path.name} has a chunk of {length:,} bytes, of which {total - at - 8:,} are there.")
        found.setdefault(kind, content[at + 8 : at + 8 + length])
        at += 8 + length
    if b"JSON" not in found:
        raise InputError(f"{path.name} has no JSON chunk.", "Export it again.")
    return found[b"JSON"], found.get(b"BIN\0", b"")


def _buffer(file: GltfFile, number: int, entry: dict[str, Any], binary: bytes) -> bytes:
    uri = entry.get("uri")
    if uri is None:
        return binary
    if not isinstance(uri, str):
        raise file.fault(f"buffers[{number}].uri is no text.")
    if uri.startswith("data:"):
        try:
            return base64.b64decode(uri.partition(",")[2], validate=True)
        except (binascii.Error, ValueError) as error:
            raise file.fault(f"buffers[{number}] is no base 64.") from error
    name = Path(unquote(uri))
    if name.is_absolute() or ".." in name.parts or ":" in uri:
        raise file.fault(f"buffers[{number}] is {uri[:80]!r}, outside of its folder.", "Export a .glb, one file.")
    return read_regular_file(file.path.parent / name, remedy=f"Keep it beside {file.path.name}, or export a .glb.")


def broken(path: Path, error: Exception) -> InputError:
    """The error for a file whose JSON has a value of another type than glTF says."""
    return InputError(
        f"{path.name} is no valid glTF file ({type(error).__name__}: {_short(error)}).", "Export it again."
    )


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:80] or type(error).__name__
