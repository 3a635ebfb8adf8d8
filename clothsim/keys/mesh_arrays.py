"""A mesh in memory as the value of a scene's key `mesh`: checked, locked, and written into the text of a scene."""

import base64
import hashlib
import io
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from clothsim.base.arrays import Floats, Ints, as_finite, as_points, as_triangles
from clothsim.base.errors import InputError

# Named panels of a mesh in memory: triangles by name, checked, and as two arrays for the text of a scene.

PANELS, PANEL_OF = "panels", "panel_of"
"""Names of the panels, and the number of the panel of each triangle, -1 for none."""


def checked_groups(where: str, groups: Mapping[str, ArrayLike], n_triangles: int) -> dict[str, Ints]:
    """Read-only triangles of each panel.

    InputError for what is not a table of whole numbers, a triangle out of range, and one in two panels.
    """
    if not isinstance(groups, Mapping):
        raise InputError(f"{where} is of the type {type(groups).__name__}.", "Give a table of triangles by name.")
    taken = np.full(n_triangles, -1)
    found = {}
    for number, (name, given) in enumerate(groups.items()):
        if not isinstance(name, str) or not name or not name.isprintable():
            raise InputError(f"{where} has the name {name!r}, which cannot be printed.", "Give a word.")
        rows = np.array(given)
        if rows.ndim != 1 or (rows.size and rows.dtype.kind not in "iu"):
            raise InputError(f"{where}.{name} must be a list of whole numbers.", "They count triangles from 0.")
        rows = rows.astype(np.int64)
        outside = np.flatnonzero((rows < 0) | (rows >= n_triangles))
        if outside.size:
            raise InputError(
                f"{where}.{name}[{outside[0]}] is {rows[outside[0]]}, but there are {n_triangles} triangles.",
                "They count from 0.",
            )
        twice = rows[taken[rows] >= 0]
        if twice.size:
            other = list(groups)[taken[twice[0]]]
            raise InputError(f"{where}: triangle {twice[0]} is in {other} and in {name}.", "Give each one panel.")
        taken[rows] = number
        rows.setflags(write=False)
        found[name] = rows
    return found


def panel_arrays(groups: Mapping[str, Ints], n_triangles: int) -> dict[str, Any]:
    """Arrays of the panels, which `groups_of` reads back."""
    panel_of = np.full(n_triangles, -1)
    for number, rows in enumerate(groups.values()):
        panel_of[rows] = number
    return {PANELS: np.array(list(groups)), PANEL_OF: panel_of}


def groups_of(arrays: Mapping[str, Any]) -> dict[str, Ints]:
    """Triangles of each panel, in ascending order."""
    panel_of = arrays[PANEL_OF]
    return {str(name): np.flatnonzero(panel_of == number) for number, name in enumerate(arrays[PANELS])}


TEXT = "arrays"
"""The key under which the text of a scene holds the arrays of a mesh."""


@dataclass(frozen=True, eq=False)
class MeshArrays:
    """Vertices and triangles, and the rest shape of a cloth or the frames of a body; all read-only copies.

    Parameters
    ----------
    vertices : (n, 3) ndarray [m]
        Positions before the scene places them.
    triangles : (m, 3) ndarray
        Vertex numbers.
    rest : (n, 3) or (m, 3, 2) ndarray [m], optional
        Rest positions, or the material coordinates of each triangle's corners; None: the vertices.
    frames : (k, n, 3) ndarray [m], optional
        Positions of an animated body in each frame.
    groups : mapping of str to (k,) ndarray
        Triangles of each named panel; none is in two.
    """

    vertices: Floats
    triangles: Ints
    rest: Floats | None = None
    frames: Floats | None = None
    groups: Mapping[str, Ints] = field(default_factory=dict)

    @classmethod
    def checked(
        cls,
        where: str,
        vertices: Any,
        triangles: Any,
        rest: ArrayLike | None = None,
        frames: ArrayLike | None = None,
        groups: Mapping[str, ArrayLike] | None = None,
    ) -> Self:
        """The mesh of arrays.

        InputError for another shape, a number that is not finite or an index out of range: it names array and index.
        """
        name = f"{where}.vertices"
        points = _locked(as_points(name, vertices))
        if not len(points):
            raise InputError(f"{name} is empty.", "Give at least three vertices and one triangle.")
        faces = _locked(as_triangles(f"{where}.triangles", triangles, len(points)))
        if not len(faces):
            raise InputError(f"{where}.triangles is empty.", "Give at least one triangle.")
        material = None if rest is None else as_finite(f"{where}.rest", rest)
        n, m = len(points), len(faces)
        if material is not None and material.shape == (n, 2):
            material = material[faces]  # by corner
        elif material is not None and material.shape not in ((n, 3), (m, 3, 2)):
            raise InputError(
                f"{where}.rest has shape {material.shape}.",
                f"Give ({n}, 2) or ({n}, 3) by vertex, or ({m}, 3, 2) by corner.",
            )
        material = None if material is None else _locked(material)
        moving = None if frames is None else _locked(as_finite(f"{where}.frames", frames))
        if moving is not None and (moving.ndim != 3 or moving.shape[1:] != (len(points), 3) or not len(moving)):
            raise InputError(f"{where}.frames has shape {moving.shape}.", f"Give (frames, {len(points)}, 3).")
        return cls(points, faces, material, moving, checked_groups(f"{where}.groups", groups or {}, len(faces)))

    @property
    def is_flat(self) -> bool:
        """True where the rest shape is material coordinates in the plane."""
        return self.rest is not None and self.rest.ndim == 3

    @cached_property
    def text(self) -> str:
        """The arrays as text, to the last bit: a NumPy archive in base 64."""
        packed = io.BytesIO()
        given = {"rest": self.rest, "frames": self.frames}
        others = {name: array for name, array in given.items() if array is not None}
        if self.groups:
            others |= panel_arrays(self.groups, len(self.triangles))
        np.savez(packed, vertices=self.vertices, triangles=self.triangles, **others)  # type: ignore[arg-type]
        return base64.b64encode(packed.getvalue()).decode("ascii")

    @classmethod
    def from_text(cls, where: str, text: Any) -> Self:
        """The mesh that `text` holds. InputError where it holds none."""
        try:
            packed = io.BytesIO(base64.b64decode(text, validate=True))
            with zipfile.ZipFile(packed) as archive:
                if sum(entry.file_size for entry in archive.infolist()) > len(packed.getvalue()):
                    raise ValueError("they would unpack to more than they hold")  # NumPy writes them uncompressed
            with np.load(packed, allow_pickle=False) as arrays:
                given = {name: arrays[name] for name in ("vertices", "triangles", "rest", "frames") if name in arrays}
                groups = groups_of(arrays) if PANELS in arrays else None
                return cls.checked(where, given.pop("vertices"), given.pop("triangles"), groups=groups, **given)
        except InputError:
            raise
        except Exception as error:  # zipfile and the headers of NumPy raise a dozen types of errors
            raise InputError(
                f"{where}.{TEXT} is not a mesh ({error}).", "It is what a run writes of a mesh in memory; name a file."
            ) from error

    @cached_property
    def _content(self) -> bytes:
        """Digest of all arrays."""
        found = hashlib.blake2b(digest_size=16)
        given = {"vertices": self.vertices, "triangles": self.triangles, "rest": self.rest, "frames": self.frames}
        for name, array in sorted([*given.items(), *((f"group {name}", rows) for name, rows in self.groups.items())]):
            if array is not None:
                found.update(f"{name} {array.dtype.str} {array.shape} ".encode() + array.tobytes())
        return found.digest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, MeshArrays) and self._content == other._content

    def __hash__(self) -> int:
        return hash(self._content)

    def __repr__(self) -> str:
        return f"MeshArrays({len(self.vertices)} vertices, {len(self.triangles)} triangles)"


def _locked(values: Any) -> Any:
    """A read-only copy in C order."""
    copy = np.array(values, order="C")
    copy.setflags(write=False)
    return copy
