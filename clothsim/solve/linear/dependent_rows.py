"""Dependent rows of x: vertices of rigid bodies as affine functions of few unknowns, and the chain rule for them.

x_d = c + W z for the rows d of a body's surface and its coordinates z. A displacement of the unknowns moves them by
W dz, a gradient at them adds W' g to that by z, and a Hessian block H of an element adds E' H E, E the derivative of
the element's vertices by the unknowns. So energies, contact and line search see vertices alone.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.physics.energies.hessians import ByElement, ElementHessian, LowRankHessian
from clothsim.solve.linear.sparsity import Explicit

CORNERS, COORDINATES = 4, 4
"""Most vertices of an element with a dependent row (a contact pair), and most coordinates of a body."""


@dataclass(frozen=True)
class Dependence:
    """Rows `rows` of x that follow the rows `unknowns`: x[rows] = constant + weights @ x[unknowns].

    rows, unknowns: slices; weights (d, k).
    """

    rows: slice
    unknowns: slice
    weights: Floats


@dataclass(frozen=True)
class DependentRows:
    """All dependent rows of x; none for a world without rigid bodies.

    Parameters
    ----------
    parts : tuple of Dependence
        One for each rigid body.
    count : int
        Number of rows of x.
    """

    parts: tuple[Dependence, ...] = ()
    count: int = 0

    def __bool__(self) -> bool:
        """True where any row depends on others."""
        return bool(self.parts)

    def any_of(self, rows: Ints) -> bool:
        """True where one of the unknown `rows` (k,) moves dependent ones."""
        return any(bool(((rows >= part.unknowns.start) & (rows < part.unknowns.stop)).any()) for part in self.parts)

    def follow(self, dx: Floats) -> Floats:
        """Set the dependent rows of a displacement (N, 3) of the unknowns, in place; return it."""
        for part in self.parts:
            dx[part.rows] = part.weights @ dx[part.unknowns]
        return dx

    def reduced(self, gradient: Floats) -> Floats:
        """Return a gradient (N, 3) by the unknowns: what acts on dependent rows is added to them."""
        if not self.parts:
            return gradient
        out = gradient.copy()
        for part in self.parts:
            out[part.unknowns] += part.weights.T @ gradient[part.rows]
        return out

    def coupled(self, elements: Sequence[Ints]) -> list[Ints]:
        """Return `elements` (m, k) each, and the unknowns that those with a dependent row couple beside."""
        return [*elements, *(each.nodes for each in map(self._expansion, elements) if each is not None)]

    def hessians(self, given: Iterable[Explicit]) -> list[Explicit]:
        """Return the Hessians, and by the chain rule those that the dependent rows in their elements add."""
        given = list(given)
        if not self.parts:
            return given
        added: list[Explicit] = []
        for hessian in given:
            if not isinstance(hessian, ByElement):
                raise TypeError("a sparse Hessian has no elements to which the chain rule applies")
            expansion = self._expansion(hessian.elements) if hessian.elements.shape[1] <= CORNERS else None
            if expansion is None:
                continue
            if isinstance(hessian, LowRankHessian):
                picked = {name: getattr(hessian, name)[expansion.chosen] for name in ("elements", "first", "count")}
                added.append(expansion.applied(replace(hessian, **picked).blocks))
            else:
                added.append(expansion.applied(np.asarray(hessian.blocks[expansion.chosen], np.float64)))
        return [*given, *added]

    @cached_property
    def _tables(self) -> tuple[Ints, Floats, Ints]:
        """Number of the body of each row, -1 for none, its weights, and the unknowns of each body."""
        bodies, weights = np.full(self.count, -1), np.zeros((self.count, COORDINATES))
        unknowns = np.full((len(self.parts), COORDINATES), self.count)
        for number, part in enumerate(self.parts):
            k = part.weights.shape[1]
            bodies[part.rows] = number
            weights[part.rows, :k] = part.weights
            unknowns[number, :k] = np.arange(part.unknowns.start, part.unknowns.stop)
        return bodies, weights, unknowns

    def _expansion(self, elements: Ints) -> "_Expansion | None":
        """The expansion of the elements (m, k) with a dependent row; None where there is none."""
        bodies, weights, unknowns = self._tables
        if not len(elements):
            return None
        owners = bodies[elements]
        chosen = np.flatnonzero((owners >= 0).any(axis=1))
        if not len(chosen):
            return None
        rows, owners = elements[chosen], owners[chosen]
        first = owners[np.arange(len(rows)), (owners >= 0).argmax(axis=1)]
        other = (owners >= 0) & (owners != first[:, None])
        two = other.any(axis=1)
        second = owners[np.arange(len(rows)), other.argmax(axis=1)]
        nodes = np.full((len(rows), COORDINATES + CORNERS), self.count)
        nodes[:, :COORDINATES] = unknowns[first]
        corners = np.arange(rows.shape[1])
        nodes[:, COORDINATES + corners] = np.where(owners < 0, rows, self.count)
        nodes[two, COORDINATES:] = unknowns[second[two]]
        derivative = np.zeros((len(rows), rows.shape[1], COORDINATES + CORNERS))
        own = (owners == first[:, None])[:, :, None]
        derivative[:, :, :COORDINATES] = np.where(own, weights[rows], 0.0)
        of_second = np.where(other[:, :, None], weights[rows], 0.0)
        derivative[two, :, COORDINATES:] = of_second[two]
        identity = np.zeros_like(derivative)
        identity[:, corners, COORDINATES + corners] = owners < 0
        derivative[~two] += identity[~two]
        return _Expansion(chosen, nodes, derivative, two)


NO_DEPENDENT_ROWS = DependentRows()


@dataclass(frozen=True)
class _Expansion:
    """Elements `chosen` (p,) with dependent rows: unknowns (p, 8), derivatives (p, k, 8), whether of two bodies (p,).

    The unknowns are those of a body, then those of a second one, or the vertices of the element that are not on it.
    """

    chosen: Ints
    nodes: Ints
    derivative: Floats
    two: np.ndarray

    def applied(self, blocks: Floats) -> ElementHessian:
        """Return E' H E for the blocks (p, 3k, 3k), less what couples unknown vertices, which the elements add."""
        p, k, n = self.derivative.shape
        by_node = blocks.reshape(p, k, 3, k, 3).transpose(0, 2, 4, 1, 3)  # (p, 3, 3, k, k)
        left = self.derivative.transpose(0, 2, 1)[:, None, None]
        expanded = (left @ by_node @ self.derivative[:, None, None]).transpose(0, 3, 1, 4, 2)
        vertices = expanded[:, COORDINATES:, :, COORDINATES:]
        vertices[~self.two] = 0.0
        return ElementHessian(self.nodes, np.ascontiguousarray(expanded).reshape(p, 3 * n, 3 * n))
