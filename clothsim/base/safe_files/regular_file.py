"""Bytes of a regular file of bounded size: no pipe, no device, no directory."""

from pathlib import Path

from clothsim.base.errors import InputError

MOST_BYTES = 1 << 31


def read_regular_file(path: str | Path, most: int = MOST_BYTES, remedy: str = "") -> bytes:
    """The bytes of a file.

    A pipe that nobody writes to would be waited for without end, and a device (/dev/zero) has none.

    Parameters
    ----------
    path : str or Path
        The file.
    most : int
        Largest size [bytes].
    remedy : str
        What to do where there is no file.

    Raises
    ------
    InputError
        It is missing, no regular file, too large, or cannot be opened.
    """
    file = Path(path)
    try:
        size = file.stat().st_size
        if not file.is_file():
            what = "a directory" if file.is_dir() else "a pipe or a device"
            raise InputError(f"{file} is {what}, no file.", "Name a regular file.")
        if size > most:
            raise InputError(f"{file} has {size / 1e9:,.3g} GB, more than the {most / 1e9:.2g} GB that are read.")
        return file.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"There is no file {file}.", remedy) from error
    except (OSError, ValueError) as error:
        raise InputError(f"{file} cannot be opened ({getattr(error, 'strerror', None) or error}).") from error
