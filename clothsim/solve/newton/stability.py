"""Stability of a static state: the exact Hessian without inertia, its lowest mode, and the way down along it.

With P the projected Hessian and K the exact one, v minimises v'K v / v'P v: as P lacks the softening of compression, it
is the mode that buckles first (v'(P - K) v / v'P v is the inverse of a load factor), whatever the mesh. By Sylvester's
law the quotient is negative for some v exactly where K has a negative eigenvalue.

With K the exact Hessian of E without inertia and dissipation and M the masses, K + M / T^2 is positive definite where
no perturbation grows by e in less than the horizon T, and then u = -(K + M / T^2)^-1 g is the displacement to
equilibrium, g the static gradient: along a mode of frequency w the fraction w^2 T^2 / (1 + w^2 T^2) of it. The mass
term keeps rigid modes, which have no stiffness, finite.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.linalg import dot
from clothsim.base.vectors import taken
from clothsim.physics.energies.base import Energy, Step
from clothsim.physics.energies.hessians import Hessian, diagonal_hessian, every_vertex, explicit, split
from clothsim.physics.energies.protocols import Lagged, Nonconservative, is_idle
from clothsim.solve.linear.direct_solver import NotPositiveDefiniteError
from clothsim.solve.linear.linear_system import System
from clothsim.solve.newton.lanczos import lowest_eigenvector
from clothsim.solve.newton.line_search import RESOLVED, extended_fraction, round_off
from clothsim.solve.newton.potential import Potential

HORIZON = 30.0
"""T [s]. A strip of light cloth of 1 m bends with w = .06 1/s: of its distance from equilibrium a horizon of 30 s shows
three quarters, one of 1 s four thousandths."""

SHIFTS = (0.0, 1e-13, 1e-11, 1e-9)
"""Fractions of the largest diagonal entry, tried in turn against the rounding of a projected matrix."""


@dataclass(frozen=True)
class StaticModel:
    """Static model at a state at the end of a step.

    Parameters
    ----------
    bound : Potential
        The potential bound to that step.
    newton : System
        The Newton matrix of that step and its solver; the pattern has the pairs that are in contact.
    masses : (n,) float64
        Of the cloth vertices [kg].
    fixed : (n,) bool
        Dirichlet vertices.
    rest : Step
        A step that starts at the state without velocities.
    """

    bound: Potential
    newton: System
    masses: Floats
    fixed: np.ndarray
    rest: Step

    @cached_property
    def potential(self) -> Potential:
        """The stored energies, and friction, whose force at the end of the step holds the cloth and is included."""
        return replace(self.bound, energies={n: e for n, e in self.bound.acting.items() if _is_static(e)})

    @cached_property
    def system(self) -> System:
        """Matrix and solver of K: those of the Newton matrix, or wider ones where K couples more (mid-edge bending)."""
        implicit = split(self._exact)[1]
        if not implicit:
            return self.newton
        wider = self.newton.widened([part.elements for part in implicit])
        wider.begin(self.bound.couplings(self.rest.positions, np.zeros_like(self.rest.positions)))
        return wider

    @cached_property
    def _exact(self) -> list[Hessian]:
        return self.potential.exact_hessians(self.rest.positions)

    def gradient(self) -> Floats:
        """Return the static gradient, (N, 3) [N]: what depends on velocities is taken at zero velocity."""
        x = self.rest.positions
        total = self.potential.gradient(x)
        for name, energy in self.bound.energies.items():
            if not _is_static(energy):
                with self.bound.timers.effect(name, ""):
                    at_rest = energy.begin(self.rest)
                    total = total if is_idle(at_rest) else total + at_rest.gradient(x)
        return total

    @property
    def is_conservative(self) -> bool:
        """True where every static force on the free vertices has a potential: else K tells nothing of stability."""
        parts = [e.rows_without_potential for e in self.potential.energies.values() if isinstance(e, Nonconservative)]
        return all(self.fixed[rows].all() for rows in parts)

    @cached_property
    def is_stable(self) -> bool:
        """True where K + M / T^2 is positive definite. `solver` then holds its factor."""
        return self._factorises(self.matrix())

    def displacement(self) -> Floats:
        """Return the displacement to equilibrium (n, 3) [m]; of an unstable state by the projected Hessian."""
        b = -np.where(self.fixed[:, None], 0.0, taken(self.gradient(), self.system.rows)).ravel()
        solve = self.system.solver.back_solve if self.is_stable else self.projected_inverse()
        if solve is None:
            return np.full((len(self.masses), 3), np.inf)
        with self.bound.timers.phase("linear solve"):
            return solve(b).reshape(-1, 3)

    def matrix(self) -> Floats:
        """Return K + M / T^2 as data of the system's pattern, the rows of fixed vertices those of the identity."""
        return self._assembled(self._exact)

    def projected(self) -> Floats:
        """Return the same with the projected Hessian, which is positive definite."""
        return self._assembled(self.potential.hessians(self.rest.positions))

    def projected_inverse(self) -> Callable[[Floats], Floats] | None:
        """Return r -> P^-1 r, P `projected`; None where it is not positive definite with any of SHIFTS on its diagonal.

        Of a sheet of a millimetre M / T^2 is smaller than the rounding of the stiffness.
        """
        data, pattern = self.projected(), self.system.pattern
        largest = float(pattern.diagonal(data).max(initial=0.0))
        shifted = (pattern.shift(data, shift * largest) if shift else data for shift in SHIFTS)
        return self.system.solver.back_solve if any(map(self._factorises, shifted)) else None

    def _assembled(self, hessians: list[Hessian]) -> Floats:
        mass = diagonal_hessian(every_vertex(len(self.masses)), self.masses / HORIZON**2)
        with self.bound.timers.phase("assembly"):
            data = self.system.assemble([*explicit(hessians), mass])
            self.system.pattern.fix(data, self.fixed)
        return data

    def _factorises(self, data: Floats) -> bool:
        """True where a matrix is positive definite; the solver then holds its factor.

        A factor in single precision may be positive definite where the matrix is not: refinement then diverges, but
        only along vectors with all modes in them, and symmetric forces lack some.
        """
        probe = np.random.default_rng(0).standard_normal(3 * len(self.masses))
        with self.bound.timers.phase("linear solve"):
            self.bound.timers.linear_solves += 1
            try:
                self.system.solver.solve(data, probe)
            except NotPositiveDefiniteError:
                return False
        return True


def _is_static(energy: Energy) -> bool:
    return not energy.incremental or isinstance(energy, Lagged)


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
