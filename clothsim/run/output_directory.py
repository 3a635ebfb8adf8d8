"""Output directory of a run: made, locked, and cleared of an earlier run on request only."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from clothsim.base.errors import InputError
from clothsim.base.file_writing import make_directory
from clothsim.base.record import RECORD_NAME, SUMMARY_NAME
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME
from clothsim.files.runs.run_lock import locked
from clothsim.files.runs.trajectory import TRAJECTORY_NAME

RUN_FILES = (TRAJECTORY_NAME, RECORD_NAME, SUMMARY_NAME, CHECKPOINT_NAME)


@contextmanager
def new_output(directory: Path, overwrite: bool) -> Iterator[None]:
    """Make and lock a directory for a new run; a link among its files is replaced, not followed.

    InputError where it cannot be made, another run writes there, or it holds an earlier run without `overwrite`.
    """
    make_directory(directory)
    with locked(directory):
        refuse_earlier_run(directory, overwrite)
        for file in (directory / name for name in RUN_FILES):  # a checkpoint must not meet another run's trajectory
            _remove(file)
        yield


@contextmanager
def continued_output(directory: Path) -> Iterator[None]:
    """Lock the directory of a run that goes on. InputError where another run writes there, or a file is a link."""
    with locked(directory):
        for file in (directory / name for name in RUN_FILES):
            if file.is_symlink():
                raise InputError(f"{file} is a link, and a run writes no file outside of its directory.", "Copy it.")
        yield


def refuse_earlier_run(directory: Path, overwrite: bool) -> None:
    """InputError where the directory holds an earlier run that may not be overwritten."""
    if overwrite:
        return
    unfinished = os.path.isfile(directory / CHECKPOINT_NAME) and not os.path.isfile(directory / SUMMARY_NAME)
    if any(os.path.isfile(directory / name) for name in (SUMMARY_NAME, TRAJECTORY_NAME)) and not unfinished:
        raise InputError(
            f"{directory} holds an earlier run.", "Choose another directory with -o, or replace it: --overwrite."
        )
    if unfinished:
        raise InputError(
            f"{directory} holds a run that was stopped before its end.",
            f"Continue it with `clothsim resume {directory}`, or replace it: --overwrite.",
        )


def _remove(file: Path) -> None:
    """Delete a file of an earlier run, or a link in its place."""
    try:
        file.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{file} cannot be replaced: {error.strerror}.", "Choose another directory.") from error
