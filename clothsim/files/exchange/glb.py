"""Binary glTF 2.0 (.glb) with a morph target for each frame but the first.

A node and a mesh a surface. Frame 0 is the mesh, each later frame a morph target of displacements from it and of
changes of the normals, whose weight is 1 at the time of the frame and 0 at all others, linear between them. Colours
are those of the last frame: readers agree on none that change.
Vertices are split where texture coordinates differ: the first n rows are the vertices of the run in their order, the
copies follow. Panels are primitives of one mesh, which share its vertices, with a material each.
Source: Khronos Group, glTF 2.0 specification, 3.7.2.2 (morph targets), 3.6.1 and appendix C (animation).
"""

import json
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.file_writing import write_atomically
from clothsim.base.srgb import linear_rgb
from clothsim.files.exchange.animation import AnimatedPart, Animation, PartFrame, split_vertices

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
                "Export fewer frames with --fps, or export USD or a point cache.",
            )
        head = struct.pack("<4sII", b"glTF", 2, total) + struct.pack("<I4s", len(text), b"JSON")
        return b"".join([head, text, struct.pack("<I4s", self._length, b"BIN\0"), *self._chunks])


MOST_TARGETS = 4_000
"""Largest number of morph targets: the weights grow with its square."""
CLOTH_COLOUR, BODY_COLOUR = (0.8, 0.8, 0.8, 1.0), (0.5, 0.5, 0.5, 1.0)


def files(animation: Animation, target: Path) -> list[Path]:
    """One file."""
    return [target]


def write(animation: Animation, target: Path) -> None:
    """Write the file. InputError where it would have too many morph targets or bytes."""
    frames = len(animation.times)
    if frames - 1 > MOST_TARGETS and any(part.moving for part in animation.parts):
        raise InputError(
            f"{frames:,} frames are more morph targets than a glTF file should have ({MOST_TARGETS:,}).",
            "Export fewer with --fps, or export USD or a point cache.",
        )
    write_atomically(target, glb_bytes(animation))


def glb_bytes(animation: Animation) -> bytes:
    """The content of the file."""
    buffer, bases, last = GlbBuffer(), animation.at(0), animation.at(len(animation.times) - 1)
    splits = [split_vertices(part, len(base.points)) for part, base in zip(animation.parts, bases, strict=True)]
    lines = [part.name for part, (_, triangles, _) in zip(animation.parts, splits, strict=True) if not len(triangles)]
    if lines:
        raise InputError(f"{lines[0]} is a rod, and a glTF file has only triangles.", "Export USD, OBJ or PLY.")
    meshes = [
        _base(buffer, part, replace(base, colours=end.colours), split)
        for part, base, end, split in zip(animation.parts, bases, last, splits, strict=True)
    ]
    moving = [number for number, part in enumerate(animation.parts) if part.moving and len(animation.times) > 1]
    for k in range(1, len(animation.times)):
        shapes = animation.at(k)
        for number in moving:
            # a morph target: what a shape differs by from the base as it is stored
            base, shape, vertices = bases[number], shapes[number], splits[number][0]
            stored = base.points.astype(np.float32).astype(np.float64)
            target = {
                "POSITION": buffer.floats((shape.points - stored)[vertices], bounds=True),
                "NORMAL": buffer.floats((shape.normals - base.normals)[vertices]),
            }
            for primitive in meshes[number]["primitives"]:
                primitive.setdefault("targets", []).append(target)
    return buffer.glb(_document(animation, meshes, _animation(buffer, animation, meshes, moving)))


def _base(buffer: GlbBuffer, part: AnimatedPart, shape: PartFrame, split: tuple[Ints, Ints, Floats]) -> dict[str, Any]:
    """The mesh of a part in the first frame."""
    vertices, triangles, texture = split
    attributes = {
        "POSITION": buffer.floats(shape.points[vertices], bounds=True),
        "NORMAL": buffer.floats(shape.normals[vertices]),
    }
    if len(texture):
        attributes["TEXCOORD_0"] = buffer.floats(texture * [1.0, -1.0] + [0.0, 1.0])  # v counts from the top
    if len(shape.colours):
        attributes["COLOR_0"] = buffer.colours(linear_rgb(shape.colours[vertices]))
    return {
        "name": part.name,
        "primitives": [
            {"attributes": attributes, "indices": buffer.indices(triangles[faces]), "panel": name}
            for name, faces in panels(part).items()
        ],
    }


def panels(part: AnimatedPart) -> dict[str, Ints]:
    """Triangles of each primitive by name: the panels, each triangle in its first, and the rest under the part's."""
    free, found = np.ones(len(part.triangles), bool), {}
    for name, own in part.groups.items():
        rows = own[free[own]]
        free[rows] = False
        if len(rows):
            found[name] = rows
    rest = np.flatnonzero(free)
    return {**found, **({part.name: rest} if len(rest) else {})}


def _animation(
    buffer: GlbBuffer, animation: Animation, meshes: list[dict[str, Any]], moving: list[int]
) -> list[dict[str, Any]]:
    """The animation of the weights, which all moving parts share."""
    count = len(animation.times)
    if not moving:
        return []
    weights = np.eye(count)[:, 1:]
    for number in moving:
        meshes[number]["weights"] = [0.0] * (count - 1)
    times = buffer.floats((animation.times - animation.times[0])[:, None], bounds=True)
    sampler = {"input": times, "output": buffer.floats(weights.reshape(-1, 1)), "interpolation": "LINEAR"}
    channels = [{"sampler": 0, "target": {"node": number, "path": "weights"}} for number in moving]
    return [{"name": "cloth", "samplers": [sampler], "channels": channels}]


def _document(animation: Animation, meshes: list[dict[str, Any]], moves: list[dict[str, Any]]) -> dict[str, Any]:
    """All of the JSON but for buffers; takes the names of the panels out of the primitives."""
    materials: list[dict[str, Any]] = []
    for part, mesh in zip(animation.parts, meshes, strict=True):
        colour = CLOTH_COLOUR if part.role == "cloth" else BODY_COLOUR
        coloured = "COLOR_0" in mesh["primitives"][0]["attributes"]
        for primitive in mesh["primitives"]:
            primitive["material"] = len(materials)
            surface = {"baseColorFactor": [1.0] * 4 if coloured else list(colour), "metallicFactor": 0.0}
            materials.append(
                {
                    "name": primitive.pop("panel"),
                    "doubleSided": part.role == "cloth",
                    "pbrMetallicRoughness": {**surface, "roughnessFactor": 0.9},
                }
            )
    origin = [float(x) for x in animation.origin]
    place = {"translation": origin} if any(origin) else {}
    nodes = [{"name": part.name, "mesh": number, **place} for number, part in enumerate(animation.parts)]
    return {
        "asset": {"version": "2.0", "generator": "clothsim"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
        **({"animations": moves} if moves else {}),
    }
