"""Record and summary of a run: `record.jsonl`, a line a step, and `summary.json`, written once at the end."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_regular_file
from clothsim.base.file_writing import ClosingWriter, write_atomically, writing
from clothsim.base.inputs import shown
from clothsim.base.process_memory import peak_memory

RECORD_NAME = "record.jsonl"
MOVIE_NAME, GIF_NAME = "movie.mp4", "movie.gif"
PICTURE_NAME, FAILURE_NAME = "picture.png", "failure.png"
RUN_PICTURES = (PICTURE_NAME, FAILURE_NAME, MOVIE_NAME, GIF_NAME)
"""Pictures that a run leaves."""
SUMMARY_NAME = "summary.json"
FITTED_NAME = "fitted.obj"
"""Garment that a fit leaves."""

SUMMARY_TYPES: dict[str, tuple[type, ...]] = {
    **dict.fromkeys(("status", "reason", "end"), (str,)),
    **dict.fromkeys(("certificate", "failure"), (dict, type(None))),
    **dict.fromkeys(("notes", "found"), (list,)),
    **dict.fromkeys(("steps", "newton_iterations"), (int, type(None))),
}
"""Types of entries of a summary that readers count on."""


class RecordWriter(ClosingWriter):
    """A writer of one JSON object a line; each line is in the file before `append` returns."""

    def __init__(self, path: str | Path, resume_at: int | None = None) -> None:
        """Create the file at `path`, or continue it after its first `resume_at` lines; later ones are dropped.

        InputError where the file cannot be written or has fewer lines.
        """
        earlier: list[bytes] = []
        if resume_at is not None:
            earlier = read_regular_file(Path(path)).split(b"\n")[:-1]
            if not 0 <= resume_at <= len(earlier):
                raise InputError(f"{path} has {len(earlier)} lines, so no run can go on from line {resume_at}.")
        write_atomically(Path(path), b"".join(line + b"\n" for line in earlier[:resume_at]))
        self._path = Path(path)
        self._file = self._path.open("ab", buffering=0)  # closed by `close`

    def append(self, entry: Mapping[str, Any]) -> None:
        """Write `entry` as one line (numbers as in `to_json`). InputError where the disk is full."""
        with writing(self._path):
            line = to_json(entry).encode() + b"\n"
            while line:  # the last write before a full disk takes a part
                line = line[self._file.write(line) :]


def read_record(path: str | Path) -> list[dict[str, Any]]:
    """The entries of a record, without an incomplete last line. InputError names any other broken line."""
    text, entries = read_regular_file(Path(path)), []
    # A complete line ends with a line break: a run was killed while it wrote what follows the last one.
    for number, line in enumerate(text.split(b"\n")[:-1], start=1):
        entry = _parse(line)
        if entry is None:
            raise InputError(f"{path}, line {number}, is not a JSON object.")
        entries.append(entry)
    return entries


def write_summary(path: str | Path, summary: Mapping[str, Any]) -> None:
    """Write a summary as indented JSON with sorted keys, atomically."""
    write_atomically(Path(path), (to_json(summary, indent=2) + "\n").encode())


def read_summary(path: str | Path) -> dict[str, Any]:
    """Read a summary. InputError where the file is missing or holds no JSON object."""
    summary = _parse(read_regular_file(Path(path)))
    if summary is None:
        raise InputError(f"{path} is not a JSON object.")
    for name, kinds in SUMMARY_TYPES.items():
        if name in summary and not isinstance(summary[name], kinds):
            raise InputError(f"{path} has a {name} that is {shown(summary[name])}.", "Repeat the run from its scene.")
    return summary


def record_peak_memory(path: str | Path) -> int:
    """Write the largest resident memory of this process so far into a summary, which work after it has raised [bytes].

    Returns
    -------
    int
        What the summary says now.
    """
    summary = read_summary(path)
    summary["peak_memory_bytes"] = max(peak_memory(), summary.get("peak_memory_bytes", 0))
    write_summary(path, summary)
    return int(summary["peak_memory_bytes"])


def to_json(value: Any, indent: int | None = None) -> str:
    """`value` as JSON: NumPy numbers and arrays as numbers and lists, inf and nan as null.

    Examples
    --------
    >>> to_json({"gap": float("inf"), "steps": 3})
    '{"gap": null, "steps": 3}'
    """
    return json.dumps(_plain(value), indent=indent, sort_keys=indent is not None, allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, Path):
        return str(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _parse(text: bytes) -> dict[str, Any] | None:
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return value if isinstance(value, dict) else None
