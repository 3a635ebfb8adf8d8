"""Publication of drapes by content: ids and hashes, and folders that are renamed to their name when they are whole."""

import hashlib
import io
import json
import os
import platform
import shutil
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim import Scene, __version__
from clothsim.base.errors import InputError, MachineError
from clothsim.engine import by_content
from clothsim.study.farm.claims import Worker
from clothsim.study.farm.reading import HASHES, LETTERS, file_hash, mesh_file, mesh_hash, read_file, read_stored_mesh


def content_id(scene: Scene, version: int) -> str:
    """First 16 hexadecimal digits of the sha256 of the resolved scene, the recipe's version and the package's.

    Files count by their content, not by their name, and the folder of the scene does not count.
    """
    data = json.loads(scene.to_text())
    folder = Path(data.pop("directory"))
    content = {"scene": by_content(data, folder), "recipe": version, "package": __version__}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:LETTERS]


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
    hashes = {file: file_hash(content) for file, content in files.items()}
    for file, content in {**files, HASHES: json.dumps(hashes, indent=1).encode()}.items():
        with (folder / file).open("wb") as handle:
            handle.write(content)
            handle.flush()
            os.fsync(handle.fileno())
    _flush(folder)
    target = farm / "drapes" / name
    for _ in range(2):
        try:
            folder.rename(target)
            break
        except OSError:  # ENOTEMPTY or EEXIST; ENOTDIR where a link or a file has its place
            if is_published(farm, name):
                shutil.rmtree(folder, ignore_errors=True)
                return False
            if not os.path.lexists(target):
                raise
            set_aside(farm, target)
    else:
        raise MachineError(f"{target} cannot be made.", "Check what is there.")
    _flush(farm / "drapes")
    return True


def is_published(farm: Path, name: str) -> bool:
    """True where the folder of a drape is there; False for a link or a file in its place."""
    path = farm / "drapes" / name
    return path.is_dir() and not path.is_symlink()


def set_aside(farm: Path, path: Path) -> None:
    """Move a link, or a folder in the place of a file or a file in that of a folder, to tmp/, unread and undeleted."""
    aside = farm / "tmp" / f"aside.{path.name}.{os.urandom(6).hex()}"
    with suppress(FileNotFoundError):
        if path.parent.name != "drapes":
            path.rename(aside)
        else:  # a folder that another process publishes meanwhile is never moved: `unlink` refuses it
            with suppress(FileExistsError, PermissionError, IsADirectoryError):
                os.link(path, aside, follow_symlinks=False)
                path.unlink()


def store_mesh(farm: Path, arrays: Mapping[str, NDArray[Any]]) -> str:
    """Store arrays under their hash, and return it; a file that is whole stays."""
    digest = mesh_hash(arrays)
    file = mesh_file(farm, digest)
    with suppress(InputError):
        read_stored_mesh(farm, digest)
        return digest
    if file.is_dir():
        set_aside(farm, file)
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
    path = farm / "attempts" / name
    if path.is_symlink() or (path.exists() and not path.is_file()):
        set_aside(farm, path)
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        os.write(handle, f"{event}\n".encode())
        os.fsync(handle)
    finally:
        os.close(handle)


def attempts(farm: Path, name: str) -> int:
    """Attempts that began and were not withdrawn; none where the file is not a file."""
    try:
        events = read_file(farm / "attempts", name).split()
    except InputError:
        return 0
    return events.count(b"started") - events.count(b"withdrawn")


def _flush(folder: Path) -> None:
    """Bring the entries of a folder to the disk, where the system can."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
