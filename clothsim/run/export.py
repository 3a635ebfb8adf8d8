"""Runs for elsewhere: files of other programs, and the archive that replays a run on another machine."""

import json
import platform
import sys
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path, PurePosixPath
from shutil import copyfileobj
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from clothsim.base.arrays import Floats, as_positive
from clothsim.base.errors import InputError
from clothsim.base.file_writing import refuse_replacing
from clothsim.base.record import RECORD_NAME, SUMMARY_NAME, read_summary
from clothsim.files.exchange.animation import Animation
from clothsim.files.exchange.formats import Format, format_of
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, Checkpoint, read_checkpoint, write_checkpoint
from clothsim.run.checkpoints import refuse_functions
from clothsim.run.frames import animated_parts, samples_of, with_frames
from clothsim.run.pictures import up_of_run
from clothsim.run.resume import RUN_FILES
from clothsim.scene.named_files import FOLDER, refuse_outside, relocated
from clothsim.scene.scene import scene_from_text

if TYPE_CHECKING:
    from clothsim.run.results import Run

SMALLEST_SCALE = 1e-9
"""Units of a file in a metre, at least, and their inverse at most: coordinates in single precision hold them."""
SETTINGS = ("frame", "fps", "scale", "up", "colour", "overwrite")
"""Keywords of `export`."""


UNEVEN = 0.01
"""Difference of the intervals of frames, over the longest, from which on they are not even."""


@dataclass(frozen=True)
class Exported:
    """Files of an export.

    Attributes
    ----------
    files : tuple of Path
        All files; the target comes first if it is one of them.
    frames : int
        Number of frames.
    rate : float
        Frames per second.
    interpolated : int
        Number of frames that were interpolated linearly in time, not simulated.
    up : str
        Axis against gravity.
    unit : float
        Metres per unit.
    notes : tuple of str
        What the files lack, and why.
    """

    files: tuple[Path, ...]
    frames: int
    rate: float
    interpolated: int
    up: str
    unit: float
    notes: tuple[str, ...]


def export(
    run: "Run",
    target: str | Path,
    *,
    frame: int | None = None,
    fps: float | None = None,
    scale: float = 1.0,
    up: str | None = None,
    colour: str = "stretch",
    overwrite: bool = False,
) -> Exported:
    """Write the frames of a run in the format that the ending of `target` names.

    Parameters
    ----------
    run : Run
    target : str or Path
        The file; its ending is one of `clothsim.files.exchange.formats.FORMATS`.
    frame : int, optional
        This frame only; negative numbers count from the end. Default: all frames; for a fitted or sewn garment only the
        last, as worn, unless `fps` asks for the frames of its drape.
    fps : float, optional
        Frames per second; frames between two frames of the run are interpolated linearly. Default: the frames of the
        run.
    scale : float
        Units of the file per metre: 100 for centimetres.
    up : "y" or "z", optional
        Axis against gravity. Default: y for .glb, otherwise that of the scene.
    colour : "stretch" or "plain"
        Colours of the cloth's vertices.
    overwrite : bool
        True: replace existing files.

    Returns
    -------
    Exported

    Raises
    ------
    InputError
        Unknown ending, no frame, an existing file, or a setting that the format does not accept.
    MissingPackageError
        USD without usd-core.

    Examples
    --------
    >>> import clothsim
    >>> cloth = clothsim.Cloth([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], velocity=[0, 0, 1])
    >>> scene = clothsim.Scene(cloth, effects=[clothsim.Inertia()], run=clothsim.RunSettings(duration=0.08))
    >>> done = clothsim.simulate(scene, "leap").export("leap.glb")
    >>> done.frames, done.rate, done.up, [file.name for file in done.files]
    (3, 25.0, 'y', ['leap.glb'])
    """
    target = Path(target)
    kind = format_of(target)
    _refuse_settings(run, target, kind, {"frame": frame, "fps": fps, "scale": scale, "colour": colour})
    parts, notes = animated_parts(run)
    if frame is None and fps is None and len(run.times) > 1 and _is_worn(run.directory):
        frame = -1
        notes = (*notes, f"The garment as it is worn at the end; fps gives the {len(run.times)} frames of its drape.")
    samples, rate = samples_of(run.trajectory, frame, fps)
    polygons = sum(part.polygons for part in parts)
    if polygons and not kind.polygons:
        notes = (*notes, f"{target.suffix} has triangles only: {polygons:,} quads and larger faces are cut.")
    if up not in {None, "y", "z"}:
        raise InputError(f"up is {up!r}.", 'Known: "y", "z".')
    if up is not None and kind.up and up != kind.up:
        raise InputError(f"This format has {kind.up} up.", "Leave --up out.")
    asked = up or kind.up or _scene_axis(up_of_run(run.directory))
    axis: Literal["y", "z"] = "y" if asked == "y" else "z"
    times = np.array([each.time for each in samples])
    animation = Animation(parts, times, rate, 1 / scale, axis, np.zeros(3), lambda k: (), frame is not None)
    files = tuple(kind.writer.files(animation, target))
    refuse_replacing(files, True, (run.directory / name for name in RUN_FILES))
    if not target.parent.is_dir():
        raise InputError(f"There is no directory {target.parent}.", "Create it first, or choose another with -o.")
    there = [file for file in files if file.exists()]
    folder = next((file for file in there if file.is_dir()), None)
    if folder is not None:
        raise InputError(f"{folder} is a directory.", "Choose another name.")
    if there and not overwrite:
        more = f" ({len(there)} of {len(files)} files)" if len(files) > 1 else ""
        raise InputError(f"{there[0]} exists{more}.", "Choose another name, or replace it with --overwrite.")
    turn = scale * _rotation(up_of_run(run.directory), axis)
    animation = with_frames(animation, run.trajectory, samples, turn, colour == "stretch", kind.relative)
    kind.writer.write(animation, target)
    between = sum(each.weight > 0 for each in samples)
    gaps = np.diff(times)
    if not kind.timed and len(gaps) and np.ptp(gaps) > UNEVEN * gaps.max():
        last = times[0] + len(gaps) / rate
        note = (
            f"{target.suffix} has no times: its last frame, of {times[-1]:g} s, is played at {last:g} s; fps resamples."
        )
        notes = (*notes, note)
    return Exported(files, len(samples), rate, between, axis, 1.0 / scale, notes)


def _is_worn(directory: Path) -> bool:
    """True for the output of a fit or of a sewn garment, whose run only brings it to rest."""
    file = directory / SUMMARY_NAME
    return file.is_file() and not {"fit_seconds", "dress_seconds"}.isdisjoint(read_summary(file))


def _refuse_settings(run: "Run", target: Path, kind: Format, given: dict[str, Any]) -> None:
    """InputError for a run without a frame, and for settings out of their range or that the format does not take."""
    if not len(run.times):
        raise InputError(f"{run.directory} holds no frame.", "Export a run that has begun.")
    for name in ("fps", "scale"):
        if given[name] is not None:
            as_positive(name, given[name])
    if not SMALLEST_SCALE <= given["scale"] <= 1 / SMALLEST_SCALE:
        what = f"scale is {given['scale']:g} units in a metre, from {SMALLEST_SCALE:g} to {1 / SMALLEST_SCALE:g} can be"
        raise InputError(f"{what}.", "Give 100 for centimetres, 1000 for millimetres.")
    if kind.metres and given["scale"] != 1:
        raise InputError(f"{target.suffix} files are in metres.", "Leave the scale out.")
    if given["frame"] is not None and given["fps"] is not None:
        raise InputError("One frame has no rate.", "Give either a frame or frames a second.")
    if given["colour"] not in ("stretch", "plain"):
        raise InputError(f"colour is {given['colour']!r}.", 'Known: "stretch", "plain".')


def _scene_axis(direction: tuple[float, ...] | str) -> str:
    """The axis "y" where a scene's direction up is that of y; else "z"."""
    if isinstance(direction, str):
        return direction
    unit = np.array(direction) / np.linalg.norm(direction)
    return "y" if unit[1] > 0.999 else "z"


def _rotation(direction: tuple[float, ...] | str, axis: str) -> Floats:
    """The rotation about x by a quarter, or none, that takes the scene's up axis to that of the file, (3, 3)."""
    own = _scene_axis(direction)
    if own == axis:
        return np.eye(3)
    to_y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    return to_y if axis == "y" else to_y.T


README_NAME, SCENE_NAME, VERSIONS_NAME = "README.txt", "scene.json", "versions.json"
PICTURES = ("failure.png", "picture.png")
TOP = (README_NAME, SCENE_NAME, VERSIONS_NAME, CHECKPOINT_NAME, RECORD_NAME, SUMMARY_NAME, *PICTURES)
"""The files that an archive may hold beside FOLDER."""

PACKAGES = (
    *("numpy", "scipy", "numba", "h5py", "meshio", "trimesh"),
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
        raise InputError(f"{target} already exists.", "Choose another file with -o, or move it away.")
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
            system = f"{platform.system()} {platform.machine()}"
            versions = {"clothsim": _own_version(), "python": platform.python_version(), "system": system}
            for package in PACKAGES:
                try:
                    versions[package] = version(package)
                except PackageNotFoundError:
                    continue
            archive.writestr(VERSIONS_NAME, json.dumps(versions, indent=2))
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
        entries = archive.infolist()
        for member in entries:
            path = PurePosixPath(member.filename)
            inside = member.filename in TOP or (path.parts[:1] == (FOLDER,) and ".." not in path.parts)
            if not inside or path.is_absolute() or any(letter in member.filename for letter in "\\:\0"):
                raise InputError(f"{file} holds {member.filename!r}, which does not belong in an archive of clothsim.")
        size = sum(member.file_size for member in entries)
        if size > MOST_BYTES or len(entries) > MOST_FILES:
            raise InputError(f"{file} would unpack to {len(entries):,} files of {size:,} bytes, which is too much.")
        if CHECKPOINT_NAME not in archive.namelist():
            raise InputError(f"{file} holds no {CHECKPOINT_NAME}, so it is not an archive of `clothsim bundle`.")
        with TemporaryDirectory() as folder:
            checkpoint = Path(folder) / CHECKPOINT_NAME
            _unpack(archive, CHECKPOINT_NAME, checkpoint)
            with _opened(checkpoint) as content:
                if sum(entry.file_size for entry in content.infolist()) > MOST_BYTES:
                    raise InputError(f"The checkpoint would unpack to more than {MOST_BYTES:,} bytes.")
            refuse_outside(read_checkpoint(checkpoint).scene_text)
        if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
            raise InputError(f"{directory} already exists.", "Choose another directory with -o.")
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
        raise InputError(f"{file} is not an archive of `clothsim bundle`, or broken ({error}).") from error


def _own_version() -> str:
    """Version of clothsim as it says itself: a clone that is not installed has no metadata."""
    return str(sys.modules["clothsim"].__dict__["__version__"])


def _readme(name: str, saved: Checkpoint, summary: dict) -> str:
    failure = summary.get("failure") or {}
    lines = [
        f"A run of clothsim {_own_version()}: {summary.get('status', 'interrupted')}.",
        summary.get("reason", ""),
        failure.get("remedy", ""),
        "",
        f"Replay it from its last good state, step {saved.state.step} at {saved.state.time:g} s, with one command:",
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
