"""Content ids of drapes, hashes of arrays, and the name of the processor."""

import hashlib
import json
import platform
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim import Scene, __version__
from clothsim.engine import by_content

LETTERS = 16


def content_id(scene: Scene, version: int) -> str:
    """The first 16 hexadecimal digits of sha256 of the resolved scene, the recipe's version and the package's.

    Files count by their content, not by their name, and the folder of the scene does not count.
    """
    data = json.loads(scene.to_text())
    folder = Path(data.pop("directory"))
    content = {"scene": by_content(data, folder), "recipe": version, "package": __version__}
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
