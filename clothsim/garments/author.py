"""Clips authored from edited frames: what explains them simulated, or their offsets followed softly under contact."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

import clothsim
from clothsim import engine, files
from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.file_writing import make_directory, write_atomically
from clothsim.base.inputs import shown
from clothsim.base.record import to_json
from clothsim.garments.floor import Floor, floor_of, scene_of_arrays
from clothsim.garments.unpose import unposed

if TYPE_CHECKING:
    from clothsim import ClipRecovery, Progress, Run, Scene

TARGETS_NAME, AUTHORED_NAME = "targets.npy", "author.json"
"""What an authored clip has besides the files of a run: what it is drawn to, and its distances to the keys."""
RATE = 300.0
"""Rate at which a clip is drawn to its targets [1/s]: its weight moves a vertex in free air by 0.1 mm off them."""
EASE = 0.2
"""Time in which the offsets come in after frame 0, which is the start of the scene [s]."""
MOST_KEYS = 1000
FARTHEST = 10.0
"""Sizes of the garment by which an edit may move a vertex: beyond that a file is in another unit."""
KEY_FILE = "Give a mesh file of the frame with moved vertices: `clothsim export RUN --frame N -o FRAME.obj` writes one."
UNKNOWN = (float("nan"), float("nan"))
MISSED = 2.0
"""Multiple of the noise, left at the keys, from which the authored clip is run with twins of its own."""
Space = Literal["canonical", "world"]


@dataclass(frozen=True, eq=False)
class EditedFrame:
    """A frame of a run whose cloths a person moved.

    Parameters
    ----------
    frame : int
    positions : (n, 3) ndarray
        Vertices of all cloths, in the order of the run [m].
    intersecting : int
        Pairs of triangles of the cloths, or of cloth and body, that intersect in it.
    """

    frame: int
    positions: Floats
    intersecting: int


@dataclass(frozen=True)
class KeyDistance:
    """Distances of a run's frame from an edited one over the vertices, root mean square and largest [m].

    `before`, `before_most`: those of the run that was edited.
    """

    frame: int
    before: float
    before_most: float
    after: float
    after_most: float
    intersecting: int


@dataclass(frozen=True, eq=False)
class Authored:
    """An authored clip.

    Attributes
    ----------
    run : Run
        All frames, simulated under contact.
    keys : tuple of KeyDistance
    space : str
        "canonical" or "world": where the offsets were interpolated; "" where they were explained.
    intersecting_frames : tuple of int or None
        Frames in which the exact test found an intersection; None where not all of them were tested.
    floor : tuple of float
        Root mean square distances of the run that was edited from its twins over frames that are not keys [m]: from a
        start 1e-6 m aside, and with a tenth of Newton's stop. nan where it is not known, or was not asked for.
    recovery : ClipRecovery or None
        What explains the edits; None of offsets that were interpolated.
    own_floor : tuple of float
        The same distances of the authored clip from its own twins, where what explains the edits leaves more than
        `MISSED` times the floor at the keys: a clip that amplifies a start 1e-6 m aside cannot be found. nan otherwise.
    """

    run: "Run"
    keys: tuple[KeyDistance, ...]
    space: str
    intersecting_frames: tuple[int, ...] | None
    floor: tuple[float, float] = UNKNOWN
    recovery: "ClipRecovery | None" = None
    own_floor: tuple[float, float] = UNKNOWN

    def as_json(self) -> dict[str, Any]:
        """The content of author.json."""
        return {
            "status": self.run.status,
            "frames": len(self.run),
            "intersecting_frames": None if self.intersecting_frames is None else list(self.intersecting_frames),
            "space": self.space,
            "floor": dict(zip(("start", "stop"), (_finite(each) for each in self.floor), strict=True)),
            "own_floor": dict(zip(("start", "stop"), (_finite(each) for each in self.own_floor), strict=True)),
            "keys": [asdict(key) for key in self.keys],
            **({} if self.recovery is None else {"explained": explained(self.recovery)}),
        }


def author(
    run: "Run",
    keys: Mapping[int, Any],
    output: str | Path,
    *,
    quick: bool = False,
    free: Sequence[str] = (),
    rest: bool = True,
    rate: float = RATE,
    space: Space | None = None,
    progress: "Callable[[Progress], None] | None" = None,
    overwrite: bool = False,
    floor: bool = True,
) -> Authored:
    """A clip through edited frames, free of intersections.

    Parameters
    ----------
    run : Run
        A completed one.
    keys : mapping of int to (n, 3) array_like [m], str or Path
        By the number of the frame, from 1: the positions of all vertices of the cloths, or a mesh file of them, as
        `Run.export` writes it and a person has edited it.
    output : str or Path
        The directory of the new run.
    quick : bool
        Interpolate the offsets of the edits and follow them, in place of finding what explains them.
    free : sequence of str
        Numbers that may explain them, as of `recover_clip`; empty: all that the scene has.
    rest : bool
        Find a residual rest shape where the numbers leave more than the noise.
    rate : float
        Of the quick form: rate at which the clip is drawn to its targets, root of the stiffness for each mass [1/s].
    space : "canonical" or "world", optional
        Of the quick form: where the offsets are interpolated: in the rest pose of the body model, by default where
        there is one; or as they are.
    progress : callable, optional
        As of `simulate`.
    overwrite : bool
        Replace an earlier run in the directory.
    floor : bool
        Find the floor of noise under the run, by two more runs of its scene the first time, and two of the
        authored clip where it misses the keys.

    Raises
    ------
    InputError
        The run did not come to its end, has no such frame, or a key has other vertices, or vertices that are moved by
        more than `FARTHEST` sizes of the garment; an option of one form is given to the other.

    Notes
    -----
    Fabric, forces and rest lengths are found for which the run passes by the edited frames, then a rest shape for what
    is left (`recover_clip`), and all frames are simulated with them. What the keys do not determine stays near the
    scene as it was, and is named.

    Of the quick form, the offsets are linear in time between the keys and held beyond them; they come in over the first
    `EASE` seconds, as frame 0 is the start of the scene. The clip is then the scene with the effect `targets`
    of its frames and these offsets: without an offset the pull vanishes and it is the run again.
    """
    if not isinstance(run, clothsim.Run):
        raise InputError(f"The run is {shown(run)}.", "Open one: clothsim.open_run(directory).")
    if not isinstance(keys, Mapping):
        raise InputError(f"The keys are {shown(keys)}.", "Give a dict: {10: positions}.")
    if quick and (free or not rest):
        raise InputError(
            f"--quick explains no edit: {'--free' if free else '--no-rest'} changes nothing.",
            "Leave out one of the two.",
        )
    if not quick and (space is not None or rate != RATE):
        raise InputError(f"{'--rate' if space is None else '--space'} is for the quick form.", "Add --quick.")
    scene = run.scene
    inputs = [run.directory, scene, *(each for each in keys.values() if isinstance(each, str | Path))]
    directory = Path(output)
    engine.refuse_earlier_run(directory, overwrite, (TARGETS_NAME, AUTHORED_NAME), inputs)
    edited = edited_frames(run, keys)

    @cache
    def twins() -> Floor | None:
        return floor_of(run) if floor else None

    def noise() -> tuple[float, float]:
        found = twins()
        return UNKNOWN if found is None else found.rms(set(keys))

    if not quick:
        of_keys = scene
        if not scene.rods:  # whose rest shape is not a key
            with suppress(InputError):  # without lengths where it cannot be of arrays, as with labels of a pattern
                of_arrays = scene_of_arrays(scene)
                engine.build(of_arrays)
                of_keys = of_arrays
        frames = {key.frame: key.positions for key in edited}

        def floor_of_frames() -> Floats:  # found after the names of what is free were looked at
            found = twins()
            return np.zeros(len(frames)) if found is None else found.at(sorted(frames))

        found = clothsim.recover_clip(of_keys, frames, free, floor=floor_of_frames, rest=rest)
        new = clothsim.simulate(found.scene, directory, progress=progress, overwrite=overwrite)
        (directory / TARGETS_NAME).unlink(missing_ok=True)  # of an earlier clip there
        authored = _written(new, run, edited, "", noise(), found)
        missed = found.misfits[2] > MISSED * float(np.nanmax([*noise(), *found.noise]))
        if not floor or not missed or len(keys) >= len(run) - 1:
            return authored
        return _written(new, run, edited, "", noise(), found, floor_of(new).rms(set(keys)))
    chosen = space or ("canonical" if any("model" in each.as_table() for each in scene.bodies) else "world")
    made = guided(scene, targets(run, edited, chosen), directory, rate)
    new = clothsim.simulate(made, directory, progress=progress, overwrite=overwrite)
    return _written(new, run, edited, chosen, noise(), None)


def _written(
    new: "Run",
    run: "Run",
    edited: tuple[EditedFrame, ...],
    space: str,
    noise: tuple[float, float],
    recovery: "ClipRecovery | None",
    own_floor: tuple[float, float] = UNKNOWN,
) -> Authored:
    """The authored clip, with its file."""
    free, frames = new.intersection_free, new.summary["certificate"]["intersecting_frames"]
    tested = None if free is None else tuple(frames)
    found = Authored(new, distances(run, new, edited), space, tested, noise, recovery, own_floor)
    write_atomically(new.directory / AUTHORED_NAME, to_json(found.as_json()).encode())
    return found


def explained(recovery: "ClipRecovery") -> dict[str, Any]:
    """What explains the edits, for author.json: distances in metres, factors of numbers."""
    before, numbers, rest = recovery.misfits
    return {
        "factors": dict(recovery.values),
        "errors": {name: _finite(error) for name, error in recovery.errors.items()},
        "undetermined": [dict(each) for each in recovery.undetermined],
        "at_limit": list(recovery.at_limit),
        "noise": list(recovery.noise),
        "misfit": {"before": before, "numbers": numbers, "rest": rest},
        "rest": None if recovery.rest is None else asdict(recovery.rest),
        "no_rest": recovery.no_rest,
        "from_minimum": _finite(recovery.from_minimum),
        "no_gradient": recovery.no_gradient,
        "runs": recovery.runs,
    }


def _finite(value: float) -> float | None:
    """A number for JSON, which has no nan."""
    return value if np.isfinite(value) else None


def edited_frames(run: "Run", keys: Mapping[int, Any]) -> tuple[EditedFrame, ...]:
    """The keys in the order of time. InputError for anything else; parameters as of `author`."""
    if run.status != "completed":
        raise InputError(f"{run.directory} is a run that {run.status}.", "Edit frames of one that completed.")
    if not keys:
        raise InputError("There is no edited frame.", "Give one: 10=edited10.obj.")
    if len(keys) > MOST_KEYS:
        raise InputError(f"There are {len(keys)} edited frames.", f"Give at most {MOST_KEYS}.")
    last = len(run) - 1
    found = []
    other = next((frame for frame in keys if not isinstance(frame, int | np.integer)), None)
    if other is not None:
        raise InputError(f"The frame {other!r} is not a whole number.", "Give positions by the number of a frame.")
    for frame in sorted(keys):
        if frame == 0:
            raise InputError("Frame 0 is the start, which the scene gives.", f"Edit a frame from 1 to {last}.")
        if not 1 <= frame <= last:
            raise InputError(f"There is no frame {frame} to edit.", f"The run has frames 1 to {last}.")
        points = _positions(run, f"The edited frame {frame}", keys[frame])
        before = run.positions(frame)
        moved = np.linalg.norm(points - before, axis=1)
        size = float(np.linalg.norm(np.ptp(before, axis=0)))
        if moved.max() > FARTHEST * size:
            raise InputError(
                f"The edited frame {frame} moves vertex {moved.argmax()} by {moved.max():.4g} m, and the cloths of the "
                f"run are {size:.3g} m large.",
                "Save the frame in metres, where it was: `clothsim export` wrote it so.",
            )
        count = len(engine.intersecting_pairs(points, run.triangles))
        for _, body, triangles in run.bodies(frame):
            both = np.concatenate([points, body])
            count += len(engine.intersecting_pairs(both, run.triangles, triangles + len(points)))
        found.append(EditedFrame(frame, points, count))
    return tuple(found)


def _positions(run: "Run", what: str, given: Any) -> Floats:
    """Vertices of all cloths, (n, 3) [m], of an array or a file that may have the bodies behind them."""
    n = len(run.positions(0))
    if not isinstance(given, str | Path):
        try:
            points = np.asarray(given, np.float64)
        except (TypeError, ValueError) as error:
            raise InputError(f"{what} is {shown(given)}, not numbers.", "Give (n, 3) numbers, or a file.") from error
    else:
        try:
            mesh = files.read_mesh(given)
        except InputError as error:
            raise InputError(f"{what}: {error.sentence}", KEY_FILE) from error
        what = f"{what}, {given},"
        points, triangles = mesh.positions, mesh.triangles
        if len(points) == n + sum(len(body) for _, body, _ in run.bodies(0)):
            points, triangles = points[:n], triangles[(triangles < n).all(axis=1)]
        if len(points) == n and not np.array_equal(_as_set(triangles), _as_set(run.triangles)):
            raise InputError(f"{what} has other triangles than the run.", "Keep the order of the vertices when saving.")
    if points.shape != (n, 3):
        has = f"{len(points)} vertices" if points.shape[1:] == (3,) else f"an array {points.shape}"
        remedy = (
            "Move vertices of what `clothsim export RUN --frame N -o FRAME.obj` wrote, without adding or merging any."
        )
        raise InputError(f"{what} has {has}, the cloths of the run have {n} vertices.", remedy)
    if not np.isfinite(points).all():
        raise InputError(f"{what} has a vertex that is not finite.", "Give each vertex a position.")
    return points


def _as_set(triangles: Any) -> Any:
    """Triangles without an order among them and of their corners: a program may sort faces, and turn them."""
    sorted_ = np.sort(triangles, axis=1)
    return sorted_[np.lexsort(sorted_.T)]


def targets(run: "Run", edited: Iterable[EditedFrame], space: str) -> Floats:
    """The frames of a run with the offsets of edited ones, (f, n, 3) [m]."""
    frames = [run.positions(k) for k in range(len(run))]
    keys = list(edited)
    if space == "world":
        offsets = _over_time(run.times, keys, [key.positions - frames[key.frame] for key in keys])
        return np.array([x + move for x, move in zip(frames, offsets, strict=True)])
    garments = unposed(run, run.scene)
    made, _ = engine.character_of_scene(run.scene)
    bodies = [made.skinning(float(time), garments.body) for time in run.times]
    at_keys = [bodies[key.frame].unposed(key.positions, garments.rows) - garments.positions[key.frame] for key in keys]
    offsets = _over_time(run.times, keys, at_keys)
    x = zip(bodies, garments.positions, offsets, strict=True)
    return np.array([body.posed(points + move, garments.rows) for body, points, move in x])


def _over_time(times: Floats, keys: list[EditedFrame], offsets: list[Floats]) -> Floats:
    """Offsets of all frames, (f, n, 3) [m]: linear between the keys, held beyond, eased in from the start."""
    at = np.array([times[key.frame] for key in keys])
    after = np.clip(np.searchsorted(at, times), 0, len(keys) - 1)
    before = np.maximum(after - (times <= at[after]), 0)
    gap = at[after] - at[before]
    weight = np.divide(times - at[before], gap, out=np.zeros(len(times)), where=gap > 0).clip(0, 1)
    values = np.array(offsets)
    mixed = values[before] + weight[:, None, None] * (values[after] - values[before])
    eased = np.minimum(times / min(EASE, at[0]), 1.0)
    return np.asarray(eased[:, None, None] * mixed, np.float64)


def guided(scene: "Scene", frames: Floats, directory: Path, rate: float) -> "Scene":
    """A scene drawn to frames (f, n, 3) [m] at its own rate, written to a directory; contact is on in it.

    What draws a scene already is replaced; contact stays off where a scene has cloth and rods, which it refuses.
    """
    content = BytesIO()
    np.save(content, frames - frames[0])
    make_directory(directory)
    write_atomically(directory / TARGETS_NAME, content.getvalue())
    scene = scene.starting_at(directory)  # the targets move with the clip
    contacts: dict[str, Any] = {"self_contact": {}, **({"body_contact": {}} if scene.bodies else {})}
    effects = {**({} if scene.rods and scene.cloths else contacts), **scene.effects}
    keys = {"displacements": TARGETS_NAME, "frames_per_second": scene.run_settings.frames_per_second, "rate": rate}
    return replace(scene, effects={**effects, "targets": keys})


def distances(run: "Run", new: "Run", edited: Iterable[EditedFrame]) -> tuple[KeyDistance, ...]:
    """How far the frames of two runs are from edited ones; of keys that a failed one came to."""
    found = []
    for key in edited:
        if key.frame < len(new):
            apart = [np.linalg.norm(each.positions(key.frame) - key.positions, axis=1) for each in (run, new)]
            rms = [float(np.sqrt((off**2).mean())) for off in apart]
            found.append(
                KeyDistance(key.frame, rms[0], float(apart[0].max()), rms[1], float(apart[1].max()), key.intersecting)
            )
    return tuple(found)
