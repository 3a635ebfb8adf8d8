"""Armijo backtracking below the step limit, and step extension along negative curvature.

A curved step has a second-order correction (geodesic acceleration). Cloth bends a thousand times more easily than it
stretches, so the valley in which a crease grows is curved: its vertices move on arcs. On the tangent of an arc they
stretch the cloth, E rises with the fourth power of the step, and each iteration moves a tenth of a millimetre in the
direction of the one before. With the bend c of

    x(a) = x + a dx + a^2 c / 2,    P c = -d^2 g(x + a dx) / da^2    (P the projected Hessian, g the gradient of E)

the gradient on the path is linear in a where the cloth is stiff, as Newton's model has it, and the path leaves the
valley with the fourth power of a (geodesic acceleration: Transtrum & Sethna 2012, "Improvements to the
Levenberg-Marquardt algorithm for nonlinear least-squares minimization"). It costs two gradients and a back-solve, a
tenth of an iteration.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.linalg import dot
from clothsim.solve.newton.direction import Direction, QuadraticModel
from clothsim.solve.newton.potential import Potential

SUFFICIENT_DECREASE = 1e-4
MAX_HALVINGS = 50
ROUND_OFF = 32 * float(np.finfo(float).eps)
RESOLVED = 1e6
"""Multiple of the round-off of E above which a promised decrease must be observed; below it tiny steps always pass."""


def armijo(potential: Potential, x: Floats, dx: Floats, slope: float, limit: float) -> float:
    """Armijo line search: the first a = limit, limit/2, ... with E(x + a dx) <= E(x) + 1e-4 a slope.

    E is a sum of energies known to round-off only. Where the step promises little more than that, a rise below
    round-off is accepted; else a converged step would be rejected for the last bits of E.

    Parameters
    ----------
    potential : Potential
        Potential bound to the step.
    x, dx : (N, 3) float64
        Positions and direction [m].
    slope : float
        gradient . dx [J], below 0.
    limit : float
        Step limit in (0, 1].

    Returns
    -------
    float
        The accepted fraction of dx, or 0 where MAX_HALVINGS halvings found none.
    """
    values = potential.values(x)
    start, noise = sum(values), round_off(values)
    if limit * abs(slope) > RESOLVED * noise:
        noise = 0.0
    fraction = limit
    for _ in range(MAX_HALVINGS):
        if potential.value(x + fraction * dx) <= start + SUFFICIENT_DECREASE * fraction * slope + noise:
            return fraction
        fraction *= 0.5
    return 0.0


def round_off(values: Sequence[float]) -> float:
    """Return the round-off of E [J]: E is the sum of `values`, each of them known to its last digits."""
    return ROUND_OFF * sum(abs(value) for value in values)


def extended_fraction(potential: Potential, x: Floats, dx: Floats, longest: float) -> float:
    """Extend the step by doubling: the last of 1, 2, 4, ... up to `longest` that is admissible and still lowers E.

    For directions of negative curvature, whose length the quadratic model does not determine: a buckle would else grow
    by many small steps, each of them a factorisation. The slope at the current end is tested first, as a search for
    collisions along a long step costs more than a gradient.
    """
    fraction, value = 1.0, potential.value(x + dx)
    while 2.0 * fraction <= longest and dot(potential.gradient(x + fraction * dx), dx) < 0.0:
        further = 2.0 * fraction * dx
        if potential.step_limit(x, further) < 1.0:
            break
        longer = potential.value(x + further)
        if not longer < value:
            break
        fraction, value = 2.0 * fraction, longer
    return fraction


PARALLEL = 0.95
"""Cosine between a Newton step and the one before from which on they follow one valley. In the last iterations of an
impact it is .97 to 1.00, where creases form one after another .3 to .9: there a bend gains nothing.
"""
MOST_BENT = 1.0
"""Length of the bend over that of the step, above which the second order is not small: contact is near."""
LONGEST = 32.0
"""Fraction up to which a step of negative curvature may be extended beyond the Newton step."""
DIFFERENCE = 0.5
"""Fraction of the step at which the gradient is differentiated: far beyond its round-off, within the step's range."""


@dataclass(frozen=True)
class CurvedStep:
    """Path a -> a dx + a^2 bend / 2 of displacements; dx, bend (N, 3) [m]."""

    dx: Floats
    bend: Floats

    def at(self, fraction: float) -> Floats:
        """Return the displacement (N, 3) at a fraction [m]."""
        return fraction * self.dx + 0.5 * fraction**2 * self.bend


def longer_step(
    potential: Potential,
    x: Floats,
    model: QuadraticModel,
    direction: Direction,
    previous: Floats,
    fraction: float,
    unclipped: bool,
) -> tuple[Floats, float]:
    """Lengthen a step along negative curvature, whose length the quadratic model does not determine.

    Along the curve of a valley where it has the direction of the step before and lowers E further; else a full step is
    extended on its line.

    Parameters
    ----------
    potential : Potential
        Potential bound to the step.
    x : (N, 3) float64
        Positions [m].
    model : QuadraticModel
        Quadratic model of E at x.
    direction : Direction
        Newton's direction from x.
    previous : (N, 3) float64
        Newton step of the iteration before [m]; 0: there is none.
    fraction : float
        Fraction of the direction that the line search took, above 0.
    unclipped : bool
        True where contact allows the whole of it.

    Returns
    -------
    ((N, 3) float64, float)
        Displacement, free of collision [m], and its fraction.
    """
    dx = direction.dx
    with potential.timers.phase("line search"):
        if unclipped and are_parallel(dx, previous):
            path = curved_step(potential, x, dx, direction.gradient, model.solver(direction.cached))
            along = fraction_along(potential, x, path, dot(direction.gradient, dx), fraction) if path else 0.0
            if path and along:
                return path.at(along), along
        if fraction == 1.0:
            fraction = extended_fraction(potential, x, dx, LONGEST)
    return fraction * dx, fraction


def are_parallel(dx: Floats, before: Floats) -> bool:
    """Return True where two steps (N, 3) point the same way, to PARALLEL."""
    return dot(dx, before) > PARALLEL * np.sqrt(dot(dx, dx) * dot(before, before))


def curved_step(
    potential: Potential, x: Floats, dx: Floats, gradient: Floats, solve: Callable[[Floats], Floats]
) -> CurvedStep | None:
    """Curve a Newton step.

    Parameters
    ----------
    potential : Potential
        Potential bound to the step.
    x, dx, gradient : (N, 3) float64
        Positions [m], Newton's step [m] and dE/dx at x [N].
    solve : callable
        Forces (N, 3) -> P^-1 of them, (N, 3) [m].

    Returns
    -------
    CurvedStep or None
        None where the bend is longer than MOST_BENT times the step, or a gradient is not finite.
    """
    ahead, behind = (potential.gradient(x + h * dx) for h in (DIFFERENCE, -DIFFERENCE))
    second = (ahead - 2.0 * gradient + behind) / DIFFERENCE**2
    if not np.isfinite(second).all():
        return None
    bend = solve(-second)
    return CurvedStep(dx, bend) if dot(bend, bend) <= MOST_BENT**2 * dot(dx, dx) else None


def fraction_along(potential: Potential, x: Floats, path: CurvedStep, slope: float, straight: float) -> float:
    """Return the fraction of a curved step that lowers E further than the straight one does, or 0.

    Doubled from 1 as long as E falls, or halved, to no less than the straight fraction, until E falls enough.

    Parameters
    ----------
    potential : Potential
        Potential bound to the step.
    x : (N, 3) float64
        Positions [m].
    path : CurvedStep
        Displacements from x.
    slope : float
        gradient . dx [J], below 0.
    straight : float
        Fraction of dx that the line search took, above 0.
    """
    start, least = potential.value(x), potential.value(x + straight * path.dx)

    def value(fraction: float) -> float:
        displacement = path.at(fraction)
        return potential.value(x + displacement) if potential.step_limit(x, displacement) == 1.0 else np.inf

    fraction, reached = 1.0, value(1.0)
    while not reached <= start + SUFFICIENT_DECREASE * fraction * slope and fraction > straight:
        fraction *= 0.5
        reached = value(fraction)
    if not reached < least:
        return 0.0
    while fraction >= 1.0 and 2.0 * fraction <= LONGEST:
        further = value(2.0 * fraction)
        if not further < reached:
            break
        fraction, reached = 2.0 * fraction, further
    return fraction
