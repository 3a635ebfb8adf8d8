"""Optional protocols of energies, and the neutral values for energies without them.

An energy takes part by deriving from a class of this file; callers ask by `isinstance` or by the function below it.
"""

import abc
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self, TypeVar, cast

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.physics.energies.base import Energy, Step
from clothsim.physics.energies.hessians import Hessian


class Idling(abc.ABC):
    """An energy that may vanish for a whole step."""

    @property
    @abc.abstractmethod
    def idle(self) -> bool:
        """True where, bound to this step, E and its derivatives are 0 at every x: the step leaves the energy out."""


def is_idle(energy: Energy) -> bool:
    """True where a bound energy is left out of its step."""
    return isinstance(energy, Idling) and energy.idle


class RecoverableEnergy(abc.ABC):
    """An energy of the step, part of which is stored and may come back (the springs of static friction)."""

    @abc.abstractmethod
    def recoverable(self, x: Floats) -> float:
        """The recoverable part at x [J]."""


@dataclass(frozen=True)
class Grip:
    """What holds each row of x up to a limit.

    Parameters
    ----------
    limits : (N,) array
        Largest tangential forces of its contacts, added [N]; 0 where none holds it.
    normals : (N, 3, 3) array
        n n' of its contacts, their mean by limit: I - n n' takes the tangential part of a force.
    labels : (N,) int array
        Object of each row.
    """

    limits: Floats
    normals: Floats
    labels: Ints


class Gripping(abc.ABC):
    """An energy that holds up to a limit and then yields, as friction does: which of both is a matter of balance."""

    @abc.abstractmethod
    def grip(self) -> Grip:
        """The limits of the step to which it is bound."""


class Driven(abc.ABC):
    """An energy that may do external work, as wind does: a rise of the total energy is then no error."""

    @property
    @abc.abstractmethod
    def drives(self) -> bool:
        """True where it may do external work on the cloth."""


def is_driven(energy: Energy) -> bool:
    """True where an energy may do external work on the cloth."""
    return isinstance(energy, Driven) and energy.drives


class Nonconservative(abc.ABC):
    """An energy whose force has no potential at some rows, as a pressure on a free border.

    Its Hessian there is not the derivative of the force, and tells nothing of stability.
    """

    @property
    @abc.abstractmethod
    def rows_without_potential(self) -> Ints:
        """The rows of x, (k,); it has a potential where all of them are fixed."""


@dataclass(frozen=True)
class ChangingMaterial(Energy):
    """The energy of a material that changes over time; in a step it is that of the material at its end.

    Parameters
    ----------
    first : Energy
        That of the start.
    numbers : function of time
        What changes, at a time [s].
    made : function of numbers
        The energy of a material.
    """

    first: Energy
    numbers: Callable[[float], tuple[tuple[float, ...], ...]]
    made: Callable[[tuple[tuple[float, ...], ...]], Energy]

    def at(self, time: float) -> Energy:
        """The energy with the material at a time [s]."""
        numbers = self.numbers(time)
        return self.first if numbers == self.numbers(0.0) else self.made(numbers)

    def begin(self, step: Step) -> Energy:
        """The energy of the step's end, which works as one whose material never changes."""
        return self.at(step.time + step.dt).begin(step)

    def value(self, x: Floats) -> float:
        """E(x) at time 0 [J]."""
        return self.at(0.0).value(x)

    def gradient(self, x: Floats) -> Floats:
        """dE/dx at time 0, (N, 3) [N]."""
        return self.at(0.0).gradient(x)

    def hessian(self, x: Floats, project: bool = True) -> Hessian:
        """d2E/dx2 at time 0 [N/m]."""
        return self.at(0.0).hessian(x, project)

    def work_of_change(self, x: Floats, start: float, end: float, after: Energy) -> float:
        """Energy at x that the change of the material between two times [s] adds [J]; below 0 where it removes some.

        after: the energy of the step between them, whose material is that of its end.
        """
        if self.numbers(start) == self.numbers(end):
            return 0.0
        return after.value(x) - self.at(start).value(x)


def with_material_at(energies: Mapping[str, Energy], time: float) -> dict[str, Energy]:
    """Energies with those of a changing material as they are at a time [s]."""
    return {name: each.at(time) if isinstance(each, ChangingMaterial) else each for name, each in energies.items()}


class Anchored(abc.ABC):
    """An energy that ties vertices to fixed or moving places, so that a load on them has an equilibrium."""

    @property
    @abc.abstractmethod
    def anchored_rows(self) -> Ints:
        """The tied rows of x, (k,)."""


class Joining(abc.ABC):
    """An energy that ties vertices of cloth to one another, as stitches do: what it joins moves as one piece."""

    @property
    @abc.abstractmethod
    def joined_rows(self) -> Ints:
        """The rows of x of each tie, (m, k)."""


class BarrierGap(abc.ABC):
    """A barrier: an energy that becomes infinite where a gap closes."""

    @abc.abstractmethod
    def gap_change(self, x: Floats, dx: Floats, within: float = np.inf) -> float:
        """The largest relative change of a gap by the displacement dx, 0 where no gap is small enough to push.

        Only gaps below `within` count, a fraction of the range of the barrier.
        """


class ContactGap(BarrierGap):
    """A barrier on the distances of pairs of simplices."""

    d_hat: float
    """Distance beyond the offset at which the barrier begins [m]."""

    offset: float
    """Distance that is kept free (the thickness of contact) [m]."""

    @property
    def activation_distance(self) -> float:
        """The distance below which the barrier pushes, offset + d_hat [m]."""
        return self.offset + self.d_hat

    @abc.abstractmethod
    def minimum_gap(self, x: Floats) -> float:
        """The smallest distance of a pair less the offset [m] where it is below d_hat, else inf."""


class Coupling(abc.ABC):
    """An energy with pairs beyond the stencils of the mesh."""

    @abc.abstractmethod
    def couplings(self, x: Floats, dx: Floats) -> Ints:
        """Rows (m, k) that the Hessian is expected to couple on the path x -> x + dx.

        A guess to size the sparsity pattern: the assembly extends the pattern where pairs are missing.
        """


class Lagged(abc.ABC):
    """An energy with quantities that are lagged over the solves of a step (friction: normal forces)."""

    @property
    @abc.abstractmethod
    def lag_iterations(self) -> int:
        """Number of solves of a step."""

    @abc.abstractmethod
    def relag(self, x: Floats) -> Self:
        """A copy for the next solve of the same step, lagged quantities taken at x."""


def lag_iterations(energies: Iterable[Energy]) -> int:
    """The number of solves of a step: the most that any energy asks for."""
    return max((energy.lag_iterations for energy in energies if isinstance(energy, Lagged)), default=1)


class History(abc.ABC):
    """An energy whose binding to a step depends on the step before."""

    @property
    @abc.abstractmethod
    def carry_over(self) -> float | Floats:
        """The number or array that the next step finds in `Step.memory` (contact: stiffness; plasticity: angles)."""


class AdaptiveStiffness(History):
    """An energy with a stiffness for each step: what it stores at the same positions changes from step to step."""

    stiffness: float
    """Stiffness of the step that it is bound to [Pa]."""

    @abc.abstractmethod
    def stiffness_energy(self, x: Floats, before: float) -> float:
        """E(x) less that with the stiffness `before` [J]."""

    @abc.abstractmethod
    def has_sunk(self, start: Floats, x: Floats) -> bool:
        """True where the stiffness is too small for the step from `start` to x, (N, 3) [m] both, and may rise."""

    @abc.abstractmethod
    def stiffness_needed(self, x: Floats, gradient: Floats) -> float:
        """Stiffness [Pa] that bears the loads at x; gradient: of all energies there, (N, 3) [N]."""


class Restrictable(abc.ABC):
    """An energy that can leave out its terms at vertices that stand."""

    @abc.abstractmethod
    def restricted_to(self, moving: np.ndarray, x: Floats) -> Self:
        """A copy, equal up to a constant, for solves from x in which only `moving` vertices ((N,) booleans) move."""


AnyEnergy = TypeVar("AnyEnergy", bound=Energy)


def restricted(energy: AnyEnergy, moving: np.ndarray, x: Floats) -> AnyEnergy:
    """The energy restricted to moving vertices; the energy itself, as correct and more expensive, if it cannot be."""
    return energy.restricted_to(moving, x) if isinstance(energy, Restrictable) else energy


@dataclass(frozen=True)
class StartDerivatives:
    """Derivatives of a.(gradient of a bound energy) by the start of its step, (N, 3) each; None for zero.

    Parameters
    ----------
    positions : array
        By `Step.positions` [N/m times the unit of a].
    velocities : array
        By `Step.velocities`.
    past_positions, past_velocities : array
        By those of `Step.past`.
    memory : array
        By the energy's own entry of `Step.memory`, in its shape.
    """

    positions: Floats | None = None
    velocities: Floats | None = None
    past_positions: Floats | None = None
    past_velocities: Floats | None = None
    memory: Floats | None = None


class PastSensitivity(abc.ABC):
    """An energy with a closed form of its derivative by the start of the step, for differentiable runs.

    For others that differ from step to step it is found by differences (`backward_pass.past_by_differences`).
    """

    @abc.abstractmethod
    def past_sensitivity(self, step: Step, x: Floats, adjoint: Floats) -> StartDerivatives:
        """d(adjoint . gradient(x)) by the start of the `step` that the energy is bound to; adjoint (N, 3) [m]."""


class NoPastSensitivity(PastSensitivity):
    """An energy of which only time and load differ from step to step: its derivative by the start of a step is zero."""

    def past_sensitivity(self, step: Step, x: Floats, adjoint: Floats) -> StartDerivatives:
        """Zero."""
        return StartDerivatives()


class HistorySensitivity(History):
    """An energy with a closed form of the derivative of its force and of what it carries over, by the start of a step.

    What is discrete in its history (which contact continues which, what slides) is held.
    """

    @abc.abstractmethod
    def history_sensitivity(self, step: Step, x: Floats, adjoint: Floats, memory_adjoint: Floats) -> StartDerivatives:
        """d(adjoint . gradient(x) - memory_adjoint . carry_over); memory_adjoint: of `carry_over`, in its shape."""


class ElementGradients(abc.ABC):
    """An energy of elements that are not rows of its arrays, with the gradient of each."""

    @abc.abstractmethod
    def element_gradients(self, x: Floats) -> tuple[Ints, Floats]:
        """Rows (m, k) of the elements and their parts (m, k, 3) of dE/dx at x [N]."""


class EnergyReport:
    """The report of an energy to the user; each part is empty where a subclass does not give it."""

    def defaults_used(self) -> tuple[str, ...]:
        """Values chosen where the scene gives none."""
        return ()

    def final_notes(self, x: Floats, time: float) -> tuple[str, ...]:
        """Remarks on the end of a run at `time` [s], with the cloth at x."""
        return ()

    def tightest(self, x: Floats) -> str:
        """Name of a limit that is nearly active at x, for the message of a failed step; empty where none is."""
        return ""

    def counts(self) -> dict[str, float]:
        """Work that only the energy can count: `pairs`, `ccd_calls`, and the seconds of its phases by name."""
        return {}


NO_REPORT = EnergyReport()


def report_of(energy: Energy) -> EnergyReport:
    """The report of an energy, an empty one if it has none."""
    return energy if isinstance(energy, EnergyReport) else NO_REPORT


class Elementwise(Restrictable):
    """Restriction by dropping the elements without a moving vertex. For frozen dataclasses."""

    per_element: ClassVar[tuple[str, ...]]
    """Names of the arrays with one row an element; the first holds the rows of x of each element, (m, k)."""

    def restricted_to(self, moving: np.ndarray, x: Floats) -> Self:
        """The elements with a vertex that moves."""
        selected = np.flatnonzero(moving[getattr(self, self.per_element[0])].any(axis=1))
        return replace(cast("Any", self), **{name: getattr(self, name)[selected] for name in self.per_element})

    def reads_beyond(self, n: int) -> bool:
        """True where an integer of an element may be a row from n on."""
        arrays = [getattr(self, name) for name in self.per_element]
        return any(bool(array.max(initial=-1) >= n) for array in arrays if array.dtype.kind in "iu")
