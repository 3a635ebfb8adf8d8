"""Stages of fit and dress: the pipeline that they are run by, and the shape and penetration counts after each."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Generic, Protocol, TypeVar

from clothsim import Progress
from clothsim.base.arrays import Floats, Ints
from clothsim.engine import Session
from clothsim.garments.fit.original_file import NO_ORIGINAL, Original
from clothsim.garments.fit.pieces import UNDIVIDED, Division
from clothsim.garments.penetration import NO_ROWS, Counts, counted
from transfer.signed_distance import BodySurface

Listener = Callable[[Progress], None]
"""Called after each step."""
Announcement = Callable[[Session], None]
"""Called once before the first step of a scene."""


@dataclass(frozen=True)
class Garment:
    """Garment: positions (n, 3) [m] on its source body; triangles (m, 3); notes: defaults used in reading.

    sewn: its panels were welded, so that three may meet in a seam; original: the file that it came in; division: pieces
    that follow it, or are stitched.
    """

    name: str
    positions: Floats
    triangles: Ints
    notes: tuple[str, ...] = ()
    sewn: bool = False
    original: Original = NO_ORIGINAL
    division: Division = UNDIVIDED


@dataclass(frozen=True)
class Stage:
    """Stage of a fit: name, seconds, positions (n, 3) [m] after it, their counts on the body; description: one line."""

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
            **({"carried": self.counts.carried} if self.counts.carried else {}),
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
    carried: Callable[[], Ints] = lambda: NO_ROWS,
) -> Stage:
    """Run a stage: `make` returns its positions and a description; checked on `body`, then `on_stage` is called.

    started: where the stage began before this call, its `perf_counter`; carried: called after `make`, the vertices that
    the body carries (`penetrations`).
    """
    started = perf_counter() if started is None else started
    positions, description = make()
    seconds = perf_counter() - started
    stage = Stage(name, seconds, positions, counted(positions, triangles, body, carried()), description)
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
