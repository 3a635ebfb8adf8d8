"""Canonical garments of a run: its frames brought back to the rest pose of the body model, and their inverse."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_array

from clothsim import Scene
from clothsim.base.arrays import Floats, Ints, write_arrays
from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_arrays
from clothsim.engine import character_of_scene
from transfer.body_model import PosedBody
from transfer.canonical import kernel_average, unposed_in_field
from transfer.errors import TransferError

if TYPE_CHECKING:
    from clothsim import Run

_AS_THEY_ARE = ("positions", "residuals", "times", "triangles", "starts", "body", "body_triangles")
_ARRAYS = (*_AS_THEY_ARE, "names", "field", "row_values", "row_columns", "row_starts")
_REMEDY = "Write it with `clothsim unpose RUN -o canonical.npz`."


@dataclass(frozen=True, eq=False)
class CanonicalGarments:
    """Frames of the cloths of a run in the rest pose of their body.

    Attributes
    ----------
    positions : (f, k, 3) ndarray [m]
        Canonical positions of each frame, in the axes of the body model; all cloths one after the other.
    residuals : (f, k) ndarray [m]
        Distance of their posed positions from those of the run.
    times : (f,) ndarray [s]
    triangles : (m, 3) ndarray
    starts : (c + 1,) ndarray
        First row of each cloth, and the number of rows.
    names : tuple of str
        Of the cloths.
    body : (n, 3) ndarray [m]
        The body model's vertices of the run, in its rest pose.
    body_triangles : (b, 3) ndarray
    rows : csr_array (k, n)
        Averages of the body's vertices at those of the garments at time 0.
    field : bool
        The positions belong to averages at themselves, not to `rows`.
    """

    positions: Floats
    residuals: Floats
    times: Floats
    triangles: Ints
    starts: Ints
    names: tuple[str, ...]
    body: Floats
    body_triangles: Ints
    rows: Any
    field: bool

    def rows_of(self, name: str | None) -> slice:
        """Rows of a cloth; of the only one for None. InputError for another name."""
        if name is None and len(self.names) == 1:
            return slice(0, int(self.starts[1]))
        if name not in self.names:
            sentence = "There are several cloths" if name is None else f"There is no cloth {name!r}"
            raise InputError(f"{sentence}.", f"Name one of: {', '.join(self.names)}.")
        k = self.names.index(name)
        return slice(int(self.starts[k]), int(self.starts[k + 1]))

    def posed(self, frame: int, body: PosedBody) -> Floats:
        """The garments of a frame on a body, (k, 3) [m]: `PlacedCharacter.skinning` of any shape and pose."""
        if not -len(self.times) <= frame < len(self.times):
            raise InputError(f"There is no frame {frame}.", f"There are {len(self.times)}.")
        points, rows = self.positions[frame], self.rows
        if self.field:
            rows = kernel_average(self.body, self.body_triangles).averaging(points)
        return body.posed(points, rows)


def unposed(run: "Run", scene: Scene, field: bool = False) -> CanonicalGarments:
    """The canonical garments of a run.

    Parameters
    ----------
    run : Run
        Of a scene with one body model.
    scene : Scene
        That of the run.
    field : bool
        Take the weights of each canonical position itself, as the paper does, instead of those of the garment's
        vertices at time 0. They have no inverse where two limbs meet: `residuals` says where.

    Raises
    ------
    InputError
        The scene has no body model or several, the run no frames, or a vertex cannot be brought back.
    """
    made, name = character_of_scene(scene)
    if not len(run):
        raise InputError("The run has no frame.", "Run it first.")
    cloths = [surface for surface in run.trajectory.surfaces if surface.role == "cloth"]
    at = np.concatenate([[0], np.cumsum([len(run[0].positions[cloth.name]) for cloth in cloths])])
    starts = [np.concatenate([frame.positions[cloth.name] for cloth in cloths]) for frame in run]
    rows = kernel_average(run[0].bodies[name], made.character.triangles).averaging(starts[0])
    reference = made.character.positions
    average = kernel_average(reference, made.character.triangles) if field else None
    found, residuals = [], []
    for k, (time, points) in enumerate(zip(run.times, starts, strict=True)):
        body = made.skinning(float(time), reference)
        try:
            x = body.unposed(points, rows)
        except TransferError as error:
            raise InputError(f"Frame {k}: {error.sentence}", error.remedy) from error
        off = np.linalg.norm(body.posed(x, rows) - points, axis=1)
        if average is not None:
            in_field = unposed_in_field(body, points, average.averaging, x)
            x, off = in_field.positions, in_field.residuals
        found.append(x)
        residuals.append(off)
    triangles = np.concatenate([cloth.own_triangles + at[k] for k, cloth in enumerate(cloths)])
    return CanonicalGarments(
        np.array(found),
        np.array(residuals),
        np.asarray(run.times),
        triangles,
        at,
        tuple(cloth.name for cloth in cloths),
        reference,
        made.character.triangles,
        rows,
        field,
    )


def write_canonical(path: Path, garments: CanonicalGarments) -> None:
    """Write canonical garments as .npz. InputError where it cannot be written."""
    arrays = {
        **{name: getattr(garments, name) for name in _AS_THEY_ARE},
        "names": np.frombuffer(json.dumps(garments.names).encode(), np.uint8),
        "field": np.array([garments.field], np.uint8),
        "row_values": garments.rows.data,
        "row_columns": garments.rows.indices,
        "row_starts": garments.rows.indptr,
    }
    write_arrays(path, arrays, overwrite=True)


def read_canonical(path: Path) -> CanonicalGarments:
    """The canonical garments of a file. InputError where it is not one, or is broken."""
    arrays = read_arrays(path, list(_ARRAYS))
    missing = [name for name in _ARRAYS if name not in arrays]
    if missing:
        raise InputError(f"{path.name} has no {missing[0]}: it holds no canonical garments.", _REMEDY)
    try:
        names = tuple(json.loads(arrays["names"].astype(np.uint8).tobytes()))
        shape = (len(arrays["positions"][0]), len(arrays["body"]))
        rows = csr_array((arrays["row_values"], arrays["row_columns"], arrays["row_starts"]), shape=shape)
        rows.check_format(full_check=True)
        if len(names) + 1 != len(arrays["starts"]) or len(arrays["times"]) != len(arrays["positions"]):
            raise ValueError("its arrays do not fit")
    except (ValueError, IndexError, TypeError, RecursionError, OverflowError) as error:
        raise InputError(f"{path.name} is broken: {error}.", _REMEDY) from error
    as_they_are = {name: arrays[name] for name in _AS_THEY_ARE}
    return CanonicalGarments(**as_they_are, names=names, rows=rows, field=bool(arrays["field"][0]))
