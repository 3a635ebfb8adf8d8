"""Publication of drapes: a folder is written beside, and renamed to its name when it is whole."""

import io
import json
import os
import shutil
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim.study.farm.claims import Worker
from clothsim.study.farm.identity import array_hash

CLOTH, SUMMARY, PARAMETERS = "cloth.npy", "summary.json", "params.json"


def working_folder(farm: Path, name: str, worker: Worker) -> Path:
    """An empty folder of this attempt."""
    folder = farm / "tmp" / f"{name}.{worker.token}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    return folder


def publish(farm: Path, name: str, worker: Worker, files: Mapping[str, bytes]) -> bool:
    """Publish a drape; False where another process had published it.

    Parameters
    ----------
    farm : Path
        Folder of the farm.
    name : str
        Id of the drape.
    worker : Worker
        Who publishes.
    files : dict of str to bytes
        Content by name.
    """
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
    digest = array_hash(*(arrays[name] for name in sorted(arrays)))[:16]
    file = farm / "meshes" / f"{digest}.npz"
    if not file.is_file():
        beside = farm / "tmp" / f"{digest}.{os.getpid()}.{os.urandom(4).hex()}.npz"
        with beside.open("wb") as handle:
            np.savez_compressed(handle, **arrays)  # type: ignore[arg-type]
            handle.flush()
            os.fsync(handle.fileno())
        beside.replace(file)
    return digest


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
