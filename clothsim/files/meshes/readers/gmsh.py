"""Gmsh files: the triangles and quads of versions 2, 4.0 and 4.1, text or binary.

https://gmsh.info/doc/texinfo/gmsh.html#Gmsh-file-formats. Other elements are counted and ignored. A count that exceeds
the bytes of the file is an error before anything is allocated. meshio 5.3 would allocate by the counts of every block
and by the largest node tag, takes unknown and repeated tags for other nodes, and refuses parametric nodes, big-endian
files and gaps in the tags of binary version 2.
"""

from collections import Counter
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.files.meshes.polygons import Polygons

FACES = (2, 3)
"""Gmsh's element types of triangle and quad."""
CORNERS = dict(enumerate((2, 3, 4, 4, 8, 6, 5, 3, 6, 9, 10, 27, 18, 14, 1, 8, 20, 15, 13, 9), start=1))
CORNERS |= dict(enumerate((10, 12, 15, 15, 21, 4, 5, 6, 20, 35, 56), start=21)) | {92: 64, 93: 125}
"""Nodes of an element of each type."""

Elements = list[tuple[int, Ints]]
"""Blocks of elements: Gmsh's element type, and the tags of the nodes (m, k)."""


def read_msh(path: Path, content: bytes) -> Polygons:
    """The faces in `content`. InputError names `path` and the fault."""
    try:
        form, offset = "", 0
        tags, points, elements = np.zeros(0, np.int64), np.zeros((0, 3)), []
        while (offset := content.find(b"$", offset)) >= 0:
            line = content.find(b"\n", offset)
            if line < 0:
                break
            name = content[offset + 1 : line].strip()
            if name == b"MeshFormat":
                end = content.find(b"\n", line + 1)
                form, binary, size = content[line + 1 : end].decode("latin-1").split()
                if form not in ("2", "2.1", "2.2", "4", "4.0", "4.1"):
                    raise ValueError(f"version {form} is not 2, 4.0 or 4.1")
                if size not in ("4", "8"):
                    raise ValueError(f"sizes of {size} bytes")
                numbers = _Bytes(content, end + 1, int(size)) if int(binary) else None
            elif name in (b"Nodes", b"Elements"):
                if not form:
                    raise ValueError("no $MeshFormat before the mesh")
                text = content[line + 1 : _find_end(name, content, line)]
                source = _Words(text) if numbers is None else numbers.seek(line + 1)
                if name == b"Nodes":
                    tags, points = _nodes_2(source) if form[0] == "2" else _nodes_4(source, form == "4.1")
                else:
                    elements = _elements_2(source) if form[0] == "2" else _elements_4(source, form == "4.1")
                line = max(line, source.offset)
            offset = _find_end(name, content, line) + 4 + len(name)
        return _polygons(tags, points, elements)
    except (ValueError, IndexError, KeyError, OverflowError) as error:
        raise InputError(f"{path} cannot be read as msh ({type(error).__name__}: {error}).") from error


def _find_end(name: bytes, content: bytes, offset: int) -> int:
    end = content.find(b"$End" + name, offset)
    if end < 0:
        raise ValueError(f"${name.decode('latin-1')[:20]} does not end")
    return end


class _Words:
    """Numbers in the text of one section."""

    offset = 0

    def __init__(self, text: bytes) -> None:
        self.words, self.taken = text.split(), 0

    def take(self, kind: str, count: int) -> np.ndarray:
        """The next `count` numbers of a kind: "int", "size" or "double"."""
        words = self._next(count)
        if kind == "double":
            return np.array([float(word) for word in words])
        return np.array([int(word) for word in words], np.int64)

    def rows(self, count: int, ints: int, doubles: int) -> tuple[Ints, Floats]:
        """`count` rows of whole numbers, then of others."""
        width = ints + doubles
        words = self._next(count * width)
        whole = [int(word) for k in range(ints) for word in words[k::width]]
        others = [float(word) for k in range(ints, width) for word in words[k::width]]
        return np.array(whole, np.int64).reshape(ints, count).T, np.array(others, float).reshape(doubles, count).T

    def _next(self, count: int) -> list[bytes]:
        words = self.words[self.taken : self.taken + max(count, 0)]
        if count != len(words):
            raise ValueError(f"{count} numbers are declared, {len(words)} are there")
        self.taken += count
        return words


class _Bytes:
    """Binary numbers; a 1 at `offset` gives the byte order."""

    def __init__(self, content: bytes, offset: int, size: int) -> None:
        self.content, self.offset = content, offset
        self.order = "<" if content[offset : offset + 4] == b"\1\0\0\0" else ">"
        self.kinds = {"int": "i4", "size": f"u{size}", "double": "f8"}

    def seek(self, offset: int) -> "_Bytes":
        """The numbers from `offset` on."""
        self.offset = offset
        return self

    def take(self, kind: str, count: int) -> np.ndarray:
        """The next `count` numbers of a kind: "int", "size" or "double"."""
        return self._take(np.dtype(self.order + self.kinds[kind]), count)

    def rows(self, count: int, ints: int, doubles: int) -> tuple[Ints, Floats]:
        """`count` rows of whole numbers, then of others."""
        row = np.dtype([("ints", self.order + "i4", ints), ("doubles", self.order + "f8", doubles)])
        table = self._take(row, count)
        return table["ints"].astype(np.int64), table["doubles"].astype(float)

    def _take(self, kind: np.dtype, count: int) -> np.ndarray:
        there = (len(self.content) - self.offset) // kind.itemsize
        if not 0 <= count <= there:
            raise ValueError(f"{count} numbers are declared, {there} are there")
        values = np.frombuffer(self.content, kind, count, self.offset) if count else np.zeros(0, kind)
        self.offset += values.nbytes
        return values.astype(np.int64) if kind.kind in "iu" else values


Source = _Words | _Bytes


def _nodes_2(source: Source) -> tuple[Ints, Floats]:
    count = _count_2(source)
    tags, points = source.rows(count, 1, 3)
    return tags.ravel(), points


def _count_2(source: Source) -> int:
    """The count, which is text in a binary file, too."""
    if isinstance(source, _Words):
        return _count(source)
    end = source.content.find(b"\n", source.offset)
    count, source.offset = int(source.content[source.offset : end]), end + 1
    return count


def _count(source: Source, of_header: int = 1) -> int:
    """The first of the next `of_header` counts."""
    count = int(source.take("size", of_header)[0])
    if count < 0:
        raise ValueError(f"a count of {count}")
    return count


def _nodes_4(source: Source, latest: bool) -> tuple[Ints, Floats]:
    blocks = _count(source, 4 if latest else 2)
    tags, points = [np.zeros(0, np.int64)], [np.zeros((0, 3))]
    for _ in range(blocks):
        dimension, other, parametric = source.take("int", 3).tolist()
        count = _count(source)
        width = 3 + ((dimension if latest else other) if parametric else 0)
        if not 3 <= width <= 6:
            raise ValueError(f"nodes of {width} numbers")
        if latest:
            tags.append(source.take("size", count))
            points.append(source.take("double", count * width).reshape(count, width)[:, :3])
        else:
            numbers, coordinates = source.rows(count, 1, width)
            tags.append(numbers.ravel())
            points.append(coordinates[:, :3])
    return np.concatenate(tags), np.concatenate(points)


def _elements_4(source: Source, latest: bool) -> Elements:
    count_of_blocks = _count(source, 4 if latest else 2)
    blocks = []
    for _ in range(count_of_blocks):
        kind = int(source.take("int", 3)[2])
        count, width = _count(source), 1 + CORNERS[kind]
        rows = source.take("size" if latest else "int", count * width).reshape(count, width)
        blocks.append((kind, rows[:, 1:]))
    return blocks


def _elements_2(source: Source) -> Elements:
    """Blocks of version 2: in text each element is a row; in binary, elements of one type have a common header."""
    left, blocks = _count_2(source), []
    if isinstance(source, _Words):
        for _ in range(left):
            _, kind, marks = source.take("int", 3).tolist()
            source.take("int", marks)
            blocks.append((kind, source.take("int", CORNERS[kind])[None]))
        return blocks
    while left > 0:
        kind, count, marks = source.take("int", 3).tolist()
        width = 1 + marks + CORNERS[kind]
        if count < 1 or marks < 0:
            raise ValueError(f"a block of {count} elements with {marks} tags")
        blocks.append((kind, source.take("int", count * width).reshape(count, width)[:, 1 + marks :]))
        left -= count
    return blocks


def _polygons(tags: Ints, points: Floats, elements: Elements) -> Polygons:
    order = np.argsort(tags, kind="stable")
    known = tags[order]
    if (known[1:] == known[:-1]).any():
        raise ValueError(f"node {known[1:][known[1:] == known[:-1]][0]} is given twice")
    corners, sizes, ignored = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], Counter[int]()
    for kind, nodes in elements:
        if kind not in FACES:
            ignored[kind] += len(nodes)
            continue
        rank = np.searchsorted(known, nodes.ravel())
        missing = (rank == len(known)) | (known[np.minimum(rank, len(known) - 1)] != nodes.ravel())
        if missing.any():
            raise ValueError(f"node {nodes.ravel()[missing][0]} is named, but not there")
        corners.append(order[rank])
        sizes.append(np.full(len(nodes), nodes.shape[1]))
    starts = np.concatenate([[0], np.cumsum(np.concatenate(sizes))]).astype(np.int64)
    messages = [f"{count} elements of Gmsh's kind {kind} ignored" for kind, count in sorted(ignored.items())]
    return Polygons(np.ascontiguousarray(points, float), np.concatenate(corners), starts, messages=tuple(messages))
