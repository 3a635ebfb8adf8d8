"""Stages of fit and dress: the pipeline that runs them, what is counted after each, and the scenes of their runs."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import process_time
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from clothsim import Gravity, Progress, Run, Scene, simulate
from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import IntersectionWarning
from clothsim.engine import Session
from clothsim.garments.penetration import NO_ROWS, Counts, count_penetrations
from transfer.signed_distance import BodySurface

Listener = Callable[[Progress], None]
"""Called after each step."""
Announcement = Callable[[Session], None]
"""Called once before the first step of a scene."""


@dataclass(frozen=True)
class Stage:
    """Stage of a fit: name, CPU seconds, positions (n, 3) [m] after it, their counts on the body; a line of text."""

    name: str
    seconds: float
    positions: Floats
    counts: Counts
    description: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Entry in summary.json."""
        return {
            "name": self.name,
            "seconds": self.seconds,
            "penetrating_vertices": self.counts.penetrating_vertices,
            "depth": self.counts.depth,
            "intersecting_pairs": self.counts.body_pairs,
            "self_pairs": self.counts.self_pairs,
            "said": self.description,
            **({"carried": self.counts.flypapered} if self.counts.flypapered else {}),
        }


def best_stage(stages: Sequence[Stage], on_target: int) -> int:
    """Number of the stage, from `on_target` on, with the fewest intersections; the first of equals.

    Those with the body count first: vertices inside, and pairs of triangles; then those of the garment with itself.
    """
    return min(range(on_target, len(stages)), key=lambda number: stages[number].counts.rank)


StageCallback = Callable[[Stage], None]
"""Called as each stage ends."""


def staged(
    name: str,
    triangles: Ints,
    body: BodySurface,
    make: Callable[[], tuple[Floats, str]],
    on_stage: StageCallback,
    started: float | None = None,
    flypapered: Callable[[], Ints] = lambda: NO_ROWS,
) -> Stage:
    """Run a stage: `make` returns its positions and a description; checked on `body`, then `on_stage` is called.

    started: where the stage began before this call, its `process_time`; flypapered: called after `make`, the vertices
    that the body carries (`penetrations`).
    """
    started = process_time() if started is None else started
    positions, description = make()
    seconds = process_time() - started
    stage = Stage(name, seconds, positions, count_penetrations(positions, triangles, body, flypapered()), description)
    on_stage(stage)
    return stage


class PipelineState(Protocol):
    """Garment on its way through a pipeline."""

    @property
    def failure(self) -> str:
        """Reason in a sentence; empty while nothing failed."""


Task = TypeVar("Task")
State = TypeVar("State", bound=PipelineState)


@dataclass(frozen=True)
class PlannedStage(Generic[Task, State]):
    """Stage of a pipeline.

    Attributes
    ----------
    name : str
        As in the summary.
    run : callable
        Returns the state after it, from the task and the state before.
    needed : callable
        False, of the task and the state before, where it is left out.
    """

    name: str
    run: Callable[[Task, State], State]
    needed: Callable[[Task, State], bool] = lambda task, state: True


def run_stages(stages: Sequence[PlannedStage[Task, State]], task: Task, state: State) -> State:
    """The state after all stages that are needed, or after the first that failed."""
    for stage in stages:
        if stage.needed(task, state):
            state = stage.run(task, state)
            if state.failure:
                break
    return state


GRAVITY = -Gravity.acceleration[2]
"""Acceleration of drapes [m/s2]."""
MOTION_SECONDS = 0.5
"""Duration of the motion of a body under a garment [s]: slow beside the damping, which holds the garment to it."""
CLOSING_REST = 0.3
"""Time for which closed seams come to rest [s]."""
CONTACT_FRACTION = 0.1
"""Distance at which contact begins while seams close, as a fraction of the mean edge."""
LEAST_BUDGET = 1e-3
"""CPU time that a run is given at least [s]."""
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
STORED_FIELDS = {"fields": ["contact_pressure"]}
"""Fields that drapes keep, to say how tight a garment is."""
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
    run={"duration": 6.0, "until": "rest", "rest_speed": 0.02, "frames_per_second": 10},
)


def fit_motion(stiffness: float, seams: Sequence[Mapping[str, Any]], self_contact: bool, slips: bool) -> StageScene:
    """Motion of a body under a garment; slips: without friction."""
    kept = {name: keys for name, keys in FIT_MOTION.effects.items() if not (slips and name == "friction")}
    return replace(FIT_MOTION, effects=_add_fitted_contact(kept, stiffness, seams, self_contact))


def fit_drape(
    stiffness: float,
    seams: Sequence[Mapping[str, Any]],
    self_contact: bool,
    up: Floats,
    duration: float | None = None,
    closes: bool = False,
) -> StageScene:
    """Drape of a fitted garment; duration [s]: None: as in FIT_DRAPE; closes: the body closes and carries vertices."""
    effects = _add_fitted_contact(FIT_DRAPE.effects, stiffness, seams, self_contact)
    effects["gravity"] = {"acceleration": (-GRAVITY * up).tolist()}
    run = {**FIT_DRAPE.run, **STORED_FIELDS, **({} if duration is None else {"duration": duration})}
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
    effects = {**DRESS_DRAPE.effects, **own, **({"seams": {"seam": seams}} if seams else {})}
    return replace(DRESS_DRAPE, effects=effects, run={**DRESS_DRAPE.run, **STORED_FIELDS})


def named_stage(name: str, listener: Listener | None) -> Listener | None:
    """The listener, with the name of the stage in its messages; None where there is none."""
    return None if listener is None else lambda progress: listener(replace(progress, stage=name))


def simulate_stage(
    scene: Scene,
    folder: Path,
    listener: Listener | None,
    announce: Announcement | None = None,
    ends: float = np.inf,
) -> Run:
    """Simulate without Python warnings of intersections: the stages count them.

    ends: the `process_time` at which a budget is spent, and the run ends as failed; it takes a step at least.
    """
    budget = max(ends - process_time(), LEAST_BUDGET) if ends < np.inf else None  # not of the scene, which is resumed
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IntersectionWarning)
        return simulate(scene, folder, listener, announce, overwrite=True, budget=budget)


def _add_fitted_contact(
    effects: Mapping[str, Mapping[str, Any]], stiffness: float, seams: Sequence[Mapping[str, Any]], self_contact: bool
) -> dict[str, Mapping[str, Any]]:
    """The effects with contact of this stiffness [Pa], and the seams of stitched pieces."""
    keys = {"stiffness": stiffness}
    own: dict[str, Mapping[str, Any]] = {"self_contact": keys} if self_contact else {}
    return {**own, **effects, "body_contact": keys, **({"seams": {"seam": seams}} if seams else {})}
