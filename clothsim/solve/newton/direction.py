"""Newton direction: the quadratic model of E at x, the step to its minimum, and its trust region.

The projected Hessian is used where the exact one cannot be trusted.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.linalg import dot
from clothsim.base.parallel import together
from clothsim.base.vectors import taken
from clothsim.physics.energies.hessians import Hessian, ImplicitHessian, explicit, split
from clothsim.solve.linear.direct_solver import EXACT, LinearSolver, NotPositiveDefiniteError
from clothsim.solve.linear.linear_system import System
from clothsim.solve.linear.sparsity import hessian_product
from clothsim.solve.newton.lanczos import saddle_free_solve
from clothsim.solve.newton.outcome import Ending, Outcome, outcome
from clothsim.solve.newton.potential import Potential

MIN_RADIUS, MAX_RADIUS = 3.0, 1000.0
"""The radius, in lengths of the projected Hessian's step. A nearly flat valley gives little information about its far
end, so it starts small; along a long curved one it must grow, or each iteration takes three steps of a thousand (a
sheet squeezed to a millionth: 4,771 iterations with the radius fixed at 3, 329 with one that grows, and never more
elsewhere).
"""


@dataclass(frozen=True)
class Trust:
    """State of the trust region.

    Parameters
    ----------
    radius : float
        Bound on a step of negative curvature, in lengths of the projected Hessian's step.
    projected : int
        Number of coming iterations that use the projected Hessian alone.
    pause : int
        Length of the next such pause.
    """

    radius: float = MIN_RADIUS
    projected: int = 1  # the first step from a start that may be far off
    pause: int = 1

    @property
    def exact(self) -> bool:
        """True where the next step uses the exact Hessian."""
        return self.projected == 0

    def after(self, fraction: float, negative_curvature: bool, noise: bool) -> "Trust":
        """Return the state after a step of which the line search took `fraction`.

        negative_curvature: the step ended on the radius; noise: it was at the round-off of E, where the exact Hessian
        shows spurious negative curvature and its long steps cycle, while the projected one alone may crawl. So the
        exact one pauses for a number of iterations that doubles.
        """
        if noise:
            return Trust(MIN_RADIUS, 2 * self.pause, 2 * self.pause)
        if not self.exact:
            return replace(self, projected=self.projected - 1)
        grows = negative_curvature and fraction >= 1.0
        return replace(self, radius=min(2.0 * self.radius, MAX_RADIUS) if grows else max(0.5 * self.radius, MIN_RADIUS))


PROJECTED = Trust()
"""State at the start of a solve: projected Hessian first."""

TRUSTED = Trust(projected=0)
"""State that uses the exact Hessian from the first step, where a solve starts near its minimiser."""


Product = Callable[[Floats], Floats]
"""v -> A v for v (n,)."""

MAX_SHIFTS = 12
SINGULAR = 2.0**12 * float(np.finfo(float).eps)
"""Curvature along a solution, over that of the diagonal alone, below which it is the rounding of the matrix. Whether a
matrix that is singular but for that can be factorised is chance (Higham 2002, theorem 10.7): it differs from processor
to processor. Such a factor is not a preconditioner: for a strip without bending it makes steps of 1e6 m, and
Lanczos' method finds its smallest pivots and nothing else."""
PRECONDITIONER_ERROR = 1e-2
"""Relative error, in the norm of the matrix, that a preconditioner may leave."""
MAX_AGE, MOST_PRODUCTS = 3, 6
"""A cached factor preconditions at most MAX_AGE further matrices, while Lanczos takes at most MOST_PRODUCTS products
with it: at 10,201 vertices a product with a back-solve costs 5 ms, a new factor with its assembly 65.
"""
MIN_VERTICES = 4000
"""Vertices from which on a factor is cached: on smaller meshes a new one costs less than the iterations that an old
one adds.
"""
REUSE_FRACTION = 0.3
"""Fraction of a step that must have been taken for the factor to be reused: else the Hessian has changed too much."""


@dataclass(frozen=True)
class CachedFactor:
    """Last factorisation: its solver, the number of matrices since, and the products of the last Lanczos solve.

    It may lack blocks that the pattern has gained since, so it serves as a preconditioner only.
    """

    solver: LinearSolver | None = None
    age: int = 0
    products: int = 0

    @property
    def usable(self) -> bool:
        """True where it may precondition one more matrix, also one whose pattern has grown since."""
        return self.solver is not None and self.age < MAX_AGE and self.products <= MOST_PRODUCTS

    def after(self, fraction: float) -> "CachedFactor":
        """Return the cached factor after a step of which the line search took `fraction`."""
        return self if fraction >= REUSE_FRACTION else NO_FACTOR


NO_FACTOR = CachedFactor()
"""State without a cached factor."""


@dataclass(frozen=True)
class Direction:
    """Newton direction at x.

    dx (N, 3) [m]; gradient (N, 3) [N]; negative_curvature: the exact Hessian is indefinite, or nearly, along dx;
    cached: the factor for the next iteration; end: the outcome where no direction exists.
    """

    dx: Floats
    gradient: Floats
    negative_curvature: bool = False
    cached: CachedFactor = NO_FACTOR
    end: Outcome | None = None


@dataclass(frozen=True)
class QuadraticModel:
    """Quadratic model of E at a point: the potential and the system that stores its Hessian.

    fixed (n,) bool: Dirichlet vertices of the system.
    """

    potential: Potential
    system: System
    fixed: np.ndarray

    def direction(
        self, x: Floats, displacement: Floats, trust: Trust = PROJECTED, cached: CachedFactor = NO_FACTOR
    ) -> Direction:
        """Solve H_ff dx_f = -(g + H u)_f with dx = u at the Dirichlet vertices, u the prescribed `displacement`.

        H is the projected Hessian. Where `trust` is exact, H is the unprojected one within the trust radius,
        preconditioned by a factor of the projected one, that of x or the `cached` one while it is usable;
        `displacement` must be 0 then.
        """
        gradient = self.potential.gradient(x)
        if not np.isfinite(gradient).all():
            return Direction(displacement, gradient, end=outcome(Ending.NOT_FINITE, x, _first_not_finite(gradient)))
        if trust.exact and len(self.fixed) >= MIN_VERTICES and cached.solver is not None and cached.usable:
            formed, implicit = split(self.potential.exact_hessians(x))
            data, right = self._assembled(formed)[0], -self._free(gradient)
            with self.potential.timers.phase("linear solve"):
                first = cached.solver.back_solve(right)
            return self._curved(data, implicit, right, first, gradient, trust, replace(cached, age=cached.age + 1))
        hessians = self.potential.hessians(x)
        right = -self._free(
            gradient + hessian_product(explicit(hessians), displacement) if displacement.any() else gradient
        )
        exact: list[Hessian] = []

        def formed_beside() -> list[Hessian]:
            exact[:] = self.potential.exact_hessians(x, hessians)
            return split(exact)[0]

        data, formed_data = self._assembled(hessians, formed_beside if trust.exact else None)
        finite = bool(np.isfinite(right).all())
        solved = self._solve(data, right, PRECONDITIONER_ERROR if trust.exact else EXACT) if finite else None
        if solved is None and finite and np.isfinite(data).all():
            return Direction(displacement, gradient, end=outcome(Ending.SINGULAR))
        if solved is None:
            vector = self.system.pattern.times(data)(np.zeros_like(right)) if finite else right
            row = int(np.arange(len(x))[self.system.rows][_first_not_finite(vector.reshape(-1, 3))])
            return Direction(displacement, gradient, end=outcome(Ending.NOT_FINITE, x, row))
        solution, solver = solved
        if not trust.exact:
            return Direction(self._fill_free(displacement, solution), gradient)
        formed, implicit = split(exact)
        formed_data = self._assembled(formed)[0] if formed_data is None else formed_data
        return self._curved(formed_data, implicit, right, solution, gradient, trust, CachedFactor(solver))

    def _curved(
        self,
        data: Floats,
        implicit: list[ImplicitHessian],
        right: Floats,
        first: Floats,
        gradient: Floats,
        trust: Trust,
        cached: CachedFactor,
    ) -> Direction:
        """Direction of the exact Hessian, the matrix of `data` and implicit parts.

        first: the preconditioner applied to the right-hand side.
        """
        curved = self._products(data, implicit, len(gradient))
        with self.potential.timers.phase("linear solve"):
            assert cached.solver is not None
            precondition = cached.solver.back_solve
            solution = saddle_free_solve(curved, precondition, right, trust.radius, first, above=cached.age == 0)
            moves_as_a_whole = solution.products > 0 and self.system.patch is None and not self.fixed.any()
            found = solution.x
            if moves_as_a_whole:
                found = without_net_force(self.system.pattern.translated(data), right, found)
        dx = self._fill_free(np.zeros_like(gradient), found)
        cached = replace(cached, products=solution.products) if solution.products else NO_FACTOR
        return Direction(dx, gradient, solution.negative_curvature, cached)

    def solver(self, cached: CachedFactor) -> Callable[[Floats], Floats]:
        """Return forces (N, 3) -> displacements (N, 3) of the free vertices, by a factor of the projected Hessian."""

        def solve(forces: Floats) -> Floats:
            assert cached.solver is not None
            return self._fill_free(np.zeros_like(forces), cached.solver.back_solve(self._free(forces)))

        return solve

    def residual(self, gradient: Floats) -> float:
        """Return the largest component of the gradient (N, 3) at a free vertex [N]."""
        return float(np.abs(self._free(gradient)).max(initial=0.0))

    def _free(self, vectors: Floats) -> Floats:
        """Entries (3 n,) of gradients (N, 3) by the system's unknowns, 0 where they are fixed."""
        entries = taken(self.system.dependent.reduced(vectors), self.system.rows)
        if self.fixed.any():
            entries = np.where(self.fixed[:, None], 0.0, entries)
        return entries.ravel()

    def _fill_free(self, displacement: Floats, solution: Floats) -> Floats:
        """`displacement` with the solution at the free vertices."""
        dx, moved = displacement.copy(), solution.reshape(-1, 3)
        if self.fixed.any():
            moved = np.where(self.fixed[:, None], taken(displacement, self.system.rows), moved)
        dx[self.system.rows] = moved
        return self.system.dependent.follow(dx)

    def _products(self, formed_data: Floats, implicit: list[ImplicitHessian], n_rows: int) -> Product:
        """v -> H v of Hessians over n_rows rows, for v (3 n,) that is 0 at the fixed vertices.

        Implicit parts are not assembled: the matrix, of `formed_data`, has the pattern of the projected one.
        """
        rows = self.system.rows
        times_formed = self.system.pattern.times(formed_data)
        if not implicit:
            return times_formed
        whole = np.zeros((n_rows, 3))

        def product(v: Floats) -> Floats:
            whole[rows] = v.reshape(-1, 3)
            tasks = [partial(times_formed, v), *(partial(part.apply, whole) for part in implicit)]
            total, *products = together(*tasks, long=len(self.fixed) >= MIN_VERTICES)
            for each in products:
                total += self._free(each)
            return total

        return product

    def _assembled(
        self, hessians: list[Hessian], beside: Callable[[], list[Hessian]] | None = None
    ) -> tuple[Floats, Floats | None]:
        """Matrix of the Hessians, and of those that others are made from beside it (`System.assemble_two`)."""
        with self.potential.timers.phase("assembly"):
            data, other = self.system.assemble_two(hessians, beside)
            for each in (data, other):
                if each is not None:
                    self.system.pattern.fix(each, self.fixed)
        return data, other

    def _solve(self, data: Floats, b: Floats, accuracy: float) -> tuple[Floats, LinearSolver] | None:
        """Solution and its solver; the diagonal is shifted by growing amounts until the matrix is positive definite.

        Also where the curvature along the solution is no more than the rounding of the matrix (SINGULAR).
        """
        timers = self.potential.timers
        shift = 0.0
        for attempt in range(MAX_SHIFTS):
            if attempt == 1:
                if not np.isfinite(data).all():
                    return None
                largest = float(self.system.pattern.diagonal(data).max(initial=0.0))
                shift = 1e-10 * max(largest, np.finfo(float).tiny)
            elif attempt:
                shift *= 10.0
            with timers.phase("linear solve"):
                timers.linear_solves += 1
                try:
                    shifted = self.system.pattern.shift(data, shift) if attempt else data
                    if attempt or accuracy == EXACT:
                        solver = self.system.solver
                    else:
                        solver, shifted = self.system.preconditioner(data)
                    solution = solver.solve(shifted, b, accuracy)
                except NotPositiveDefiniteError:
                    continue
            with np.errstate(over="ignore", invalid="ignore"):
                descent = dot(solution, b)
                rounding = SINGULAR * dot(self.system.pattern.diagonal(data) * solution, solution)
            if np.isfinite(solution).all() and max(0.0, rounding) <= descent < np.inf:
                return solution, solver
        return None


def _first_not_finite(vectors: Floats) -> int:
    return int(np.argmax(~np.isfinite(vectors).all(axis=1)))


def _is_positive(matrix: Floats) -> bool:
    """True where a symmetric (3, 3) matrix is positive definite (Sylvester); a tenth of what its eigenvalues take."""
    (a, _, _), (b, c, _), (d, e, f) = matrix.tolist()
    minor = a * c - b * b
    return a > 0.0 and minor > 0.0 and f * minor > a * e * e - 2.0 * b * d * e + c * d * d


def without_net_force(translated: Floats, b: Floats, x: Floats) -> Floats:
    """x (3 n,), an inexact solution of A x = b, with the translation of all vertices after which T'(b - A x) = 0.

    A Krylov space holds no translations, so what a solution in it leaves has a net force: momentum out of nothing. x
    itself where the translations have no positive stiffness T'A T, or would no longer lead downhill. translated
    (3, 3 n): A T, to which implicit parts add nothing, as a translation bends no cloth.
    """
    stiffness = translated.reshape(3, -1, 3).sum(axis=1)
    force = b.reshape(-1, 3).sum(axis=0) - np.array([dot(image, x) for image in translated])
    if not np.isfinite(stiffness).all() or not _is_positive(stiffness):
        return x
    moved = (x.reshape(-1, 3) + np.linalg.solve(stiffness, force)).ravel()
    return moved if dot(b, moved) > 0.0 else x
