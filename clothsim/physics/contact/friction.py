"""Coulomb friction with lagged normal forces, which holds by anchors or creeps."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.physics.contact import friction_kernels as kernels
from clothsim.physics.contact.anchors import Anchors, anchors_at, anchors_from, relative_positions, tangential
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.elementwise import Elementwise
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.physics.energies.protocols import History, Idling, Lagged, PastSensitivity, Report, SeesPast, Storing
from clothsim.physics.energies.step import Step

# Rigid part of displacements: translation and rotation of each object as a whole.


def rigid_displacements(x: Floats, displacements: Floats, labels: Ints) -> Floats:
    """The rigid displacements nearest to those of each object.

    Of each object u + r x d is fitted by least squares, with the offsets d from its mean position. Objects without
    extent across a line turn about none of it.

    Parameters
    ----------
    x, displacements : (n, 3) array
        Positions and small displacements [m].
    labels : (n,) int array
        Object of each row.

    Returns
    -------
    (n, 3) array [m]

    Examples
    --------
    >>> x = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    >>> turned = np.cross([0, 0, 0.1], x)
    >>> bool(np.allclose(rigid_displacements(x, turned, np.zeros(4, int)), turned))
    True
    """
    found = np.zeros_like(displacements)
    for label in np.unique(labels):
        rows = labels == label
        mean = displacements[rows].mean(axis=0)
        offsets = x[rows] - x[rows].mean(axis=0)
        squares = offsets.T @ offsets
        inertia = np.trace(squares) * np.eye(3) - squares
        momentum = np.cross(offsets, displacements[rows] - mean).sum(axis=0)
        rotation = np.linalg.lstsq(inertia, momentum, rcond=None)[0]
        found[rows] = mean + np.cross(rotation, offsets)
    return found


NAME = "friction"

MIN_GAP_FRACTION = 0.25
"""Fraction of d_hat below which a gap counts as that in the first step: a start is no equilibrium, and a pair that
happens to be a millionth of d_hat apart there would stick by a normal force that no load balances."""


@dataclass(frozen=True)
class Contacts:
    """Bound barriers of the step; `start` (N, 3) [m] that displacements refer to, displacement that slides [m].

    least_gap: fraction of d_hat below which a gap counts as that; displacements: (N, 3) that the velocities at the
    start would make in the step [m].
    """

    barriers: tuple[Barrier, ...]
    start: Floats
    slip: float
    least_gap: float
    displacements: Floats


NO_CONTACTS = Contacts((), np.zeros((0, 3)), 1.0, 0.0, np.zeros((0, 3)))
NO_ANCHORS = anchors_from(())


@dataclass(frozen=True)
class FrictionEnergy(Elementwise, Energy, History, Idling, Lagged, Report, SeesPast, Storing):
    """E = sum mu F f0(|u|), u = z + (I - n n') sum_i g_i (x_i - x_i(start)) (Li et al. 2020, IPC, section 5).

    F [N], n and g: normal force, normal and weights of the closest points of each pair, lagged. f0 is |u| beyond e and
    -u^3/(3 e^2) + u^2/e + e/3 below. With anchors z is the elastic slip of the pair at the start of the step
    (`anchors`) and e the largest one: a contact below mu_static F holds its place. Without, z is 0 and e = eps_v dt: it
    creeps slower than eps_v.

    Parameters
    ----------
    kinetic, static : (L, L) array
        mu_kinetic and mu_static of each pair of objects.
    labels : (N,) int array
        Object of each row of x.
    triangles_at : (N, 3) int array
        Rows of a triangle at each vertex of a body (`anchors.turners_of`).
    eps_v : float
        Speed below which a contact creeps [m/s]; 0 with anchors.
    elastic_slip : float
        Largest elastic slip of an anchor [m]; 0 without anchors.
    iterations : int
        Solves of a step, each with the forces of the last.
    contacts : Contacts
        Barriers that the pairs come from.
    anchors : Anchors
        Of the contacts of the step before, as they are at its end.
    elements, weights, normals, slips, turns, limits, slides : (p, 4), (p, 4), (p, 3), (p, 3), (p, 3), (p,), (p,) array
        Lagged pairs: rows, weights, normals, z [m], `Anchors.turning` of the step as the velocities at its start
        predict it (`_predictable`) [m], limits mu F [N], and whether they slide.
    """

    kinetic: Floats
    static: Floats
    labels: Ints
    triangles_at: Ints
    eps_v: float
    elastic_slip: float
    iterations: int
    contacts: Contacts
    anchors: Anchors
    elements: Ints
    weights: Floats
    normals: Floats
    slips: Floats
    turns: Floats
    limits: Floats
    slides: np.ndarray

    per_element = ("elements", "weights", "normals", "slips", "turns", "limits", "slides")

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

    @property
    def carry_over(self) -> Floats:
        """The contacts of the step, with their slips and points at its start (`Anchors.as_array`)."""
        if not self.elastic_slip:
            return np.zeros(0)
        pairs = self.elements, self.weights, self.normals, self.slips, self.slides
        return anchors_at(self.contacts.start, *pairs, self.triangles_at).as_array()

    def begin(self, step: Step) -> Self:
        """Copy for the step, with the contacts and their forces at its start.

        The gaps there were solved with the stiffness of the step before: with this step's own the forces would differ.
        """
        found = {name: energy for name, energy in step.bound.items() if isinstance(energy, Barrier)}
        stiffness = [float(step.memory.get(name, barrier.stiffness)) for name, barrier in found.items()]
        least_gap = 0.0 if step.time > 0.0 else MIN_GAP_FRACTION
        start, slip, anchors = step.past.positions, self.eps_v * step.past.dt, NO_ANCHORS
        if self.elastic_slip:
            start, slip = step.positions, self.elastic_slip
            anchors = anchors_from(step.memory.get(NAME, ()), self.triangles_at)
            objects = self.labels[anchors.elements[:, 0]], self.labels[anchors.elements[:, 3]]
            anchors = anchors.after(step.positions, slip, self.kinetic[objects] / self.static[objects])
        contacts = Contacts(tuple(found.values()), start, slip, least_gap, step.dt * step.velocities)
        return replace(self, contacts=contacts, anchors=anchors)._with_forces(step.positions, stiffness)

    def relag(self, x: Floats) -> Self:
        """Copy with the contact forces at x, for another lagged solve of the same step."""
        return self._with_forces(x, [barrier.stiffness for barrier in self.contacts.barriers])

    def _with_forces(self, x: Floats, stiffness: Sequence[float]) -> Self:
        """Copy with the pairs at x and their normal forces."""
        pairs = zip(self.contacts.barriers, stiffness, strict=True)
        found = [barrier.normal_forces(x, kappa, self.contacts.least_gap) for barrier, kappa in pairs]
        if not found:
            return self
        elements, weights, differences, forces = (np.concatenate(parts) for parts in zip(*found, strict=True))
        objects = self.labels[elements[:, 0]], self.labels[elements[:, 3]]
        held = (self.static[objects] * forces) > 0.0
        elements, weights, differences, forces = (each[held] for each in (elements, weights, differences, forces))
        kinetic, static = self.kinetic[objects][held] * forces, self.static[objects][held] * forces
        normals = differences / np.linalg.norm(differences, axis=1, keepdims=True)
        slips, turns, slides = self._inherited(elements, weights, normals)
        limits = np.where(slides, kinetic, static)
        geometry = {"elements": elements, "weights": weights, "normals": normals, "slips": slips, "turns": turns}
        return replace(self, **geometry, limits=limits, slides=slides)

    def _inherited(self, elements: Ints, weights: Floats, normals: Floats) -> tuple[Floats, Floats, np.ndarray]:
        """Slips and turns (p, 3) [m] of contacts, and which slide (p,): a new one if its velocity takes it beyond e."""
        none = np.zeros((len(elements), 3))
        if not self.elastic_slip or not len(elements):
            return none, none, np.zeros(len(elements), bool)
        parents, slips = self.anchors.inherited(elements, weights, normals, self.labels)
        start, displacements = self.contacts.start, self.contacts.displacements
        still = np.zeros(len(elements), bool)
        at_start = anchors_at(start, elements, weights, normals, none, still, self.triangles_at)
        turns = tangential(at_start.turning(start + self._predictable(at_start)), normals)
        moves = tangential(relative_positions(displacements, elements, weights), normals) - turns
        slides = np.linalg.norm(moves, axis=1) > self.elastic_slip
        known = parents >= 0
        slides[known] = self.anchors.slides[parents[known]]
        return slips, turns, slides

    def _predictable(self, anchors: Anchors) -> Floats:
        """Displacements (N, 3) [m] of the step that are known at its start: of a cloth in contact its rigid part.

        The tilt of its triangles is not: friction that follows the tilt of the step before drives it back and forth.
        """
        displacements = self.contacts.displacements
        cloths = np.unique(self.labels[anchors.elements[anchors.turners[:, 0] < 0]])
        if not len(cloths):
            return displacements
        rows, found = np.isin(self.labels, cloths), displacements.copy()
        found[rows] = rigid_displacements(self.contacts.start[rows], displacements[rows], self.labels[rows])
        return found

    def value(self, x: Floats) -> float:
        """Dissipation potential of the step [J]."""
        return kernels.value(x, *self._lagged)

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return kernels.gradient(x, *self._lagged)

    def stored(self, x: Floats) -> float:
        """Energy of the springs of anchors [J]; 0 where contacts creep."""
        if not self.elastic_slip:
            return 0.0
        displacements = relative_positions(x - self.contacts.start, self.elements, self.weights)
        slips = self.slips - self.turns + tangential(displacements, self.normals)
        fractions = np.minimum(np.linalg.norm(slips, axis=1) / self.elastic_slip, 1.0)
        return float(self.elastic_slip * (self.limits * fractions**2 * (1.0 - fractions / 3.0)).sum())

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (p, 12, 12) [N/m]; positive semi-definite without projection."""
        return ElementHessian(self.elements, kernels.hessian(x, *self._lagged))

    def past_sensitivity(self, step: Step, x: Floats, adjoint: Floats) -> PastSensitivity:
        """By the start of the displacements, and by what is lagged; for contacts that creep."""
        from clothsim.physics.contact.friction_sensitivity import friction_sensitivity  # for differentiable runs alone

        return friction_sensitivity(self, step, x, adjoint)

    def defaults_used(self) -> tuple[str, ...]:
        """Elastic slip or eps_v, and the number of lagged solves a step."""
        times = f"{self.lag_iterations} time{'s' * (self.lag_iterations > 1)}"
        how = f"elastic slip {self.elastic_slip:g} m" if self.elastic_slip else f"eps_v = {self.eps_v:g} m/s"
        return (f"{how}, normal forces lagged {times} a step",)

    def counts(self) -> dict[str, float]:
        """Number of lagged pairs."""
        return {"pairs": len(self.elements)}

    @property
    def _lagged(self) -> tuple[Floats, Ints, Floats, Floats, Floats, Floats, float]:
        contacts = self.contacts
        slips = self.slips - self.turns
        return contacts.start, self.elements, self.weights, self.normals, self.limits, slips, contacts.slip
