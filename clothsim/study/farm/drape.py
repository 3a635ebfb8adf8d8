"""One drape of a farm: simulated, accepted by its certificate, and made ready for publication.

The pilot of a farm is one of its recipe that is made before it is planned, to say what is missing.
"""

import math
import shutil
import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim import Scene, simulate
from clothsim.base.errors import ClothsimError, InputError, IntersectionWarning, MachineError
from clothsim.engine import Session, World
from clothsim.study.farm.plan import TRIED
from clothsim.study.farm.publication import processor, store_mesh
from clothsim.study.farm.reading import array_hash
from clothsim.study.farm.recipe import Recipe, broken_rule, changed, checked_rules
from clothsim.study.workers import jittered

SUMMARY_KEYS = (
    "status",
    "reason",
    "end",
    "steps",
    "newton_iterations",
    "vertices",
    "triangles",
    "certificate",
    "notes",
    "warnings",
)
"""What is kept of the summary of a run."""


@dataclass(frozen=True)
class Drape:
    """A drape that was simulated.

    Attributes
    ----------
    summary : dict
        Status, reason, certificate, hash of the positions, processor, seconds.
    positions : (n, 3) or (k, n, 3) float32 ndarray or None
        All cloths one after the other, at the end or in every frame [m]; None where there is no frame.
    """

    summary: dict[str, Any]
    positions: NDArray[np.float32] | None


def drape(
    scene: Scene, folder: Path, farm: Path | None = None, frames: str = "last", rules: Mapping[str, Any] | None = None
) -> Drape:
    """Simulate a scene in a folder of its own; what it refuses or fails at is the reason of a failed drape.

    folder: of the files of the run, which are deleted; farm: where the meshes are stored; frames: "last" or "all", what
    is kept; rules: what is usable, besides what every drape must be (`checked_rules`; without them, at rest where the
    scene runs until rest). OSError, MemoryError, MachineError and KeyboardInterrupt are not a verdict on the drape, and
    are raised.
    """
    started, cpu = perf_counter(), process_time()
    rules = checked_rules({}, scene.run_settings.until) if rules is None else rules
    try:
        content, positions, meshes = _simulated(scene, folder, farm, frames, rules)
    except (OSError, MemoryError, MachineError):
        raise
    except ClothsimError as error:
        content, positions, meshes = failed(f"{error.sentence} {error.remedy}".strip(), "refused"), None, {}
    except Exception as error:
        content, positions, meshes = failed(f"{type(error).__name__}: {error}", "fault"), None, {}
    finally:
        for name in ("run", "second"):
            shutil.rmtree(folder / name, ignore_errors=True)
    content |= {
        "hash": None if positions is None else array_hash(positions),
        "meshes": meshes,
        "processor": processor(),
        "cpu_seconds": process_time() - cpu,
        "wall_seconds": perf_counter() - started,
    }
    return Drape(content, positions)


def failed(reason: str, cause: str) -> dict[str, Any]:
    """The summary of a drape without a run. cause: "refused" input, "fault" of the package, or "killed"."""
    return {"status": "failed", "reason": reason, "cause": cause, "usable": False}


def _simulated(
    scene: Scene, folder: Path, farm: Path | None, frames: str, rules: Mapping[str, Any]
) -> tuple[dict[str, Any], NDArray[np.float32], dict[str, Any]]:
    sessions: list[Session] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IntersectionWarning)
        run = simulate(scene, folder / "run", announce=sessions.append, overwrite=True)
    kept = range(len(run)) if frames == "all" else [len(run) - 1]
    shapes = [np.concatenate(list(run[k].positions.values())).astype(np.float32) for k in kept]
    content = {key: run.summary[key] for key in SUMMARY_KEYS if key in run.summary}
    certificate = content["certificate"]
    content["measured"] = {
        "time": float(run[-1].time),
        "stretch_min": certificate["stretch_min"],
        "stretch_max": certificate["stretch_max"],
        "drop": max(float(np.mean(x[:, 2] - run[-1].positions[name][:, 2])) for name, x in run[0].positions.items()),
    }
    cause = "" if content["status"] == "completed" else str((run.summary["failure"] or {}).get("cause", "run"))
    if not cause and certificate["intersection_free"] is not True:
        cause = "not certified"
    if not cause and certificate["held_inside"]:
        cause = "inside a body"
    if not cause:
        if "floor_max" in rules:
            content["measured"]["floor"] = _floor(scene, folder, shapes[-1])
        cause, sentence = broken_rule(rules, bool(certificate["at_rest"]), content["measured"])
        content["reason"] = sentence or content["reason"]
    content |= {"cause": cause, "usable": not cause}
    meshes = {} if farm is None else store_world(farm, sessions[-1].built.world)
    return content, np.stack(shapes) if frames == "all" else shapes[0], meshes


def _floor(scene: Scene, folder: Path, end: NDArray[np.float32]) -> float | None:
    """Root mean square distance of a vertex to where it ends from a jittered start [m]; None where that run fails."""
    folder.mkdir(exist_ok=True)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", IntersectionWarning)
            again = simulate(replace(scene, seed=jittered(scene, 1, folder)), folder / "second", overwrite=True)
    except MachineError:
        raise
    except ClothsimError:
        return None
    if again.status != "completed":
        return None
    return float(np.sqrt(np.mean(np.sum((again.positions(-1) - end) ** 2, axis=1))))


def store_world(farm: Path, world: World) -> dict[str, Any]:
    """Store the meshes of a world, garments as they are cut and bodies at the start; returns their hashes by name."""
    cloths = {
        cloth.name: store_mesh(
            farm,
            {
                "start": (cloth.positions + world.origin).astype(np.float32),
                "rest": np.asarray(cloth.rest_positions, np.float32),
                "triangles": cloth.triangles.astype(np.int32),
                "material": cloth.material_coordinates.astype(np.float32),
                "uv": cloth.texture.astype(np.float32),
            },
        )
        for cloth in world.cloths
    }
    bodies = {
        body.name: store_mesh(
            farm,
            {
                "start": (body.positions + world.origin).astype(np.float32),
                "triangles": body.triangles.astype(np.int32),
            },
        )
        for body in world.bodies
    }
    return {"cloth": cloths, "body": bodies}


LONGER = 10.0
"""A pilot that is to come to rest has so many times the duration of the recipe, to find how long it takes."""
SPARE = 1.5
"""What is proposed is so many times what the pilot took."""


@dataclass(frozen=True)
class Pilot:
    """A usable drape of a recipe: its number, simulated time [s] and processor time [s]."""

    index: int
    time: float
    cpu_seconds: float


def pilot(recipe: Recipe) -> Pilot:
    """Make the first drapes of a recipe, until one is usable.

    Raises
    ------
    InputError
        None of the first TRIED is usable: what the first one lacks, and what to set where that is the duration.
    """
    lacks: list[InputError] = []
    for index in range(min(TRIED, recipe.count)):
        found = _tried(recipe, index)
        if isinstance(found, Pilot):
            return found
        lacks.append(found)
    others = f" The next {len(lacks) - 1} are not usable either." if len(lacks) > 1 else ""
    raise InputError(
        f"No pilot drape is usable, so nothing is planned. {lacks[0].sentence}{others}",
        lacks[0].remedy or "Change the recipe, or plan it as it is: --no-pilot.",
    )


def _tried(recipe: Recipe, index: int) -> Pilot | InputError:
    """A drape of the recipe; where it is not usable, what it lacks."""
    scene = changed(recipe.scene, recipe.values(index))
    allowed = scene.run_settings.duration
    if recipe.rules["at_rest"]:
        scene = changed(scene, {"run.duration": LONGER * allowed})
    with tempfile.TemporaryDirectory(prefix="clothsim-pilot-") as folder:
        made = drape(scene, Path(folder), rules=recipe.rules).summary
    if made["cause"] == "not at rest":
        return InputError(
            f"Drape {index} will not rest in {allowed:g} s, nor in {LONGER * allowed:g} s: {made['reason']}",
            'Raise effects.damping.rate or run.rest_speed under [set], or write until = "time" under [farm].',
        )
    if made["cause"]:
        return InputError(f"Drape {index} is not usable ({made['cause']}): {made['reason']}")
    time = made["measured"]["time"]
    if time > allowed * (1 + 1e-9):
        return InputError(
            f"Drape {index} will not rest in {allowed:g} s; {enough(time):g} s would do.",
            f'Write "run.duration" = {enough(time):g} under [set], or plan the recipe as it is: --no-pilot.',
        )
    return Pilot(index, time, made["cpu_seconds"])


def enough(time: float) -> float:
    """A duration of one digit that leaves SPARE to a drape that took `time` [s].

    Examples
    --------
    >>> enough(2.6), enough(0.31), enough(11.0)
    (4.0, 0.5, 20.0)
    """
    digit = 10.0 ** math.floor(math.log10(SPARE * time))
    return float(f"{digit * math.ceil(SPARE * time / digit - 1e-9):.3g}")
