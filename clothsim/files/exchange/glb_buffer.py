"""Binary buffer of a glTF file: accessors into one chunk, and the container of both chunks."""

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError

FLOAT, UNSIGNED_INT, UNSIGNED_BYTE = 5126, 5125, 5121
VERTICES, INDICES = 34962, 34963
"""Targets of buffer views: vertex attributes, and indices."""
_KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_LARGEST = (1 << 32) - 1


class GlbBuffer:
    """Accessors that are added one after the other; each has its own view of the buffer."""

    def __init__(self) -> None:
        self._chunks: list[bytes] = []
        self._length = 0
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []

    def floats(self, values: Floats, bounds: bool = False) -> int:
        """Number of a new accessor of (n, c) values in single precision; bounds: with smallest and largest values."""
        rows = np.asarray(values, "<f4")
        more = {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()} if bounds else {}
        return self._add(rows, FLOAT, VERTICES if rows.shape[1] > 1 else None, more)

    def indices(self, triangles: Ints) -> int:
        """Number of a new accessor of the corners of triangles (m, 3)."""
        return self._add(np.asarray(triangles, "<u4").reshape(-1, 1), UNSIGNED_INT, INDICES, {})

    def colours(self, linear: Floats) -> int:
        """Number of a new accessor of linear colours (n, 3) in [0, 1], opaque, a byte each."""
        bytes_ = np.column_stack([np.rint(255 * np.clip(linear, 0, 1)), np.full(len(linear), 255)])
        return self._add(bytes_.astype("u1"), UNSIGNED_BYTE, VERTICES, {"normalized": True})

    def _add(self, rows: NDArray[Any], kind: int, target: int | None, more: dict[str, Any]) -> int:
        content = rows.tobytes()
        view: dict[str, Any] = {"buffer": 0, "byteOffset": self._length, "byteLength": len(content)}
        self._views.append(view if target is None else {**view, "target": target})
        self._chunks.append(content + bytes(-len(content) % 4))
        self._length += len(self._chunks[-1])
        entry = {"bufferView": len(self._views) - 1, "componentType": kind, "count": len(rows)}
        self._accessors.append({**entry, "type": _KINDS[rows.shape[1]], **more})
        return len(self._accessors) - 1

    def glb(self, document: dict[str, Any]) -> bytes:
        """The file of a JSON document and the buffer. InputError where it has 4 GiB or more."""
        whole = {
            **document,
            "buffers": [{"byteLength": self._length}],
            "bufferViews": self._views,
            "accessors": self._accessors,
        }
        text = json.dumps(whole, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + self._length
        if total > _LARGEST:
            raise InputError(
                f"The .glb file would have {total / 2**30:.1f} GiB, and the format ends at 4.",
                "Take fewer frames by --fps, or export USD or a point cache.",
            )
        head = struct.pack("<4sII", b"glTF", 2, total) + struct.pack("<I4s", len(text), b"JSON")
        return b"".join([head, text, struct.pack("<I4s", self._length, b"BIN\0"), *self._chunks])
