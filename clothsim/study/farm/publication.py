"""Publication of drapes by content: ids and hashes, and folders that are renamed to their name when they are whole."""

import hashlib
import io
import json
import os
import platform
import re
import shutil
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim import Scene, __version__
from clothsim.base.errors import InputError
from clothsim.engine import by_content
from clothsim.study.farm.claims import Worker

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


def checked_id(name: Any, where: Path) -> str:
    """An id or a hash that a file names: whatever is joined to the folder of a farm goes through here.

    Raises
    ------
    InputError
        Where it is not LETTERS hexadecimal digits, such as a path that leads out of the farm.
    """
    if isinstance(name, str) and re.fullmatch(f"[0-9a-f]{{{LETTERS}}}", name):
        return name
    raise InputError(
        f"{where} names {name!r}, which is no id of a farm: an id is {LETTERS} hexadecimal digits.",
        "Take the file from where the farm was planned, or plan the recipe again in another folder.",
    )


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


CLOTH, SUMMARY, PARAMETERS = "cloth.npy", "summary.json", "params.json"


def working_folder(farm: Path, name: str, worker: Worker) -> Path:
    """An empty folder of this attempt."""
    folder = farm / "tmp" / f"{name}.{worker.token}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    return folder


def publish(farm: Path, name: str, worker: Worker, files: Mapping[str, bytes]) -> bool:
    """Publish a drape, whose files are given by name; False where another process had published it."""
    folder = farm / "tmp" / f"{name}.{worker.token}.whole"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for file, content in files.items():
        with (folder / file).open("wb") as handle:
            handle.write(content)
            handle.flush()
            os.fsync(handle.fileno())
    _flush(folder)
    try:
        folder.rename(farm / "drapes" / name)
    except OSError:  # ENOTEMPTY or EEXIST
        if not (farm / "drapes" / name).is_dir():
            raise
        shutil.rmtree(folder, ignore_errors=True)
        return False
    _flush(farm / "drapes")
    return True


def store_mesh(farm: Path, arrays: Mapping[str, NDArray[Any]]) -> str:
    """Store arrays once under their hash, and return it."""
    digest = array_hash(*(arrays[name] for name in sorted(arrays)))[:LETTERS]
    file = mesh_file(farm, digest)
    if not file.is_file():
        beside = farm / "tmp" / f"{digest}.{os.getpid()}.{os.urandom(4).hex()}.npz"
        with beside.open("wb") as handle:
            np.savez_compressed(handle, **arrays)  # type: ignore[arg-type]
            handle.flush()
            os.fsync(handle.fileno())
        beside.replace(file)
    return digest


def mesh_file(farm: Path, digest: Any) -> Path:
    """The file of a stored mesh. InputError where a summary names what is no hash."""
    return farm / "meshes" / f"{checked_id(digest, farm / 'drapes')}.npz"


def as_npy(array: NDArray[Any]) -> bytes:
    """An array as the content of a .npy file."""
    target = io.BytesIO()
    np.save(target, array)
    return target.getvalue()


def note_attempt(farm: Path, name: str, event: str) -> None:
    """Append "started" or "withdrawn" (stopped by its user) to the attempts of a drape."""
    handle = os.open(farm / "attempts" / name, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        os.write(handle, f"{event}\n".encode())
        os.fsync(handle)
    finally:
        os.close(handle)


def attempts(farm: Path, name: str) -> int:
    """Attempts that began and were not withdrawn."""
    try:
        events = (farm / "attempts" / name).read_text(encoding="utf-8").split()
    except FileNotFoundError:
        return 0
    return events.count("started") - events.count("withdrawn")


def read_drape(farm: Path, name: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Summary and parameters of a published drape."""
    folder = farm / "drapes" / name
    summary, parameters = (json.loads((folder / file).read_text(encoding="utf-8")) for file in (SUMMARY, PARAMETERS))
    return summary, parameters


def _flush(folder: Path) -> None:
    """Bring the entries of a folder to the disk, where the system can."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
