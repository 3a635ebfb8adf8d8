"""Archive of a run: scene, meshes, checkpoint, record, summary and versions, to replay it elsewhere."""

import json
import platform
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path, PurePosixPath
from shutil import copyfileobj
from tempfile import TemporaryDirectory
from typing import Any

from clothsim.base.errors import InputError
from clothsim.base.record import RECORD_NAME, SUMMARY_NAME, read_summary
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, Checkpoint, read_checkpoint, write_checkpoint
from clothsim.physics.energies.key_values import FUNCTION, lost_function
from clothsim.run.archive_files import FOLDER, refuse_outside, relocated
from clothsim.scene.scene import scene_from_text

README_NAME, SCENE_NAME, VERSIONS_NAME = "README.txt", "scene.json", "versions.json"
PICTURES = ("failure.png", "picture.png")
TOP = (README_NAME, SCENE_NAME, VERSIONS_NAME, CHECKPOINT_NAME, RECORD_NAME, SUMMARY_NAME, *PICTURES)
"""The files that an archive may hold beside FOLDER."""

PACKAGES = (
    *("clothsim", "numpy", "scipy", "numba", "h5py", "meshio", "trimesh"),
    *("pypardiso", "mkl", "py-mkl-pardiso", "scikit-sparse"),
)
"""Distributions whose versions an archive states."""

MOST_BYTES, MOST_FILES = 4 << 30, 100_000
"""The largest content of an archive."""


def write_bundle(directory: Path, target: Path) -> None:
    """Write the archive of a run, with a README that has the command to replay it.

    The scene of the archive holds no path of this machine.

    Parameters
    ----------
    directory : Path
        The output directory of the run.
    target : Path
        A file that does not exist yet.

    Raises
    ------
    InputError
        The run has no checkpoint, a file of its scene is missing, or the scene was made with a Python function.
    """
    saved = read_checkpoint(directory / CHECKPOINT_NAME)
    scene = scene_from_text(saved.scene_text, directory)
    refuse_functions("effects", scene.effects)
    text, files = relocated(scene)
    summary = read_summary(directory / SUMMARY_NAME) if (directory / SUMMARY_NAME).is_file() else {}
    if target.exists():
        raise InputError(f"{target} is there already.", "Choose another file with -o, or move it away.")
    beside = target.with_name(f".{target.name}.part")
    try:
        with (
            TemporaryDirectory() as folder,
            zipfile.ZipFile(beside, "w", zipfile.ZIP_DEFLATED, strict_timestamps=False) as archive,
        ):
            checkpoint = Path(folder) / CHECKPOINT_NAME
            write_checkpoint(checkpoint, replace(saved, scene_text=text))
            archive.writestr(README_NAME, _readme(target.name, saved, summary))
            archive.writestr(SCENE_NAME, json.dumps(json.loads(text), indent=2))
            archive.writestr(VERSIONS_NAME, json.dumps(_versions(), indent=2))
            archive.write(checkpoint, CHECKPOINT_NAME)
            for name in (RECORD_NAME, SUMMARY_NAME, *PICTURES):
                if (directory / name).is_file():
                    archive.write(directory / name, name)
            for name, source in files.items():
                archive.write(source, name)
        beside.replace(target)
    except OSError as error:
        raise InputError(f"{target} cannot be written ({error.strerror or error}).") from error
    finally:
        beside.unlink(missing_ok=True)


def refuse_functions(where: str, keys: Mapping[str, Any]) -> None:
    """InputError for a Python function among the keys: no file holds it."""
    for key, value in keys.items():
        if callable(value):
            raise lost_function(f"{where}.{key}", {FUNCTION: getattr(value, "__qualname__", type(value).__name__)})
        if isinstance(value, Mapping):
            if set(value) == {FUNCTION}:
                raise lost_function(f"{where}.{key}", value)
            refuse_functions(f"{where}.{key}", value)


def unpack_bundle(file: Path, directory: Path) -> None:
    """Unpack an archive of `write_bundle`, ready to be resumed.

    The archive is not trusted: nothing is written outside of `directory`, at most MOST_BYTES, and its scene may name no
    file outside.

    Parameters
    ----------
    file : Path
        The archive.
    directory : Path
        Empty, or not there yet.

    Raises
    ------
    InputError
        The file is no such archive, or breaks one of these rules.
    """
    with _opened(file) as archive:
        _refuse_contents(file, archive)
        with TemporaryDirectory() as folder:
            checkpoint = Path(folder) / CHECKPOINT_NAME
            _unpack(archive, CHECKPOINT_NAME, checkpoint)
            _refuse_large(checkpoint)
            refuse_outside(read_checkpoint(checkpoint).scene_text)
        if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
            raise InputError(f"{directory} is there already.", "Choose another directory with -o.")
        for entry in archive.infolist():
            if not entry.is_dir():
                _unpack(archive, entry.filename, directory / entry.filename)


def _unpack(archive: zipfile.ZipFile, name: str, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    with archive.open(name) as packed, target.open("wb") as unpacked:
        copyfileobj(packed, unpacked)


@contextmanager
def _opened(file: Path) -> Iterator[zipfile.ZipFile]:
    """The archive, opened. InputError for a file that is none, or is damaged."""
    try:
        if not file.is_file():
            raise FileNotFoundError("there is no such file")
        with zipfile.ZipFile(file) as archive:
            yield archive
    except (OSError, zipfile.BadZipFile, zlib.error, NotImplementedError, EOFError, RuntimeError) as error:
        raise InputError(f"{file} is no archive of `clothsim bundle`, or broken ({error}).") from error


def _refuse_contents(file: Path, archive: zipfile.ZipFile) -> None:
    """InputError for names outside of the folder, for too large a content, and for an archive without a checkpoint."""
    entries = archive.infolist()
    for entry in entries:
        path = PurePosixPath(entry.filename)
        inside = entry.filename in TOP or (path.parts[:1] == (FOLDER,) and ".." not in path.parts)
        if not inside or path.is_absolute() or any(letter in entry.filename for letter in "\\:\0"):
            raise InputError(f"{file} holds {entry.filename!r}, which does not belong in an archive of clothsim.")
    size = sum(entry.file_size for entry in entries)
    if size > MOST_BYTES or len(entries) > MOST_FILES:
        raise InputError(f"{file} would unpack to {len(entries):,} files of {size:,} bytes, which is too much.")
    if CHECKPOINT_NAME not in archive.namelist():
        raise InputError(f"{file} holds no {CHECKPOINT_NAME}, so it is no archive of `clothsim bundle`.")


def _refuse_large(checkpoint: Path) -> None:
    """InputError where the checkpoint, an archive too, has too large a content."""
    with _opened(checkpoint) as archive:
        if sum(entry.file_size for entry in archive.infolist()) > MOST_BYTES:
            raise InputError(f"The checkpoint would unpack to more than {MOST_BYTES:,} bytes.")


def _versions() -> dict[str, str]:
    """Versions of the installed packages."""
    versions = {"python": platform.python_version(), "system": f"{platform.system()} {platform.machine()}"}
    for package in PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            continue
    return versions


def _readme(name: str, saved: Checkpoint, summary: dict) -> str:
    failure = summary.get("failure") or {}
    lines = [
        f"A run of clothsim {version('clothsim')}: {summary.get('status', 'interrupted')}.",
        summary.get("reason", ""),
        failure.get("remedy", ""),
        "",
        f"Replay it from its last good state, step {saved.step} at {saved.time:g} s, with one command:",
        "",
        f"  clothsim resume {name}",
        "",
    ]
    if failure.get("step"):  # a fit that failed did so in no step
        lines += [
            f"The Newton iterates of the step that fails: clothsim resume {name} --dump-iterates {failure['step']}",
            "",
        ]
    lines += [
        f"{SCENE_NAME}: the scene; {FOLDER}/: the files that it names; {CHECKPOINT_NAME}: the last good state;",
        f"{RECORD_NAME}: a line a step; {SUMMARY_NAME}: how it ended; {VERSIONS_NAME}: with what.",
        "With the same versions and solver.threads = 1 the replay is the same bit for bit.",
    ]
    return "\n".join(lines) + "\n"
