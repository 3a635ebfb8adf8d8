"""Lock file of an output directory: one process at a time writes a run there."""

import json
import os
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from clothsim.base.errors import InputError

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

LOCK_NAME = "run.lock"

_ATTEMPTS = 5
"""Tries to take a lock that others take and give back at the same time."""

_LOCKED_BYTE = 4096
"""Byte that Windows locks, behind the text, which stays readable."""


@contextmanager
def locked(directory: Path) -> Iterator[None]:
    """Hold the lock of a directory; the file goes at the end.

    The operating system gives the lock up when its process ends, however it ends: what a killed process left is taken
    over. A lock that names another host is left alone, since not every shared file system passes locks between hosts.

    Parameters
    ----------
    directory : Path
        An existing directory.

    Raises
    ------
    InputError
        Another run writes there (its process, host and start are named), or the file cannot be written.
    """
    path = directory / LOCK_NAME
    try:
        handle = _taken(path, directory)
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror}).", "Choose another directory.") from error
    try:
        yield
    finally:
        if sys.platform != "win32":  # before it is given up: the next one makes its own file
            path.unlink(missing_ok=True)
        os.close(handle)
        if sys.platform == "win32":  # an open file stays there
            with suppress(OSError):
                path.unlink()


def _taken(path: Path, directory: Path) -> int:
    """File descriptor of the lock, held. InputError where another one holds it."""
    for _ in range(_ATTEMPTS):
        handle = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o644)
        try:
            if not _exclusive(handle):
                raise _refusal(directory, _content(handle))
            if not _is_at(handle, path):  # removed by the one that gave it up, between these two lines
                os.close(handle)
                continue
            left = _content(handle)
            if left and left.get("host") != platform.node():
                raise _refusal(directory, left)
            now = datetime.now(UTC).isoformat(timespec="seconds")
            os.ftruncate(handle, 0)
            os.lseek(handle, 0, os.SEEK_SET)
            os.write(handle, json.dumps({"pid": os.getpid(), "host": platform.node(), "started": now}).encode())
        except BaseException:
            os.close(handle)
            raise
        return handle
    raise InputError(f"{directory} keeps being locked by other processes.", "Choose another directory.")


def _exclusive(handle: int) -> bool:
    """True where the lock of the open file was free and is now held; threads of one process exclude each other too."""
    try:
        if sys.platform == "win32":
            os.lseek(handle, _LOCKED_BYTE, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    return True


def _is_at(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False


def _content(handle: int) -> dict[str, Any]:
    """What the file says of its process; empty where it says nothing."""
    os.lseek(handle, 0, os.SEEK_SET)
    try:
        found = json.loads(os.read(handle, _LOCKED_BYTE))
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _refusal(directory: Path, holder: dict[str, Any]) -> InputError:
    pid, host, started = (holder.get(key, "unknown") for key in ("pid", "host", "started"))
    away = host not in (platform.node(), "unknown")
    known = f"process {pid} on {host}, since {started}"
    if away:
        return InputError(
            f"{directory} is being written by {known}, which cannot be checked from here.",
            f"Choose another directory, or delete {LOCK_NAME} if that process has ended.",
        )
    return InputError(f"{directory} is being written by {known}.", "Choose another directory, or wait for its end.")
