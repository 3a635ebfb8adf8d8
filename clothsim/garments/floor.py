"""Floor of noise under a run, by twins: the same scene from a start a little aside, and with a stricter stop.

Where cloth buckles and slides, a run is one of many that its scene allows. Twins show how far apart they are; no
authored clip can be nearer to the truth than that. And scenes whose cloths are given by arrays: start and rest shape
free to change.
"""

import hashlib
import json
import tempfile
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import clothsim
from clothsim import Scene
from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.file_reading import read_regular_file
from clothsim.base.file_writing import write_atomically
from clothsim.engine import World, build

if TYPE_CHECKING:
    from clothsim import Run

PLACED = {"vertices", "triangles", "rest", "groups", "position", "rotation_degrees", "scale", "up"}
"""Keys of a cloth that are of its mesh."""
OF_FABRIC = {each.name for each in fields(clothsim.Cloth)} - PLACED - {"arrays", "section"}
"""Keys of a cloth of arrays that are not."""


def table_of_arrays(
    keys: Any, name: str, start: Floats, triangles: Ints, rest: Floats, groups: Mapping[str, Ints]
) -> Any:
    """The cloth of a table with another mesh.

    Parameters
    ----------
    keys : mapping
        Section [cloth], whose fabric, velocity and sewing are taken.
    name : str
    start : (n, 3) ndarray [m]
    triangles : (m, 3) ndarray
    rest : (n, 3) or (m, 3, 2) ndarray [m]
    groups : mapping of str to (k,) ndarray
        Triangles of each panel.
    """
    own = {key: value for key, value in keys.items() if key in OF_FABRIC}
    return clothsim.Cloth(start, triangles, rest=rest, groups=groups, **{**own, "name": name})


def scene_of_arrays(scene: Scene, world: World | None = None, starts: Sequence[Floats] | None = None) -> Scene:
    """A scene whose cloths are the arrays that the scene makes of them; its rods stay as they are.

    Parameters
    ----------
    scene : Scene
    world : World, optional
        Of the scene, where it is built already.
    starts : sequence of (n, 3) ndarray [m], optional
        Positions of each cloth at the start in place of its own.

    Raises
    ------
    InputError
        For a scene that cannot be built, or an effect by names of a pattern's edges, which arrays have not.
    """
    world = build(scene).world if world is None else world
    places = [each.positions + world.origin for each in world.cloths] if starts is None else starts
    cloths = []
    for keys, cloth, start in zip(scene.cloths, world.cloths, places, strict=False):  # rods are behind the cloths
        rest = cloth.material_coordinates if cloth.flat else cloth.rest_positions
        table = {**keys, "weld": 0.0, "sewn": keys.weld > 0 or keys.sewn}
        cloths.append(table_of_arrays(table, cloth.name, start, cloth.triangles, rest, cloth.groups))
    changed: dict[str, Any] = {"cloth": cloths, "seed": {}}
    return replace(scene, **changed)


FLOOR_NAME = "floor.json"
"""The file in the directory of a run that holds what its twins found."""
ASIDE = 1e-6
"""Standard deviation of the displacements of the twin's start, each coordinate [m]."""
STRICTER = 0.1
"""Factor on the stop of Newton's method."""


@dataclass(frozen=True, eq=False)
class Floor:
    """Mean squared distances of twins from a run in each frame, nan where a twin did not come to it.

    Attributes
    ----------
    start : (f,) ndarray [m2]
        Of the twin from a start `ASIDE` away.
    stop : (f,) ndarray [m2]
        Of the twin with `STRICTER` of the stop of Newton's method.
    """

    start: Floats
    stop: Floats

    def rms(self, without: Collection[int] = ()) -> tuple[float, float]:
        """Root mean square distances [m] of both over the frames after the start but for some; nan: not known."""
        frames = [frame for frame in range(1, len(self.start)) if frame not in without]
        if not frames:
            return float("nan"), float("nan")
        return float(np.sqrt(self.start[frames].mean())), float(np.sqrt(self.stop[frames].mean()))

    def at(self, frames: Collection[int]) -> Floats:
        """Root mean square distance [m] of the farther twin in each of some frames; 0 where none came to it."""
        squares = np.nan_to_num([self.start[list(frames)], self.stop[list(frames)]])
        return np.asarray(np.sqrt(squares.max(axis=0)))


def floor_of(run: "Run") -> Floor:
    """The floor of a run: of its file where it has one, else two runs of its scene, and then written there.

    Examples
    --------
    >>> import clothsim
    >>> sheet = {"mesh": "rectangle", "size": [0.2, 0.2], "cells": [2, 2]}
    >>> effects = {"inertia": {}, "membrane": {}, "gravity": {}, "pins": {"select": "left"}}
    >>> run = clothsim.simulate(clothsim.Scene(sheet, effects=effects, run={"duration": 0.08}), "falls")
    >>> start, stop = floor_of(run).rms()
    >>> start < 1e-5, stop < 1e-3
    (True, True)
    """
    # digest of the frames of a run: another run in the directory has another
    digest = hashlib.blake2b(digest_size=16)
    for frame in range(len(run)):
        digest.update(np.ascontiguousarray(run.positions(frame)).tobytes())
    file, key = run.directory / FLOOR_NAME, digest.hexdigest()
    with suppress(InputError, ValueError, KeyError, TypeError, RecursionError):  # written by an earlier command
        stored = json.loads(read_regular_file(file))
        arrays = [np.array(stored[name], np.float64) for name in ("start", "stop")]
        if stored["run"] == key and all(each.shape == (len(run),) for each in arrays):
            return Floor(*arrays)
    with tempfile.TemporaryDirectory(prefix="clothsim-") as folder:
        twins = [
            _twin(aside(run.scene), run, Path(folder) / "start"),
            _twin(stricter(run.scene), run, Path(folder) / "stop"),
        ]
    found = Floor(*twins)
    content = {"run": key, "start": found.start.tolist(), "stop": found.stop.tolist()}
    with suppress(ClothsimError):  # a directory that is read only: the next command takes the twins again
        write_atomically(file, json.dumps(content).encode())
    return found


def aside(scene: Scene, seed: int = 0) -> Scene:
    """A scene of arrays whose start is `ASIDE` away from that of another; its rest shape is the same."""
    world, noise = build(scene).world, np.random.default_rng(seed)
    starts = [each.positions + world.origin + ASIDE * noise.normal(size=each.positions.shape) for each in world.cloths]
    return scene_of_arrays(scene, world, starts)


def stricter(scene: Scene) -> Scene:
    """A scene with `STRICTER` of the stop of Newton's method."""
    given: Any = scene.solver_settings
    if given.tolerance:
        return replace(scene, solver=given.with_keys(tolerance=STRICTER * given.tolerance))
    return replace(scene, solver=given.with_keys(newton_error_fraction=STRICTER * given.stop_fraction))


def _twin(scene: Scene, run: "Run", output: Path) -> Floats:
    """Mean squared distances (f,) [m2] of a twin in each frame of a run."""
    twin = clothsim.simulate(scene, output)
    out = np.full(len(run), np.nan)
    for frame in range(min(len(run), len(twin))):
        out[frame] = ((twin.positions(frame) - run.positions(frame)) ** 2).sum(axis=1).mean()
    return out
