"""The barrier energy of contact: zero beyond d_hat, infinite at contact."""

from dataclasses import dataclass, field, replace
from typing import Self, cast

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.contact import barrier_kernels as kernels
from clothsim.contact.barrier_hessian import exact, projected
from clothsim.contact.candidates import Candidates
from clothsim.contact.pair_list import Pairs
from clothsim.contact.stiffness import barrier_stiffness
from clothsim.contact.subset import CandidatesAround
from clothsim.energies.base import Energy
from clothsim.energies.hessians import ByElement, ElementHessian
from clothsim.energies.protocols import ContactGap, Coupling, History, Report, Restrictable
from clothsim.energies.step import Step
from clothsim.indexing import equal


@dataclass(frozen=True)
class Measured:
    """Of the pairs that are near at a `place` (N, 3): their poses, and the energy [m3] for a stiffness of 1 Pa."""

    place: Floats
    pairs: Pairs
    poses: Floats
    value: float


FORESEEN = 30.0
"""How far, in d_hat, a vertex is followed to see what it will meet: a guess is worth no search of a long way."""

MOST_FORESEEN = 16.0
"""Pairs for each vertex from which on a shorter way is looked along; a sheet flat on its like has 12. Layers that close
upon one another would each be coupled with all that lie before them, though the first stops them: ten of 529 vertices,
5 d_hat apart, had 9.2 times the blocks of the mesh, and a factor took 170 times as long (2.3 s)."""

NOTHING = ElementHessian(np.zeros((0, 4), np.int64), np.zeros((0, 12, 12)))


@dataclass(frozen=True)
class Barrier(Energy, ContactGap, Coupling, History, Restrictable, Report):
    """E = kappa sum w m b(d) over the pairs closer than offset + d_hat (Li et al. 2020, IPC; areas: Li et al. 2023).

    d_hat, offset [m]; w the area of the pair [m2], kappa = stiffness [Pa]; b and the mollifier m in `barrier_kernels`.
    areas (n_cloth,) [m2] and masses (n_cloth,) [kg] of the cloth vertices give kappa its scale in `begin`, where
    `adaptive`; otherwise it stays as given.
    """

    candidates: Candidates
    d_hat: float
    offset: float
    areas: Floats
    masses: Floats
    stiffness: float
    adaptive: bool
    _last: list[Measured] = field(default_factory=list, init=False, repr=False, compare=False)

    begins_last = True

    def begin(self, step: Step) -> Self:
        """Bound to the step: a stiffness that holds the loads at about half of d_hat."""
        if not self.adaptive:
            return self
        n = len(self.areas)
        push = -self.gradient(step.positions)[:n]
        toward, touching = _toward(push)
        loads = -(step.gradient[:n] * toward).sum(axis=1) / self.areas
        speeds = np.linalg.norm(step.velocities[:n], axis=1)
        approach = np.where(touching, (step.velocities[:n] * toward).sum(axis=1), speeds)
        stiffness = barrier_stiffness(
            float(loads[touching].max(initial=0.0)),
            float(self.masses.sum() / self.areas.sum()),
            float(approach.max(initial=0.0)),
            self.d_hat,
            step.dt,
            step.contact_time_scale or step.dt,
        )
        return replace(self, stiffness=stiffness)

    def value(self, x: Floats) -> float:
        """Barrier energy [J]; +inf where a pair touches."""
        value = self.stiffness * self._measured(x).value
        return value if np.isfinite(value) else np.inf

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]: also on the rows of bodies, where it is the reaction's negative."""
        measured = self._measured(x)
        if not len(measured.poses):
            return np.zeros_like(x)
        pairs = measured.pairs
        return self.stiffness * kernels.gradient(measured.poses, x, pairs.elements, pairs.thresholds)

    def hessian(self, x: Floats, project: bool = True) -> ByElement:
        """Over the pairs (p, 4) [N/m]; projected pair by pair, or exact."""
        measured = self._measured(x)
        if not len(measured.poses):
            return NOTHING
        pairs = measured.pairs
        derived = projected if project else exact
        return derived(measured.poses, x, pairs.elements, pairs.thresholds, pairs.n_points, self.stiffness)

    def restricted_to(self, moving: np.ndarray, x: Floats) -> Self:
        """The barrier of the pairs that a moving vertex belongs to."""
        return replace(self, candidates=cast(Candidates, CandidatesAround.of(self.candidates, moving, x)))

    def couplings(self, x: Floats, dx: Floats) -> Ints:
        """The rows (p, 4) of the pairs of cloth with cloth that come near on the way x -> x + dx, or its beginning."""
        if not self.candidates.surface.itself:
            return np.zeros((0, 4), np.int64)  # a body's vertices are no unknowns
        way = dx - dx[self.candidates.surface.rows].mean(axis=0)
        length = np.linalg.norm(way, axis=1, keepdims=True)
        seen, many = FORESEEN, MOST_FORESEEN * len(self.candidates.surface.rows)
        while True:
            far = seen * self.d_hat
            pairs, _ = self.candidates.search.pairs(x, x + far / np.maximum(length, far) * way, self.candidates.limit)
            if len(pairs) <= many or seen < 1.0:
                return pairs.elements
            seen *= 0.25

    @property
    def carry_over(self) -> float:
        """The stiffness [Pa]."""
        return self.stiffness

    def normal_forces(self, x: Floats, stiffness: float, least: float = 0.0) -> tuple[Ints, Floats, Floats, Floats]:
        """The near pairs: rows (p, 4), weights g (p, 4) and line r (p, 3) [m] of closest points, force (p,) [N].

        stiffness [Pa]: that with which the gaps at x were found; least: share of d_hat; a pair that is closer pushes as
        one at this gap.
        """
        pairs = self._pairs(x)
        if not len(pairs[0]):
            return NOTHING.elements, np.zeros((0, 4)), np.zeros((0, 3)), np.zeros(0)
        weights, lines, slopes = kernels.pull(x, *pairs, least * self.d_hat)
        return pairs[0], weights, lines, -stiffness * slopes

    def step_limit(self, x: Floats, dx: Floats, most: float = 1.0) -> float:
        """The fraction of dx, at most `most`, that is free of collision."""
        return self.candidates.step_limit(x, dx, most)

    def minimum_gap(self, x: Floats) -> float:
        """The smallest distance of a pair less the offset [m] where it is below d_hat, else inf."""
        return self.candidates.minimum_gap(x)

    def gap_change(self, x: Floats, dx: Floats) -> float:
        """The largest share by which the step changes the gap of a pair that is below d_hat before or after it."""
        return self.candidates.gap_change(x, dx)

    def defaults_used(self) -> tuple[str, ...]:
        """d_hat, and how the stiffness is set."""
        stiffness = "set anew at each step" if self.adaptive else f"{self.stiffness:g} Pa"
        offset = f", offset {self.offset:g} m" if self.offset else ""
        return (f"d_hat = {self.d_hat:g} m{offset}, stiffness {stiffness}",)

    def counts(self) -> dict[str, float]:
        """Pairs closer than d_hat at the last position, CCD calls, and the seconds of both searches."""
        searches = self.candidates
        return {"pairs": searches.pairs, "ccd_calls": searches.ccd_calls, **searches.seconds}

    def _pairs(self, x: Floats) -> tuple[Ints, Floats, Floats, int, float, float]:
        pairs = self.candidates.active(x)
        return pairs.elements, pairs.weights, pairs.thresholds, pairs.n_points, self.offset, self.d_hat

    def _measured(self, x: Floats) -> Measured:
        """The poses at x: energy, gradient and Hessian are asked for at the same place, one after the other."""
        if self._last and equal(x, self._last[0].place):
            return self._last[0]
        pairs = self.candidates.active(x)
        poses, value = np.empty((len(pairs), kernels.POSE)), 0.0
        if len(pairs):
            value = kernels.measure(poses, x, *self._pairs(x))
        self._last[:] = [Measured(x.copy(), pairs, poses, value)]
        return self._last[0]


def _toward(push: Floats) -> tuple[Floats, np.ndarray]:
    """The unit vectors (n, 3) against which contact pushes, zero where it does not; and where it does, (n,)."""
    length = np.linalg.norm(push, axis=1)
    touching = length > 0
    return -push / np.where(touching, length, 1.0)[:, None], touching
