"""Closing of seams under contact: strings that shorten draw the panels round the body; nothing ever intersects.

There is neither gravity nor friction, and strong damping: what counts is the end. No gap closes faster than SPEED, so
that the fabric is hardly strained. Whether a seam is closed is measured; strings are shortened in rounds until all are.
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
CLOSED = 1.5
"""Gap of a closed seam, as a multiple of the distance at which contact begins."""
SETTINGS: dict[str, Any] = {
    "effects": {
        "inertia": {},
        "membrane": {},
        "bending": {"model": "hinge"},
        "damping": {"rate": 10.0},
        "body_contact": {},
        "self_contact": {},
    },
    "solver": {"dt": 0.02, "tolerance": 0.05, "max_iterations": 200, "integrator": "backward_euler"},
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
        scene = _scene(state, body, fabric, seam_tables, end + HOLD)
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
    single = []
    for seam in seams:
        pairs = state.pairs(seam)
        start = DARTS if darts and not is_dart(seam) else 0.0
        duration = DARTS if darts and is_dart(seam) else max(SHORTEST, float(state.gaps(seam).max(initial=0)) / SPEED)
        if len(pairs) > 1:
            tables.append({"pairs": pairs, "start": start, "end": start + duration})
        else:
            single.append(pairs)
    latest = max(tables, key=lambda table: table["end"])
    latest["pairs"] = np.concatenate([latest["pairs"], *single])  # a line needs two vertices
    return tables, latest["end"]


def _scene(state: SewingState, body: Figure, fabric: str, seam_tables: list[dict[str, Any]], duration: float) -> Scene:
    cloth = ClothArrays(
        state.positions, state.triangles, rest=state.mesh.material_coordinates, name="garment", fabric=fabric, sewn=True
    )
    return Scene(
        cloth=cloth,
        body=BodyArrays(body.positions, body.triangles, name="body"),
        effects={**SETTINGS["effects"], "seams": {"seam": [_seam_table(table) for table in seam_tables]}},
        solver=SETTINGS["solver"],
        run={"duration": duration, "frames_per_second": 10},
    )


def _seam_table(table: dict[str, Any]) -> dict[str, Any]:
    first, second = table["pairs"].T
    lines = {"from": {"vertices": first.tolist()}, "to": {"vertices": second.tolist()}, "match": "vertices"}
    return {**lines, "start": table["start"], "end": table["end"]}


def stretch_range(stretches: Floats) -> tuple[float, float]:
    """1st and 99th percentile of principal stretches."""
    low, high = np.percentile(stretches, (1.0, 99.0))
    return float(low), float(high)
