"""Scenes of a fit: prescribed motion of the body under the garment, and the drape under gravity."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from clothsim import Run, Scene
from clothsim.base.arrays import Floats, Ints
from clothsim.engine import fabric_named
from clothsim.files import write_obj
from clothsim.garments.inputs import Garment
from clothsim.garments.stages import (
    MOTION_SECONDS,
    Announcement,
    Listener,
    StageScene,
    fit_drape,
    fit_motion,
    simulate_stage,
)

REST, START, BODY = "garment_rest.obj", "garment_start.obj", "body.obj"
FRAMES = "body[0-9][0-9][0-9].obj"
CLOSING = ("body_closing0.obj", "body_closing1.obj")
"""Frames of a body that closes where it overlaps itself."""

CLOSING_SECONDS = 0.2
"""Duration of the closing of a body that overlaps itself [s]: four steps of a drape."""
STITCHING_SECONDS = 0.1
"""Time in which the stitches of a piece close [s]."""
CARRYING_STRETCH = 0.4
"""Stretch of the garment for which contact is made stiff enough there: its gap is then about half of d_hat."""
LIMB = 0.06
"""Radius of a limb as a fraction of the body's largest extent."""
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
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob(FRAMES):  # of an earlier fit with more frames
        old.unlink()
    for k, frame in enumerate(frames):
        write_obj(folder / f"body{k:03d}.obj", frame, worn.body_triangles)
    rate = (len(frames) - 1) / MOTION_SECONDS
    body = {"name": "body", "frames": FRAMES, "frames_per_second": rate}
    stiffness = carrying_stiffness(worn.fabric, frames[-1])
    sections = fit_motion(stiffness, _stitching_seams(worn), worn.self_contact, slips)
    return simulate_stage(_worn_scene(worn, start, body, sections, folder), folder, listener)


def carrying_stiffness(fabric: str, body: Floats) -> float:
    """Barrier stiffness [Pa] while a body (k, 3) [m] moves: the pressure of the fabric stretched around it.

    That of a membrane with tension E h eps on a limb of radius R is E h eps / R. A stiffness that adapts to the loads
    rises too slowly for a body that does the work: the gap shrinks to a micrometre, and blocks the body.
    """
    cloth = fabric_named("fabric", fabric)
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

    duration [s]: None: as in FIT_DRAPE. opened (k, 3) [m]: the body at the start, where it overlaps itself; it closes,
    and carries the vertices between its parts.
    """
    folder.mkdir(parents=True, exist_ok=True)
    table: dict[str, Any] = {"name": "body", "mesh": BODY}
    write_obj(folder / BODY, body, worn.body_triangles)
    if len(opened):
        for name, frame in zip(CLOSING, (opened, body), strict=True):
            write_obj(folder / name, frame, worn.body_triangles)
        table = {"name": "body", "frames": "body_closing[01].obj", "frames_per_second": 1 / CLOSING_SECONDS}
    stiffness, seams = carrying_stiffness(worn.fabric, body), _stitching_seams(worn)
    sections = fit_drape(stiffness, seams, worn.self_contact, up, duration, closes=len(opened) > 0)
    return simulate_stage(_worn_scene(worn, start, table, sections, folder), folder, listener, announce)


def _worn_scene(worn: StageSettings, start: Floats, body: dict[str, Any], sections: StageScene, folder: Path) -> Scene:
    """Scene of the garment from `start` (n, 3) [m] on a body, with its meshes in `folder`."""
    write_obj(folder / REST, worn.rest, worn.garment.triangles)
    write_obj(folder / START, start, worn.garment.triangles)
    return sections.scene(
        cloth={"name": "garment", "mesh": REST, "fabric": worn.fabric, "sewn": worn.garment.sewn},
        body=body,
        seed={"from": "file", "file": START},
        directory=folder,
    )


def _stitching_seams(worn: StageSettings) -> list[dict[str, Any]]:
    """Seams of the pieces that are stitched to another."""
    keys = {"to": {"nearest": True}, "end": STITCHING_SECONDS, "bends": False}
    return [{"from": {"vertices": rows.tolist()}, **keys} for rows in worn.garment.division.stitched]


MARGIN = 0.06
"""Distance from the garment up to which the body is kept, as a fraction of the body's largest extent."""


def near_body(garment: Floats, frames: Sequence[Floats], triangles: Ints) -> tuple[tuple[Floats, ...], Ints]:
    """Frames and triangles (m, 3) of the part of a body that is near a garment in any frame; all of it where none is.

    garment (n, 3), frames (k, 3): positions [m]. A triangle with a vertex near the garment is kept whole.
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
