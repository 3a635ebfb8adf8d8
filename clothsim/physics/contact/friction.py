"""Coulomb friction with lagged normal forces, which holds by anchors or creeps."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import inlined, kernel, natural
from clothsim.base.vectors import dots, lengths
from clothsim.physics.contact.anchors import (
    COLUMNS,
    NO_ANCHORS,
    Anchors,
    anchors_at,
    anchors_from,
    relative_positions,
    rigid_adjoint,
    rigid_displacements,
    tangential,
    tangential_adjoint,
    turned_adjoint,
)
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.contact.barrier_kernels import by_lag
from clothsim.physics.energies.base import Energy, Step
from clothsim.physics.energies.block_sums import OUTSIDE, add_block
from clothsim.physics.energies.hessians import DeferredHessian
from clothsim.physics.energies.protocols import (
    Elementwise,
    EnergyReport,
    Grip,
    Gripping,
    HistorySensitivity,
    Idling,
    Lagged,
    PastSensitivity,
    RecoverableEnergy,
    StartDerivatives,
)

NAME = "friction"

MIN_GAP_FRACTION = 0.25
"""Fraction of d_hat below which a gap counts as that in the first step: a start is not an equilibrium, and a pair that
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


@dataclass(frozen=True)
class FrictionEnergy(
    Elementwise, Energy, Gripping, Idling, Lagged, EnergyReport, HistorySensitivity, PastSensitivity, RecoverableEnergy
):
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

    depends_on_other_energies = True
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
        return replace(self, contacts=contacts, anchors=anchors)._list_pairs(step.positions, stiffness)

    def relag(self, x: Floats) -> Self:
        """Copy with the contact forces at x, for another lagged solve of the same step."""
        return self._list_pairs(x, [barrier.stiffness for barrier in self.contacts.barriers])

    def _list_pairs(self, x: Floats, stiffness: Sequence[float]) -> Self:
        """Copy with the pairs at x and their normal forces."""
        pairs = zip(self.contacts.barriers, stiffness, strict=True)
        found = [barrier.normal_forces(x, kappa, self.contacts.least_gap) for barrier, kappa in pairs]
        if not found:
            return self
        elements, weights, differences, forces = (np.concatenate(parts) for parts in zip(*found, strict=True))
        held, kinetic, static = _limits(elements, forces, self.labels, self.kinetic, self.static)
        elements, weights, differences = (each.take(held, axis=0) for each in (elements, weights, differences))
        normals = differences / lengths(differences)[:, None]
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
        slides = lengths(moves) > self.elastic_slip
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
        return _value(x, *self._lagged)

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return _gradient(x, *self._lagged)

    def recoverable(self, x: Floats) -> float:
        """Energy of the springs of anchors [J]; 0 where contacts creep."""
        if not self.elastic_slip:
            return 0.0
        displacements = relative_positions(x - self.contacts.start, self.elements, self.weights)
        slips = self.slips - self.turns + tangential(displacements, self.normals)
        fractions = np.minimum(lengths(slips) / self.elastic_slip, 1.0)
        return float(self.elastic_slip * (self.limits * fractions**2 * (1.0 - fractions / 3.0)).sum())

    def grip(self) -> Grip:
        """Limits mu F and normals of the lagged contacts, by the rows that they touch."""
        limits, normals = np.zeros(len(self.labels)), np.zeros((len(self.labels), 3, 3))
        _add_grips(limits, normals, self.elements, self.weights, self.normals, self.limits)
        normals /= np.where(limits > 0.0, limits, 1.0)[:, None, None]
        return Grip(limits, normals, self.labels)

    def hessian(self, x: Floats, project: bool = True) -> DeferredHessian:
        """Blocks (p, 12, 12) [N/m]; positive semi-definite without projection."""
        lagged = self._lagged
        return DeferredHessian(
            self.elements,
            lambda blocks: _fill_blocks(blocks, x, *lagged),
            lambda data, at: _add_blocks(data, at, x, *lagged),
        )

    def past_sensitivity(self, step: Step, x: Floats, adjoint: Floats) -> StartDerivatives:
        """By the start of the displacements, and by what is lagged."""
        return self.history_sensitivity(step, x, adjoint, np.zeros_like(self.carry_over))

    def history_sensitivity(self, step: Step, x: Floats, adjoint: Floats, memory_adjoint: Floats) -> StartDerivatives:
        """By the start of the displacements, by what is lagged, and by the anchors of the step before."""
        blocks = self.hessian(x)
        products = blocks.times(adjoint[blocks.elements].reshape(len(blocks.elements), 12)).reshape(-1, 4, 3)
        by_start = np.zeros_like(x)
        np.subtract.at(by_start, blocks.elements.ravel(), products.reshape(-1, 3))
        more = np.zeros((len(self.elements), 7))
        if not self.elastic_slip:
            return StartDerivatives(positions=self._differentiate_lag(step, x, adjoint, more), past_positions=by_start)
        by_x, by_memory, velocities = np.zeros_like(x), None, None
        if len(self.elements):
            by_x, by_memory, velocities = self._differentiate_anchors(step, x, adjoint, memory_adjoint, more)
        by_lag = self._differentiate_lag(step, x, adjoint, more)
        return StartDerivatives(positions=by_start + by_lag + by_x, velocities=velocities, memory=by_memory)

    def _differentiate_lag(self, step: Step, x: Floats, adjoint: Floats, more: Floats) -> Floats:
        """By the positions (N, 3) at which pairs are lagged; more (p, 7): adjoints of their weights and normals."""
        out, done = np.zeros_like(x), 0
        for barrier in self.contacts.barriers:
            pairs, least_gap = barrier.distinct(step.positions), self.contacts.least_gap
            objects = self.labels[pairs.elements[:, 0]], self.labels[pairs.elements[:, 3]]
            factors, all_slips, all_more = self.static[objects], np.zeros((len(pairs), 3)), np.zeros((len(pairs), 7))
            acts = self.static[objects] * barrier.normal_forces(step.positions, 1.0, least_gap)[3] > 0.0
            own = slice(done, done := done + int(acts.sum()))
            all_slips[acts], all_more[acts] = (self.slips - self.turns)[own], more[own]
            factors[acts] = np.where(self.slides[own], self.kinetic[objects][acts], factors[acts])
            factors = float(step.memory.get(barrier.name, barrier.stiffness)) * factors
            lists = pairs.elements, pairs.weights, pairs.thresholds, pairs.n_points, factors, all_slips, all_more
            lengths = barrier.offset, barrier.d_hat, least_gap * barrier.d_hat, self.contacts.slip
            out += by_lag(step.positions, x - self.contacts.start, adjoint, *lists, *lengths)
        return out

    def _differentiate_anchors(
        self, step: Step, x: Floats, adjoint: Floats, memory_adjoint: Floats, more: Floats
    ) -> tuple[Floats, Floats | None, Floats]:
        """By positions (N, 3), memory and velocities, through slips and turns; fills `more` (p, 7)."""
        pairs, start, normals = (self.elements, self.weights), self.contacts.start, self.normals
        _, to_weights, to_normals, to_slips, *to_anchors, _ = np.split(
            -memory_adjoint.reshape(len(more), -1), COLUMNS, axis=1
        )
        # the power L f u.w by the slip of each pair
        slip, u = self.contacts.slip, tangential(relative_positions(x - start, *pairs), normals)
        u, w = u + self.slips - self.turns, relative_positions(adjoint, *pairs)
        length, power = np.linalg.norm(u, axis=1), dots(u, w)
        slides, least = length >= slip, np.where(length > 0.0, length, 1.0)
        f = np.where(slides, 1.0 / least, (2.0 - length / slip) / slip)
        slope = np.where(slides, -power / least**3, np.where(length > 0.0, -power / (slip**2 * least), 0.0))
        by_slips = self.limits[:, None] * (f[:, None] * w + slope[:, None] * u)
        # turns, from the velocities at the start
        at_start = anchors_at(start, *pairs, normals, self.slips, self.slides, self.triangles_at)
        end = start + self._predictable(at_start)
        by_turning, by_normals = tangential_adjoint(at_start.turning(end), normals, -by_slips)
        by_end, *of_start = at_start.turning_adjoint(end, by_turning)
        by_x, by_weights = at_start.start_adjoint(
            start, *(one + other for one, other in zip(to_anchors, of_start, strict=True))
        )
        by_rigid, by_displacements = np.zeros_like(by_end), by_end.copy()  # of `_predictable`
        cloths = np.unique(self.labels[at_start.elements[at_start.turners[:, 0] < 0]])
        if len(cloths):
            rows = np.isin(self.labels, cloths)
            own = start[rows], self.contacts.displacements[rows], self.labels[rows]
            by_rigid[rows], by_displacements[rows] = rigid_adjoint(*own, by_end[rows])
        by_x += by_end + by_rigid
        # slips, from the anchors of the step before
        parents, _ = self.anchors.inherited(*pairs, normals, self.labels)
        known = np.flatnonzero(parents >= 0)
        memory = np.zeros((0, memory_adjoint.shape[-1]))
        if len(known):
            before = anchors_from(step.memory[NAME], self.triangles_at)
            to_parents, of_normals = turned_adjoint(
                self.anchors.slips[parents[known]], normals[known], (by_slips + to_slips)[known]
            )
            by_normals[known] += of_normals
            by_parents = np.zeros_like(before.slips)
            np.add.at(by_parents, parents[known], to_parents)
            objects = self.labels[before.elements[:, 0]], self.labels[before.elements[:, 3]]
            ratios = self.kinetic[objects] / self.static[objects]
            of_x, memory = before.after_adjoint(step.positions, slip, ratios, by_parents)
            by_x += of_x
        more[:, :4], more[:, 4:] = to_weights + by_weights, to_normals + by_normals
        return by_x, memory if len(memory) else None, step.dt * by_displacements

    def defaults_used(self) -> tuple[str, ...]:
        """Elastic slip or eps_v, and the number of lagged solves a step."""
        times = f"{self.lag_iterations} times" if self.lag_iterations > 1 else "once"
        how = f"elastic slip {self.elastic_slip:g} m" if self.elastic_slip else f"eps_v = {self.eps_v:g} m/s"
        return (f"{how}, normal forces lagged {times} per step",)

    def counts(self) -> dict[str, float]:
        """Number of lagged pairs."""
        return {"pairs": len(self.elements)}

    @property
    def _lagged(self) -> tuple[Floats, Ints, Floats, Floats, Floats, Floats, float]:
        contacts = self.contacts
        slips = self.slips - self.turns
        return contacts.start, self.elements, self.weights, self.normals, self.limits, slips, contacts.slip


# Pair loops of lagged friction: E = sum L f0(|u|), u = z + (I - n n') sum_i g_i (x_i - start_i).
#
# L = mu F; z: elastic slip at the start of the step; e: displacement from which a contact slides, eps_v dt or the
# largest elastic slip.


@inlined
def _sliding(x, start, rows, g, n, z, u):
    """Tangential displacement u (3,) [m] of a pair, with the elastic slip z (3,) at the start; returns its length."""
    for k in range(3):
        u[k] = 0.0
    for i in range(4):
        row = natural(rows[i])
        for k in range(3):
            u[k] += g[i] * (x[row, k] - start[row, k])
    normal_part = norm_squared = 0.0
    for k in range(3):
        normal_part += u[k] * n[k]
    for k in range(3):
        u[k] += z[k] - normal_part * n[k]
        norm_squared += u[k] * u[k]
    return np.sqrt(norm_squared)


@kernel
def _limits(elements, forces, labels, kinetic, static):
    """Indices of the pairs with friction, by the forces (p,) [N], and their limits mu F by either coefficient [N]."""
    held, limits, count = np.empty(len(elements), np.int64), np.empty((2, len(elements))), 0
    for p in range(len(elements)):
        first, second = labels[elements[p, 0]], labels[elements[p, 3]]
        limit = static[first, second] * forces[p]
        if limit > 0.0:
            held[count], limits[0, count], limits[1, count] = p, kinetic[first, second] * forces[p], limit
            count += 1
    return held[:count].copy(), limits[0, :count].copy(), limits[1, :count].copy()


@kernel
def _add_grips(of_rows, products, elements, weights, normals, limits):
    """Add the shares L |g_i| of each pair to its rows, (N,), and their products with n n', (N, 3, 3)."""
    for p in range(len(elements)):
        for i in range(4):
            row, share = natural(elements[p, i]), limits[p] * abs(weights[p, i])
            of_rows[row] += share
            for k in range(3):
                for q in range(3):
                    products[row, k, q] += share * (normals[p, k] * normals[p, q])


@kernel
def _value(x, start, elements, weights, normals, limits, slips, e):
    """Sum of L f0 [J]."""
    u = np.empty(3)
    total = 0.0
    for p in range(len(elements)):
        length = _sliding(x, start, elements[p], weights[p], normals[p], slips[p], u)
        total += limits[p] * (length if length >= e else length * length / e - length**3 / (3.0 * e * e) + e / 3.0)
    return total


@inlined
def _per_length(length, e):
    """f0'(y) / y [1/m]: finite at 0."""
    return 1.0 / length if length >= e else (2.0 - length / e) / e


@kernel
def _gradient(x, start, elements, weights, normals, limits, slips, e):
    """Sum of L f0'/|u| g_i u, (N, 3) [N]."""
    out = np.zeros_like(x)
    u = np.empty(3)
    for p in range(len(elements)):
        slope = limits[p] * _per_length(_sliding(x, start, elements[p], weights[p], normals[p], slips[p], u), e)
        for i in range(4):
            row = natural(elements[p, i])
            for k in range(3):
                out[row, k] += slope * weights[p, i] * u[k]
    return out


@kernel
def _fill_blocks(blocks, x, start, elements, weights, normals, limits, slips, e):
    """Write blocks (p, 12, 12): L g_i g_j K."""
    u, K = np.empty(3), np.empty((3, 3))
    for p in range(len(elements)):
        _tangential_stiffness(K, x, start, elements, weights, normals, slips, e, p, u)
        for i in range(4):
            for k in range(3):
                for j in range(4):
                    weight = limits[p] * weights[p, i] * weights[p, j]
                    for q in range(3):
                        blocks[p, 3 * i + k, 3 * j + q] = weight * K[k, q]


@kernel
def _add_blocks(data, at, x, start, elements, weights, normals, limits, slips, e):
    """`DeferredHessian.add` of the same."""
    u, K, block, outside = np.empty(3), np.empty((3, 3)), np.empty(9), 0
    for p in range(len(elements)):
        _tangential_stiffness(K, x, start, elements, weights, normals, slips, e, p, u)
        number = 0
        for i in range(4):
            for j in range(i, 4):
                if at[p, number] >= 0:
                    weight = limits[p] * weights[p, i] * weights[p, j]
                    for k in range(3):
                        for q in range(3):
                            block[3 * k + q] = weight * K[k, q]
                    add_block(data, at[p, number], block, 0, 3, 1)
                outside += at[p, number] == OUTSIDE
                number += 1
    return outside


@inlined
def _tangential_stiffness(K, x, start, elements, weights, normals, slips, e, p, u):
    """K (3, 3) = f0'/|u| (I - n n' - t t') + f0'' t t' of a pair [1/m], t = u/|u|; u (3,) is overwritten."""
    length = _sliding(x, start, elements[p], weights[p], normals[p], slips[p], u)
    tangent_scale = _per_length(length, e)
    normal_part = 0.0 if length >= e else 2.0 * (1.0 - length / e) / e
    for k in range(3):
        for q in range(3):
            K[k, q] = tangent_scale * ((1.0 if k == q else 0.0) - normals[p, k] * normals[p, q])
            if length > 0.0:
                K[k, q] += (normal_part - tangent_scale) * u[k] * u[q] / (length * length)
