"""Energies: terms of E(x) with value, gradient and Hessian; the step that binds them; constraints."""

import abc
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.body import LaterMotion, RigidMotion
from clothsim.physics.energies.hessians import Hessian

CONTACT_TIME_SCALE = 0.01
"""`contact_time` at a d_hat of 2 mm on the earth [s], the usual dt of a scene; of steps that no scene makes."""

PART_OF_FALL = 0.49
"""Square of the contact time over d_hat / g."""


def contact_time(d_hat: float, gravity: float) -> float:
    """Return the shortest time in which the barrier of contact stops a motion [s].

    That of a fall through a quarter of `d_hat` [m] at the acceleration `gravity` [m/s2]. The barrier of a shorter dt is
    no stiffer: the energy stored below d_hat would grow with 1/dt^2, and finer steps would eject what starts there. So
    it is at most about what lifts the cloth by d_hat, whatever the units of the scene.

    Examples
    --------
    >>> round(contact_time(2e-3, 9.81), 4), round(contact_time(2e-2, 98.1), 4)
    (0.01, 0.01)
    """
    return float((PART_OF_FALL * d_hat / gravity) ** 0.5)


@dataclass(frozen=True)
class Past:
    """Past positions and velocities in the difference formula: velocities at the end are v = (x - positions) / dt.

    Backward Euler: x_n, v_n and h; BDF2: x^, v^ and b h (docs/theory.md#time-integration). Inertia, damping and
    friction use no other time.

    Parameters
    ----------
    positions, velocities : (N, 3) arrays
        [m], [m/s].
    dt : float
        Effective length of the step [s].
    """

    positions: Floats
    velocities: Floats
    dt: float


@dataclass(frozen=True)
class Step:
    """A step of the integrator, as an energy sees it in `Energy.begin`.

    Parameters
    ----------
    time, dt : float
        Start and length of the step [s].
    positions, velocities : (N, 3) arrays
        At the start [m], [m/s], in the order of the world: cloths, bodies, ghosts.
    load : float
        Fraction of the loads that acts; below 1 only during a quasi-static ramp.
    gradient : (N, 3) array
        Sum of the gradients of the energies that do not begin last, at the start [N].
    bound : mapping
        The energies already bound to this step, by name. Complete, as `gradient` is, for energies that begin last.
    memory : mapping
        The `History.carry_over` of each energy from the step before, by name.
    multistep_past : Past or None
        The past of a difference formula other than backward Euler.
    contact_time_scale : float or None
        Time in which the barrier stops a motion [s], None for dt.
    contact_time : float
        Least such time of the scene [s], see `contact_time`.
    least_stiffness : mapping
        Stiffness [Pa] that an earlier solve of this step found to be needed, by name of contact.
    """

    time: float
    dt: float
    positions: Floats
    velocities: Floats
    load: float
    gradient: Floats
    bound: Mapping[str, object] = field(default_factory=dict)
    memory: Mapping[str, float | Floats] = field(default_factory=dict)
    multistep_past: Past | None = None
    contact_time_scale: float | None = None
    contact_time: float = CONTACT_TIME_SCALE
    least_stiffness: Mapping[str, float] = field(default_factory=dict)

    @property
    def past(self) -> Past:
        """The past from which velocities are computed."""
        return self.multistep_past or Past(self.positions, self.velocities, self.dt)


class Energy(abc.ABC):
    """A term of E(x) = sum of energies over the vertex positions x (N, 3) [m], relative to `World.origin`.

    A subclass is a frozen dataclass with `value`, `gradient` and `hessian`. `begin` and `step_limit` are optional; what
    few energies have besides (contact gap, lagged data, history, report) is in `energies.protocols`.
    """

    depends_on_other_energies: ClassVar[bool] = False
    """True where `begin` reads `Step.gradient` or `Step.bound`: such energies are bound after all others."""

    incremental: ClassVar[bool] = False
    """True where the value belongs to the step (inertia, dissipation) and is not an energy of the state."""

    exact_in_newton: ClassVar[bool] = True
    """False where Newton's exact model takes the projected Hessian too: the exact one costs more than it saves."""

    def reads_beyond(self, n: int) -> bool:
        """True where E depends on more than the first n rows of x, as may be by default: else it is called with those.

        A cloth beside a body is a tenth of x.
        """
        return True

    @abc.abstractmethod
    def value(self, x: Floats) -> float:
        """E(x) [J]; +inf where x is not admissible, never NaN."""

    @abc.abstractmethod
    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]; zero in rows that E does not depend on."""

    @abc.abstractmethod
    def hessian(self, x: Floats, project: bool = True) -> Hessian:
        """d2E/dx2 [N/m].

        Parameters
        ----------
        x : (N, 3) array
            Positions [m].
        project : bool
            True for a positive semi-definite approximation (the Newton direction), False for the exact one.

        Returns
        -------
        ByElement, SumHessian or (3N, 3N) sparse array
            Blocks by element, a sum of such and of implicit ones (not projected), or the matrix.
        """

    def begin(self, step: Step) -> "Energy":
        """A copy bound to the step, with lagged quantities and targets; the energy itself where nothing is lagged.

        Binding makes a copy so that a rejected step needs no undo.
        """
        return self

    def step_limit(self, x: Floats, dx: Floats, most: float = 1.0) -> float:
        """The largest admissible fraction of the displacement dx (N, 3) [m], in [0, most] (CCD, strain limit)."""
        return most


@dataclass(frozen=True)
class Off:
    """A named effect without anything to do, returned by its builder: the `reason` is reported by `explain`."""

    reason: str


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


@dataclass(frozen=True)
class PinnedGroup:
    """Vertices with one prescribed motion.

    Parameters
    ----------
    vertices : (k,) int array
        Rows of x.
    start : (k, 3) array
        Positions at time 0 [m].
    motion : RigidMotion
        Prescribed motion.
    name : str
        The scene's name, "pins" or "pins.group[1]".
    """

    vertices: Ints
    start: Floats
    motion: RigidMotion | LaterMotion
    name: str


@dataclass(frozen=True)
class PinsConstraint(Constraint):
    """Prescribed positions of the groups, with the ghost vertices that fix the direction at clamped edges."""

    groups: tuple[PinnedGroup, ...]

    @property
    def still(self) -> bool:
        """True where no group ever moves."""
        return all(group.motion.still for group in self.groups)

    def at(self, time: float) -> Prescribed:
        """The pinned vertices and their positions at `time` [s]."""
        return Prescribed(
            np.concatenate([group.vertices for group in self.groups]),
            np.concatenate([group.motion.apply(group.start, time) for group in self.groups]),
        )

    def holder(self, row: int) -> str:
        """The name of the group that prescribes a row of x, empty if none does."""
        return next((group.name for group in self.groups if row in group.vertices), "")

    def angular_velocities(self) -> Mapping[str, Floats]:
        """Of each group, also one that was set by hand."""
        motions = {group.name: group.motion for group in self.groups}
        return {
            name: (each.motion if isinstance(each, LaterMotion) else each).angular_velocity
            for name, each in motions.items()
        }
