"""Values over the cloth in NumPy files: a text that ends in .npy is replaced by the file's array."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_numbers
from clothsim.keys.key_table import KeyTable

ENDING = ".npy"


def with_arrays(where: str, value: Any, directory: Path) -> Any:
    """A value with the arrays of the .npy files that its tables name; the value itself where they name none.

    Parameters
    ----------
    where : str
        Dotted name of the value, for messages.
    value : Any
        A section, a table, or one of its values.
    directory : Path
        Folder at which relative file names start.

    Raises
    ------
    InputError
        Where a file is missing or has no numeric data.
    """
    if isinstance(value, Mapping):
        read = {key: with_arrays(f"{where}.{key}", inner, directory) for key, inner in value.items()}
        if all(read[key] is inner for key, inner in value.items()):
            return value
        return type(value).parsed(where, read) if isinstance(value, KeyTable) else read
    return _read(where, directory / value) if names_array(value) else value


def names_array(value: Any) -> bool:
    """True for the name of a file of numbers."""
    return isinstance(value, str) and value.endswith(ENDING)


def named_arrays(where: str, table: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], str]]:
    """Each key of nested tables that names a file of numbers: what has it, its table, the key."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from named_arrays(f"{where}_{key}", value)
        elif names_array(value):
            yield f"{where}_{key}", table, key


def _read(where: str, path: Path) -> Any:
    if not path.name.isprintable():
        raise InputError(f"{where} is {path.name!r}, which names no file.", "Name a .npy file.")
    try:
        return read_numbers(path)
    except InputError as error:
        remedy = error.remedy or f"Its path starts at {path.parent}/: correct {where}."
        raise InputError(f"{where}: {error.sentence}", remedy) from error
