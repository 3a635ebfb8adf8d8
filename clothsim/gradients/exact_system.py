"""Solution with the exact Hessian of a bound potential at its minimum, and the polish of a converged step to it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError
from clothsim.physics.energies.base import Prescribed
from clothsim.physics.energies.hessians import ByElement, explicit, split
from clothsim.solve.linear.direct_solver import LinearSolver, NotPositiveDefiniteError
from clothsim.solve.linear.linear_system import System
from clothsim.solve.linear.sparsity import Explicit, couplings, hessian_product
from clothsim.solve.newton.lanczos import lowest_eigenvector
from clothsim.solve.newton.newton import Newton, NewtonResult, NewtonSettings
from clothsim.solve.newton.potential import Potential

ACCURACY = 1e-12
"""Relative error of a solution in the norm of the matrix."""


class NoMinimumError(ClothsimError):
    """State at which the exact Hessian is not positive definite: no minimum of E, and so without a derivative."""


@dataclass(frozen=True)
class ExactSystem:
    """The factored exact Hessian H of E at x, and its products.

    Parameters
    ----------
    hessians : list
        Parts of H over all rows of x [N/m].
    free : (n,) bool
        Cloth vertices whose positions are not prescribed.
    solver : LinearSolver
        Holds the factor of H on the free vertices.
    data : (9 b,) float64
        H in the pattern of the solver, rows of other vertices those of the identity.
    """

    hessians: list[Explicit]
    free: np.ndarray
    solver: LinearSolver
    data: Floats

    def solve(self, forces: Floats) -> Floats:
        """Return a (N, 3) with H a = forces at the free vertices and a = 0 elsewhere.

        Raises
        ------
        NoMinimumError
            Where H is not positive definite.
        """
        n = len(self.free)
        right = np.where(self.free[:, None], forces[:n], 0.0).ravel()
        out = np.zeros_like(forces)
        if right.any():
            out[:n] = self.solver.solve(self.data, right, ACCURACY).reshape(-1, 3)
        return out

    def prescribed_rows_times(self, vectors: Floats) -> Floats:
        """Return (N, 3), of which the prescribed rows are those of H v, v (N, 3): other parts of H are left out."""
        prescribed = np.ones(len(vectors), bool)
        prescribed[: len(self.free)] = ~self.free
        parts = [part for part in self.hessians if not isinstance(part, ByElement) or prescribed[part.elements].any()]
        return hessian_product(parts, vectors)


def exact_system(potential: Potential, x: Floats, system: System, prescribed: np.ndarray) -> ExactSystem:
    """Assemble the exact Hessian of a bound potential at x.

    Parameters
    ----------
    potential : Potential
        Bound to the step.
    x : (N, 3) float64
        Its minimiser [m].
    system : System
        Newton's system, whose pattern is extended in a copy.
    prescribed : (k,) int array
        Rows of x with prescribed positions.
    """
    wider, hessians, data = _assembled(potential, [x], system)
    free = _free(wider, prescribed)
    wider.pattern.fix(data, ~free)
    return ExactSystem(hessians, free, wider.solver, data)


def mean_adjoint(
    potential: Potential, states: Sequence[Floats], system: System, prescribed: np.ndarray, forces: Floats
) -> Floats:
    """Solve with the mean of the exact Hessians at several states.

    Parameters
    ----------
    states : sequence of (N, 3) arrays
        Positions [m].
    forces : (N, 3) float64
        Right-hand side.
    potential, system, prescribed
        As of `exact_system`.

    Returns
    -------
    (N, 3) float64
        0 in the prescribed rows.

    Raises
    ------
    NotPositiveDefiniteError
        Where the mean is not positive definite.
    """
    wider, _, data = _assembled(potential, states, system)
    free = _free(wider, prescribed)
    data /= len(states)
    wider.pattern.fix(data, ~free)
    return ExactSystem([], free, wider.solver, data).solve(forces)


def lowest_direction(potential: Potential, x: Floats, system: System, prescribed: np.ndarray) -> Floats | None:
    """Return the direction of least curvature of the exact Hessian over the projected one, its largest displacement 1.

    (N, 3); None where the curvature is not negative, or the projected one singular. Parameters as of `exact_system`.
    """
    wider, _, exact = _assembled(potential, [x], system)
    free = _free(wider, prescribed)
    projected = wider.assemble(potential.hessians(x))
    for data in (exact, projected):
        wider.pattern.fix(data, ~free)
    forces = np.random.default_rng(0).standard_normal((len(free), 3))
    forces[~free] = 0.0
    try:
        wider.solver.solve(projected, forces.ravel())
    except NotPositiveDefiniteError:  # free to move: of all directions none is least
        return None
    value, v = lowest_eigenvector(wider.pattern.times(exact), wider.solver.back_solve, forces.ravel())
    if not value < 0.0:
        return None
    out = np.zeros_like(x)
    out[: len(free)] = v.reshape(-1, 3) / np.linalg.norm(v.reshape(-1, 3), axis=1).max()
    return out


def _assembled(potential: Potential, states: Sequence[Floats], system: System) -> tuple[System, list[Explicit], Floats]:
    """A system wide enough for the sum of the exact Hessians at states, its parts, and its data in the pattern."""
    given = [energy.hessian(x, False) for x in states for energy in potential.acting.values()]
    implicit = split(given)[1]
    wider = system.widened([part.elements for part in implicit])
    hessians = explicit(given)
    wider.cover([couplings(part) for part in hessians])
    return wider, hessians, wider.assemble(list(hessians))


def _free(system: System, prescribed: np.ndarray) -> np.ndarray:
    n = system.base.n_vertices
    free = np.ones(n, bool)
    free[prescribed[prescribed < n]] = False
    return free


def solved(system: ExactSystem, forces: Floats, where: str) -> Floats:
    """`ExactSystem.solve`, with the error for the user; where: names the state in a sentence."""
    try:
        return system.solve(forces)
    except NotPositiveDefiniteError as error:
        raise NoMinimumError(
            f"The state {where} is not a minimum of the energy: it has no derivative.",
            "Its equilibrium is unstable, or it is free to move: add effects.inertia or pins, or change dt.",
        ) from error


# Polishing of a converged step: Newton steps with the exact Hessian down to round-off.


MOST_STEPS = 8
"""Bound on the Newton steps of a polish; two to four are usual."""
LEAST_GAIN = 0.5
"""Fraction of the residual that a step must leave at most: else round-off is reached."""


MOST_DESCENTS = 3
"""Bound on the descents of one step from states that are not minima."""
AMPLITUDES = tuple(1e-3 * 0.1**k for k in range(6))
"""Largest displacements of a vertex that are tried along the direction of least curvature [m]."""
DESCENT = NewtonSettings(tolerance=1e-8)
"""Settings of a descent; the tolerance is a length [m]."""


@dataclass(frozen=True)
class Polish:
    """Refinement of converged solves for `Integrator.refine`: at most `steps` Newton steps with the exact Hessian.

    Newton's method may end where the exact Hessian is not positive definite, beside a saddle of the energy, as its
    matrix is projected, or where the exact Newton step is too long: it raises the force, or contact blocks it. From
    there it goes on to a minimum first, at steps below DESCENT's tolerance; from a saddle down along the direction of
    least curvature.
    """

    system: System
    steps: int = MOST_STEPS

    def __call__(self, potential: Potential, result: NewtonResult, target: Prescribed) -> NewtonResult:
        """Return the result with polished positions; where no descent helps, what it came to."""
        x, residual, end = self._polished(potential, result.x, target)
        for _ in range(MOST_DESCENTS):
            if end is _End.EXACT:
                break
            if end is _End.SADDLE:
                x = self._beside(potential, x, target)
            below = Newton(potential, self.system, DESCENT, dt=1.0).minimise(x, target)
            if not below.outcome.converged:
                break
            x, residual, end = self._polished(potential, below.x, target)
        return replace(result, x=x, residual=min(result.residual, residual)) if np.isfinite(residual) else result

    def _beside(self, potential: Potential, x: Floats, target: Prescribed) -> Floats:
        """Positions of lower energy along the direction of least curvature; x where there are none."""
        direction = lowest_direction(potential, x, self.system, target.vertices)
        if direction is None:
            return x
        start, side = potential.value(x), -1.0 if float(np.vdot(direction, potential.gradient(x))) > 0 else 1.0
        for amplitude in AMPLITUDES:
            dx = side * amplitude * direction
            if potential.step_limit(x, dx) == 1.0 and potential.value(x + dx) < start:
                return x + dx
        return x

    def _polished(self, potential: Potential, x: Floats, target: Prescribed) -> "tuple[Floats, float, _End]":
        """Positions, the force that is left [N], and how the steps ended."""
        best, residual, length = x, np.inf, np.inf
        for _ in range(self.steps):
            gradient = potential.gradient(x)
            exact = exact_system(potential, x, self.system, target.vertices)
            left = _largest(gradient, exact.free)
            if not left < LEAST_GAIN * residual:
                break
            best, residual = x, left
            try:
                dx = exact.solve(-gradient)
            except NotPositiveDefiniteError:
                return best, residual, _End.SADDLE
            length = float(np.abs(dx).max())
            if not length or potential.step_limit(x, dx) < 1.0 or not np.isfinite(potential.value(x + dx)):
                break
            x = x + dx
        else:
            left = _largest(potential.gradient(x), exact.free)
            best, residual = (x, left) if left < residual else (best, residual)
        return best, residual, _End.EXACT if length <= DESCENT.tolerance else _End.FAR


class _End(Enum):
    """End of the Newton steps of a polish."""

    EXACT = "the last step is below the tolerance"
    FAR = "a step that does not reduce the force, or that contact blocks"
    SADDLE = "no positive definite Hessian"


def _largest(gradient: Floats, free: np.ndarray) -> float:
    return float(np.abs(gradient[: len(free)][free]).max(initial=0.0))
