"""Directories that are made, and can be written."""

import os
from pathlib import Path

from clothsim.base.errors import InputError


def make_directory(directory: Path) -> None:
    """Make a directory where there is none. InputError where it cannot be made or written."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"{directory} cannot be made a directory: {reason}.", "Choose another with -o.") from error
    if not os.access(directory, os.W_OK | os.X_OK):
        raise InputError(f"{directory} cannot be written.", "Choose another with -o.")
