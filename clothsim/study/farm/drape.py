"""One drape of a farm: simulated, accepted by its certificate, and made ready for publication."""

import shutil
import warnings
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim import Scene, simulate
from clothsim.base.errors import ClothsimError, IntersectionWarning, MachineError
from clothsim.engine import Session, World
from clothsim.study.farm.publication import processor, store_mesh
from clothsim.study.farm.reading import array_hash

KEPT = ("status", "reason", "steps", "newton_iterations", "vertices", "triangles", "certificate", "notes", "warnings")
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


def drape(scene: Scene, folder: Path, farm: Path | None = None, frames: str = "last") -> Drape:
    """Simulate a scene in a folder of its own; what it refuses or fails at is the reason of a failed drape.

    folder: of the files of the run, which are deleted; farm: where the meshes are stored; frames: "last" or "all", what
    is kept. OSError, MemoryError, MachineError and KeyboardInterrupt are no verdict on the drape, and are raised.
    """
    started, cpu = perf_counter(), process_time()
    try:
        content, positions, meshes = _simulated(scene, folder / "run", farm, frames)
    except (OSError, MemoryError, MachineError):
        raise
    except ClothsimError as error:
        content, positions, meshes = failed(f"{error.sentence} {error.remedy}".strip(), "refused"), None, {}
    except Exception as error:
        content, positions, meshes = failed(f"{type(error).__name__}: {error}", "fault"), None, {}
    finally:
        shutil.rmtree(folder / "run", ignore_errors=True)
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
    scene: Scene, folder: Path, farm: Path | None, frames: str
) -> tuple[dict[str, Any], NDArray[np.float32], dict[str, Any]]:
    sessions: list[Session] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IntersectionWarning)
        run = simulate(scene, folder, announce=sessions.append, overwrite=True)
    world = sessions[-1].built.world
    kept = range(len(run)) if frames == "all" else [len(run) - 1]
    shapes = [np.concatenate(list(run[k].positions.values())).astype(np.float32) for k in kept]
    content = {key: run.summary[key] for key in KEPT if key in run.summary}
    certificate = content["certificate"]
    at_rest = scene.run_settings.until != "rest" or bool(certificate["at_rest"])
    free = certificate["intersection_free"] is True
    cause = "" if content["status"] == "completed" else str((run.summary["failure"] or {}).get("cause", "run"))
    outside = "inside a body" if certificate["held_inside"] else ""
    content["cause"] = cause or ("" if free else "not certified") or outside or ("" if at_rest else "not at rest")
    content["usable"] = not content["cause"]
    meshes = {} if farm is None else store_world(farm, world)
    return content, np.stack(shapes) if frames == "all" else shapes[0], meshes


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
