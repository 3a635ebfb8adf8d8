"""Legacy VTK files: the faces of PolyData and of unstructured grids, text or binary, versions 1 to 5.1.

https://docs.vtk.org/en/latest/vtk_file_formats/vtk_legacy_file_format.html; reading stops where the data of points and
cells begin. Binary numbers are big-endian. Up to version 4 a face is its size and its corners; from 5 on the faces are
two arrays, OFFSETS and CONNECTIVITY.
"""

from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.files.meshes.polygons import Polygons

NUMBERS = {"float": ">f4", "double": ">f8", "int": ">i4", "vtktypeint32": ">i4", "long": ">i8", "vtktypeint64": ">i8"}
FACE_TYPES = (5, 7, 9)
"""VTK's cell types of triangle, polygon and quad."""


def read_vtk(path: Path, content: bytes) -> Polygons:
    """The faces in `content`. InputError names `path` and the fault."""
    header = content.split(b"\n", 3)
    if len(header) < 4 or not header[0].startswith(b"# vtk DataFile"):
        raise InputError(f"{path} does not start with '# vtk DataFile'.", "Only legacy .vtk files can be read.")
    try:
        return _Sections(header[3], binary=header[2].strip().upper() == b"BINARY").polygons(path)
    except (ValueError, IndexError, KeyError, OverflowError, MemoryError) as error:
        raise InputError(
            f"{path} cannot be read as legacy VTK ({type(error).__name__}: {str(error)[:100]})."
        ) from error


class _Sections:
    """A cursor in the file."""

    def __init__(self, content: bytes, binary: bool) -> None:
        self.content, self.binary, self.offset = content, binary, 0

    def polygons(self, path: Path) -> Polygons:
        points, messages = np.zeros((0, 3)), []
        faces = (np.zeros(0, np.int64), np.zeros(0, np.int64))
        types = None
        while words := self.words():
            keyword = words[0].upper()
            if keyword == "DATASET" and words[1].upper() not in ("POLYDATA", "UNSTRUCTURED_GRID"):
                raise InputError(f"{path} is a {words[1]}.", "Only POLYDATA and UNSTRUCTURED_GRID hold faces.")
            if keyword == "POINTS":
                points = self.numbers(3 * int(words[1]), words[2]).astype(float).reshape(-1, 3)
            elif keyword in ("POLYGONS", "CELLS"):
                faces = self.faces(int(words[1]), int(words[2]))
            elif keyword in ("VERTICES", "LINES", "TRIANGLE_STRIPS"):
                ignored = self.faces(int(words[1]), int(words[2]))[1]
                messages.append(f"{len(ignored)} {keyword.lower()} ignored")
            elif keyword == "CELL_TYPES":
                types = self.numbers(int(words[1]), "int").astype(np.int64)
            elif keyword == "FIELD":  # numbers about the whole file, such as its time
                for _ in range(int(words[2])):
                    _, width, length, kind = self.words()
                    self.numbers(int(width) * int(length), kind)
            elif keyword in ("POINT_DATA", "CELL_DATA"):
                break
        corners, sizes = faces
        if types is not None:
            keep = np.isin(types, FACE_TYPES)
            corners, sizes = corners[np.repeat(keep, sizes)], sizes[keep]
            messages += [f"{(~keep).sum()} other cells ignored"] if not keep.all() else []
        starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        return Polygons(points, corners, starts, messages=tuple(messages))

    def words(self) -> list[str]:
        """The words of the next line that is not blank; none at the end of the file."""
        while self.offset < len(self.content):
            end = self.content.find(b"\n", self.offset)
            end = len(self.content) if end < 0 else end
            words = self.content[self.offset : end].decode("latin-1").split()
            self.offset = end + 1
            if words:
                return words
        return []

    def numbers(self, count: int, kind: str) -> Floats | Ints:
        """The next `count` numbers."""
        if not 0 <= count <= len(self.content):
            raise ValueError(f"{count} numbers declared")
        number = np.dtype(NUMBERS[kind.lower()])
        if self.binary:
            values = np.frombuffer(self.content, number, count, self.offset)
            self.offset += values.nbytes
            return values
        words: list[bytes] = []
        while len(words) < count:
            if self.offset >= len(self.content):
                raise ValueError(f"the file ends {count - len(words)} numbers early")
            end = self.content.find(b"\n", self.offset)
            end = len(self.content) if end < 0 else end
            words += self.content[self.offset : end].split()
            self.offset = end + 1
        if len(words) > count:
            raise ValueError(f"{len(words)} numbers where {count} were declared")
        return np.array([float(word) for word in words] if number.kind == "f" else [int(word) for word in words])

    def faces(self, count: int, size: int) -> tuple[Ints, Ints]:
        """Corners of all faces, one face after the other, and the number of corners of each."""
        here = self.offset
        words = self.words()
        if words and words[0].upper() == "OFFSETS":
            offsets = self.numbers(count, words[1]).astype(np.int64)
            corners = self.numbers(size, self.words()[1]).astype(np.int64)
            sizes = np.diff(offsets)
            if (sizes < 0).any() or offsets[:1].any() or offsets[-1:].sum() != len(corners):
                raise ValueError("offsets do not fit the connectivity")
            return corners, sizes
        self.offset = here
        table = self.numbers(size, "int").astype(np.int64)
        if not 0 <= count <= len(table):
            raise ValueError(f"{count} faces declared in {len(table)} numbers")
        starts, offset = np.zeros(count, np.int64), 0
        for face in range(count):
            starts[face] = offset
            if table[offset] < 0:
                raise ValueError(f"face {face} has {table[offset]} corners")
            offset += 1 + int(table[offset])
        if offset != len(table):
            raise ValueError(f"faces use {offset} of {len(table)} numbers")
        return np.delete(table, starts), table[starts]
