"""The results of a run: a sequence of frames."""

import os
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from operator import index
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.file_writing import refuse_replacing
from clothsim.base.inputs import with_remedies
from clothsim.base.record import RECORD_NAME, SUMMARY_NAME, read_record, read_summary
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint
from clothsim.files.runs.trajectory import TRAJECTORY_NAME, Trajectory, read_trajectory
from clothsim.keys.value_checks import refuse_unknown_key
from clothsim.physics.energies.protocols import with_material_at
from clothsim.run.fields import Configuration, field, known_field
from clothsim.run.pictures import (
    MOVIE_SETTINGS,
    PICTURE_NAME,
    PICTURE_SETTINGS,
    draw_run,
    frame_picture,
    settings_of,
    up_of_run,
)
from clothsim.run.step_reports import forces_of
from clothsim.run.summary import certificate_rows
from clothsim.scene.scene import Scene, scene_from_text

if TYPE_CHECKING:
    from clothsim.run.export import Exported
    from clothsim.run.fields import Configuration
    from clothsim.run.step_reports import Forces
    from clothsim.scene.assembly.scene_world import Built

NO_GRADIENT = "Simulate again: clothsim.simulate(scene, differentiable=True)."
RUN_DIRECTORY = "Name the directory that `clothsim run SCENE -o DIR` or clothsim.simulate wrote."

_INTERRUPTED = {"status": "interrupted", "reason": "The run was stopped before its end, or is still going."}

LARGEST_PICTURE = 2 << 20
"""A larger picture.png is not put into the page of a notebook [bytes]."""


@dataclass(frozen=True)
class Frame:
    """One frame of a run; its arrays are read from the file when they are asked for.

    Attributes
    ----------
    frame : int
        Its number, from 0.
    time : float
        [s].
    """

    trajectory: Trajectory
    frame: int

    def __repr__(self) -> str:
        return f"<Frame {self.frame} at {self.time:g} s>"

    @property
    def time(self) -> float:
        """Time of the frame [s]."""
        return float(self.trajectory.times[self.frame])

    @cached_property
    def positions(self) -> Mapping[str, Floats]:
        """Vertices of each cloth by its name, (n, 3) [m]."""
        points = self.trajectory.positions(self.frame)
        return {each.name: points[each.rows] for each in self.trajectory.surfaces if each.role == "cloth"}

    @cached_property
    def bodies(self) -> Mapping[str, Floats]:
        """Vertices of each body by its name, (n, 3) [m]."""
        return {name: points for name, points, _ in self.trajectory.bodies(self.frame)}


@dataclass(frozen=True, repr=False, eq=False)
class Run(Sequence[Frame]):
    """The results of a run, also of one that failed, was stopped, or is still in progress.

    A sequence of its frames: ``len(run)``, ``run[-1].positions["cloth"]``, ``run[::10]``, ``for frame in run``.

    Attributes
    ----------
    directory : Path
        Directory of the files of the run.
    trajectory : Trajectory
        The file of the frames.
    summary : dict
        The content of summary.json; empty if the run did not come to its end.

    Examples
    --------
    >>> import clothsim
    >>> cloth = clothsim.Cloth([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], velocity=[0, 0, 1])
    >>> scene = clothsim.Scene(cloth, effects=[clothsim.Inertia()], run=clothsim.RunSettings(duration=0.08))
    >>> run = clothsim.simulate(scene, "flight")
    >>> run
    <Run 'flight': completed, 3 frames, to 0.08 s>
    >>> [round(float(frame.positions["cloth"][0, 2]), 12) for frame in run]
    [0.0, 0.04, 0.08]
    >>> run.summary["steps"], clothsim.open_run("flight")[-1].time
    (8, 0.08)
    """

    directory: Path
    trajectory: Trajectory
    summary: dict[str, Any]

    def __len__(self) -> int:
        return len(self.times)

    @overload
    def __getitem__(self, frame: int) -> Frame: ...

    @overload
    def __getitem__(self, frame: slice) -> list[Frame]: ...

    def __getitem__(self, frame: int | slice) -> Frame | list[Frame]:
        if isinstance(frame, slice):
            return [Frame(self.trajectory, k) for k in range(*frame.indices(len(self)))]
        frame = index(frame)  # a float is not a number of a frame
        if not -len(self) <= frame < len(self):
            raise IndexError(f"There is no frame {frame}: the run has {len(self)} frames.")
        return Frame(self.trajectory, frame % len(self))

    def __bool__(self) -> bool:
        return True  # a run without a frame is a run, too

    def __repr__(self) -> str:
        until = f", to {self.times[-1]:g} s" if len(self) else ""
        kinds = [kind.replace("_", " ") for kind, each in self.intersections.items() if each["states"]]
        crossed = f", INTERSECTS ({', '.join(kinds)})" if kinds else ""
        return f"<Run {str(self.directory)!r}: {self.status}, {len(self)} frames{until}{crossed}>"

    def _repr_html_(self) -> str:
        """A table for a notebook, with the picture of the run where it has one."""
        rows = "".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in self._facts())
        picture, file = "", self.directory / PICTURE_NAME
        if file.is_file() and file.stat().st_size <= LARGEST_PICTURE:
            data = b64encode(file.read_bytes()).decode()
            picture = f'<img alt="last frame" width="480" src="data:image/png;base64,{data}">'
        return f"<table>{rows}</table>{picture}"

    def _facts(self) -> list[tuple[str, str]]:
        """Names and values of the table."""
        facts = [("run", str(self.directory)), ("status", self.status), ("reason", self.reason)]
        facts.append(("frames", f"{len(self)}, to {self.times[-1]:g} s" if len(self) else "0"))
        facts += [(name, str(self.summary[name])) for name in ("steps", "newton_iterations") if name in self.summary]
        try:
            return facts + self.certificate_rows
        except KeyError:  # of an earlier version
            certificate = self.summary.get("certificate") or {}
            return facts + [(name.replace("_", " "), str(value)) for name, value in certificate.items()]

    @property
    def status(self) -> str:
        """Status of the run: "completed", "failed" or "interrupted"."""
        return str((self.summary or _INTERRUPTED)["status"])

    @property
    def reason(self) -> str:
        """The reason for the status, as a sentence."""
        return str((self.summary or _INTERRUPTED).get("reason", ""))

    @property
    def intersection_free(self) -> bool | None:
        """True if all pairs of cloths, and of cloth and body, were checked at every step and none intersects.

        False if some do; None if it is not known, for a run without a summary or one that was not checked completely.
        """
        free = (self.summary.get("certificate") or {}).get("intersection_free")
        return free if self.intersections or free is False else None  # older runs did not check cloth with cloth

    @property
    def intersections(self) -> dict[str, Any]:
        """Counts and first occurrence by kind ("cloth_body", "cloth_cloth", "excluded"); empty without a summary."""
        return dict((self.summary.get("certificate") or {}).get("intersections", {}))

    @property
    def up(self) -> tuple[float, ...] | str:
        """The direction against gravity in the scene; "z" if the run's checkpoint has none."""
        return up_of_run(self.directory)

    @property
    def times(self) -> Floats:
        """The times of the frames, (k,) [s]."""
        return self.trajectory.times

    @property
    def triangles(self) -> Ints:
        """The triangles of all cloths, (m, 3)."""
        return self.trajectory.triangles

    @property
    def cloth_names(self) -> tuple[str, ...]:
        """The names of the cloths, in the order of their vertices."""
        return self.trajectory.cloth_names

    @with_remedies()
    def positions(self, frame: int) -> Floats:
        """The vertices of all cloths in a frame, (n, 3) [m]; negative frames count from the end."""
        return self.trajectory.positions(frame)

    def bodies(self, frame: int) -> list[tuple[str, Floats, Ints]]:
        """Each body in a frame: name, vertices (n, 3) [m], triangles (m, 3) of its own vertices."""
        return self.trajectory.bodies(frame)

    def stretches(self, frame: int) -> NDArray[np.float32]:
        """The principal stretches of the triangles in a frame, (m, 2); InputError if none were written."""
        return self.trajectory.stretches(frame)

    def field(self, name: str, frame: int = -1) -> NDArray[np.floating]:
        """Values of a field in a frame, as written by the run or else computed from the positions.

        Parameters
        ----------
        name : str
            A key of `clothsim.run.fields.FIELDS`: "stress", "contact_pressure", "body_pressure", ...; "carried" in
            a run with ``contact.pinch = "carry"``: 1 for a vertex that a body carries through a pinch.
        frame : int
            Number of the frame; negative numbers count from the end.

        Returns
        -------
        ndarray
            (m, ...) for a field of the triangles, (n, ...) of the vertices, (b, ...) of the bodies', in SI units;
            float32 if the run wrote the field (``run.fields`` of the scene), else float64.

        Raises
        ------
        InputError
            For an unknown name, for a contact field that the run did not write, or if the scene in the checkpoint
            cannot be built again.

        Examples
        --------
        >>> import clothsim
        >>> cloth = clothsim.Cloth([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], fabric="denim")
        >>> effects = [clothsim.Inertia(), clothsim.Membrane()]
        >>> settings = clothsim.RunSettings(duration=0.04, fields=["stress"])
        >>> run = clothsim.simulate(clothsim.Scene(cloth, effects=effects, run=settings))
        >>> run.field("stress").shape, run.field("thickness", frame=0)
        ((1, 3, 2), array([0.00062308]))
        """
        if name in self.trajectory.fields:
            return self.trajectory.field(name, frame)
        known_field(name)
        positions, world = self.positions(frame), self._built.world
        if not np.array_equal(self.triangles, world.triangles):
            raise InputError(f"{self.directory} has another mesh than its scene.", "Restore the mesh files.")
        x = world.start()
        x[: len(positions)] = positions - world.origin
        energies = with_material_at(self._built.energies, float(self.times[frame]))
        return field(name, Configuration(world, x, energies))

    @cached_property
    def _built(self) -> "Built":
        """The scene of the checkpoint, built once for all fields."""
        from clothsim.scene.assembly.scene_world import build

        return build(self.scene)

    @property
    def scene(self) -> Scene:
        """The scene of the run, from its checkpoint. InputError if there is none."""
        return scene_from_text(read_checkpoint(self.directory / CHECKPOINT_NAME).scene_text, self.directory)

    @property
    def certificate_rows(self) -> list[tuple[str, str]]:
        """Names and texts of the certificate, with the warnings; empty until the run has ended."""
        return certificate_rows(self.summary) if self.summary else []

    def record(self) -> list[dict[str, Any]]:
        """The entries of the record, one per step; none if the run has no record."""
        path = self.directory / RECORD_NAME
        return read_record(path) if path.is_file() else []

    def forces(self) -> "Forces":
        """Contact force on each body and reaction of each group of pins, at each step; needs ``run.forces``."""
        return forces_of(self.record(), str(self.directory))

    def plot(
        self,
        frame: int = -1,
        path: str | Path | None = None,
        field: str | None = None,
        overwrite: bool = False,
        **settings: Any,
    ) -> np.ndarray | Path:
        """Draw one frame, coloured by its stretch or by another field.

        Parameters
        ----------
        frame : int
            Number of the frame; negative numbers count from the end.
        path : str or Path, optional
            PNG file to write.
        field : str, optional
            A name as in `field`; tensors are drawn by their norm, rotations by their angle, directions as strokes.
        overwrite : bool
            Replace an existing file; otherwise it is an InputError.
        **settings
            size (width, height) in pixels, colour "stretch" or "plain", up and view as (3,) directions (view also
            "front", "back", "left", "right", "top"), renderer "vtk", "ray" or "auto", style "fields", "print" or
            "fabric", limits (low, high) of the colours.

        Returns
        -------
        ndarray or Path
            The picture, (height, width, 3) uint8; with `path` that file.
        """
        refuse_unknown_key("Run.plot", settings, PICTURE_SETTINGS)
        if path is None:
            return frame_picture(self.trajectory, frame, **settings_of(self, field, settings))
        refuse_replacing([Path(path)], overwrite)
        draw_run(self, Path(path), frame, field, **settings)
        return Path(path)

    def movie(
        self,
        path: str | Path,
        progress: Callable[[int, int], None] = lambda done, total: None,
        field: str | None = None,
        overwrite: bool = False,
        **settings: Any,
    ) -> Path:
        """Write a movie of all frames, in real time unless a rate is given.

        Parameters
        ----------
        path : str or Path
            A file that ends in .mp4, .webp or .gif.
        progress : callable, optional
            Called after each frame with the number of drawn frames and of all frames.
        field : str, optional
            As in `plot`.
        overwrite : bool
            As in `plot`.
        **settings
            As in `plot`, frames_per_second, samples (per pixel and direction; 1 is faster and rougher), and follow
            (the camera moves with the cloth).

        Returns
        -------
        Path
            The file. MissingPackageError for a .mp4 file if ffmpeg is not installed.
        """
        refuse_unknown_key("Run.movie", settings, (*PICTURE_SETTINGS, *MOVIE_SETTINGS))
        target = Path(path)
        refuse_replacing([target], overwrite)
        draw_run(self, target, field=field, progress=progress, **settings)
        return target

    def gradient(self, loss: Any) -> Any:
        """Raise an InputError: only `simulate(scene, differentiable=True)` records the steps of a run."""
        raise InputError(f"The run {self.directory} did not record its steps, and has no gradient.", NO_GRADIENT)

    def export(self, path: str | Path, **settings: Any) -> "Exported":
        """Write the frames for other programs, in the format that the ending of the file names.

        Parameters
        ----------
        path : str or Path
            .obj, .ply, .pc2, .mdd, .glb, .usd, .usda, .usdc (with ``clothsim[usd]``) or .vtkhdf.
        **settings
            frame, fps, scale, up, colour and overwrite, as in `clothsim.run.export.export`.

        Returns
        -------
        Exported
            Files, frames, rate, unit, axis and notes. InputError for bad input, MissingPackageError without usd-core.
        """
        from clothsim.run.export import SETTINGS, export

        refuse_unknown_key("Run.export", settings, SETTINGS)
        return export(self, path, **settings)


def open_run(path: str | Path) -> Run:
    """Open the run in a directory.

    Parameters
    ----------
    path : str or Path
        The output directory of `simulate` or ``clothsim run``.

    Returns
    -------
    Run
        Its frames and its summary.

    Raises
    ------
    InputError
        The directory is missing or has no run, or a file of the run is broken.
    """
    directory = Path(path)
    if os.path.isfile(directory):
        raise InputError(f"{directory} is a file, not the directory of a run.", RUN_DIRECTORY)
    if not os.path.isdir(directory):
        raise InputError(f"There is no run directory {directory}.", RUN_DIRECTORY)
    if not (directory / TRAJECTORY_NAME).is_file():
        raise InputError(f"{directory} holds no {TRAJECTORY_NAME}, so it is not the output of a run.", RUN_DIRECTORY)
    summary_path = directory / SUMMARY_NAME
    summary = read_summary(summary_path) if summary_path.exists() else {}
    if summary_path.exists() and "status" not in summary:
        raise InputError(f"{summary_path} has no status, so it is not the summary of a run.")
    return Run(directory, read_trajectory(directory / TRAJECTORY_NAME), summary)
