"""Coulomb friction with lagged normal forces, which holds by anchors or creeps."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import inlined, kernel, natural, part
from clothsim.base.vectors import dot, four_points
from clothsim.physics.contact.anchors import (
    NO_ANCHORS,
    Anchors,
    anchors_at,
    anchors_from,
    relative_positions,
    rigid_displacements,
    tangential,
)
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.contact.barrier_kernels import barrier as barrier_function
from clothsim.physics.contact.barrier_kernels import cross_squared, cross_squared_gradient, edges, mollifier
from clothsim.physics.contact.distance import closest_points, tangent_directions
from clothsim.physics.energies.base import Energy, Step
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.physics.energies.protocols import (
    Elementwise,
    Grip,
    Gripping,
    History,
    Idling,
    Lagged,
    PastSensitivity,
    Report,
    SeesPast,
    Storing,
)

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


@dataclass(frozen=True)
class FrictionEnergy(Elementwise, Energy, Gripping, History, Idling, Lagged, Report, SeesPast, Storing):
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
        return _value(x, *self._lagged)

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return _gradient(x, *self._lagged)

    def stored(self, x: Floats) -> float:
        """Energy of the springs of anchors [J]; 0 where contacts creep."""
        if not self.elastic_slip:
            return 0.0
        displacements = relative_positions(x - self.contacts.start, self.elements, self.weights)
        slips = self.slips - self.turns + tangential(displacements, self.normals)
        fractions = np.minimum(np.linalg.norm(slips, axis=1) / self.elastic_slip, 1.0)
        return float(self.elastic_slip * (self.limits * fractions**2 * (1.0 - fractions / 3.0)).sum())

    def grip(self) -> Grip:
        """Limits mu F and normals of the lagged contacts, by the rows that they touch."""
        rows, shares = self.elements.ravel(), (self.limits[:, None] * np.abs(self.weights)).ravel()
        limits = np.bincount(rows, shares, len(self.labels)).astype(np.float64)
        normals = np.zeros((len(limits), 3, 3))
        for i, j in np.ndindex(3, 3):
            products = np.repeat(self.normals[:, i] * self.normals[:, j], 4)
            normals[:, i, j] = np.bincount(rows, shares * products, len(limits))
        normals /= np.where(limits > 0.0, limits, 1.0)[:, None, None]
        return Grip(limits, normals, self.labels)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (p, 12, 12) [N/m]; positive semi-definite without projection."""
        return ElementHessian(self.elements, _hessian(x, *self._lagged))

    def past_sensitivity(self, step: Step, x: Floats, adjoint: Floats) -> PastSensitivity:
        """By the start of the displacements, and by what is lagged; for contacts that creep."""
        blocks = self.hessian(x)
        products = blocks.times(adjoint[blocks.elements].reshape(len(blocks.elements), 12)).reshape(-1, 4, 3)
        by_start, by_lag = np.zeros_like(x), np.zeros_like(x)
        np.subtract.at(by_start, blocks.elements.ravel(), products.reshape(-1, 3))
        displacements = x - self.contacts.start
        for barrier in self.contacts.barriers:
            pairs, least_gap = barrier.distinct(step.positions), self.contacts.least_gap * barrier.d_hat
            objects = self.labels[pairs.elements[:, 0]], self.labels[pairs.elements[:, 3]]
            factors = float(step.memory.get(barrier.name, barrier.stiffness)) * self.static[objects]
            lists = pairs.elements, pairs.weights, pairs.thresholds, pairs.n_points, factors
            lengths = barrier.offset, barrier.d_hat, least_gap, self.contacts.slip
            by_lag += _by_lag(step.positions, displacements, adjoint, *lists, *lengths)
        return PastSensitivity(positions=by_lag, past_positions=by_start)

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
def _hessian(x, start, elements, weights, normals, limits, slips, e):
    """Blocks (p, 12, 12): L g_i g_j (f0'/|u| (I - n n' - t t') + f0'' t t'), t = u/|u|."""
    blocks = np.empty((len(elements), 12, 12))
    u, block = np.empty(3), np.empty((3, 3))
    for p in range(len(elements)):
        length = _sliding(x, start, elements[p], weights[p], normals[p], slips[p], u)
        tangent_scale = _per_length(length, e)
        normal_part = 0.0 if length >= e else 2.0 * (1.0 - length / e) / e
        for k in range(3):
            for q in range(3):
                block[k, q] = tangent_scale * ((1.0 if k == q else 0.0) - normals[p, k] * normals[p, q])
                if length > 0.0:
                    block[k, q] += (normal_part - tangent_scale) * u[k] * u[q] / (length * length)
        for i in range(4):
            for k in range(3):
                for j in range(4):
                    weight = limits[p] * weights[p, i] * weights[p, j]
                    for q in range(3):
                        blocks[p, 3 * i + k, 3 * j + q] = weight * block[k, q]
    return blocks


# Derivative of lagged friction by the start of a step: displacements, normals, weights and normal forces.
#
# With D = sum g_i (x_i - start_i) and w = sum g_i a_i of a pair, a the adjoint, the power of its force is
#
#     P = L f(|u|) u.w,    u = (I - n n') D,    f(y) = f0'(y)/y,    n = r/|r|
#
# It depends on the start of the displacements, by minus the Hessian; and on the pair's own twelve coordinates y_i at
# the start of the step, from which the limit L = mu F, the normal n and the weights g are lagged. By r and g, with q =
# f w + f' (u.w) u/|u| and L by its chain,
#
#     P_g_i = L ((I - n n') q . (x_i - start_i) + f u . a_i)
#     P_r   = L_r f u.w - L ((q.n) u + (D.n)(I - n n') q)/|r|
#
# and, as r = sum g_i y_i is the shortest over the feature's tangents t_a with dg = c_a dp_a (`distance`),
#
#     P_y_i = g_i P_r - sum_a (t_a . P_r + c_a . P_g) (g_i t_a + c_ai r)    (+ L's mollifier of nearly parallel edges).


@kernel
def _by_lag(at, moves, adjoint, elements, weights, thresholds, n_points, factors, offset, d_hat, least_gap, slip):
    """Derivative of the power of all pairs by the positions `at` which they are lagged, (N, 3).

    moves: x - start; factors (p,): mu kappa; slip: displacement from which a contact slides; lengths in [m].
    """
    out = np.zeros_like(at)
    for e in range(len(elements)):
        points = four_points(at, elements, e)
        g, r = closest_points(points, e >= n_points)
        limit, by_distance, by_cross = _limit(points, r, weights[e], thresholds[e], offset, d_hat, least_gap)
        limit, by_distance, by_cross = factors[e] * limit, factors[e] * by_distance, factors[e] * by_cross
        if not limit > 0.0:
            continue
        d, a = four_points(moves, elements, e), four_points(adjoint, elements, e)
        by_r, by_g, per_limit = _by_closest_points(g, r, d, a, limit, by_distance, slip)
        (has_first, t, c), (has_second, u, b) = tangent_directions(points, e >= n_points, g)
        first = dot(t, by_r) + _dot_four(c, by_g) if has_first else 0.0
        second = dot(u, by_r) + _dot_four(b, by_g) if has_second else 0.0
        for i in range(4):
            row = natural(elements[e, i])
            along = first * c[i] + second * b[i]
            for k in range(3):
                out[row, k] += g[i] * (by_r[k] - first * t[k] - second * u[k]) - along * r[k]
        if by_cross != 0.0:
            du, dv = cross_squared_gradient(*edges(points))
            slope = per_limit * by_cross
            for k in range(3):
                out[natural(elements[e, 0]), k] -= slope * du[k]
                out[natural(elements[e, 1]), k] += slope * du[k]
                out[natural(elements[e, 2]), k] -= slope * dv[k]
                out[natural(elements[e, 3]), k] += slope * dv[k]
    return out


@part
def _limit(points, r, weight, threshold, offset, d_hat, least_gap):
    """-w m db/dd of `barrier_kernels.normal_forces`, its derivatives by |r| and by the squared cross product."""
    length = np.sqrt(dot(r, r))
    distance = max(length, offset + least_gap)
    s, s_hat = distance * distance - offset * offset, d_hat * (2.0 * offset + d_hat)
    if s >= s_hat:
        return 0.0, 0.0, 0.0
    m, dm = 1.0, 0.0
    if threshold > 0.0:
        ratio = cross_squared(points) / threshold
        if ratio < 1.0:
            m, dm, _ = mollifier(ratio, threshold)
    _, first, second = barrier_function(s, s_hat, d_hat)
    slope = -2.0 * weight * first * distance
    by_distance = -2.0 * weight * m * (first + 2.0 * second * distance * distance) if length == distance else 0.0
    return m * slope, by_distance, dm * slope


@part
def _by_closest_points(g, r, d, a, limit, by_distance, slip):
    """Derivatives of P by r (3) and by g (4), and P/L."""
    length = np.sqrt(dot(r, r))
    n = r[0] / length, r[1] / length, r[2] / length
    moved, w = _combined(g, d), _combined(g, a)
    normal = dot(moved, n)
    u = moved[0] - normal * n[0], moved[1] - normal * n[1], moved[2] - normal * n[2]
    y, power = np.sqrt(dot(u, u)), dot(u, w)
    if y >= slip:
        f, slope = 1.0 / y, -power / (y * y * y)
    else:
        f, slope = (2.0 - y / slip) / slip, (-power / (slip * slip * y) if y > 0.0 else 0.0)
    q = f * w[0] + slope * u[0], f * w[1] + slope * u[1], f * w[2] + slope * u[2]
    out = dot(q, n)
    q = q[0] - out * n[0], q[1] - out * n[1], q[2] - out * n[2]
    by_length, turn = by_distance * f * power, limit / length
    by_r = (
        by_length * n[0] - turn * (out * u[0] + normal * q[0]),
        by_length * n[1] - turn * (out * u[1] + normal * q[1]),
        by_length * n[2] - turn * (out * u[2] + normal * q[2]),
    )
    by_g = (
        limit * (dot(q, d[0]) + f * dot(u, a[0])),
        limit * (dot(q, d[1]) + f * dot(u, a[1])),
        limit * (dot(q, d[2]) + f * dot(u, a[2])),
        limit * (dot(q, d[3]) + f * dot(u, a[3])),
    )
    return by_r, by_g, f * power


@part
def _combined(g, x):
    """Sum of g_i x_i."""
    p, a, b, c = x
    return (
        g[0] * p[0] + g[1] * a[0] + g[2] * b[0] + g[3] * c[0],
        g[0] * p[1] + g[1] * a[1] + g[2] * b[1] + g[3] * c[1],
        g[0] * p[2] + g[1] * a[2] + g[2] * b[2] + g[3] * c[2],
    )


@part
def _dot_four(c, g):
    return c[0] * g[0] + c[1] * g[1] + c[2] * g[2] + c[3] * g[3]
