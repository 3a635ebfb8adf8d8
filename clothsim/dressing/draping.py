"""Drape of a sewn garment on its body: gravity, friction, until it rests."""

import warnings
from pathlib import Path
from typing import Any

from clothsim.dressing.sewing_state import SewingState
from clothsim.errors import IntersectionWarning
from clothsim.fitting.inputs import Figure
from clothsim.run.recorded_run import Announcement, Listener
from clothsim.run.results import Run
from clothsim.run.simulate import simulate
from clothsim.scene.cloth_arrays import BodyArrays, ClothArrays
from clothsim.scene.scene import Scene

LONGEST = 3.0
"""Bound on the time of a drape [s]."""
FRICTION = 0.4
SETTINGS: dict[str, Any] = {
    "effects": {
        "inertia": {},
        "membrane": {},
        "bending": {"model": "hinge"},
        "damping": {"rate": 4.0},
        "body_contact": {},
        "self_contact": {},
        "friction": {"coefficient": FRICTION},
    },
    "solver": {"dt": 0.02, "tolerance": 0.05, "max_iterations": 200, "integrator": "backward_euler"},
    "run": {"duration": LONGEST, "until": "rest", "rest_speed": 0.02, "frames_per_second": 10},
}


def drape(
    state: SewingState,
    body: Figure,
    fabric: str,
    folder: Path,
    listener: Listener | None,
    announce: Announcement | None,
) -> Run:
    """Run of the garment under gravity until it rests. InputError for a start that cannot be simulated."""
    strings = [state.pairs(state.mesh.seams[k]) for k in state.open_seams]
    seam = [
        {"from": {"vertices": a.tolist()}, "to": {"vertices": b.tolist()}, "match": "vertices", "end": 1e-3}
        for a, b in (pairs.T for pairs in strings)
    ]
    effects = {**SETTINGS["effects"], "gravity": {"acceleration": (-9.81 * body.up).tolist()}}
    scene = Scene(
        cloth=ClothArrays(
            state.positions,
            state.triangles,
            rest=state.mesh.material_coordinates,
            name="garment",
            fabric=fabric,
            sewn=True,
        ),
        body=BodyArrays(body.positions, body.triangles, name="body"),
        effects=effects | ({"seams": {"seam": seam}} if seam else {}),
        solver=SETTINGS["solver"],
        run=SETTINGS["run"],
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IntersectionWarning)
        return simulate(scene, folder, listener, announce, overwrite=True)
