"""Stability of a static state: the lowest mode of its exact Hessian, and the way down along it.

With P the projected Hessian and K the exact one, v minimises v'K v / v'P v: as P lacks the softening of compression, it
is the mode that buckles first (v'(P - K) v / v'P v is the inverse of a load factor), whatever the mesh. By Sylvester's
law the quotient is negative for some v exactly where K has a negative eigenvalue.
"""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.linalg import dot
from clothsim.solve.newton.lanczos import lowest_eigenvector
from clothsim.solve.newton.line_search import RESOLVED, extended_fraction, round_off
from clothsim.solve.newton.statics import HORIZON, StaticModel

ROUNDING = 64 * float(np.finfo(float).eps)
"""Curvature v'K v of round-off alone, over |v|'|K||v|."""
SYMMETRIC = 0.01
"""Slope along a mode over the curvature's own: below it the two sides count as equal, and the seed chooses one."""
MAX_SHORTENINGS = 12
"""Halvings of a displacement that contact requires."""
MAX_ENERGY_SHORTENINGS = 4
"""Halvings that the energy requires: where it falls only nearer than that, the minimum beside the state is as good as
the state. (Contact changes its closest features at an edge of a body, with a ridge of a micrometre.)"""


@dataclass(frozen=True)
class Mode:
    """An unstable mode of a state.

    Parameters
    ----------
    shape : (N, 3) float64
        Its displacement, the largest of a vertex 1; 0 in rows that do not move.
    curvature : float
        v'K v of the shape v, below 0 [N/m].
    growth_rate : float
        (-v'K v / v'M v)^1/2 [1/s].
    """

    shape: Floats
    curvature: float
    growth_rate: float


def lowest_mode(model: StaticModel, seed: int, along: Floats | None = None) -> Mode | None:
    """Return the lowest mode of a state, None where its curvature is not negative beyond round-off.

    Parameters
    ----------
    model : StaticModel
        The state.
    seed : int
        Direction: 2 k and 2 k + 1 search from the same random vector, and return opposite sides.
    along : (n, 3) float64, optional
        Directions of the random forces that the search begins with; the mode then has the symmetries that these have.
    """
    precondition = model.projected_inverse()
    if precondition is None:
        return None
    forces = np.random.default_rng(seed // 2).standard_normal((len(model.masses), 3 if along is None else 1))
    forces = np.where(model.fixed[:, None], 0.0, forces if along is None else forces * along)
    exact = model.matrix()
    pattern = model.system.pattern
    with model.bound.timers.phase("linear solve"):
        value, v = lowest_eigenvector(pattern.times(exact), precondition, forces.ravel())
    if not value < 0.0:
        return None
    v *= (-1.0) ** seed / np.linalg.norm(v.reshape(-1, 3), axis=1).max()
    lowest, size = dot(v, pattern.times(exact)(v)), np.abs(v)
    if not lowest < -ROUNDING * dot(size, pattern.times(np.abs(exact))(size)):
        return None
    mass = float(model.masses @ (v.reshape(-1, 3) ** 2).sum(axis=1))
    shape = np.zeros_like(model.rest.positions)
    shape[model.system.rows] = v.reshape(-1, 3)
    curvature = lowest - mass / HORIZON**2
    return Mode(shape, curvature, float(np.sqrt(-curvature / mass)))


def descent_from_saddle(model: StaticModel, mode: Mode, amplitude: float, longest: float = 1.0) -> Floats | None:
    """Return a displacement along a mode that lowers the static energy and is free of collision.

    Downhill where the state has a slope along the mode, else to the side of the mode's shape if that is admissible.

    Parameters
    ----------
    model : StaticModel
        The state.
    mode : Mode
        Its unstable mode.
    amplitude : float
        Largest displacement of a vertex [m]; halved where contact or the energy requires it.
    longest : float
        Factor by which it may be extended, by doubling, as long as the energy falls.

    Returns
    -------
    (N, 3) float64 or None
        [m]; None where neither side has one: the energy falls nowhere near, or contact is in the way.
    """
    x, potential = model.rest.positions, model.potential
    slope = dot(model.gradient(), mode.shape)
    sided = abs(slope) > SYMMETRIC * 0.5 * -mode.curvature * amplitude
    first = -float(np.sign(slope)) if sided else 1.0
    start, noise = potential.value(x), round_off(potential.values(x))
    for sign in (first, -first):
        dx, rises = sign * amplitude * mode.shape, 0
        for _ in range(MAX_SHORTENINGS):
            if potential.step_limit(x, dx) == 1.0:
                rises += 1
                promised = 0.5 * -mode.curvature * float(np.abs(dx).max()) ** 2
                if potential.value(x + dx) < start + (0.0 if promised > RESOLVED * noise else noise):
                    return extended_fraction(potential, x, dx, longest) * dx
            if rises > MAX_ENERGY_SHORTENINGS:
                break
            dx = 0.5 * dx
    return None
