"""Smoothed Coulomb friction with lagged normal forces."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.contact import friction_kernels as kernels
from clothsim.contact.barrier import Barrier
from clothsim.energies.base import Energy
from clothsim.energies.elementwise import Elementwise
from clothsim.energies.hessians import ElementHessian
from clothsim.energies.protocols import Idling, Lagged, Report
from clothsim.energies.step import Step

MIN_GAP_FRACTION = 0.25
"""Fraction of d_hat below which a gap counts as that in the first step: a start is no equilibrium, and a pair that
happens to be a millionth of d_hat apart there would stick by a normal force that no load balances."""


@dataclass(frozen=True)
class Contacts:
    """Bound barriers of the step; `start` (N, 3) [m] and dt [s] of the past that velocities refer to.

    least_gap: fraction of d_hat below which a gap counts as that.
    """

    barriers: tuple[Barrier, ...]
    start: Floats
    dt: float
    least_gap: float


NO_CONTACTS = Contacts((), np.zeros((0, 3)), 1.0, 0.0)


@dataclass(frozen=True)
class Friction(Elementwise, Energy, Idling, Lagged, Report):
    """E = sum mu F f0(|u|), u = (I - n n') sum_i g_i (x_i - x_i(start)) (Li et al. 2020, IPC, section 5).

    F [N], n and g: normal force, normal and weights of the closest points of each pair, lagged. f0 is |u| beyond eps_v
    dt and -u^3/(3 e^2) + u^2/e + e/3 below, e = eps_v dt: a sticking contact creeps slower than eps_v [m/s].

    Parameters
    ----------
    coefficients : (L, L) array
        mu of each pair of objects.
    labels : (N,) int array
        Object of each row of x.
    eps_v : float
        Speed below which a contact counts as sticking [m/s].
    iterations : int
        Solves of a step, each with the forces of the last.
    contacts : Contacts
        Barriers that the pairs come from.
    elements, weights, normals, limits : (p, 4), (p, 4), (p, 3), (p,) array
        Lagged pairs: rows, weights, normals and limits mu F [N].
    """

    coefficients: Floats
    labels: Ints
    eps_v: float
    iterations: int
    contacts: Contacts
    elements: Ints
    weights: Floats
    normals: Floats
    limits: Floats

    per_element = ("elements", "weights", "normals", "limits")

    begins_last = True
    incremental = True
    exact_in_newton = False  # it is positive semi-definite: the projected Hessian is the exact one

    @property
    def idle(self) -> bool:
        """True where no contact was lagged."""
        return not len(self.elements)

    @property
    def lag_iterations(self) -> int:
        """`iterations`."""
        return self.iterations

    def begin(self, step: Step) -> Self:
        """Copy for the step, with the contacts and their forces at its start.

        The gaps there were solved with the stiffness of the step before: with this step's own the forces would differ.
        """
        contacts = {name: energy for name, energy in step.bound.items() if isinstance(energy, Barrier)}
        stiffness = [float(step.memory.get(name, barrier.stiffness)) for name, barrier in contacts.items()]
        least_gap = 0.0 if step.time > 0.0 else MIN_GAP_FRACTION
        past = step.past
        bound = replace(self, contacts=Contacts(tuple(contacts.values()), past.positions, past.dt, least_gap))
        return bound._with_forces(step.positions, stiffness)

    def relag(self, x: Floats) -> Self:
        """Copy with the contact forces at x, for another lagged solve of the same step."""
        return self._with_forces(x, [barrier.stiffness for barrier in self.contacts.barriers])

    def _with_forces(self, x: Floats, stiffness: Sequence[float]) -> Self:
        """Copy with the active pairs at x and their normal forces."""
        pairs = zip(self.contacts.barriers, stiffness, strict=True)
        found = [barrier.normal_forces(x, kappa, self.contacts.least_gap) for barrier, kappa in pairs]
        if not found:
            return self
        elements, weights, differences, forces = (np.concatenate(parts) for parts in zip(*found, strict=True))
        limits = self.coefficients[self.labels[elements[:, 0]], self.labels[elements[:, 3]]] * forces
        sliding = limits > 0.0
        normals = differences[sliding] / np.linalg.norm(differences[sliding], axis=1, keepdims=True)
        return replace(
            self, elements=elements[sliding], weights=weights[sliding], normals=normals, limits=limits[sliding]
        )

    def value(self, x: Floats) -> float:
        """Dissipation potential of the step [J]."""
        return kernels.value(x, *self._lagged)

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return kernels.gradient(x, *self._lagged)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (p, 12, 12) [N/m]; positive semi-definite without projection."""
        return ElementHessian(self.elements, kernels.hessian(x, *self._lagged))

    def defaults_used(self) -> tuple[str, ...]:
        """eps_v, and the number of lagged solves a step."""
        times = f"{self.lag_iterations} time{'s' * (self.lag_iterations > 1)}"
        return (f"eps_v = {self.eps_v:g} m/s, normal forces lagged {times} a step",)

    def counts(self) -> dict[str, float]:
        """Number of lagged pairs."""
        return {"pairs": len(self.elements)}

    @property
    def _lagged(self) -> tuple[Floats, Ints, Floats, Floats, Floats, float]:
        slip = self.eps_v * self.contacts.dt
        return self.contacts.start, self.elements, self.weights, self.normals, self.limits, slip
