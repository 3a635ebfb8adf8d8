"""Closing of seams under contact: strings that shorten draw the panels round the body; nothing ever intersects.

There is no gravity, and strong damping: what counts is the end. Darts close first, then at one time
all seams of the torso and those of each sleeve, so that the panels approach the body as they were placed; then sleeves
and collars are sewn to the torso, which is held. Whether a seam is closed is measured; stiffer rounds follow.
"""

import warnings
from collections import deque
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from clothsim import Body, Run, Scene, simulate
from clothsim.base.arrays import Floats
from clothsim.base.errors import IntersectionWarning
from clothsim.engine import ContactGap, Listener, build
from clothsim.garments.dress.closing_rounds import Round, Strings, further_turns, turns
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.dress.sewn_cloth import Fabrics, sewn_cloth
from clothsim.garments.dress.welding import welded_where_closed
from clothsim.garments.inputs import Figure
from transfer.signed_distance import BodySurface

HOLD = 0.3
"""Time for which the closed seams come to rest [s]."""
THICKNESS = 0.1
"""Distance at which contact begins, as a fraction of the mean edge."""
FRICTION = 0.5
"""Friction with the body once all seams were drawn together: stiffer strings would pull the garment off."""
CLOSED = 1.5
"""Gap of a closed seam while others are open, as a multiple of the distance at which contact begins."""
NEAR = 0.5
"""Gap of a closed seam once all were drawn together, as a fraction of the mean edge: at corners of several panels, in
cuffs and armpits contact keeps strings apart that the weld closes. It moves a vertex by a quarter of an edge at most,
which turns no triangle over; the drape relaxes it."""
SETTINGS: dict[str, Any] = {
    "effects": {
        "inertia": {},
        "membrane": {},
        "bending": {"model": "hinge"},
        "damping": {"rate": 40.0},
    },
    "solver": {"dt": 0.04, "tolerance": 0.1, "max_iterations": 200, "integrator": "backward_euler"},
}


@dataclass(frozen=True)
class Closing:
    """End of the closing.

    Attributes
    ----------
    state : SewingState
        The garment at its end.
    failure : str
        Reason in a sentence; empty where all seams are closed.
    description : str
        Rounds, seconds and largest gap.
    runs : tuple of Run
        The rounds.
    """

    state: SewingState
    failure: str
    description: str
    runs: tuple[Run, ...]


def close(
    state: SewingState, body: Figure, surface: BodySurface, fabrics: Fabrics, folder: Path, listener: Listener | None
) -> Closing:
    """Draw all open seams together. InputError for a start that cannot be simulated.

    After each round the pairs that are closed are welded: at the corners of several panels strings against contact
    would keep one another apart.
    """
    runs: list[Run] = []
    waiting, further = deque(turns(state)), deque(further_turns(state))
    largest, name, limit = 0.0, "", np.inf
    while waiting or (state.open_seams and further):
        turn = waiting.popleft() if waiting else further.popleft()
        made = turn.made(state, surface)
        if turn.is_partial(state, surface):
            waiting.appendleft(replace(turn, patient=False))
        if not made.strings:
            continue
        scene = _scene(state, body, fabrics, made)
        limit = CLOSED * contact_gap(scene) if waiting else NEAR * mean_edge(state)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", IntersectionWarning)
            run = simulate(scene, folder / f"close{len(runs)}", listener, overwrite=True)
        runs.append(run)
        state = state.at(run.positions(-1))
        if run.status != "completed":
            return Closing(state, f"While the seams were closed: {run.reason}", "", tuple(runs))
        state = welded_where_closed(state, limit, surface)
        largest, name = worst_gap(state)
    seconds = sum(float(run.times[-1]) for run in runs)
    welded = f"pairs within {1e3 * limit:.2g} mm welded, largest gap left {1e3 * largest:.2g} mm"
    description = f"{len(runs)} rounds, {seconds:.2g} s; {welded}"
    failure = ""
    if largest > limit:
        failure = f"Seam {name} stays open by {1e3 * largest:.3g} mm (closed: {1e3 * limit:.2g} mm)."
    return Closing(state, failure, description, tuple(runs))


def worst_gap(state: SewingState) -> tuple[float, str]:
    """Largest gap of all open seams [m], and the name of its seam."""
    gaps = [(float(state.gaps(seam).max(initial=0.0)), seam.name) for seam in state.mesh.seams]
    return max(gaps, default=(0.0, "none"))


def contact_gap(scene: Scene) -> float:
    """Distance at which contact of the cloth with itself begins in a scene [m]."""
    contact = build(scene).energies["self_contact"]
    assert isinstance(contact, ContactGap)
    return float(contact.activation_distance)


def _scene(state: SewingState, body: Figure, fabrics: Fabrics, turn: Round) -> Scene:
    """Scene of a round."""
    contact = {"d_hat": THICKNESS * mean_edge(state)}
    effects = {
        **SETTINGS["effects"],
        "body_contact": contact,
        "self_contact": contact,
        "seams": {"seam": [_seam_table(strings, turn.stiffness) for strings in turn.strings]},
    }
    if turn.friction:
        effects["friction"] = {"coefficient": FRICTION}
    if len(turn.held):
        effects["pins"] = {"select": turn.held.tolist()}
    return Scene(
        cloth=sewn_cloth(state, fabrics),
        body=Body(body.positions, body.triangles, name="body"),
        effects=effects,
        solver=SETTINGS["solver"],
        run={"duration": turn.duration + HOLD, "frames_per_second": 10},
    )


def _seam_table(strings: Strings, stiffness: float) -> dict[str, Any]:
    first, second = strings.pairs.T
    lines = {"from": {"vertices": first.tolist()}, "to": {"vertices": second.tolist()}, "match": "vertices"}
    return {**lines, "start": strings.start, "end": strings.end, "stiffness": stiffness}


def mean_edge(state: SewingState) -> float:
    """Mean length of the sides of all triangles at rest [m]."""
    corners = state.mesh.material_coordinates
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())


def stretch_range(stretches: Floats) -> tuple[float, float]:
    """1st and 99th percentile of principal stretches."""
    low, high = np.percentile(stretches, (1.0, 99.0))
    return float(low), float(high)
