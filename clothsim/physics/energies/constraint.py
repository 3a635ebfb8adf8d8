"""Constraints: effects without an energy, which prescribe positions exactly."""

import abc
from collections.abc import Mapping
from dataclasses import dataclass

from clothsim.base.arrays import Floats, Ints


@dataclass(frozen=True)
class Prescribed:
    """Vertices with prescribed positions: `vertices` (k,), rows of x, and their `positions` (k, 3) [m]."""

    vertices: Ints
    positions: Floats


class Constraint(abc.ABC):
    """Dirichlet positions over time."""

    @property
    @abc.abstractmethod
    def still(self) -> bool:
        """True where the prescribed positions never change."""

    @abc.abstractmethod
    def at(self, time: float) -> Prescribed:
        """The prescribed vertices and their positions at `time` [s]."""

    def holder(self, row: int) -> str:
        """The scene's name of the group that prescribes a row of x ("pins.group[1]"), empty if none does."""
        return ""

    def angular_velocities(self) -> Mapping[str, Floats]:
        """The angular velocity (3,) [rad/s] of each group that turns as a rigid body, by its name."""
        return {}
