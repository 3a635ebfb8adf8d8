"""What a run is between two steps. A step is a function of this and of the scene, so a run can be resumed from it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from clothsim.arrays import Floats
from clothsim.mesh.world import World


@dataclass(frozen=True)
class Previous:
    """The state a step earlier, for formulas of two steps: positions, velocities (N, 3); dt: the step since [s]."""

    positions: Floats
    velocities: Floats
    dt: float


@dataclass(frozen=True)
class State:
    """time [s]; dt: length of the next step [s]; step, frame: how many are done; positions, velocities (N, 3) of x.

    memory: what each energy remembers of the last step (contact the stiffness with which it found its gaps).
    blocked_at: the time of the script [s] at which the last tries found no way on, nan where none did; blocked: how
    many they were. previous: None at a start and where the formula is of one step. temporal_error: what the steps so
    far added to the error of the positions, by `step_error` [m].
    """

    time: float
    dt: float
    step: int
    frame: int
    positions: Floats
    velocities: Floats
    blocked_at: float = math.nan
    blocked: int = 0
    memory: Mapping[str, float | Floats] = field(default_factory=dict)
    previous: Previous | None = None
    temporal_error: float = 0.0


def first_state(world: World, dt: float) -> State:
    """The world at its start."""
    return State(0.0, dt, 0, 0, world.start(), world.start_velocities())
