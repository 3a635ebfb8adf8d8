"""Trajectory of a run: `trajectory.vtkhdf`, every cloth and body at every frame."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from clothsim.base.arrays import Floats, Ints, as_points
from clothsim.base.errors import InputError
from clothsim.base.file_writing import ClosingWriter, require_space, writing
from clothsim.files.runs.vtkhdf import (
    STRETCHES,
    FrameArray,
    arrays_for,
    arrays_of,
    blocks,
    frame_size_bound,
    grow_tables,
    lay_out,
    layout_size_bound,
    rows_of,
    set_frame_count,
    truncate,
    write_frame,
)
from clothsim.mesh.world import NO_EDGES, SurfaceRows, check_surfaces, same_surfaces

TRAJECTORY_NAME = "trajectory.vtkhdf"


class TrajectoryWriter(ClosingWriter):
    """A writer of frames; after each of them the file on disk is complete."""

    def __init__(
        self,
        path: str | Path,
        surfaces: Sequence[SurfaceRows],
        resume_at: int | None = None,
        stretches: bool = True,
        fields: Sequence[FrameArray] = (),
    ) -> None:
        """Create the file at `path`, or continue it after its first `resume_at` frames; later ones are dropped.

        Parameters
        ----------
        path : str or Path
            The file.
        surfaces : sequence of SurfaceRows
            Cloths, then bodies, in the order of their rows of x.
        resume_at : int, optional
            Number of frames to keep of an existing file.
        stretches : bool
            True where each frame holds the principal stretches of the cloths' triangles.
        fields : sequence of FrameArray
            Further arrays that each frame holds on the cloths or on the bodies.

        Raises
        ------
        InputError
            The file cannot be written, has fewer frames, or other surfaces or fields.
        """
        check_surfaces(surfaces)
        self.surfaces = tuple(surfaces)
        self.arrays = (*([STRETCHES] if stretches else []), *fields)
        start = _create if resume_at is None else _resume
        self._path = Path(path)
        self._file = start(self._path, self.surfaces, self.arrays, resume_at or 0)

    @property
    def n_frames(self) -> int:
        """Number of frames in the file."""
        return int(self._file["VTKHDF/Steps"].attrs["NSteps"])

    def append(
        self,
        time: float,
        positions: ArrayLike,
        principal_stretches: ArrayLike | None = None,
        fields: Mapping[str, ArrayLike] | None = None,
    ) -> None:
        """Write one frame.

        Parameters
        ----------
        time : float
            Later than the last frame [s].
        positions : (N, 3) array_like
            Rows of x [m]; those after the last surface, the ghosts of clamps, are not written.
        principal_stretches : (m, 2) array_like, optional
            Of all triangles of cloths.
        fields : mapping of str to (m, ...) or (n, ...) array_like
            The values of each further array, for all triangles or vertices of the cloths, or of the bodies.

        Raises
        ------
        InputError
            A position is not finite, an array has another shape, or the disk is full; the file then ends with the frame
            before.
        """
        x = as_points("positions", positions)
        if len(x) < self.surfaces[-1].rows.stop:
            raise InputError(f"positions has {len(x)} rows, the surfaces have {self.surfaces[-1].rows.stop}.")
        frame = self.n_frames
        if not np.isfinite(time) or (frame and time <= self._file["VTKHDF/Steps/Values"][frame - 1]):
            raise InputError(f"Frame {frame} is at {time!r} s, which is not later than the frame before it.")
        stretches = {} if principal_stretches is None else {STRETCHES.name: principal_stretches}
        values = {**stretches, **(fields or {})}
        names = [array.name for array in self.arrays]
        if sorted(values) != sorted(names):
            raise InputError(
                f"This trajectory is written with {', '.join(names) or 'no field'}, "
                f"not with {', '.join(values) or 'none'}."
            )
        parts = {}
        for array in self.arrays:
            own = [surface for surface in self.surfaces if surface.role == array.role]
            rows = np.asarray(values[array.name], dtype=np.float32)
            ends = np.cumsum([0, *(array.row_count(surface) for surface in own)])
            if rows.shape != (ends[-1], *array.components):
                raise InputError(
                    f"{array.name} must have shape {(int(ends[-1]), *array.components)}, not {rows.shape}."
                )
            flat = rows.reshape(len(rows), math.prod(array.components)) if array.components else rows
            for surface, start, stop in zip(own, ends[:-1], ends[1:], strict=True):
                parts[surface.name, array.name] = flat[start:stop]
        require_space(self._path, frame_size_bound(self.surfaces, self.arrays))
        with writing(self._path):
            grow_tables(self._file, frame)
            for surface, block in zip(self.surfaces, blocks(self._file), strict=True):
                if surface.moving or frame == 0:
                    write_frame(block, "Points", frame, x[surface.rows])
                for array in arrays_for(surface, self.arrays):
                    write_frame(block, array.dataset, frame, parts[surface.name, array.name])
            # First the frame, then the number of frames: readers never see an incomplete one.
            self._file.flush()
            set_frame_count(self._file, frame + 1, float(time))
            self._file.flush()


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The frames of a run, read on demand: times (k,) [s] and surfaces, cloths first."""

    path: Path
    times: Floats
    surfaces: tuple[SurfaceRows, ...]

    @property
    def cloth_names(self) -> tuple[str, ...]:
        """The names of the cloths, in the order of their vertices."""
        return tuple(surface.name for surface in self.surfaces if surface.role == "cloth")

    @cached_property
    def triangles(self) -> Ints:
        """The triangles of all cloths, (m, 3)."""
        none = np.zeros((0, 3), np.int64)
        return np.concatenate([none, *(surface.triangles for surface in self.surfaces if surface.role == "cloth")])

    def positions(self, frame: int) -> Floats:
        """The vertices of all cloths in a frame, (n, 3) [m]; negative frames count from the end."""
        return np.concatenate([np.zeros((0, 3)), *(points for surface, points in self._points(frame, "cloth"))])

    def bodies(self, frame: int) -> list[tuple[str, Floats, Ints]]:
        """Each body in a frame: name, vertices (n, 3) [m], triangles (m, 3) of its own vertices."""
        return [(body.name, points, body.own_triangles) for body, points in self._points(frame, "body")]

    def stretches(self, frame: int) -> NDArray[np.float32]:
        """The principal stretches of the cloths' triangles in a frame, (m, 2); InputError where none were written."""
        return self.field(STRETCHES.name, frame)

    @property
    def fields(self) -> tuple[str, ...]:
        """The names of the arrays that the frames hold beside the positions."""
        with _opened(self.path) as file:
            return tuple(dict.fromkeys(array.name for block in blocks(file) for array in arrays_of(block)))

    def field(self, name: str, frame: int) -> NDArray[np.float32]:
        """The values of a field in a frame, (m, ...) or (n, ...); InputError where none were written."""
        i, parts = self._number(frame), []
        with _opened(self.path) as file:
            for block in blocks(file):
                for array in arrays_of(block):
                    if array.name == name:
                        rows = rows_of(block, array)
                        parts.append(block[array.dataset][i * rows : (i + 1) * rows].reshape(rows, *array.components))
        if not parts:
            raise InputError(f"{self.path} holds no {name}.")
        return np.concatenate(parts)

    def _points(self, frame: int, role: str) -> list[tuple[SurfaceRows, Floats]]:
        i, points = self._number(frame), []
        with _opened(self.path) as file:
            for surface, block in zip(self.surfaces, blocks(file), strict=True):
                if surface.role == role:
                    first = i * surface.n_vertices if surface.moving else 0
                    points.append((surface, block["Points"][first : first + surface.n_vertices]))
                    if points[-1][1].shape != (surface.n_vertices, 3):
                        raise ValueError(f"{surface.name} has no frame {frame}")
        return points

    def _number(self, frame: int) -> int:
        k = len(self.times)
        if not isinstance(frame, int | np.integer):
            raise InputError(f"A frame is a whole number from {-k} to {k - 1}, not {frame!r}.", "The last one is -1.")
        if not -k <= frame < k:
            raise InputError(f"There is no frame {frame}: {self.path} holds {k} frames.", f"Give 0 to {k - 1}.")
        return int(frame) % k


def read_trajectory(path: str | Path) -> Trajectory:
    """Open a file of `TrajectoryWriter`, also one that is still written or was cut short.

    InputError where the file is missing, broken or another program's.
    """
    with _opened(Path(path)) as file:
        steps = file["VTKHDF/Steps"]
        surfaces: list[SurfaceRows] = []
        start = 0
        for block in blocks(file):
            stop = start + int(block["NumberOfPoints"][0])
            triangles = block["Polygons/Connectivity"][:].reshape(-1, 3) + start
            name, role, moving = (block.attrs[key] for key in ("Name", "Role", "Moving"))
            rigid = bool(block.attrs.get("Rigid", 0))
            edges, radius = NO_EDGES, float(block.attrs.get("Radius", 0.0))
            if radius:
                edges = block["Lines/Connectivity"][:].reshape(-1, 2) + start
            surfaces.append(SurfaceRows(name, role, slice(start, stop), triangles, bool(moving), rigid, edges, radius))
            if triangles.size and not start <= triangles.min() <= triangles.max() < stop:
                raise ValueError(f"{name} has triangles of vertices that are not there")
            start = stop
        check_surfaces(surfaces)
        return Trajectory(Path(path), steps["Values"][: int(steps.attrs["NSteps"])], tuple(surfaces))


def _create(path: Path, surfaces: tuple[SurfaceRows, ...], arrays: tuple[FrameArray, ...], frames: int) -> h5py.File:
    try:
        # Without a lock, so that a viewer may look at a run while it goes on.
        file = h5py.File(path, "w", locking=False)
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error}).") from error
    try:
        require_space(path, layout_size_bound(surfaces, arrays))
        with writing(path):
            lay_out(file, surfaces, arrays)
            file.flush()
    except InputError:
        with suppress(OSError, RuntimeError):
            file.close()
        path.unlink(missing_ok=True)  # a run that goes on without a trajectory begins another one
        raise
    return file


def _resume(path: Path, surfaces: tuple[SurfaceRows, ...], arrays: tuple[FrameArray, ...], frames: int) -> h5py.File:
    trajectory = read_trajectory(path)
    if not 0 <= frames <= len(trajectory.times):
        raise InputError(f"{path} holds {len(trajectory.times)} frames, so no run can continue from frame {frames}.")
    with _opened(path) as file:
        stored = {array for block in blocks(file) for array in arrays_of(block)}
    wanted = {array for array in arrays if any(surface.role == array.role for surface in surfaces)}
    if stored != wanted or not same_surfaces(trajectory.surfaces, surfaces):
        raise InputError(f"{path} holds other surfaces or fields than this run.", "Write to another directory.")
    require_space(path, frame_size_bound(surfaces, arrays))
    with writing(path):
        file = h5py.File(path, "r+", locking=False)
        truncate(file, frames)
    return file


@contextmanager
def _opened(path: Path) -> Iterator[h5py.File]:
    if not path.is_file():
        raise InputError(f"There is no file {path}.")
    try:
        with h5py.File(path, "r", locking=False) as file:
            yield file
    except (OSError, KeyError, RuntimeError, ValueError, TypeError) as error:
        raise InputError(f"{path} is broken or not the trajectory of a run ({error}).") from error
