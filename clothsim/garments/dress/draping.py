"""Drape of a sewn garment on its body: gravity and friction, until it rests.

Friction holds the folds and strains that the closing left. A garment that hangs on the shoulders is therefore shaken
down first, with little friction, as a person pulls a shirt straight. What is in equilibrium with it is so with more,
as the forces that more friction can give include those of less.
"""

from pathlib import Path
from typing import Any

import numpy as np

from clothsim import Body, Run
from clothsim.base.arrays import Floats
from clothsim.garments.dress.sewing_state import Fabrics, SewingState, sewn_cloth
from clothsim.garments.inputs import BodyMesh
from clothsim.garments.stage_scenes import dress_drape, simulate_stage
from clothsim.garments.stages import Announcement, Listener

FRICTION = 0.4
SLIPPERY = 0.05
"""Friction while a garment is shaken down."""
SHOULDERS = 0.8
"""Level above which a garment hangs on the shoulders, as a fraction of the body's height: armpits are at .76."""
SANK = 0.03
"""Way down of the top of a garment, as a fraction of the body's height, beyond which it was held by friction alone."""


def open_seam_tables(state: SewingState) -> list[dict[str, Any]]:
    """Tables of `[effects.seams]` for the pairs of seams that are not welded, also where a seam has one alone."""
    lines = [state.pairs(state.mesh.seams[k]).T for k in state.open_seams]
    return [
        {"from": {"vertices": a.tolist()}, "to": {"vertices": b.tolist()}, "match": "vertices", "end": 1e-3}
        for a, b in lines
    ]


def drape(
    state: SewingState,
    body: BodyMesh,
    fabrics: Fabrics,
    folder: Path,
    listener: Listener | None,
    announce: Announcement | None,
) -> Run:
    """Run of the garment under gravity until it rests.

    One that hangs on the shoulders is shaken down before, in the folder `shaken`; that is left out where it sinks.

    Raises
    ------
    InputError
        A start that cannot be simulated.
    """
    if hangs_on_shoulders(state.positions, body):
        shaken = _drape_with_friction(state, body, fabrics, folder / "shaken", SLIPPERY, listener, announce)
        if shaken.status != "completed":
            return shaken
        sank = (state.positions @ body.up).max() - (shaken.positions(-1) @ body.up).max()
        if sank < SANK * np.ptp(body.positions @ body.up):
            state = state.moved_to(shaken.positions(-1))
    return _drape_with_friction(state, body, fabrics, folder, FRICTION, listener, announce)


def hangs_on_shoulders(positions: Floats, body: BodyMesh) -> bool:
    """True where a garment reaches over the level of the shoulders of its body."""
    levels = body.positions @ body.up
    return bool((positions @ body.up).max() > levels.min() + SHOULDERS * np.ptp(levels))


def _drape_with_friction(
    state: SewingState,
    body: BodyMesh,
    fabrics: Fabrics,
    folder: Path,
    friction: float,
    listener: Listener | None,
    announce: Announcement | None,
) -> Run:
    scene = dress_drape(body.up, open_seam_tables(state), friction).scene(
        cloth=sewn_cloth(state, fabrics), body=Body(body.positions, body.triangles, name="body")
    )
    return simulate_stage(scene, folder, listener, announce)
