"""Scenes of the stages of fit and dress: effects, solver and run sections, and their simulation."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from clothsim import Gravity, Run, Scene, simulate
from clothsim.base.arrays import Floats
from clothsim.base.errors import IntersectionWarning
from clothsim.garments.stages import Announcement, Listener

GRAVITY = -Gravity.acceleration[2]
"""Acceleration of drapes [m/s2]."""
MOTION_SECONDS = 0.5
"""Duration of the motion of a body under a garment [s]: slow beside the damping, which holds the garment to it."""
CLOSING_REST = 0.3
"""Time for which closed seams come to rest [s]."""
CONTACT_FRACTION = 0.1
"""Distance at which contact begins while seams close, as a fraction of the mean edge."""
CLOSING_FRICTION = 0.5
"""Friction with the body once all seams were drawn together: stiffer springs would pull the garment off."""


@dataclass(frozen=True)
class StageScene:
    """Sections of the scene of a stage, as in a scene file."""

    effects: Mapping[str, Mapping[str, Any]]
    solver: Mapping[str, Any]
    run: Mapping[str, Any] = field(default_factory=dict)
    contact: Mapping[str, Any] = field(default_factory=dict)

    def scene(self, **parts: Any) -> Scene:
        """The scene with its other sections: cloth, body, seed, directory."""
        return Scene(effects=self.effects, solver=self.solver, contact=self.contact, run=self.run, **parts)


# Only where it ends counts: backward Euler damps the motion until there, and hinges bend the garment cheapest.
# tolerance [m/s]: 5 mm a step: what is in between is free of intersections, and that is enough. On a body of 47,500
# triangles .02 takes twice to three times the iterations, and steps of .01 s five halves.
# friction keeps the garment where it is on the body. Without, a growing body squeezes it from the hips up to the waist,
# and the folds that it makes there take four times the Newton iterations. Where a crease of the body closes on the
# garment it must slip out: what fails with friction is tried without.
FIT_MOTION = StageScene(
    effects={
        "inertia": {},
        "membrane": {},
        "bending": {"model": "hinge"},
        "damping": {"rate": 20.0},
        "body_contact": {},
        "friction": {"coefficient": 0.5},
    },
    solver={"dt": 0.05, "tolerance": 0.1, "max_iterations": 200, "integrator": "backward_euler"},
    run={"duration": MOTION_SECONDS, "frames_per_second": 2},
)
FIT_DRAPE = StageScene(
    effects={
        "inertia": {},
        "membrane": {},
        "bending": {"model": "hinge"},
        "gravity": {},
        "damping": {"rate": 4.0},
        "body_contact": {},
        "friction": {"coefficient": 0.3},
    },
    solver={
        "dt": 0.05,
        "tolerance": 0.02,
        "max_iterations": 200,
        "integrator": "backward_euler",
        "unstable_equilibrium": "keep",
    },
    run={"duration": 1.0, "frames_per_second": 10, "until": "rest", "rest_speed": 0.02},
)
# There is no gravity, and strong damping: what counts is the end.
DRESS_CLOSING = StageScene(
    effects={
        "inertia": {},
        "membrane": {},
        "bending": {"model": "hinge"},
        "damping": {"rate": 40.0},
    },
    solver={"dt": 0.04, "tolerance": 0.1, "max_iterations": 200, "integrator": "backward_euler"},
)
DRESS_DRAPE = StageScene(
    effects={
        "inertia": {},
        "membrane": {},
        "bending": {"model": "hinge"},
        "damping": {"rate": 4.0},
        "body_contact": {},
        "self_contact": {},
    },
    solver={"dt": 0.02, "tolerance": 0.05, "max_iterations": 200, "integrator": "backward_euler"},
    run={"duration": 3.0, "until": "rest", "rest_speed": 0.02, "frames_per_second": 10},
)


def fit_motion(stiffness: float, seams: Sequence[Mapping[str, Any]], self_contact: bool, slips: bool) -> StageScene:
    """Motion of a body under a garment; slips: without friction."""
    kept = {name: keys for name, keys in FIT_MOTION.effects.items() if not (slips and name == "friction")}
    return replace(FIT_MOTION, effects=_with_fitted_contact(kept, stiffness, seams, self_contact))


def fit_drape(
    stiffness: float,
    seams: Sequence[Mapping[str, Any]],
    self_contact: bool,
    up: Floats,
    duration: float | None = None,
    closes: bool = False,
) -> StageScene:
    """Drape of a fitted garment; duration [s]: None: as in FIT_DRAPE; closes: the body closes and carries vertices."""
    effects = _with_fitted_contact(FIT_DRAPE.effects, stiffness, seams, self_contact)
    effects["gravity"] = {"acceleration": (-GRAVITY * up).tolist()}
    run = FIT_DRAPE.run if duration is None else {**FIT_DRAPE.run, "duration": duration}
    return replace(FIT_DRAPE, effects=effects, run=run, contact={"pinch": "carry"} if closes else {})


def dress_closing(
    mean_edge: float, seams: Sequence[Mapping[str, Any]], held: Sequence[int], duration: float, friction: bool
) -> StageScene:
    """A round of closing; held: vertices that do not move; duration [s]: until the last seam is closed."""
    contact = {"d_hat": CONTACT_FRACTION * mean_edge}
    effects = {**DRESS_CLOSING.effects, "body_contact": contact, "self_contact": contact, "seams": {"seam": seams}}
    if friction:
        effects["friction"] = {"coefficient": CLOSING_FRICTION}
    if len(held):
        effects["pins"] = {"select": held}
    run = {"duration": duration + CLOSING_REST, "frames_per_second": 10}
    return replace(DRESS_CLOSING, effects=effects, run=run)


def dress_drape(up: Floats, seams: Sequence[Mapping[str, Any]], friction: float) -> StageScene:
    """Drape of a sewn garment; seams: those that are not welded."""
    own = {"friction": {"coefficient": friction}, "gravity": {"acceleration": (-GRAVITY * up).tolist()}}
    return replace(DRESS_DRAPE, effects={**DRESS_DRAPE.effects, **own, **({"seams": {"seam": seams}} if seams else {})})


def simulate_stage(scene: Scene, folder: Path, listener: Listener | None, announce: Announcement | None = None) -> Run:
    """Simulate without Python warnings of intersections: the stages count them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IntersectionWarning)
        return simulate(scene, folder, listener, announce, overwrite=True)


def _with_fitted_contact(
    effects: Mapping[str, Mapping[str, Any]], stiffness: float, seams: Sequence[Mapping[str, Any]], self_contact: bool
) -> dict[str, Mapping[str, Any]]:
    """The effects with contact of this stiffness [Pa], and the seams of stitched pieces."""
    keys = {"stiffness": stiffness}
    own: dict[str, Mapping[str, Any]] = {"self_contact": keys} if self_contact else {}
    return {**own, **effects, "body_contact": keys, **({"seams": {"seam": seams}} if seams else {})}
