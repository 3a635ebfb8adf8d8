"""Export of a run for other programs: settings, unit, axes and files."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from clothsim.base.arrays import Floats, as_positive
from clothsim.base.errors import InputError
from clothsim.files.exchange.animation import Animation
from clothsim.files.exchange.formats import Format, format_of
from clothsim.run.exported_frames import parts_of, samples_of, with_frames
from clothsim.run.pictures import upright

if TYPE_CHECKING:
    from clothsim.run.results import Run

SETTINGS = ("frame", "fps", "scale", "up", "colour", "overwrite")
"""Keywords of `export`."""


@dataclass(frozen=True)
class Exported:
    """Files of an export.

    Attributes
    ----------
    files : tuple of Path
        All files, that of the target first where there is one.
    frames : int
        Number of frames.
    rate : float
        Frames a second.
    interpolated : int
        Frames between two of the run, at positions linear in time: they were not simulated.
    up : str
        Axis against gravity.
    unit : float
        Metres per unit.
    notes : tuple of str
        What is missing, and why.
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
        This frame only; negative ones count from the end.
    fps : float, optional
        Frames a second; those between two frames of the run are linear in time. Default: the run's own frames.
    scale : float
        Units of the file in a metre: 100 for centimetres.
    up : "y" or "z", optional
        Axis against gravity. Default: the format's own (y of .glb), else the scene's.
    colour : "stretch" or "plain"
        Colours of the cloth's vertices.
    overwrite : bool
        True to replace files.

    Returns
    -------
    Exported

    Raises
    ------
    InputError
        Unknown ending, no frame, a file that exists, a setting that the format does not take.
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
    samples, rate = samples_of(run.trajectory, frame, fps)
    parts, notes = parts_of(run)
    axis = _axis(up, kind, run.directory)
    times = np.array([each.time for each in samples])
    animation = Animation(parts, times, rate, 1 / scale, axis, np.zeros(3), lambda k: (), frame is not None)
    files = tuple(kind.writer.files(animation, target))
    _refuse_files(target, files, overwrite)
    turn = scale * _rotation(upright(run.directory), axis)
    animation = with_frames(animation, run.trajectory, samples, turn, colour == "stretch", kind.relative)
    kind.writer.write(animation, target)
    between = sum(each.weight > 0 for each in samples)
    return Exported(files, len(samples), rate, between, axis, 1.0 / scale, notes)


def _refuse_settings(run: "Run", target: Path, kind: Format, given: dict[str, Any]) -> None:
    """InputError for a run without a frame, and for settings out of their range or that the format does not take."""
    if not len(run.times):
        raise InputError(f"{run.directory} holds no frame.", "Export a run that has begun.")
    for name in ("fps", "scale"):
        if given[name] is not None:
            as_positive(name, given[name])
    if kind.metres and given["scale"] != 1:
        raise InputError(f"{target.suffix} files are in metres.", "Leave the scale out.")
    if given["frame"] is not None and given["fps"] is not None:
        raise InputError("One frame has no rate.", "Give either a frame or frames a second.")
    if given["colour"] not in ("stretch", "plain"):
        raise InputError(f"colour is {given['colour']!r}.", 'Known: "stretch", "plain".')


def _axis(up: str | None, kind: Format, directory: Path) -> Literal["y", "z"]:
    """The up axis of the file: as asked, else the format's, else the scene's."""
    if up not in {None, "y", "z"}:
        raise InputError(f"up is {up!r}.", 'Known: "y", "z".')
    if up is not None and kind.up and up != kind.up:
        raise InputError(f"This format has {kind.up} up.", "Leave --up out.")
    asked = up or kind.up or _scene_axis(upright(directory))
    return "y" if asked == "y" else "z"


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


def _refuse_files(target: Path, files: tuple[Path, ...], overwrite: bool) -> None:
    """InputError for a directory that is not there, and for files that are unless they are to be replaced."""
    if not target.parent.is_dir():
        raise InputError(f"There is no directory {target.parent}.", "Make it first, or choose another with -o.")
    there = [file for file in files if file.exists()]
    folder = next((file for file in there if file.is_dir()), None)
    if folder is not None:
        raise InputError(f"{folder} is a directory.", "Choose another name.")
    if there and not overwrite:
        more = f" ({len(there)} of {len(files)} files)" if len(files) > 1 else ""
        raise InputError(f"{there[0]} exists{more}.", "Choose another name, or replace it with --overwrite.")
