"""Newton's method on the sum of energies; Dirichlet positions first, then monotone decrease of E.

Every loop is bounded and every end has a name (`outcome.Ending`).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.linalg import dot
from clothsim.physics.energies.base import Prescribed
from clothsim.solve.linear.linear_system import Patch, System, unconverged
from clothsim.solve.newton.convergence import (
    BALANCED,
    MOST_UNBALANCED,
    NO_FORCE_LEFT,
    ErrorBalance,
    ForceBalance,
    LastStep,
    MotionStop,
    force_balance,
)
from clothsim.solve.newton.direction import NO_FACTOR, PROJECTED, TRUSTED, Direction, QuadraticModel, Trust
from clothsim.solve.newton.line_search import RESOLVED, armijo, longer_step, round_off
from clothsim.solve.newton.outcome import Ending, Iterate, Observer, Outcome, outcome, unobserved
from clothsim.solve.newton.potential import Potential

SMALLEST_FRACTION = 1e-12
BLOCKED_FRACTION = 1e-8
"""A prescribed displacement of which less than this fraction is admissible is blocked; closer still, additive CCD may
miss a collision.
"""
SMALLEST_REMAINDER = 1e-6
"""Fraction of a prescribed displacement that may remain while contact still clips it: a target in contact is only
approached.
"""
LAST_PIECE = 1e-3
"""Fraction of a prescribed displacement that may be applied at once, the free vertices at rest, where it is free of
collision.
"""
FARTHEST = 3.0
"""Displacement of a free vertex that follows prescribed ones, over theirs, from which on its energy is compared."""
FRACTION_OF_GAP = 0.1
"""The last piece of a prescribed displacement may not be longer than this fraction of the smallest gap."""
CHANGE_OF_GAP = 0.3
"""A step that changes a gap by more than this fraction of it is not converged. Close to contact Newton's step on the
logarithm is about as long as the gap, however large the force F: d -> 2 d - F d^2, a change by 1 - F d. Where the
change is .3, one more step leaves its square, 9 %.
"""
NEAR_LIMIT = 0.1
"""Gap, over d_hat, from which on CHANGE_OF_GAP does not bound a step that the time error allows: the logarithm is mild
there, and the change of the gap is one of position like any other.
"""
TOLERANCE_ALONE = ErrorBalance()
"""Stop at the tolerance, whatever the time error."""
LAST_DIGITS = float(np.finfo(float).eps)
MAX_PATCH_ITERATIONS = 10
"""Newton iterations on a patch before the next global one."""
PROBE_PERIOD = 10
"""Iterations after which a solve is asked whether it sinks: a gap that a first long step left opens in fewer."""

Probe = Callable[[Floats], bool]
"""True for positions from which a solve is not worth going on: contact is too soft there, and is made stiffer."""


def no_probe(x: Floats) -> bool:
    """Go on, whatever the gaps."""
    return False


@dataclass(frozen=True)
class NewtonSettings:
    """Settings of Newton's method.

    Parameters
    ----------
    tolerance : float
        Convergence tolerance on |dx|_inf / dt [m/s].
    max_iterations : int
        Bound on the iterations with the Dirichlet vertices fixed.
    max_prescribed_iterations : int
        Bound on the iterations that move the Dirichlet vertices to their positions.
    error_fraction : float
        Fraction of the time error of a step at which a solve may stop before the tolerance; 0: it may not.
    converge : bool
        True where forces balance and the fastest vertex is within that fraction, too (`ErrorBalance`); False where the
        motion of each body is (`MotionStop`).
    """

    tolerance: float = 1e-3
    max_iterations: int = 100
    max_prescribed_iterations: int = 60
    error_fraction: float = 0.0
    converge: bool = True


@dataclass(frozen=True)
class NewtonResult:
    """Result of a solve.

    Parameters
    ----------
    x : (N, 3) float64
        Last positions [m].
    outcome : Outcome
        How the solve ended.
    iterations : int
        Iterations that moved vertices.
    speed : float
        |dx|_inf / dt of the last step [m/s].
    residual : float
        Largest component of the force that is left on a free vertex [N]; of a solve that failed, at its last step.
    relative_residual : float
        It over the force scale (`ForceBalance`); inf for a solve that failed.
    remaining : float
        Estimated distance from the minimiser [m]: the last step times the observed rate of convergence.
    elimination_iterations : int
        Further iterations on patches (nonlinear elimination).
    """

    x: Floats
    outcome: Outcome
    iterations: int
    speed: float
    residual: float
    remaining: float = np.inf
    elimination_iterations: int = 0
    relative_residual: float = np.inf


@dataclass(frozen=True)
class Newton:
    """One minimisation of a bound potential.

    Parameters
    ----------
    potential : Potential
        Potential bound to the step.
    system : System
        Stores the Hessian and solves with it.
    settings : NewtonSettings
        Tolerance and bounds.
    dt : float
        Length of the step [s].
    observe : callable
        Observer of the iterates.
    balance : ErrorBalance or MotionStop
        Stop by the time error of the step.
    least_force : float
        Force that is no imbalance [N]; inf: the force balance is not checked.
    sinks : callable
        Asked every PROBE_PERIOD iterations whether contact is too soft; True ends the solve.
    """

    potential: Potential
    system: System
    settings: NewtonSettings
    dt: float
    observe: Observer = unobserved
    balance: ErrorBalance | MotionStop = TOLERANCE_ALONE
    least_force: float = np.inf
    sinks: Probe = no_probe

    def minimise(self, x: Floats, target: Prescribed) -> NewtonResult:
        """Minimise E from x, with the target's vertices at their positions (Dirichlet).

        First the prescribed vertices are displaced as far as contact allows at each iteration, while the free ones
        follow; then E decreases monotonically with the prescribed ones fixed.

        Parameters
        ----------
        x : (N, 3) float64
            Start [m], free of intersections.
        target : Prescribed
            Rows of x and the positions that they take [m].

        Returns
        -------
        NewtonResult
            Its outcome names the end; nothing is raised where the solve fails.
        """
        fixed = np.zeros(self.system.pattern.n_vertices, bool)
        fixed[target.vertices[target.vertices < self.system.pattern.n_vertices]] = True
        self.observe(Iterate(x))
        model = QuadraticModel(self.potential, self.system, fixed)
        x, moved, iterations = self._move_prescribed(x.copy(), target, model)
        if not moved.converged:
            return NewtonResult(x, moved, iterations, np.inf, np.inf)
        return self._descend(x, model, PROJECTED, iterations)

    def _move_prescribed(self, x: Floats, target: Prescribed, model: QuadraticModel) -> tuple[Floats, Outcome, int]:
        """Move the prescribed vertices to their positions; return x, the outcome, the iterations taken."""
        distance = float(np.abs(target.positions - x[target.vertices]).max(initial=0.0))
        for iteration in range(self.settings.max_prescribed_iterations):
            displacement = np.zeros_like(x)
            displacement[target.vertices] = target.positions - x[target.vertices]
            remaining = float(np.abs(displacement).max())
            done = remaining == 0.0 or (  # the rest is shorter than every gap, and free of collision
                remaining <= LAST_PIECE * distance
                and remaining <= FRACTION_OF_GAP * self.potential.minimum_gap(x)
                and self._limit(x, displacement) == 1.0
                and bool(np.isfinite(self.potential.value(x + displacement)))
            )
            if done:
                x[target.vertices] = target.positions
                return x, outcome(Ending.CONVERGED), iteration
            direction = model.direction(x, displacement)
            if direction.end is not None:
                return x, direction.end, iteration
            dx, fraction = self._following(x, direction.dx, displacement)
            if fraction < BLOCKED_FRACTION:
                return x, _blocked(x, target), iteration
            x = x + fraction * dx
            if fraction == 1.0:
                x[target.vertices] = target.positions
            self.observe(Iterate(x, fraction, self._speed(dx)))
            if fraction < 1.0 and np.abs(target.positions - x[target.vertices]).max() < SMALLEST_REMAINDER * distance:
                return x, _blocked(x, target), iteration
        return x, _blocked(x, target), self.settings.max_prescribed_iterations

    def _following(self, x: Floats, dx: Floats, displacement: Floats) -> tuple[Floats, float]:
        """Step with the prescribed `displacement`, and its admissible fraction.

        No line search bounds it, as E may rise. Where the projected Hessian is nearly singular, as in a slack sheet
        without inertia, dx throws free vertices out by kilometres: one that follows to FARTHEST times the prescribed
        displacement is taken in its place where its energy is lower. What contact clips is left alone: a blocked motion
        would creep on.
        """
        fraction = self._finite_fraction(x, dx, self._limit(x, dx))
        farthest, follows = FARTHEST * np.abs(displacement).max(), np.abs(dx - displacement).max()
        if follows <= farthest or fraction < 1.0:
            return dx, fraction
        shorter = displacement + farthest / follows * (dx - displacement)
        admissible = self._finite_fraction(x, shorter, self._limit(x, shorter))
        if self.potential.value(x + admissible * shorter) < self.potential.value(x + fraction * dx):
            return shorter, admissible
        return dx, fraction

    def _eliminated(self, x: Floats, dx: Floats, model: QuadraticModel) -> NewtonResult | None:
        """Nonlinear elimination of the vertices that the step dx moved; None where they are not few.

        A vertex counts as moved by more than every vertex may without ending the solve.
        """
        if self.system.patch is not None or isinstance(self.balance, MotionStop):
            return None  # a motion that may end a solve leaves no few vertices that are worth solves of their own
        moved = np.abs(dx[self.system.rows].T.copy()).max(axis=0, initial=0.0)
        least = self.settings.tolerance * self.dt
        if self.balance.fraction:
            least = max(least, min(self.balance.allowed(x)[0], self.balance.most(self.dt)))
        rows = unconverged(moved, least, self.system.base, model.fixed)
        if not len(rows) or self.system.dependent.any_of(rows):
            return None
        patch, timers = Patch(rows, len(x)), self.potential.timers
        with timers.patch():
            with timers.phase("assembly"):
                potential = self.potential.restricted_to(patch.moving, x)
                system = self.system.subsystem(patch)
            settings = replace(self.settings, max_iterations=MAX_PATCH_ITERATIONS)
            part = Newton(potential, system, settings, self.dt, balance=self.balance)
            return part._descend(x, QuadraticModel(potential, system, np.zeros(len(patch.rows), bool)), TRUSTED, 0)

    def _descend(self, x: Floats, model: QuadraticModel, trust: Trust, iterations: int) -> NewtonResult:
        """Newton with the prescribed vertices fixed, until forces balance after an unclipped step that may be last."""
        settings = self.settings
        still = previous = np.zeros_like(x)
        lengths = self.balance.rms(still, exact=False) + np.inf
        speed, residual, cached, elimination_iterations, unbalanced = np.inf, np.inf, NO_FACTOR, 0, 0

        def ended(how: Outcome, count: int, remaining: float = np.inf, relative: float = np.inf) -> NewtonResult:
            return NewtonResult(x, how, count, speed, residual, remaining, elimination_iterations, relative)

        for count in range(iterations, iterations + settings.max_iterations):
            direction = model.direction(x, still, trust, cached)
            dx, gradient, cached = direction.dx, direction.gradient, direction.cached
            residual, end = model.residual(gradient), direction.end or self._sunk(x, dx, count - iterations)
            if end is not None:
                return ended(end, count)
            before, speed = speed, self._speed(dx)
            lengths_before, lengths = lengths, self.balance.rms(dx, trust.exact)
            if speed == 0.0:
                forces = self._force_balance(x, model)
                return ended(_balanced_or_not(forces, x), count, 0.0, forces.relative)
            limit = self._limit(x, dx)
            if limit < SMALLEST_FRACTION and not cached.age:
                return ended(_at_fastest(Ending.NO_ROOM, x, dx, fraction=limit), count)
            with self.potential.timers.phase("line search"):
                slope = dot(gradient, dx)
                fraction = (
                    armijo(self.potential, x, dx, slope, limit) if slope < 0.0 and limit >= SMALLEST_FRACTION else 0.0
                )
                last = LastStep(count - iterations + 1, direction.negative_curvature, lengths, lengths_before)
                done = limit == 1.0 and self._may_be_last(x, direction, speed, last, fraction)
            by_motion = done and isinstance(self.balance, MotionStop) and speed >= settings.tolerance
            if cached.age and (done or fraction == 0.0) and not by_motion:  # the cached factor is of an earlier x
                done, cached = False, NO_FACTOR
                if fraction == 0.0:
                    continue
            step = fraction * dx
            if direction.negative_curvature and fraction > 0.0 and not done:
                step, fraction = longer_step(self.potential, x, model, direction, previous, fraction, limit == 1.0)
            previous = dx
            if done or fraction > 0.0:
                x = x + step
                self.observe(Iterate(x, fraction, speed, residual))
            if done:
                forces = self._force_balance(x, model)
                residual, unbalanced = forces.residual, unbalanced + 1
                balanced = forces.holds and forces.within(self.balance.force_fraction(count == iterations, BALANCED))
                if by_motion or balanced or fraction == 0.0 or unbalanced == MOST_UNBALANCED:
                    how = outcome(Ending.CONVERGED) if by_motion else _balanced_or_not(forces, x)
                    left = float(lengths.max()) if by_motion else speed * self.dt
                    return ended(how, count + 1, contraction(speed, before) * left, forces.relative)
            if fraction == 0.0 and not trust.exact:
                return ended(
                    self._classify_failure(_at_fastest(Ending.LINE_SEARCH, x, dx, speed=speed), x, speed, model), count
                )
            noise = fraction == 0.0 or (
                direction.negative_curvature and -slope < RESOLVED * round_off(self.potential.values(x))
            )
            trust, cached = trust.after(fraction, direction.negative_curvature, noise), cached.after(fraction)
            last_one = count + 1 == iterations + settings.max_iterations
            eliminated = None if noise or last_one or not trust.exact else self._eliminated(x, dx, model)
            if eliminated is not None:
                x, cached, speed = eliminated.x, NO_FACTOR, np.inf
                elimination_iterations += eliminated.iterations
                self.observe(Iterate(x, np.nan))
        end = _at_fastest(
            Ending.ITERATION_LIMIT, x, dx, tolerance=settings.tolerance, limit=settings.max_iterations, speed=speed
        )
        return ended(self._classify_failure(end, x, speed, model), iterations + settings.max_iterations)

    def _sunk(self, x: Floats, dx: Floats, count: int) -> Outcome | None:
        """Outcome of a solve that is probed after `count` iterations and sinks into contact."""
        probed = count > 0 and count % PROBE_PERIOD == 0
        return _at_fastest(Ending.SUNK, x, dx) if probed and self.sinks(x) else None

    def _classify_failure(self, end: Outcome, x: Floats, speed: float, model: QuadraticModel) -> Outcome:
        """Outcome of a solve that fails: UNBALANCED where its steps are short enough and only forces are left."""
        forces = self._force_balance(x, model) if speed < self.settings.tolerance else None
        return end if forces is None or forces.within(NO_FORCE_LEFT) else _unbalanced(forces, x)

    def _may_be_last(self, x: Floats, direction: Direction, speed: float, last: LastStep, fraction: float) -> bool:
        """True where an unclipped step may end the solve: it is below the tolerance, or the time error allows it.

        fraction: of the step that the line search took.
        """
        dx = direction.dx
        if speed < self.settings.tolerance:
            if self.potential.gap_change(x, dx) > CHANGE_OF_GAP:
                return False
            if fraction == 1.0 or speed < 1e-6 * self.settings.tolerance:  # a millionth of the tolerance is round-off
                return True
            # The full step may be rejected for the round-off of E alone. Near the minimum E cannot distinguish x from
            # x + dx, but its derivative can: along a good Newton step it falls to near zero (Hager & Zhang 2005,
            # approximate Wolfe conditions). A step that promises less than the last digits of x is round-off too.
            slope = dot(direction.gradient, dx)
            if -slope <= LAST_DIGITS * dot(np.abs(direction.gradient), np.abs(x)):
                return True
            return abs(dot(self.potential.gradient(x + dx), dx)) <= -0.5 * slope
        if fraction < 1.0 or not self.balance.reached(x, dx, last, self.dt):
            return False
        return self.potential.gap_change(x, dx, NEAR_LIMIT) <= CHANGE_OF_GAP

    def _force_balance(self, x: Floats, model: QuadraticModel) -> ForceBalance:
        """Force balance at the free vertices of the system."""
        rows = np.arange(len(x))[self.system.rows]
        return force_balance(self.potential, x, rows[~model.fixed], self.least_force, self.system.dependent)

    def _speed(self, dx: Floats) -> float:
        return float(np.abs(dx).max(initial=0.0)) / self.dt

    def _limit(self, x: Floats, dx: Floats) -> float:
        return self.potential.step_limit(x, dx)

    def _finite_fraction(self, x: Floats, dx: Floats, fraction: float) -> float:
        """`fraction`, halved until the energy is finite: a prescribed displacement may raise E, but not to infinity."""
        while fraction >= SMALLEST_FRACTION and not np.isfinite(self.potential.value(x + fraction * dx)):
            fraction *= 0.5
        return fraction


def contraction(speed: float, before: float) -> float:
    """Observed rate of the last step over the one before, at most 1."""
    return min(1.0, speed / before) if np.isfinite(before) else 1.0


def _balanced_or_not(forces: ForceBalance, x: Floats) -> Outcome:
    """Outcome of a solve whose last step was short enough: CONVERGED only where forces balance."""
    return outcome(Ending.CONVERGED) if forces.within(BALANCED) else _unbalanced(forces, x)


def _unbalanced(forces: ForceBalance, x: Floats) -> Outcome:
    return outcome(Ending.UNBALANCED, x, forces.row, force=forces.residual, percent=100 * forces.relative)


def _at_fastest(ending: Ending, x: Floats, dx: Floats, **numbers: float) -> Outcome:
    """Outcome located at the vertex with the largest displacement in dx."""
    return outcome(ending, x, int(np.abs(dx).max(axis=1).argmax()), **numbers)


def _blocked(x: Floats, target: Prescribed) -> Outcome:
    """Outcome located at the prescribed vertex with the longest remaining displacement."""
    remaining = np.linalg.norm(target.positions - x[target.vertices], axis=1)
    return outcome(Ending.BLOCKED, x, int(target.vertices[remaining.argmax()]))
