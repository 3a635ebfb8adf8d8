"""A run opened from its directory, also one that failed, was stopped, or is still going."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy import float32
from numpy.typing import NDArray

from clothsim.arrays import Floats, Ints
from clothsim.errors import InputError
from clothsim.io.record import RECORD_NAME, SUMMARY_NAME, read_record, read_summary
from clothsim.io.trajectory import TRAJECTORY_NAME, Trajectory, read_trajectory

_INTERRUPTED = {"status": "interrupted", "reason": "The run was stopped before its end, or is still going."}


@dataclass(frozen=True)
class Run:
    """What a run left in `directory`: its frames and its `summary` (empty where it never came to its end)."""

    directory: Path
    trajectory: Trajectory
    summary: dict[str, Any]

    @property
    def status(self) -> str:
        """How it ended: "completed", "failed" or "interrupted"."""
        return str((self.summary or _INTERRUPTED)["status"])

    @property
    def reason(self) -> str:
        """The sentence that goes with the status."""
        return str((self.summary or _INTERRUPTED).get("reason", ""))

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

    def positions(self, frame: int) -> Floats:
        """The vertices of all cloths in a frame, (n, 3) [m]; negative frames count from the end."""
        return self.trajectory.positions(frame)

    def bodies(self, frame: int) -> list[tuple[str, Floats, Ints]]:
        """Each body in a frame: name, vertices (n, 3) [m], triangles (m, 3) of its own vertices."""
        return self.trajectory.bodies(frame)

    def stretches(self, frame: int) -> NDArray[float32]:
        """The principal stretches of the triangles in a frame, (m, 2); InputError where none were written."""
        return self.trajectory.stretches(frame)

    def record(self) -> list[dict[str, Any]]:
        """The entries of the record, one a step; none where the run kept no record."""
        path = self.directory / RECORD_NAME
        return read_record(path) if path.is_file() else []


def open_run(path: str | Path) -> Run:
    """The run in the directory `path`. InputError where it is missing, holds no run, or a file of it is broken."""
    directory = Path(path)
    if not directory.is_dir():
        raise InputError(f"There is no run directory {directory}.")
    if not (directory / TRAJECTORY_NAME).is_file():
        raise InputError(f"{directory} holds no {TRAJECTORY_NAME}, so it is not the output of a run.")
    summary_path = directory / SUMMARY_NAME
    summary = read_summary(summary_path) if summary_path.exists() else {}
    if summary_path.exists() and "status" not in summary:
        raise InputError(f"{summary_path} has no status, so it is not the summary of a run.")
    return Run(directory, read_trajectory(directory / TRAJECTORY_NAME), summary)
