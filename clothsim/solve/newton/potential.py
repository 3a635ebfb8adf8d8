"""Incremental potential E(x): the sum of the energies, bound to a step."""

# mypy: disable-error-code="type-abstract"
# (an abstract protocol is asked for by isinstance, never made)

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, partial
from typing import Any, Self, TypeVar

import numpy as np
from scipy import sparse

from clothsim.base.arrays import Floats, Ints
from clothsim.base.memo import Memo
from clothsim.base.vectors import add_to
from clothsim.physics.energies.base import Energy, Step
from clothsim.physics.energies.hessians import DeferredHessian, Hessian, ImplicitHessian, LanesHessian, SumHessian
from clothsim.physics.energies.protocols import (
    AdaptiveStiffness,
    BarrierGap,
    ContactGap,
    Coupling,
    Grip,
    Gripping,
    History,
    Lagged,
    is_idle,
    lag_iterations,
    report_of,
    restricted,
)
from clothsim.solve.timers import EffectsInTurn, Timers

P = TypeVar("P")

TOO_SOFT = 10.0
"""Stiffness needed over the given one from which on a contact is too soft: a load that holds a gap of d_hat / 100 needs
a hundred times; an iterate may be as close by a long step alone."""


@dataclass(frozen=True)
class Potential:
    """Sum of named energies, timed call by call.

    Energies that are idle in a step keep their position in the sum but are not called; the sum of the others has the
    same bits.

    Parameters
    ----------
    energies : mapping
        Energies by name, in the order of summation.
    timers : Timers
        Timers and counters of their calls.
    unknowns : int, optional
        Number of rows of x that are unknowns; energies that read no other rows are called with these alone.
    """

    energies: Mapping[str, Energy]
    timers: Timers
    unknowns: int | None = None
    _values: Memo[tuple[float, ...]] = field(
        default_factory=partial(Memo, keeps_first=True), init=False, repr=False, compare=False
    )
    _gradients: Memo[tuple[Floats, float]] = field(default_factory=Memo, init=False, repr=False, compare=False)

    def begin(self, step: Step) -> Self:
        """Bind to a step: first the energies that stand alone, then those that need the others' gradient."""
        bound: dict[str, Energy] = {}
        gradient = np.zeros_like(step.positions)
        slower = 1.0 if step.contact_time_scale is None else step.past.dt / step.contact_time_scale
        for name, energy in self.energies.items():
            if not energy.depends_on_other_energies:
                with self.timers.effect(name, ""):
                    bound[name] = energy.begin(step)
                    if is_idle(bound[name]):
                        continue
                    rows = self._rows_of(bound[name])
                    part = bound[name].gradient(step.positions[rows])
                    gradient[rows] += slower * part if energy.incremental else part  # momentum over contact's time
        for name, energy in self.energies.items():
            if energy.depends_on_other_energies:
                with self.timers.effect(name, ""):
                    bound[name] = energy.begin(replace(step, gradient=gradient, bound=dict(bound)))
        for name, energy in bound.items():
            counters = self.timers.effects[name]
            counters.steps += 1
            counters.idle_steps += is_idle(energy)
            counters.pairs = int(report_of(energy).counts().get("pairs", 0))
        return replace(self, energies={name: bound[name] for name in self.energies})

    @cached_property
    def acting(self) -> Mapping[str, Energy]:
        """Energies that are not idle in this step."""
        return {name: energy for name, energy in self.energies.items() if not is_idle(energy)}

    @cached_property
    def _rows(self) -> Mapping[str, slice]:
        """The rows of x that each acting energy is called with."""
        return {name: self._rows_of(energy) for name, energy in self.acting.items()}

    def _rows_of(self, energy: Energy) -> slice:
        return slice(None) if self.unknowns is None or energy.reads_beyond(self.unknowns) else slice(self.unknowns)

    @property
    def lagging(self) -> Mapping[str, Energy]:
        """Acting energies for which a step is solved more than once (lagged friction)."""
        return {name: energy for name, energy in self.acting.items() if lag_iterations([energy]) > 1}

    @property
    def lag_iterations(self) -> int:
        """Number of solves of a step, the largest that an energy needs."""
        return lag_iterations(self.energies.values())

    def relag(self, x: Floats) -> Self:
        """Bind for another solve of the same step, lagged data taken at x."""
        bound = {}
        for name, energy in self.energies.items():
            with self.timers.effect(name, ""):
                bound[name] = energy.relag(x) if isinstance(energy, Lagged) else energy
        return replace(self, energies=bound)

    def restricted_to(self, moving: np.ndarray, x: Floats) -> Self:
        """Restrict to `moving` vertices ((N,) bool), all others fixed at x; E changes by a constant only."""
        return replace(self, energies={name: restricted(energy, moving, x) for name, energy in self.energies.items()})

    def value(self, x: Floats) -> float:
        """Return E(x) [J]; +inf where an energy is not defined at x."""
        return sum(self.values(x))

    def values(self, x: Floats) -> tuple[float, ...]:
        """Return the energies one by one [J]; they end at the first that is not defined at x, with +inf."""
        return self._values.at(x, self._evaluate)

    def _evaluate(self, x: Floats) -> tuple[float, ...]:
        values: list[float] = []
        with self.timers.effects_in_turn() as effects:
            for name, energy in self.acting.items():
                value = energy.value(x[self._rows[name]])
                effects.done(name, "evaluations")
                if not math.isfinite(value):
                    return (*values, np.inf)
                values.append(value)
        return tuple(values)

    def gradient(self, x: Floats) -> Floats:
        """Return dE/dx, (N, 3) [N]."""
        return self._gradients.at(x, self._differentiate)[0].copy()

    def largest_force(self, x: Floats) -> float:
        """Return the largest component of the gradient of one energy at x [N]."""
        return self._gradients.at(x, self._differentiate)[1]

    def _differentiate(self, x: Floats) -> tuple[Floats, float]:
        total, largest = np.zeros_like(x), 0.0
        with self.timers.effects_in_turn() as effects:
            for name, energy in self.acting.items():
                own = x[self._rows[name]]
                part = np.ascontiguousarray(energy.gradient(own), np.float64)
                if part.shape != own.shape:
                    part = np.ascontiguousarray(np.broadcast_to(part, own.shape))
                largest = max(largest, add_to(total, part))
                effects.done(name, "gradients")
        return total, largest

    def hessians(self, x: Floats) -> list[Hessian]:
        """Return the projected Hessian of each acting energy [N/m], in their order."""
        with self.timers.effects_in_turn() as effects:
            return [self._hessian(effects, name, x, True) for name in self.acting]

    def exact_hessians(self, x: Floats, projected: list[Hessian] | None = None) -> list[Hessian]:
        """Return the exact Hessian of each acting energy [N/m], or the projected one for Newton (friction).

        projected: the result of `hessians` at x, if it is known.
        """
        known = projected or [None] * len(self.acting)
        with self.timers.effects_in_turn() as effects:
            return [
                self._hessian(effects, name, x, not energy.exact_in_newton)
                if energy.exact_in_newton or one is None
                else one
                for (name, energy), one in zip(self.acting.items(), known, strict=True)
            ]

    def _hessian(self, effects: EffectsInTurn, name: str, x: Floats, project: bool) -> Hessian:
        hessian = self.energies[name].hessian(x[self._rows[name]], project)
        effects.done(name, "hessians")
        self.timers.account(name).hessian_nonzeros = int(hessian.nnz)
        if isinstance(hessian, SumHessian):
            return SumHessian(tuple(self._timed_part(name, part) for part in hessian.parts))
        return hessian if isinstance(hessian, sparse.csr_array) else self._timed_part(name, hessian)

    def _timed_part(self, name: str, part: Any) -> Any:
        """A part of a Hessian whose later work is timed as its energy's."""
        if isinstance(part, LanesHessian):
            added = None if part.add is None else self._timed(name, part.add)
            return LanesHessian(part.elements, self._timed(name, part.fill), added)
        if isinstance(part, DeferredHessian):
            return DeferredHessian(part.elements, self._timed(name, part.fill), self._timed(name, part.add))
        if isinstance(part, ImplicitHessian):
            return ImplicitHessian(part.elements, self._timed(name, part.apply), part.explicit)
        return part

    def _timed(self, name: str, work: Callable[..., Any]) -> Callable[..., Any]:
        """A function of a Hessian, timed as work of its energy."""

        def timed(*arguments: Any) -> Any:
            with self.timers.effect(name, ""):
                return work(*arguments)

        return timed

    def couplings(self, x: Floats, dx: Floats) -> list[Ints]:
        """Rows (m, k) that energies are expected to couple on the path x -> x + dx, energy by energy.

        Contact predicts pairs only where one is active at x: the order of elimination depends on the pattern, so that a
        predicted pair that never becomes active would change every bit of a run without contact.
        """
        acting = self._acting_as(Coupling)
        active = [each for each in acting if not isinstance(each, ContactGap) or each.minimum_gap(x) < np.inf]
        return [energy.couplings(x, dx) for energy in active]

    def step_limit(self, x: Floats, dx: Floats) -> float:
        """Return the smallest step limit of the energies, in [0, 1]; each starts from the limit of those before it."""
        limit = 1.0
        for name, energy in self.acting.items():
            if type(energy).step_limit is not Energy.step_limit:  # an account for those alone that limit
                with self.timers.effect(name, ""):
                    limit = energy.step_limit(x, dx, limit)
        return limit

    def minimum_gap(self, x: Floats) -> float:
        """Return the smallest gap of all contact energies [m], inf without contact."""
        return min((energy.minimum_gap(x) for energy in self._acting_as(ContactGap)), default=np.inf)

    def gap_change(self, x: Floats, dx: Floats, within: float = np.inf) -> float:
        """Return the largest relative change by the step dx of a gap below `within`, a fraction of d_hat."""
        return max((energy.gap_change(x, dx, within) for energy in self._acting_as(BarrierGap)), default=0.0)

    def stiffnesses_needed(self, start: Floats, x: Floats) -> dict[str, float]:
        """Return the stiffness [Pa] of each contact that is too soft for the step from `start` to x, by its name."""
        found = {}
        for name, energy in self.acting.items():
            if isinstance(energy, AdaptiveStiffness) and energy.has_sunk(start, x):
                needed = energy.stiffness_needed(x, self.gradient(x))
                if needed > TOO_SOFT * energy.stiffness:
                    found[name] = needed
        return found

    def grips(self) -> list[Grip]:
        """Return what holds the rows of x up to a limit (friction)."""
        return [energy.grip() for energy in self._acting_as(Gripping)]

    def _acting_as(self, protocol: type[P]) -> Iterator[P]:
        """The acting energies with an optional protocol, each timed in turn."""
        for name, energy in self.acting.items():
            if isinstance(energy, protocol):
                with self.timers.effect(name, ""):
                    yield energy

    def memory(self) -> dict[str, float | Floats]:
        """Return the history data of the energies that pass any to the next step."""
        return {name: energy.carry_over for name, energy in self.energies.items() if isinstance(energy, History)}

    def effect_counters(self) -> dict[str, dict[str, Any]]:
        """Return the counters of each effect: {name: fields of `EffectCounters`}."""
        effect_counters = {}
        for name, energy in self.energies.items():
            counters = asdict(self.timers.effects[name])
            for key, count in report_of(energy).counts().items():
                if key == "pairs":
                    counters[key] = count or counters[key]  # only the bound energy knows its lagged pairs
                elif key in counters:
                    counters[key] += count
                else:
                    counters["parts"][key] = counters["parts"].get(key, 0.0) + count
            effect_counters[name] = counters
        return effect_counters
