"""Closing of seams under contact: strings that shorten draw the panels round the body; nothing ever intersects.

There is neither gravity nor friction, and strong damping: what counts is the end. All seams close at one time, so that
the panels approach the body as they were placed (closed one after the other, the first drag the rest aside), and no gap
faster than SPEED. Darts are closed before. Whether a seam is closed is measured; rounds with stiffer strings follow.
"""

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.arrays import Floats
from clothsim.build.scene_world import build
from clothsim.dressing.sewing_state import SewingState
from clothsim.energies.protocols import ContactGap
from clothsim.errors import IntersectionWarning
from clothsim.fitting.inputs import Figure
from clothsim.mesh.pattern.pattern_mesh import Seam
from clothsim.run.recorded_run import Listener
from clothsim.run.results import Run
from clothsim.run.simulate import simulate
from clothsim.scene.cloth_arrays import BodyArrays, ClothArrays
from clothsim.scene.scene import Scene

SPEED = 0.5
"""Largest speed at which a gap closes [m/s]."""
SHORTEST = 0.4
"""Shortest time of closing [s]."""
DARTS = 0.3
"""Time in which the darts close, first of all [s]."""
HOLD = 0.3
"""Time for which the closed seams come to rest [s]."""
ROUNDS = 4
"""Bound on the number of rounds."""
STIFFNESS, STIFFER = 100.0, 5.0
"""Stiffness of a string in the first round [N/m] and its growth in each further one: stiffer strings pull the fabric
into folds and take twice the iterations."""
THICKNESS = 0.1
"""Distance at which contact begins, as a fraction of the mean edge."""
CLOSED = 1.5
"""Gap of a closed seam, as a multiple of the distance at which contact begins."""
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


def close(state: SewingState, body: Figure, fabric: str, folder: Path, listener: Listener | None) -> Closing:
    """Draw all open seams together. InputError for a start that cannot be simulated."""
    runs: list[Run] = []
    seconds = 0.0
    for number in range(ROUNDS):
        seam_tables, end = _schedule(state, first=not runs)
        scene = _scene(state, body, fabric, seam_tables, end + HOLD, STIFFNESS * STIFFER**number)
        limit = CLOSED * contact_gap(scene)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", IntersectionWarning)
            run = simulate(scene, folder / f"close{number}", listener)
        runs.append(run)
        seconds += float(run.times[-1])
        state = state.at(run.positions(-1))
        if run.status != "completed":
            return Closing(state, f"While the seams were closed: {run.reason}", "", tuple(runs))
        largest, name = worst_gap(state)
        if largest <= limit:
            break
    description = f"{len(runs)} rounds, {seconds:.2g} s; largest gap {1e3 * largest:.2g} mm"
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


def is_dart(seam: Seam) -> bool:
    """True where both sides are on one panel."""
    first, second = seam.stitch.sides
    return first.panel == second.panel


def _schedule(state: SewingState, first: bool) -> tuple[list[dict[str, Any]], float]:
    """Tables of the open seams, and the time at which the last is closed [s]; darts go first in the first round."""
    tables: list[dict[str, Any]] = []
    seams = [state.mesh.seams[k] for k in state.open_seams]
    darts = first and any(is_dart(seam) for seam in seams) and not all(is_dart(seam) for seam in seams)
    largest = max(float(state.gaps(seam).max(initial=0)) for seam in seams if not (darts and is_dart(seam)))
    start = DARTS if darts else 0.0
    last = start + max(SHORTEST, largest / SPEED)
    single = []
    for seam in seams:
        pairs, early = state.pairs(seam), darts and is_dart(seam)
        if len(pairs) > 1:
            tables.append({"pairs": pairs, "start": 0.0 if early else start, "end": DARTS if early else last})
        else:
            single.append(pairs)
    latest = max(tables, key=lambda table: table["end"])
    latest["pairs"] = np.concatenate([latest["pairs"], *single])  # a line needs two vertices
    return tables, last


def _scene(
    state: SewingState,
    body: Figure,
    fabric: str,
    seam_tables: list[dict[str, Any]],
    duration: float,
    stiffness: float,
) -> Scene:
    cloth = ClothArrays(
        state.positions, state.triangles, rest=state.mesh.material_coordinates, name="garment", fabric=fabric, sewn=True
    )
    contact = {"d_hat": THICKNESS * mean_edge(state)}
    return Scene(
        cloth=cloth,
        body=BodyArrays(body.positions, body.triangles, name="body"),
        effects={
            **SETTINGS["effects"],
            "body_contact": contact,
            "self_contact": contact,
            "seams": {"seam": [_seam_table(table, stiffness) for table in seam_tables]},
        },
        solver=SETTINGS["solver"],
        run={"duration": duration, "frames_per_second": 10},
    )


def _seam_table(table: dict[str, Any], stiffness: float) -> dict[str, Any]:
    first, second = table["pairs"].T
    lines = {"from": {"vertices": first.tolist()}, "to": {"vertices": second.tolist()}, "match": "vertices"}
    return {**lines, "start": table["start"], "end": table["end"], "stiffness": stiffness}


def mean_edge(state: SewingState) -> float:
    """Mean length of the sides of all triangles at rest [m]."""
    corners = state.mesh.material_coordinates
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())


def stretch_range(stretches: Floats) -> tuple[float, float]:
    """1st and 99th percentile of principal stretches."""
    low, high = np.percentile(stretches, (1.0, 99.0))
    return float(low), float(high)
