"""Content ids of drapes, hashes of arrays, and the name of the processor."""

import hashlib
import json
import platform
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim.scene.overrides import FILES
from clothsim.scene.scene import Scene

LETTERS = 16


def content_id(scene: Scene, version: int) -> str:
    """The first 16 hexadecimal digits of sha256 of the resolved scene, the recipe's version and the package's.

    Files count by their content, not by their name, and the folder of the scene does not count.
    """
    from clothsim import __version__

    data = json.loads(scene.to_text())
    folder = Path(data.pop("directory"))
    content = {"scene": _by_content(data, folder), "recipe": version, "package": __version__}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:LETTERS]


def array_hash(*arrays: NDArray[Any]) -> str:
    """sha256 of types, shapes and bytes of arrays."""
    made = hashlib.sha256()
    for array in arrays:
        whole = np.ascontiguousarray(array)
        made.update(f"{whole.dtype.str}{whole.shape}".encode())
        made.update(whole.tobytes())
    return made.hexdigest()


@cache
def processor() -> str:
    """The name of the processor: the last bits of a drape depend on it."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _by_content(value: Any, folder: Path, key: str = "") -> Any:
    """Tables whose names of files are replaced by hashes of their content."""
    if isinstance(value, dict):
        return {name: _by_content(inner, folder, name) for name, inner in value.items()}
    if isinstance(value, list):
        return [_by_content(inner, folder, key) for inner in value]
    if isinstance(value, str) and key in FILES and "." in value and (folder / value).is_file():
        file = folder / value
        return _file_hash(file, file.stat().st_mtime_ns)
    return value


@cache
def _file_hash(file: Path, changed: int) -> str:
    """sha256 of a file; changed: time of its last change, so that a process reads it once."""
    return f"sha256:{hashlib.sha256(file.read_bytes()).hexdigest()}"
