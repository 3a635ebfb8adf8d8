"""Barrier energy of contact: zero beyond d_hat, infinite at contact."""

from dataclasses import dataclass, field, replace
from functools import partial
from typing import Self, cast

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.memo import Memo
from clothsim.base.vectors import lengths
from clothsim.physics.contact import barrier_kernels as kernels
from clothsim.physics.contact.candidate_subsets import CandidateSubset
from clothsim.physics.contact.candidates import Candidates
from clothsim.physics.contact.pair_list import Pairs, distinct
from clothsim.physics.contact.psd_projection import positive_factors
from clothsim.physics.contact.stiffness import HeavyBody, barrier_stiffness, bounded_stiffness, kinetic_energy_of_impact
from clothsim.physics.energies.base import Energy, Step
from clothsim.physics.energies.hessians import ByElement, DeferredHessian, ElementHessian, LowRankHessian
from clothsim.physics.energies.protocols import AdaptiveStiffness, ContactGap, Coupling, EnergyReport, Restrictable


@dataclass(frozen=True)
class ActiveSet:
    """Distinct pairs at one position, their closest-point records, the energy [m3] for a stiffness of 1 Pa.

    count: number of active pairs, before those of one feature were merged.
    """

    pairs: Pairs
    records: Floats
    value: float
    count: int


SUNK = 0.01
"""Gap, over d_hat, below which a barrier is too soft for its load: half of d_hat is meant (`barrier_stiffness`)."""
PREDICTION_LENGTH = 30.0
"""Length, in d_hat, to which a displacement is followed to predict contacts: a guess is not worth a long search."""

MAX_PREDICTED_PAIRS = 16.0
"""Predicted pairs a vertex above which a shorter displacement is followed; a sheet flat on another has 12. Layers that
close on one another would each be coupled with all in their path, though the first stops them: ten of 529 vertices,
5 d_hat apart, had 9.2 times the blocks of the mesh, and a factorization took 170 times as long (2.3 s)."""

EMPTY_HESSIAN = ElementHessian(np.zeros((0, 4), np.int64), np.zeros((0, 12, 12)))


@dataclass(frozen=True)
class Barrier(Energy, ContactGap, Coupling, AdaptiveStiffness, Restrictable, EnergyReport):
    """Barrier energy E = kappa sum w m b(d) over the pairs closer than offset + d_hat.

    Li et al. 2020 (IPC); area weights, and distinct features of a surface: Li et al. 2023 (`pair_list`). w is
    the area of the pair [m2]; b and the mollifier m are in `barrier_kernels`.

    Parameters
    ----------
    candidates : Candidates
        Pairs that may touch.
    d_hat : float
        Range of the barrier beyond the offset [m].
    offset : float
        Distance that is never reached [m].
    areas, masses : (n_cloth,) array
        Of the cloth vertices [m2], [kg]: the scale of an adaptive stiffness.
    stiffness : float
        kappa [Pa].
    adaptive : bool
        Let `begin` choose the stiffness of each step.
    name : str
        Effect, for its stiffness in `Step.memory`.
    heavy : tuple of HeavyBody
        Rigid bodies that may touch something, whose loads the stiffness must bear too.
    """

    candidates: Candidates
    d_hat: float
    offset: float
    areas: Floats
    masses: Floats
    stiffness: float
    adaptive: bool
    name: str = ""
    heavy: tuple[HeavyBody, ...] = ()
    _evaluations: Memo[ActiveSet] = field(
        default_factory=partial(Memo, keeps_first=True), init=False, repr=False, compare=False
    )

    depends_on_other_energies = True

    def begin(self, step: Step) -> Self:
        """Copy for the step, with a stiffness that balances the loads at about half of d_hat.

        Where pairs are active a rise adds energy: it is bounded by `bounded_stiffness`.
        """
        if not self.adaptive:
            return self
        n = len(self.areas)
        force = -self.gradient(step.positions)[:n]
        inward, in_contact = _contact_directions(force)
        speeds = lengths(step.velocities[:n])
        approach = np.where(in_contact, (step.velocities[:n] * inward).sum(axis=1), speeds)
        stiffness = barrier_stiffness(
            self._pressure(step.gradient, inward),
            float(self.masses.sum() / self.areas.sum()) if n else 0.0,
            float(approach.max(initial=0.0)),
            self.d_hat,
            step.dt,
            step.contact_time_scale or step.dt,
        )
        # the lowest of a pile, or the first link of a chain, bears all
        load = sum(body.load(step) for body in self.heavy)
        stiffness = max([stiffness, *(body.stiffness(step, load, self.d_hat) for body in self.heavy)])
        stiffness = max(stiffness, step.least_stiffness.get(self.name, 0.0))
        before = float(step.memory.get(self.name, stiffness))
        rises = stiffness > before and "inertia" in step.bound
        if rises and (energy := self.value(step.positions) / self.stiffness):
            kinetic = kinetic_energy_of_impact(step.velocities, self.masses)
            kinetic += sum(body.kinetic_energy(step) for body in self.heavy)
            stiffness = bounded_stiffness(stiffness, before, energy, kinetic, step.dt, step.contact_time)
        bound = replace(self, stiffness=stiffness)
        start = self.candidates.read(step.positions)
        known = self._evaluations.known(start)
        if known is not None:  # it holds for any stiffness
            bound._evaluations.remember(start, known)
        return bound

    def reads_beyond(self, n: int) -> bool:
        """False for contact of cloths alone, whose rows are the first."""
        return self.candidates.surface.n_read > n

    def value(self, x: Floats) -> float:
        """Barrier energy [J]; +inf where a pair touches."""
        value = self.stiffness * self._evaluated(x).value
        return value if np.isfinite(value) else np.inf

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]; on the rows of bodies, the negative of the reaction."""
        active = self._evaluated(x)
        if not len(active.records):
            return np.zeros_like(x)
        pairs = active.pairs
        gradient: Floats = kernels.gradient(active.records, x, pairs.elements, pairs.thresholds)
        gradient *= self.stiffness
        return gradient

    def hessian(self, x: Floats, project: bool = True) -> ByElement:
        """Hessian over the active pairs (p, 4) [N/m]; projected pair by pair, or exact."""
        active = self._evaluated(x)
        if not len(active.records):
            return EMPTY_HESSIAN
        pairs = active.pairs
        assemble = projected if project else exact
        return assemble(active.records, x, pairs.elements, pairs.thresholds, pairs.n_points, self.stiffness)

    def restricted_to(self, moving: np.ndarray, x: Floats) -> Self:
        """The barrier of the pairs that are incident to a moving vertex."""
        return replace(self, candidates=cast("Candidates", CandidateSubset.restrict(self.candidates, moving, x)))

    def couplings(self, x: Floats, dx: Floats) -> Ints:
        """Rows (p, 4) of cloth-cloth pairs predicted to be active on the path x -> x + dx, or on its beginning."""
        surface = self.candidates.surface
        if not surface.is_self_contact:
            return np.zeros((0, 4), np.int64)  # the vertices of bodies are not unknowns
        x, dx = surface.read(x), surface.read(dx)
        relative = dx - dx[surface.rows].mean(axis=0)
        length = lengths(relative)[:, None]
        length_in_d_hat, max_pairs = PREDICTION_LENGTH, MAX_PREDICTED_PAIRS * len(surface.rows)
        while True:
            prediction = length_in_d_hat * self.d_hat
            pairs, _ = self.candidates.search.pairs(
                x, x + prediction / np.maximum(length, prediction) * relative, self.candidates.activation_distance
            )
            if len(pairs) <= max_pairs or length_in_d_hat < 1.0:
                return pairs.elements
            length_in_d_hat *= 0.25

    @property
    def carry_over(self) -> float:
        """Stiffness [Pa], which bounds that of the next step, and which its friction needs."""
        return self.stiffness

    def stiffness_energy(self, x: Floats, before: float) -> float:
        """E(x) less that with the stiffness `before` [J]."""
        return (self.stiffness - before) * (self.value(x) / self.stiffness) if self.stiffness != before else 0.0

    def has_sunk(self, start: Floats, x: Floats) -> bool:
        """True where gaps at x are below SUNK of d_hat, and no pair was active at the start: a rise adds no energy.

        Before its first contact stretched cloth shows no load, and its barrier is as soft as its weight allows. A body
        that goes further than d_hat in the step is another matter: the load is then that of the step's own length.
        """
        if not self.adaptive or self.minimum_gap(x) >= SUNK * self.d_hat or self.minimum_gap(start) < np.inf:
            return False
        n = len(self.areas)
        return float(np.abs(x[n:] - start[n:]).max(initial=0.0)) < self.d_hat

    def stiffness_needed(self, x: Floats, gradient: Floats) -> float:
        """Stiffness [Pa] that bears the loads at x."""
        force = -self.gradient(x)
        return self._pressure(gradient + force, _contact_directions(force[: len(self.areas)])[0])

    def _pressure(self, gradient: Floats, inward: Floats) -> float:
        """Largest pressure [Pa] on a vertex in contact of other energies with this gradient (N, 3) [N]."""
        n = len(self.areas)
        return float((-(gradient[:n] * inward).sum(axis=1) / self.areas).max(initial=0.0))

    def normal_forces(self, x: Floats, stiffness: float, least_gap: float = 0.0) -> tuple[Ints, Floats, Floats, Floats]:
        """Distinct pairs: rows (p, 4), weights g (p, 4) and difference r (p, 3) [m] of closest points, force (p,) [N].

        stiffness [Pa]: that of the step whose solution x is; least_gap: fraction of d_hat below which a gap counts as
        that.
        """
        pairs = self.distinct(x)
        if not len(pairs):
            return EMPTY_HESSIAN.elements, np.zeros((0, 4)), np.zeros((0, 3)), np.zeros(0)
        weights, differences, slopes = kernels.normal_forces(x, *self._arguments(pairs), least_gap * self.d_hat)
        return pairs.elements, weights, differences, -stiffness * slopes

    def distinct(self, x: Floats) -> Pairs:
        """Pairs of distinct closest features at x."""
        known = self._evaluations.known(self.candidates.read(x))
        return self._distinct(x, self.candidates.active(x)) if known is None else known.pairs

    def _distinct(self, x: Floats, active: Pairs) -> Pairs:
        return distinct(x, active, self.activation_distance) if len(active) else active

    def step_limit(self, x: Floats, dx: Floats, most: float = 1.0) -> float:
        """Collision-free fraction of dx, at most `most`."""
        return self.candidates.step_limit(x, dx, most)

    def minimum_gap(self, x: Floats) -> float:
        """Smallest distance of an active pair less the offset [m]; inf where no pair is active."""
        return self.candidates.minimum_gap(x)

    def gap_change(self, x: Floats, dx: Floats, within: float = np.inf) -> float:
        """Largest relative change of a gap below `within` d_hat, of a pair that is active before or after the step."""
        return self.candidates.gap_change(x, dx, within * self.d_hat)

    def defaults_used(self) -> tuple[str, ...]:
        """d_hat, offset and the stiffness or its rule."""
        stiffness = "adapted to the loads at each step" if self.adaptive else f"{self.stiffness:g} Pa"
        offset = f", offset {self.offset:g} m" if self.offset else ""
        return (f"d_hat = {self.d_hat:g} m{offset}, stiffness {stiffness}",)

    def counts(self) -> dict[str, float]:
        """Number of active pairs at the last position, CCD calls, and the seconds of both searches."""
        candidates = self.candidates
        return {"pairs": candidates.pairs, "ccd_calls": candidates.ccd_calls, **candidates.seconds}

    def _arguments(self, pairs: Pairs) -> tuple[Ints, Floats, Floats, int, float, float]:
        return pairs.elements, pairs.weights, pairs.thresholds, pairs.n_points, self.offset, self.d_hat

    def _evaluated(self, x: Floats) -> ActiveSet:
        """Active set and records at x, cached for the energy, gradient and Hessian at the same positions.

        Those of the start of the step, which its certificate asks for at its end, and of the last two positions.
        """
        found = self._evaluations.at(self.candidates.read(x), self._evaluate)
        if isinstance(self.candidates, Candidates):
            self.candidates.pairs = found.count
        return found

    def _evaluate(self, x: Floats) -> ActiveSet:
        active = self.candidates.active(x)
        pairs = self._distinct(x, active)
        records, value = np.empty((len(pairs), kernels.RECORD_SIZE)), 0.0
        if len(pairs):
            value = kernels.evaluate(records, x, *self._arguments(pairs))
        return ActiveSet(pairs, records, value, len(active))


def _contact_directions(force: Floats) -> tuple[Floats, np.ndarray]:
    """Unit vectors (n, 3) opposite to the contact forces, zero without; and the mask (n,) of vertices in contact."""
    length = lengths(force)
    in_contact = length > 0
    return -force / np.where(in_contact, length, 1.0)[:, None], in_contact


def projected(
    records: Floats, x: Floats, elements: Ints, thresholds: Floats, n_points: int, kappa: float
) -> LowRankHessian:
    """Positive semi-definite Hessian of pairs with these records, pair by pair no smaller than the exact one [N/m]."""
    others = np.flatnonzero((records[:, kernels.CROSS_RATIO] < 1.0) | (records[:, kernels.FIRST] > 0.0))
    factors = np.empty((3 * (len(elements) - len(others)) + 9 * len(others), 12))
    first, count = np.empty((2, len(elements)), np.int64)
    n_factors = kernels.rank_one_factors(factors, first, count, records, x, elements, n_points, kappa)
    if len(others):
        blocks = np.empty((len(others), 9, 9))
        kernels.relative_blocks(blocks, others, records, x, elements, thresholds, n_points, kappa)
        n_factors = positive_factors(blocks, others, factors, n_factors, first, count)
    return LowRankHessian(elements, first, count, factors[:n_factors])


def exact(
    records: Floats, x: Floats, elements: Ints, thresholds: Floats, n_points: int, kappa: float
) -> DeferredHessian:
    """Exact Hessian of pairs with these records [N/m]."""
    of_pairs = records, x, elements, thresholds, n_points, kappa
    return DeferredHessian(
        elements,
        lambda blocks: kernels.exact_blocks(blocks, *of_pairs),
        lambda data, at: kernels.add_exact(data, at, *of_pairs),
    )
