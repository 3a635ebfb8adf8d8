"""State of a run between two steps. A step is a function of it and of the scene, so a run can be resumed from it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from clothsim.base.arrays import Floats
from clothsim.mesh.world import World


@dataclass(frozen=True)
class Previous:
    """State one step earlier, for two-step formulas: positions, velocities (N, 3); dt: the step since [s]."""

    positions: Floats
    velocities: Floats
    dt: float


class Rest(Enum):
    """State of rest (`time_loop`); the value says it of the cloth."""

    MOVING = "it moves"
    CHANGING = "it is slow, but a load, a pin or a body still changes"
    DISTANT = "it is slow, but far from equilibrium"
    UNSTABLE = "it is slow, in an unstable equilibrium or near one"
    REACHED = "it is at rest"


@dataclass(frozen=True)
class Switch:
    """Record of an unstable equilibrium (`time_loop`).

    Parameters
    ----------
    growth_rate : float
        Of its lowest mode [1/s].
    vertex : int
        Row of x that the mode displaces most.
    displacement : tuple of float
        Of that vertex, by which the state was left [m]; 0 where it was kept.
    """

    growth_rate: float
    vertex: int
    displacement: tuple[float, ...]

    @property
    def left(self) -> bool:
        """True where the state was left."""
        return any(self.displacement)


@dataclass(frozen=True)
class State:
    """State between two steps.

    Parameters
    ----------
    time : float
        Time [s].
    dt : float
        Length of the next step [s].
    step, frame : int
        Numbers of steps and frames done.
    positions, velocities : (N, 3) float64
        All rows of x [m], [m/s].
    blocked_at : float
        Time of the prescribed motion at which the last tries were blocked [s]; nan where none was.
    blocked : int
        Number of those tries.
    memory : mapping
        History data of each energy from the last step (for contact the barrier stiffness).
    previous : Previous or None
        None at a start and with a one-step formula.
    temporal_error : float
        Sum of the local errors of the positions, by `step_error` [m].
    slow_steps : int
        Consecutive steps so far without a fast vertex, see `time_loop`.
    rest : Rest
        State of rest, as last seen at the end of a frame.
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
    slow_steps: int = 0
    rest: Rest = Rest.MOVING

    @property
    def at_rest(self) -> bool:
        """True where the cloth is at rest."""
        return self.rest is Rest.REACHED


def first_state(world: World, dt: float) -> State:
    """Return the state of the world at time 0."""
    return State(0.0, dt, 0, 0, world.start(), world.start_velocities())
