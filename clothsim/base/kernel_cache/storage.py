"""The folder of compiled kernels: its place on this machine, its reads and atomic writes, its removal of old files.

    <user's cache folder>/clothsim/kernels/<hash of the compiler>/<name>-<hash of the code>-<hash of the types>.kernel

Several processes may read, write and remove at once: a file is whole or not there, and one that is missing is compiled.
"""

import contextlib
import functools
import hashlib
import os
import re
import sys
import time
import warnings
from pathlib import Path
from tempfile import NamedTemporaryFile

DAY = 86400.0
UNUSED_DAYS = 30
"""After so many days without a use a file is removed."""

SUFFIX = ".kernel"
CHECKSUM_BYTES = 16
"""Length of the checksum at the start of a file."""

_FOLDER = re.compile(r"[0-9a-f]{16}")
_SWEPT = "last-removal"
"""Marker file with the time of the last removal of old files, once a day at most."""


def root(chosen: str = "") -> Path | None:
    """The folder of all compiled kernels, which may not exist.

    Parameters
    ----------
    chosen : str
        The user's NUMBA_CACHE_DIR; empty: the platform's cache folder.

    Returns
    -------
    Path or None
        None where the user has no home and chose nothing.
    """
    base = Path(chosen).absolute() if chosen else user_cache()
    return None if base is None else base / "clothsim" / "kernels"


def user_cache() -> Path | None:
    """The platform's cache folder; None where the user has no home."""
    if sys.platform == "win32":
        variable, below_home = "LOCALAPPDATA", ("AppData", "Local")
    elif sys.platform == "darwin":
        variable, below_home = "", ("Library", "Caches")
    else:
        variable, below_home = "XDG_CACHE_HOME", (".cache",)
    named = Path(os.environ.get(variable, ""))
    if named.is_absolute():  # the XDG specification: a relative path is ignored
        return named
    try:
        return Path.home().joinpath(*below_home)
    except RuntimeError:
        return None


def read(path: Path) -> bytes | None:
    """The content of a file, which counts as a use of it; None where it cannot be read or is damaged."""
    try:
        written = path.read_bytes()
        checksum, content = written[:CHECKSUM_BYTES], written[CHECKSUM_BYTES:]
        if checksum != _checksum(content):  # machine code with a wrong byte gives wrong numbers, or ends the process
            return None
        if time.time() - path.stat().st_mtime > DAY:  # a day's precision saves a write for each kernel of each start
            with contextlib.suppress(OSError):  # another user's folder, or one that is only for reading
                os.utime(path)
    except OSError:
        return None
    return content


def write(path: Path, content: bytes) -> bool:
    """Put `content` at `path`, whole or not at all; False, and one warning, where its folder cannot be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with NamedTemporaryFile(dir=path.parent, prefix="writing-", suffix=SUFFIX, delete=False) as beside:
            try:
                beside.write(_checksum(content) + content)
                beside.close()
                os.replace(beside.name, path)
            except BaseException:
                beside.close()
                Path(beside.name).unlink(missing_ok=True)
                raise
    except OSError as error:
        if os.path.exists(path):  # Windows refuses while another process reads the same, written there before
            return True
        reason = error.strerror or str(error)
        warn_once(
            f"{path.parent.parent} cannot be written ({reason}): each process compiles its kernels. "
            "Set NUMBA_CACHE_DIR to a folder that can."
        )
        return False
    return True


def _checksum(content: bytes) -> bytes:
    return hashlib.blake2b(content, digest_size=CHECKSUM_BYTES).digest()


def can_write(folder: Path) -> bool:
    """True where files can be written below `folder`, which is made where it is missing."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        NamedTemporaryFile(dir=folder, prefix="writing-", suffix=SUFFIX).close()
    except OSError:
        return False
    return True


def remove_unused(folder: Path, now: float | None = None) -> list[Path]:
    """Remove the files below `folder` that nobody used for UNUSED_DAYS, at most once a day.

    Only files of this module in folders of this module are removed, and no link is followed.

    folder: as `root` gives it; now: the time [s] since 1970; the clock's by default.
    """
    now = time.time() if now is None else now
    marker = folder / _SWEPT
    removed: list[Path] = []
    with contextlib.suppress(OSError):
        if not folder.is_dir() or (marker.exists() and 0 <= now - marker.stat().st_mtime < DAY):
            return removed
        marker.touch()
        os.utime(marker, (now, now))
        for below in folder.iterdir():
            if _FOLDER.fullmatch(below.name) and below.is_dir() and not below.is_symlink():
                removed += _remove_from(below, now)
    return removed


def _remove_from(folder: Path, now: float) -> list[Path]:
    removed = []
    for file in folder.glob(f"*{SUFFIX}"):
        with contextlib.suppress(OSError):  # already removed, or open in another process (Windows)
            if now - file.lstat().st_mtime > UNUSED_DAYS * DAY:
                file.unlink()
                removed.append(file)
    if removed:
        with contextlib.suppress(OSError):  # not empty
            folder.rmdir()
    return removed


@functools.cache
def warn_once(text: str) -> None:
    """A warning that names no line of code, once in a process: the cache saves time, and is no reason to fail."""
    warnings.warn_explicit(text, RuntimeWarning, filename="clothsim", lineno=0, module="kernel_cache")
