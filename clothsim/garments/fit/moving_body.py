"""Scenes of a fit: prescribed motion of the body under the garment, and the drape under gravity."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from clothsim import Run, Scene, simulate
from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import IntersectionWarning
from clothsim.engine import FABRICS, Announcement, Listener
from clothsim.files import write_obj
from clothsim.garments.stages import Garment

REST, START, BODY = "garment_rest.obj", "garment_start.obj", "body.obj"
FRAMES = "body[0-9][0-9][0-9].obj"
CLOSING = ("body_closing0.obj", "body_closing1.obj")
"""Frames of a body that closes where it overlaps itself."""

CARRYING_SECONDS = 0.5
"""Duration of the motion of a body [s]: slow beside the damping, which holds the garment to it."""
CLOSING_SECONDS = 0.2
"""Duration of the closing of a body that overlaps itself [s]: four steps of a drape."""
STITCHING_SECONDS = 0.1
"""Time in which the stitches of a piece close [s]."""
CARRYING_TOLERANCE = 0.1
"""Newton's tolerance there [m/s], 5 mm a step: what is in between is free of intersections, and that is enough.
On a body of 47,500 triangles .02 takes twice to three times the iterations, and steps of .01 s five halves."""
CARRYING_FRICTION = 0.5
"""It keeps the garment where it is on the body. Without, a growing body squeezes it from the hips up to the waist, and
the folds that it makes there take four times the Newton iterations. Where a crease of the body closes on the garment it
must slip out: what fails with friction is tried without."""
CARRYING_STRETCH = 0.4
"""Stretch of the garment for which contact is made stiff enough there: its gap is then about half of d_hat."""
LIMB = 0.06
"""Radius of a limb as a fraction of the body's largest extent."""
# Only where it ends counts: backward Euler damps the way there, and hinges bend the garment cheapest.
MORPH_SETTINGS: dict[str, Any] = {
    "effects": {
        "inertia": {},
        "membrane": {},
        "bending": {"model": "hinge"},
        "damping": {"rate": 20.0},
        "body_contact": {},
        "friction": {"coefficient": CARRYING_FRICTION},
    },
    "solver": {"dt": 0.05, "tolerance": CARRYING_TOLERANCE, "max_iterations": 200, "integrator": "backward_euler"},
    "run": {"duration": CARRYING_SECONDS, "frames_per_second": 2},
}
DRAPING: dict[str, Any] = {
    "effects": {
        "inertia": {},
        "membrane": {},
        "bending": {"model": "hinge"},
        "gravity": {},
        "damping": {"rate": 4.0},
        "body_contact": {},
        "friction": {"coefficient": 0.3},
    },
    "solver": {
        "dt": 0.05,
        "tolerance": 0.02,
        "max_iterations": 200,
        "integrator": "backward_euler",
        "unstable_equilibrium": "keep",
    },
    "run": {"duration": 1.0, "frames_per_second": 10, "until": "rest", "rest_speed": 0.02},
}


NO_POSITIONS: Floats = np.zeros((0, 3))


@dataclass(frozen=True)
class StageSettings:
    """Settings common to the scenes of a fit.

    garment; rest (n, 3) [m]: its rest shape; fabric: its name; body_triangles (m, 3): the body's; self_contact: True
    for contact of the garment with itself.
    """

    garment: Garment
    rest: Floats
    fabric: str
    body_triangles: Ints
    self_contact: bool


def moved_with_body(
    worn: StageSettings,
    start: Floats,
    frames: Sequence[Floats],
    folder: Path,
    listener: Listener | None,
    slips: bool = False,
) -> Run:
    """Run without gravity from `start` (n, 3) [m] under a body that moves through `frames`, each (k, 3) [m].

    slips: without friction. All files of the run are in `folder`, with a scene that repeats it.
    """
    _make(folder)
    for old in folder.glob(FRAMES):  # of an earlier fit with more frames
        old.unlink()
    for k, frame in enumerate(frames):
        write_obj(folder / f"body{k:03d}.obj", frame, worn.body_triangles)
    rate = (len(frames) - 1) / CARRYING_SECONDS
    body = {"name": "body", "frames": FRAMES, "frames_per_second": rate}
    kept = {name: keys for name, keys in MORPH_SETTINGS["effects"].items() if not (slips and name == "friction")}
    effects = {**kept, **_stiff_contact(worn, frames[-1])}
    return _run(_scene(worn, start, body, {**MORPH_SETTINGS, "effects": effects}, folder), folder, listener)


def _stiff_contact(worn: StageSettings, body: Floats) -> dict[str, Any]:
    """Contact effects with `carrying_stiffness`."""
    keys = {"stiffness": carrying_stiffness(worn.fabric, body)}
    return {"body_contact": keys, **({"self_contact": keys} if worn.self_contact else {})}


def carrying_stiffness(fabric: str, body: Floats) -> float:
    """Barrier stiffness [Pa] while a body (k, 3) [m] moves: the pressure of the fabric stretched around it.

    That of a membrane with tension E h eps on a limb of radius R is E h eps / R. A stiffness that adapts to the loads
    rises too slowly for a body that does the work: the gap shrinks to a micrometre, and blocks the body.
    """
    cloth = FABRICS[fabric]
    radius = LIMB * float(np.ptp(body, axis=0).max())
    return max(cloth.stiffness_along_warp, cloth.stiffness_along_weft) * CARRYING_STRETCH / radius


def draped(
    worn: StageSettings,
    start: Floats,
    body: Floats,
    up: Floats,
    folder: Path,
    listener: Listener | None,
    announce: Announcement | None,
    duration: float | None = None,
    opened: Floats = NO_POSITIONS,
) -> Run:
    """Run of the garment, from `start` (n, 3) [m], on the standing `body (k, 3)` [m] under gravity against `up (3,)`.

    duration [s]: None: as in DRAPING. opened (k, 3) [m]: the body at the start, where it overlaps itself; it closes,
    and carries the vertices between its parts.
    """
    _make(folder)
    table: dict[str, Any] = {"name": "body", "mesh": BODY}
    contact: dict[str, Any] = {}
    write_obj(folder / BODY, body, worn.body_triangles)
    if len(opened):
        for name, frame in zip(CLOSING, (opened, body), strict=True):
            write_obj(folder / name, frame, worn.body_triangles)
        table = {"name": "body", "frames": "body_closing[01].obj", "frames_per_second": 1 / CLOSING_SECONDS}
        contact = {"pinch": "carry"}
    settings: dict[str, Any] = {
        **DRAPING,
        "effects": {
            **DRAPING["effects"],
            **_stiff_contact(worn, body),
            "gravity": {"acceleration": (-9.81 * up).tolist()},
        },
    }
    if duration is not None:
        settings["run"] = {**settings["run"], "duration": duration}
    scene = _scene(worn, start, table, {**settings, "contact": contact}, folder)
    return _run(scene, folder, listener, announce)


def named_stage(name: str, listener: Listener | None) -> Listener | None:
    """The listener, told the name of the stage; None where there is none."""
    return None if listener is None else lambda progress: listener(replace(progress, stage=name))


def _run(scene: Scene, folder: Path, listener: Listener | None, announce: Announcement | None = None) -> Run:
    """Run without Python warnings of intersections: the stages of a fit count them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IntersectionWarning)
        return simulate(scene, folder, listener, announce, overwrite=True)


def _scene(worn: StageSettings, start: Floats, body: dict[str, Any], settings: dict[str, Any], folder: Path) -> Scene:
    write_obj(folder / REST, worn.rest, worn.garment.triangles)
    write_obj(folder / START, start, worn.garment.triangles)
    own: dict[str, Any] = {"self_contact": {}} if worn.self_contact else {}
    effects = {**own, **settings["effects"], **_seams(worn)}
    return Scene(
        cloth={"name": "garment", "mesh": REST, "fabric": worn.fabric, "sewn": worn.garment.sewn},
        body=body,
        effects=effects,
        solver=settings["solver"],
        contact=settings.get("contact", {}),
        run=settings["run"],
        seed={"from": "file", "file": START},
        directory=folder,
    )


def _seams(worn: StageSettings) -> dict[str, Any]:
    """Seams of the pieces that are stitched to another."""
    lines = [{"vertices": vertices.tolist()} for vertices in worn.garment.division.stitched]
    keys = {"to": {"nearest": True}, "end": STITCHING_SECONDS, "bends": False}
    return {"seams": {"seam": [{"from": line, **keys} for line in lines]}} if lines else {}


def _make(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)


MARGIN = 0.06
"""Distance from the garment up to which the body is kept, as a fraction of the body's largest extent."""


def near_body(garment: Floats, frames: Sequence[Floats], triangles: Ints) -> tuple[tuple[Floats, ...], Ints]:
    """Frames and triangles of the part of a body that is near a garment in any frame; all of it where none is.

    Parameters
    ----------
    garment : (n, 3) ndarray
        Positions of the garment [m].
    frames : sequence of (k, 3) ndarray
        Positions of the body [m].
    triangles : (m, 3) ndarray
        Its triangles; one with a vertex near the garment is kept whole.
    """
    margin = MARGIN * max(float(np.ptp(frame, axis=0).max()) for frame in frames)
    tree = cKDTree(garment)
    near = np.zeros(len(frames[0]), bool)
    for frame in frames:
        near |= np.isfinite(tree.query(frame, distance_upper_bound=margin)[0])
    kept = triangles[near[triangles].any(axis=1)]
    if not len(kept):
        return tuple(frames), triangles
    used, renumbered = np.unique(kept, return_inverse=True)
    return tuple(frame[used] for frame in frames), renumbered.reshape(-1, 3).astype(np.int64)
