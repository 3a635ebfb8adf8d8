"""Writing of files: what may be replaced, directories made, space reserved, a file replaced as a whole."""

import errno
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Self

from clothsim.base.errors import InputError, MachineError

_FULL = (errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC))
_ZEROS = 1 << 20


def require_space(path: Path, size: int) -> None:
    """Make sure that an open file of another library can grow by `size` bytes; it is as long afterwards as before.

    HDF5 leaves a file that cannot be opened again where a write fails half way, so it must not fail there.

    InputError: the disk, the quota or the limit on the size of files does not leave so much.
    """
    try:
        handle = os.open(path, os.O_WRONLY)
    except OSError as error:
        raise full_or_forbidden(path, error) from error
    length = os.fstat(handle).st_size
    try:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(handle, length, size)
        else:
            os.lseek(handle, length, os.SEEK_SET)
            while size > 0:
                size -= os.write(handle, bytes(min(size, _ZEROS)))
    except OSError as error:
        if error.errno in _FULL:
            raise full_or_forbidden(path, error) from error
        # a file system that cannot reserve space
    finally:
        with suppress(OSError):
            os.ftruncate(handle, length)
        os.close(handle)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Errors of writing to a file, of the system or of h5py, as one MachineError."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        raise full_or_forbidden(path, error) from error


def full_or_forbidden(path: Path, error: Exception) -> MachineError:
    """The error of a file that cannot be written; of a full disk with what to do."""
    text = getattr(error, "strerror", None) or str(error)
    full = getattr(error, "errno", None) in (*_FULL, None)  # h5py's own errors have no number
    remedy = "Choose another name or folder, or change its rights."
    if full:
        remedy = f"Free space, or lift the limit, and continue: clothsim resume {path.parent}"
    return MachineError(f"{path} cannot be written ({text}).", remedy)


def refuse_replacing(files: Iterable[Path], overwrite: bool, inputs: Iterable[object] = ()) -> None:
    """The rule for the output of every command: what is there is replaced with `overwrite` only, an input never.

    files: what the command will write; inputs: what it reads, of which those count that are names of files. InputError
    names the first file that breaks the rule.
    """
    written = list(files)
    places = {file.resolve() for file in written}
    for given in inputs:
        if isinstance(given, str | Path) and Path(given).resolve() in places:
            raise InputError(f"{given} is read, and would be replaced by the output.", "Choose another name with -o.")
    for file in written:
        if file.is_dir():
            raise InputError(f"{file} is a directory.", "Choose another name with -o.")
        if not overwrite and os.path.lexists(file):
            raise InputError(f"{file} exists.", "Choose another name with -o, or replace it: --overwrite.")


def make_directory(directory: Path) -> None:
    """Make a directory where there is none. InputError where it cannot be made or written."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        reason = "it is a file" if os.path.isfile(directory) else reason
        raise MachineError(f"{directory} cannot be made a directory: {reason}.", "Choose another with -o.") from error
    if not os.access(directory, os.W_OK | os.X_OK):
        raise MachineError(f"{directory} cannot be written.", "Choose another with -o.")


def write_atomically(path: Path, content: bytes) -> None:
    """Write `content` to `path` so that a reader sees the old file or the new one, whenever the process is killed.

    InputError where the file cannot be written.
    """
    with replacing(path) as beside, beside.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A file beside `path` that takes its place at the end of the block.

    InputError where a file cannot be written; then what was written is removed.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        try:
            yield beside
            beside.replace(path)
        finally:
            beside.unlink(missing_ok=True)
    except OSError as error:
        raise full_or_forbidden(path, error) from error


class ClosingWriter:
    """A writer of a file that is closed at the end of the `with` block; an exception is passed on."""

    _path: Path
    _file: Any

    def __enter__(self) -> Self:
        """The writer itself."""
        return self

    def __exit__(self, *failure: object) -> None:
        """Close the file."""
        self.close()

    def close(self) -> None:
        """Close the file; what was appended is in it already."""
        with writing(self._path):
            self._file.close()
