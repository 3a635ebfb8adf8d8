"""Tables of a scene by the content of the files that they name."""

import hashlib
from functools import cache
from pathlib import Path
from typing import Any

from clothsim.scene.overrides import FILES


def by_content(value: Any, folder: Path, key: str = "") -> Any:
    """Tables whose names of files are replaced by hashes of their content."""
    if isinstance(value, dict):
        return {name: by_content(inner, folder, name) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [by_content(inner, folder, key) for inner in value]
    if isinstance(value, str) and key in FILES and "." in value and (folder / value).is_file():
        file = folder / value
        return _file_hash(file, file.stat().st_mtime_ns)
    return value


@cache
def _file_hash(file: Path, changed: int) -> str:
    """sha256 of a file; changed: time of its last change, so that a process reads it once."""
    return f"sha256:{hashlib.sha256(file.read_bytes()).hexdigest()}"
