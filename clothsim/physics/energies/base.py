"""Energies: terms of E(x) with value, gradient and Hessian."""

import abc
from dataclasses import dataclass
from typing import ClassVar, Self

from clothsim.base.arrays import Floats
from clothsim.physics.energies.hessians import Hessian
from clothsim.physics.energies.step import Step


class Energy(abc.ABC):
    """A term of E(x) = sum of energies over the vertex positions x (N, 3) [m], relative to `World.origin`.

    A subclass is a frozen dataclass with `value`, `gradient` and `hessian`. `begin` and `step_limit` are optional; what
    few energies have besides (contact gap, lagged data, history, report) is in `energies.protocols`.
    """

    begins_last: ClassVar[bool] = False
    """True where `begin` reads `Step.gradient` or `Step.bound`: such energies are bound after all others."""

    incremental: ClassVar[bool] = False
    """True where the value belongs to the step (inertia, dissipation) and is no energy of the state."""

    exact_in_newton: ClassVar[bool] = True
    """False where Newton's exact model takes the projected Hessian too: the exact one costs more than it saves."""

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

    def begin(self, step: Step) -> Self:
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
