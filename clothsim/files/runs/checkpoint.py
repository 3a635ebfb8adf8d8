"""Checkpoint: the state of a run between two steps, bit for bit."""

import json
import math
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_regular_file
from clothsim.base.file_writing import write_atomically
from clothsim.solve.stepping.state import Previous, Rest, State

CHECKPOINT_NAME = "checkpoint.npz"
_FORMAT, _EARLIER = "clothsim checkpoint 3", "clothsim checkpoint 2"
"""The format that is written, and an earlier one, which holds one unused number more and is read too."""


@dataclass(frozen=True)
class Checkpoint:
    """What a run needs to go on.

    Parameters
    ----------
    state : State
        Its state between two steps.
    scene_text : str
        The scene, by `Scene.to_text`.
    counters : dict
        Sums of the summary so far, as JSON values.
    files : mapping of str to bytes
        Files that the scene names, by their names in it; empty where they are not kept in the checkpoint.
    """

    state: State
    scene_text: str
    counters: dict[str, Any]
    files: Mapping[str, bytes] = field(default_factory=dict)


def write_checkpoint(path: str | Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint as a NumPy archive, atomically. InputError where it cannot be written."""
    write_atomically(Path(path), packed(checkpoint))


def packed(checkpoint: Checkpoint) -> bytes:
    """The bytes of the NumPy archive that holds a checkpoint."""
    state, previous = checkpoint.state, checkpoint.state.previous
    history = {
        "memory": dict(state.memory),
        "temporal_error": state.temporal_error,
        "slow_steps": state.slow_steps,
        "rest": state.rest.name,
    }
    counters = json.dumps({**history, **checkpoint.counters}, default=lambda number: number.tolist())
    archive = BytesIO()
    more: dict[str, Any] = {}
    if files := checkpoint.files:
        sizes = np.array([len(content) for content in files.values()], np.int64)
        contents = np.frombuffer(b"".join(files.values()), np.uint8)
        more = {"file_names": _text(json.dumps(list(files))), "file_sizes": sizes, "file_contents": contents}
    if previous is not None:
        more |= {
            "previous_positions": np.asarray(previous.positions, np.float64),
            "previous_velocities": np.asarray(previous.velocities, np.float64),
            "previous_dt": np.array([previous.dt]),
        }
    np.savez(
        archive,
        format=_text(_FORMAT),
        times=np.array([state.time, state.dt, state.blocked_at]),
        counts=np.array([state.frame, state.step, state.blocked], np.int64),
        positions=np.asarray(state.positions, np.float64),
        velocities=np.asarray(state.velocities, np.float64),
        scene_text=_text(checkpoint.scene_text),
        counters=_text(counters),
        **more,
    )
    return archive.getvalue()


def read_checkpoint(path: str | Path) -> Checkpoint:
    """Read a checkpoint. InputError where the file is missing, broken or another program's."""
    if not os.path.isfile(path):
        raise InputError(
            f"There is no checkpoint {path}.", "Name the directory that `clothsim run SCENE -o DIR` wrote."
        )
    return unpacked(read_regular_file(path), str(path))


def unpacked(data: bytes, name: str) -> Checkpoint:
    """The checkpoint in the bytes of `packed`. InputError where they hold none; `name` is for its message."""
    try:
        content = BytesIO(data)
        if not zipfile.is_zipfile(content):
            raise ValueError("it is not a NumPy archive, or not all of one")
        with zipfile.ZipFile(content) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > len(content.getvalue()):
                raise ValueError("it would unpack to more than it should")  # NumPy writes it uncompressed
        with np.load(content, allow_pickle=False) as arrays:
            if _string(arrays["format"]) not in (_FORMAT, _EARLIER):
                raise ValueError(f"its format is not {_FORMAT!r}")
            positions, velocities = arrays["positions"], arrays["velocities"]
            if positions.ndim != 2 or positions.shape[1] != 3 or positions.shape != velocities.shape:
                raise ValueError(f"positions {positions.shape} and velocities {velocities.shape} are not (N, 3)")
            times, counts = arrays["times"], arrays["counts"]
            if counts.dtype != np.int64 or any(a.dtype != np.float64 for a in (positions, velocities, times)):
                raise ValueError("its numbers are of other types")
            (time, dt, blocked_at), (frame, step, blocked) = times.tolist(), counts.tolist()
            if not (0 <= time < math.inf and 0 < dt < math.inf and min(frame, step, blocked) >= 0):
                raise ValueError(f"its time is {time} s, its step {dt} s, its counts {counts}")
            scene_text, counters = _string(arrays["scene_text"]), json.loads(_string(arrays["counters"]))
            if not isinstance(counters, dict):
                raise ValueError("its counters are not tables")
            state = State(
                *(time, dt, step, frame, positions, velocities, blocked_at, blocked),
                memory=counters.pop("memory", {}),
                previous=_previous(arrays, positions.shape),
                temporal_error=counters.pop("temporal_error", 0.0),
                slow_steps=counters.pop("slow_steps", 0),
                rest=Rest[counters.pop("rest", Rest.MOVING.name)],
            )
            return Checkpoint(state, scene_text, counters, _files(arrays))
    except Exception as error:  # zipfile, NumPy and JSON raise a dozen types of errors
        raise InputError(
            f"{name} is broken or not a checkpoint ({error}).", "Repeat the run from its scene."
        ) from error


def _previous(arrays: Any, shape: tuple[int, ...]) -> Previous | None:
    """The state a step earlier, where there is one."""
    if "previous_positions" not in arrays:
        return None
    positions, velocities, dts = (arrays[f"previous_{key}"] for key in ("positions", "velocities", "dt"))
    if any(a.dtype != np.float64 for a in (positions, velocities, dts)) or not 0 < (dt := float(dts[0])) < math.inf:
        raise ValueError("the step before it is broken")
    if positions.shape != shape or velocities.shape != shape:
        raise ValueError(f"the step before it has positions {positions.shape}, not {shape}")
    return Previous(positions, velocities, dt)


def _files(arrays: Any) -> dict[str, bytes]:
    """The files that `packed` took."""
    if "file_names" not in arrays:
        return {}
    names, sizes = json.loads(_string(arrays["file_names"])), arrays["file_sizes"].tolist()
    contents = arrays["file_contents"].tobytes()
    if sum(sizes) != len(contents) or min(sizes, default=0) < 0 or len(set(names)) != len(sizes):
        raise ValueError("its files are not complete")
    ends = np.cumsum([0, *sizes])
    return {str(name): contents[a:b] for name, a, b in zip(names, ends[:-1], ends[1:], strict=True)}


def _text(text: str) -> np.ndarray:
    """UTF-8 bytes, as NumPy's own strings lose a NUL at the end."""
    return np.frombuffer(text.encode(), np.uint8)


def _string(array: np.ndarray) -> str:
    if array.dtype != np.uint8:
        raise ValueError("its text is not text")
    return array.tobytes().decode()
