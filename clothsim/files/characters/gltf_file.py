"""glTF 2.0 files: JSON chunk, buffers and accessors, each checked against the bytes that are there, and skeletons.

Read by hand (json, struct and NumPy): pygltflib 1.16 maps the JSON to classes and leaves the accessors, which are the
work here, to its caller; it takes a file that is cut in half, and 11 ms for one that takes .7 ms here. The skeleton is
that of all nodes, with the pose in which the skins were bound.
"""

import base64
import binascii
import json
import struct
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.file_reading import Budget, read_regular_file
from clothsim.files.characters.skeleton import Pose, Skeleton, from_matrices, orthonormal, to_matrices

DTYPES = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
READ_EXTENSIONS = ("KHR_mesh_quantization", "KHR_materials_", "KHR_texture_", "KHR_lights_", "EXT_texture_")
"""Required extensions that change nothing in what is read, by how their names begin."""
BROKEN = (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError, np.linalg.LinAlgError)
"""Exceptions where the JSON has a value of another type than glTF says."""
LARGEST = 1e12
"""Bound on the numbers of a node's transform: products of a few stay finite."""


@dataclass(frozen=True)
class GltfFile:
    """JSON of a glTF file, the bytes of its buffers, and what may still be read of it."""

    path: Path
    json: dict[str, Any]
    buffers: tuple[bytes, ...]
    budget: Budget

    def fault(self, what: str, remedy: str = "Export it again.") -> InputError:
        """An InputError with the name of the file."""
        return InputError(f"{self.path.name}: {what}", remedy)

    def table(self, name: str) -> list[dict[str, Any]]:
        """The tables of a top-level list, "nodes" or "skins"; empty where the file has none."""
        if name in self.json and name not in self.tables:
            raise self.fault(f"{name} is not a list of tables.")
        return self.tables.get(name, [])

    @cached_property
    def tables(self) -> dict[str, list[dict[str, Any]]]:
        """The top-level lists of tables; looked through once, not for each node."""
        lists = {name: entries for name, entries in self.json.items() if isinstance(entries, list)}
        return {name: entries for name, entries in lists.items() if all(isinstance(each, dict) for each in entries)}

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
        self.budget.spend("values", count, width)
        if accessor.get("componentType") not in DTYPES or WIDTHS.get(str(accessor.get("type"))) != width:
            raise self.fault(f"{where} has the type {accessor.get('type')!r} of {accessor.get('componentType')!r}.")
        dtype = np.dtype(DTYPES[accessor["componentType"]]).newbyteorder("<")
        if "bufferView" in accessor:
            start = self._whole(accessor, "byteOffset", where, 0)
            values = self._strided(accessor["bufferView"], start, count, dtype, width, where)
        else:
            values = np.zeros((count, width), dtype)
        if "sparse" in accessor:
            values = self._replace_sparse(accessor["sparse"], values, where)
        if values.dtype.kind == "f":
            if not np.isfinite(values).all():
                raise self.fault(f"{where}[{np.argwhere(~np.isfinite(values))[0, 0]}] is not finite.")
            return values.astype(np.float64)
        if accessor.get("normalized"):
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
            raise self.fault(f"{where}.{key} is {value!r}, not a count.")
        return value

    def numbers(self, table: dict[str, Any], key: str, default: list[float], where: str) -> Floats:
        """Finite numbers of a key, as many as those of `default`."""
        try:
            values = np.asarray(table.get(key, default), np.float64)
        except (TypeError, ValueError) as error:
            raise self.fault(f"{where}.{key} is not a list of numbers.") from error
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
        raise InputError(f"{path.name} is not a glTF file: {_short(error)}.", "Export a .glb or a .gltf.") from error
    if not isinstance(data, dict) or not isinstance(data.get("asset"), dict):
        raise InputError(f"{path.name} is not a glTF file: it has no asset.", "Export a .glb or a .gltf.")
    if not str(data["asset"].get("version", "")).startswith("2"):
        raise InputError(f"{path.name} has glTF version {data['asset'].get('version')!r}.", "Export glTF 2.0.")
    budget = Budget(path.name)
    file = GltfFile(path, data, (), budget)
    needed = data.get("extensionsRequired", [])
    for name in needed if isinstance(needed, list) else [needed]:
        if not str(name).startswith(READ_EXTENSIONS):
            raise file.fault(f"it needs the extension {name}, which is not read.", "Export it without compression.")
    buffers = tuple(_buffer(file, k, entry, binary) for k, entry in enumerate(file.table("buffers")))
    return GltfFile(path, data, buffers, budget)


def _chunks(path: Path, content: bytes) -> tuple[bytes, bytes]:
    """The JSON and the binary chunk of a .glb file."""
    if len(content) < 20 or struct.unpack_from("<I", content, 8)[0] > len(content):
        raise InputError(f"{path.name} is truncated: it has {len(content):,} bytes.", "Copy it again.")
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
        raise file.fault(f"buffers[{number}].uri is not text.")
    if uri.startswith("data:"):
        try:
            return base64.b64decode(uri.partition(",")[2], validate=True)
        except (binascii.Error, ValueError) as error:
            raise file.fault(f"buffers[{number}] is not base 64.") from error
    name = Path(unquote(uri))
    if name.is_absolute() or ".." in name.parts or ":" in uri:
        raise file.fault(f"buffers[{number}] is {uri[:80]!r}, outside of its folder.", "Export a .glb, one file.")
    return read_regular_file(file.path.parent / name, remedy=f"Keep it beside {file.path.name}, or export a .glb.")


def broken(path: Path, error: Exception) -> InputError:
    """The error for a file whose JSON has a value of another type than glTF says."""
    return InputError(
        f"{path.name} is not a valid glTF file ({type(error).__name__}: {_short(error)}).", "Export it again."
    )


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:80] or type(error).__name__


SHEAR = 1e-3
"""Largest relative deviation of a matrix from rotation and scale; a bound pose with more is that of the nodes."""


def node_order(file: GltfFile) -> tuple[list[int], Ints]:
    """Nodes listed after their parents, and the parent of each in that list, -1 for a root.

    Raises
    ------
    InputError
        A node has two parents, or is its own ancestor.
    """
    nodes = file.table("nodes")
    Budget(file.path.name).spend("nodes", len(nodes))
    parents = np.full(len(nodes), -1)
    for k, node in enumerate(nodes):
        for child in node.get("children", []):
            file.entry("nodes", child)
            if parents[child] >= 0:
                raise file.fault(f"nodes[{child}] has two parents.")
            parents[child] = k
    order = [int(k) for k in np.flatnonzero(parents < 0)]
    for k in order:
        order.extend(nodes[k].get("children", []))
    if len(order) < len(nodes):
        raise file.fault("a node is its own ancestor.")
    place = np.empty(len(nodes), np.int64)
    place[order] = np.arange(len(nodes))
    return order, np.array([place[parents[k]] if parents[k] >= 0 else -1 for k in order], np.int64)


def node_names(file: GltfFile, order: list[int]) -> tuple[str, ...]:
    """Names of the nodes in `order`, each once: a nameless or repeated one gets its number."""
    names: dict[str, None] = {}
    for k in order:
        name = file.table("nodes")[k].get("name")
        named = isinstance(name, str) and name.isprintable() and name and name not in names
        names[name if named and isinstance(name, str) else f"node{k}"] = None
    return tuple(names)


def node_pose(file: GltfFile, order: list[int]) -> Pose:
    """Transforms of the nodes as the file has them."""
    rows = [_transform(file, k) for k in order]
    return Pose(*(np.array([row[part] for row in rows]) for part in range(3)))


def bound_skeleton(file: GltfFile, joints: Ints, inverse_bind: Floats) -> Skeleton:
    """Skeleton of all nodes, at rest in the pose in which `joints` (in node order) were bound.

    Parameters
    ----------
    file : GltfFile
    joints : (k,) ndarray
        Row of each joint of the skins.
    inverse_bind : (k, 4, 4) ndarray

    Notes
    -----
    Exporters write nodes in the pose of the moment; the bound pose is in the inverse bind matrices B_k. Where the first
    root of the joints keeps its transform G_0, joint k rests at G_0 B_0 B_k^-1. A pose that is not a rotation, scale
    and translation stays that of the nodes.
    """
    order, parents = node_order(file)
    names, pose = node_names(file, order), node_pose(file, order)
    skeleton = Skeleton(names, parents, pose)
    now = skeleton.transforms(pose)
    wanted, root = now.copy(), int(np.argmin(joints))
    space = now[joints[root]] @ inverse_bind[root]
    for row, matrix in zip(joints, inverse_bind, strict=True):
        if abs(np.linalg.det(matrix)) > 0:
            wanted[row] = space @ np.linalg.inv(matrix)
    bound = np.zeros(len(order), bool)
    bound[joints] = True
    rest = [part.copy() for part in (pose.translations, pose.rotations, pose.scales)]
    for row in range(len(order)):
        parent = wanted[parents[row]] if parents[row] >= 0 else np.eye(4)
        if not bound[row]:
            translation, rotation, scale = (part[row] for part in rest)
            matrix = np.eye(4)
            matrix[:3, :3], matrix[:3, 3] = to_matrices(rotation) * scale, translation
            wanted[row] = parent @ matrix
            continue
        found = _parts(np.linalg.solve(parent, wanted[row]))
        if found is None:
            return skeleton
        for part, value in zip(rest, found, strict=True):
            part[row] = value
    return Skeleton(names, parents, Pose(*rest))


def _transform(file: GltfFile, k: int) -> tuple[Floats, Floats, Floats]:
    """Translation, rotation (w, x, y, z) and scale of a node."""
    node, where = file.table("nodes")[k], f"nodes[{k}]"
    if "matrix" in node:
        found = _parts(file.numbers(node, "matrix", [0.0] * 16, where).reshape(4, 4).T)
        if found is None:
            raise file.fault(f"{where}.matrix is not a rotation, scale and translation.", "Apply its shear.")
        return found
    rotation = file.numbers(node, "rotation", [0.0, 0.0, 0.0, 1.0], where)
    length = float(np.linalg.norm(rotation))
    if length == 0:
        raise file.fault(f"{where}.rotation is not a rotation.")
    translation = file.numbers(node, "translation", [0.0] * 3, where)
    return translation, np.roll(rotation, 1) / length, file.numbers(node, "scale", [1.0] * 3, where)


def _parts(matrix: Floats) -> tuple[Floats, Floats, Floats] | None:
    """Translation, rotation and scale of a transform; None for one with shear or reflection."""
    linear = matrix[:3, :3]
    scale = np.linalg.norm(linear, axis=0)
    if scale.min() <= 0 or np.linalg.det(linear) <= 0:
        return None
    rotation = orthonormal(linear / scale)
    if np.abs(rotation * scale - linear).max() > SHEAR * scale.max():
        return None
    return matrix[:3, 3], from_matrices(rotation), scale
