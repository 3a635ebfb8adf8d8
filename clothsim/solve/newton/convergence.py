"""Stopping rules of Newton's method: the balance of its error against the time error of the step.

A step of the time integrator is wrong by its local error, whatever Newton does. Iterations that change the result by
much less buy nothing; iterations left out add their error to it. Both errors enter the velocity alike, so that what is
balanced in each step stays balanced over a run (docs/notes/newton_stop.md). `MotionStop` is the default;
`ErrorBalance` converges each step (`[solver] converge = true`), `StaticStop` those of a quasi-static run.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.physics.energies.protocols import Grip
from clothsim.solve.linear.dependent_rows import NO_DEPENDENT_ROWS, DependentRows
from clothsim.solve.newton.potential import Potential

LEAST_SPEED, MOST_SPEED = 1e-2, 0.3
"""Bounds of the balanced stop on |dx|_inf / dt, over the fraction of the time error [m/s].

At a fraction of .1, a step below .001 m/s ends the solve whatever the time error, which vanishes at rest, and none
above .03 m/s does, where the time error is large: at the start, or with a dt of seconds.
"""

FIRST_FORCE = 0.1
"""Residual over the force scale, over the fraction of the time error, after a solve of one step: 1 % at a fraction of
.1. A card that is about to slip is held, 2 to 8 % out of balance, by a first step of which the next is a hundredfold.
"""

CONVERGED_PART = 0.1
"""Largest fraction that counts in FIRST_FORCE: a card that slides was held at a residual of 2 %. A solve that leaves an
unstable equilibrium has it where the scene gives a tolerance (`time_loop`).
"""
FEWEST = 2
"""Fewest iterations of a step that a time error ends: the first one has the projected Hessian, whose step says nothing
of a buckle or of friction that is about to slip.
"""
FEWEST_UNSTABLE = 3
"""The same where the last step followed negative curvature: a buckle grows for some iterations before it shows."""
LONGEST_END = 0.03
"""Longest root mean square of a step that may end a solve, in cells. Where a cloth hits a plate at 50 m/s the time
error is a quarter of a metre; at .1 cells the impulse of the impact was lost.
"""

TimeError = Callable[[Floats], tuple[float, float]]
"""Local time error of a step that ends at x (N, 3): root mean square over the cloth vertices, and the largest [m]."""

TimeErrors = Callable[[Floats], Floats]
"""Local time error of a step that ends at x (N, 3), root mean square over the rows of each body, (k,) [m]."""


def no_time_error(x: Floats) -> tuple[float, float]:
    """Return the time error of a quasi-static step, 0."""
    return 0.0, 0.0


@dataclass(frozen=True)
class LastStep:
    """What a stop may know of the last Newton step, beside its displacement.

    iteration: its number in the solve, from 1; negative_curvature: it followed such; rms, before: root mean squares of
    it and of the one before (k,), as the stop measures them [m]; before is inf where it predicts nothing.
    """

    iteration: int
    negative_curvature: bool
    rms: Floats
    before: Floats


@dataclass(frozen=True)
class ErrorBalance:
    """Newton's error as a fraction of the time error of the step.

    Parameters
    ----------
    fraction : float
        Fraction of the time error that Newton may leave; 0: the tolerance alone ends a solve.
    count : int
        Number of cloth vertices, the first rows of x.
    time_error : callable
        Time error of the step at its end.
    """

    fraction: float = 0.0
    count: int = 0
    time_error: TimeError = no_time_error

    def allowed(self, x: Floats) -> tuple[float, float]:
        """Return what Newton may leave at the end x (N, 3) of a step: root mean square and largest [m]."""
        rms, largest = self.time_error(x)
        return self.fraction * rms, self.fraction * largest

    def reached(self, x: Floats, dx: Floats, last: LastStep, dt: float) -> bool:
        """True where the change that remains at x is predicted to be below the allowed one.

        Parameters
        ----------
        x, dx : (N, 3) float64
            Positions and the Newton step from them, unclipped and along positive curvature [m].
        last : LastStep
            That step.
        dt : float
            Length of the time step [s].
        """
        largest = largest_step(dx)
        if not self.fraction or largest > self.most(dt):
            return False
        allowed_rms, allowed_largest = self.allowed(x + dx)
        return bool(remaining_change(last.rms, last.before)[0] < allowed_rms) and largest < allowed_largest

    def force_fraction(self, first: bool, without: float) -> float:
        """Residual over the force scale to which forces must balance.

        first: after the first step of a solve; without: the fraction where the tolerance alone ends a solve.
        """
        if not self.fraction:
            return without
        return (FIRST_FORCE if first else 1.0) * min(self.fraction, without)

    def most(self, dt: float) -> float:
        """Return the longest displacement of a vertex that may end a solve [m]."""
        return MOST_SPEED * self.fraction * dt

    def rms(self, dx: Floats, exact: bool) -> Floats:
        """Return the root mean square of a step over the cloth vertices, (1,) [m]; inf for one that is not exact.

        Plain, not weighted by mass: the local error of a step is (`StepError`), and like is compared with like.
        """
        return rms_by_body(dx, (slice(self.count),)) if exact else np.array([np.inf])


STATIC_FLOOR = 1e-3
"""Motion of a quasi-static solve, in cells, whose steps are as good as none: one that starts at rest has no other."""


@dataclass(frozen=True, kw_only=True)
class StaticStop(ErrorBalance):
    """Newton's error as a fraction of what a quasi-static solve moves, for lack of a time error.

    Its dt is but a part of the load. A speed, 1 mm/s, ended loops 10 to 30 % off where the load came in one step,
    and left a deep beam a hundredth of the way from its unstable equilibrium to the stable one: steps beside a saddle
    are short. The longest step may have `fraction` of the longest motion since the start, or of a cell where that is
    shorter.

    Parameters
    ----------
    start : (N, 3) float64
        Positions before the solve [m].
    cell : float
        Median length of the edges [m].
    """

    start: Floats
    cell: float

    @property
    def floor(self) -> float:
        """Length of a step that ends a solve whatever it moved [m]."""
        return STATIC_FLOOR * self.fraction * self.cell

    def allowed(self, x: Floats) -> tuple[float, float]:
        """Return the longest step that may end a solve at x (N, 3) [m], twice."""
        moved = largest_step(x[: self.count] - self.start[: self.count])
        longest = max(self.floor, self.fraction * min(moved, self.cell))
        return longest, longest

    def reached(self, x: Floats, dx: Floats, last: LastStep, dt: float) -> bool:
        """Return True where the step dx from x may end the solve; parameters as of `ErrorBalance.reached`."""
        return largest_step(dx) < self.allowed(x + dx)[1]

    def force_fraction(self, first: bool, without: float) -> float:
        """Return the residual over the force scale to which forces must balance: that of a tolerance."""
        return without

    def most(self, dt: float) -> float:
        """Return the longest displacement of a vertex that may end a solve [m]."""
        return self.fraction * self.cell


@dataclass(frozen=True)
class MotionStop:
    """Newton's error as a fraction of what the time step is wrong by, body by body.

    The last step must be unclipped and complete, and shorter than the one before. Its root mean square over each cloth
    and each rigid body, or the geometric series that its ratio begins where that is longer, is compared with the time
    error of the same body, so that a large sheet does not hide a small one. Forces are not asked to balance, nor the
    fastest vertex to be slow: both measure the stiffest mode, which moves nothing.

    Parameters
    ----------
    fraction : float
        Fraction of the time error that the last step may have.
    bodies : tuple of slice
        Rows of x of each cloth, and of the coordinates of each rigid body.
    time_errors : callable
        Time errors of the step at its end, body by body.
    cell : float
        Median length of the edges [m].
    least : float
        Root mean square of a step that ends a solve whatever the time error [m].
    """

    fraction: float
    bodies: tuple[slice, ...]
    time_errors: TimeErrors
    cell: float
    least: float

    def rms(self, dx: Floats, exact: bool) -> Floats:
        """Return the root mean square of a step (N, 3) over the rows of each body, (k,) [m]."""
        return rms_by_body(dx, self.bodies)

    def allowed(self, x: Floats) -> Floats:
        """Return the longest last step to x (N, 3), root mean square by body (k,) [m]."""
        return np.clip(self.fraction * self.time_errors(x), self.least, max(self.least, LONGEST_END * self.cell))

    def reached(self, x: Floats, dx: Floats, last: LastStep, dt: float) -> bool:
        """True where the unclipped step dx from x may end the solve; parameters as of `ErrorBalance.reached`."""
        if last.iteration < (FEWEST_UNSTABLE if last.negative_curvature else FEWEST):
            return False
        return bool((remaining_change(last.rms, last.before) <= self.allowed(x + dx)).all())

    def force_fraction(self, first: bool, without: float) -> float:
        """Return the residual over the force scale to which forces balance where the tolerance ends a solve."""
        return FIRST_FORCE * min(self.fraction, CONVERGED_PART) if first else without


def rms_by_body(vectors: Floats, bodies: tuple[slice, ...]) -> Floats:
    """Return the root mean square length of vectors (N, 3) over the rows of each body, (k,)."""
    return np.array([np.sqrt((vectors[rows] ** 2).sum() / max(len(vectors[rows]), 1)) for rows in bodies])


def remaining_change(step: Floats, before: Floats) -> Floats:
    """Predict the distance to the minimiser from the lengths (k,) of the last two Newton steps.

    The last step itself, or the sum of the geometric series that its ratio to the one before begins, where that is
    longer. Steps that grow predict nothing (inf), and so does one alone: where friction sticks the first step is a
    hundredth of those that follow once it slips.

    Examples
    --------
    >>> remaining_change(np.array([1.0, 3.0, 2.0, 0.0]), np.array([10.0, 4.0, 1.0, 0.0]))
    array([ 1.,  9., inf,  0.])
    """
    contracts = (step < before) & np.isfinite(before)
    rate = np.divide(step, before, out=np.zeros_like(step), where=contracts)
    return np.where(contracts | (step == 0.0), step * np.maximum(1.0, rate / (1.0 - rate)), np.inf)


def largest_step(dx: Floats) -> float:
    """Return the largest component of a step [m]."""
    return float(np.abs(dx).max(initial=0.0))


# Newton's step is the residual over the stiffness. Where a gap of 1e-13 m or a modulus of 1e20 Pa makes that huge, a
# step is short long before forces balance, or no position that doubles can express balances them.

BALANCED = 0.3
"""Largest residual, relative to the force scale, of a balanced state. Of converged steps of a drape it was up to 5e-4
at a tolerance of 1e-3 m/s, .06 at .01 and .21 at .1; of unbalanced ones .6 to 1 (docs/notes/newton_stop.md).
"""
NO_FORCE_LEFT = 0.01
"""The same of a solve that cannot go on though its steps are short: with more, forces are why it fails."""
MOST_SLIPPING = 0.01
"""Tangential force that may be left on an object whose friction holds it, over the limit mu F of that friction.

Where friction holds, its Hessian 2 (1 - u/e) mu F / e is that of a spring of length e = 0.01 mm, a hundred times m/h^2.
So a Newton step of a card that is over the threshold is far shorter than what the force r that is left would move it,
h^2 r / m, and below any tolerance: a card was held up to 1.11 mu, for r was compared with the largest force that a
vertex has. What is left acts against friction alone, hence r <= 0.01 mu F: no slope of more than 1.01 mu is held.
"""
MOST_UNBALANCED = 20
"""Iterations with steps below the tolerance after which forces that do not balance end the solve."""


@dataclass(frozen=True)
class ForceBalance:
    """Residual force and force scale of a state [N].

    Parameters
    ----------
    residual : float
        Largest component of the total force on a free vertex.
    scale : float
        Largest component of the force of one energy on a vertex, gravity and inertia included, and the force that
        gives the heaviest vertex the tolerance as its speed within the step: what is below that is no imbalance.
    row : int
        Row of x with the residual.
    slipping : float
        `slipping_force` that is left over the limit of friction.
    """

    residual: float
    scale: float
    row: int
    slipping: float = 0.0

    @property
    def relative(self) -> float:
        """Residual over force scale, 0 without any force."""
        return self.residual / self.scale if self.residual else 0.0

    def within(self, fraction: float) -> bool:
        """True where the residual is at most this fraction of the force scale."""
        return self.residual <= fraction * self.scale

    @property
    def holds(self) -> bool:
        """True where friction balances the rest of the forces to MOST_SLIPPING."""
        return self.slipping <= MOST_SLIPPING


def force_balance(
    potential: Potential,
    x: Floats,
    free: np.ndarray,
    least: float,
    dependent: DependentRows = NO_DEPENDENT_ROWS,
) -> ForceBalance:
    """Return the force balance at x.

    Parameters
    ----------
    potential : Potential
        Potential bound to the step.
    x : (N, 3) float64
        Positions [m].
    free : (n,) int64
        Rows of the free vertices.
    least : float
        Force that is no imbalance [N]; inf where masses are unknown.
    dependent : DependentRows
        Rows whose forces act on the unknowns that they follow.
    """
    left = dependent.reduced(potential.gradient(x))
    largest = np.abs(left[free]).max(axis=1, initial=0.0)
    if not len(largest):
        return ForceBalance(0.0, least, 0)
    worst = int(largest.argmax())
    slipping = max((slipping_force(grip, left, free, least, dependent) for grip in potential.grips()), default=0.0)
    return ForceBalance(float(largest[worst]), potential.largest_force(x) + least, int(free[worst]), slipping)


def slipping_force(
    grip: Grip, left: Floats, free: np.ndarray, least: float, dependent: DependentRows = NO_DEPENDENT_ROWS
) -> float:
    """Return the tangential force left on an object over the limit of its friction, the largest of all objects.

    sum |(I - n n') r| / (sum mu F + k least), over the k free rows in contact of a cloth. A rigid body counts as one
    row with the net force, which its rigidity has no part in.

    Parameters
    ----------
    grip : Grip
        Limits mu F [N] and normals n by row.
    left : (N, 3) float64
        Forces r that are left, reduced to the unknowns [N].
    free, least, dependent
        As of `force_balance`.
    """
    acting, limits = np.zeros_like(left), np.zeros(len(left))
    acting[free], limits[free] = left[free], grip.limits[free]
    normals = grip.normals
    for part in dependent.parts:
        held, body = part.rows.start, grip.limits[part.rows]
        acting[held], limits[held] = left[part.unknowns].sum(axis=0), body.sum()
        normals = normals.copy()
        normals[held] = np.einsum("d,dij->ij", body, normals[part.rows]) / max(limits[held], np.finfo(float).tiny)
    rows = np.flatnonzero(limits > 0.0)
    tangential = acting[rows] - np.einsum("dij,dj->di", normals[rows], acting[rows])
    forces, most, counts = (
        np.bincount(grip.labels[rows], each)
        for each in (np.linalg.norm(tangential, axis=1), limits[rows], np.ones(len(rows)))
    )
    return float((forces / np.where(counts > 0.0, most + counts * least, 1.0)).max(initial=0.0))
