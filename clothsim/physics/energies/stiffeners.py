"""Rods sewn along edges of the cloth, as boning, wire, piping or a topstitched seam: the effect `stiffeners`.

    E = sum_edges EA/2 (|e|/l0 - 1)^2 l0 + sum_vertices EI/2 |kb|^2 / l,   kb = 2 t x t' / (1 + t.t')        [J]

over the edges e of a line and the vertices between two of them, with t and t' the directions of both, l0 the length of
an edge at rest and l the mean of two (Bergou et al. 2008, Discrete elastic rods). |kb| = 2 tan(phi/2) of the angle phi
between the edges, so that the energy of a fold is infinite. There is no unknown of twist: a round rod that is straight
at rest and free to turn at its ends has none. EA [N] and EI [N m2] are those of the rod alone, beside the cloth.

With c = t.t' a vertex has f(c) = 2 EI/l (1 - c)/(1 + c), f' = -4 EI/l / (1 + c)^2 and f'' = 8 EI/l / (1 + c)^3;
the Hessian is f'' g g' + f' H with g, H the derivatives of c by both edges. Edges are links (`links`), which push too.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.keys.typed_effects import Stiffeners
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off
from clothsim.physics.energies.edge_curves import EdgeCurve, edge_curves
from clothsim.physics.energies.example import Example
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.physics.energies.links import Links
from clothsim.physics.energies.protocols import Coupling, Elementwise, EnergyReport, Restrictable

FOLDED = 1e-12
"""1 + t.t' below which a vertex is folded to round-off: its energy is infinite."""


@dataclass(frozen=True)
class RodBending(Elementwise, Energy):
    """E = sum 2 k (1 - c)/(1 + c), c = t.t'.

    Parameters
    ----------
    rows : (b, 3) int array
        Rows of x: a vertex between those before and after it.
    stiffnesses : (b,) array
        k = EI / l [N m].
    """

    rows: Ints
    stiffnesses: Floats

    per_element = ("rows", "stiffnesses")

    def value(self, x: Floats) -> float:
        """E(x) [J]; inf where a vertex is folded or an edge has no length."""
        cosines, lengths, _ = self._angles(x)
        if (cosines <= FOLDED - 1).any() or not (lengths > 0).all():
            return np.inf
        return 2.0 * float(np.sum(self.stiffnesses * (1 - cosines) / (1 + cosines)))

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        cosines, lengths, directions = self._angles(x)
        by_edges = self._slopes(cosines)[:, None, None] * _cosine_gradient(cosines, lengths, directions)
        parts = np.stack([-by_edges[:, 0], by_edges[:, 0] - by_edges[:, 1], by_edges[:, 1]], axis=1)
        gradient = np.zeros_like(x)
        np.add.at(gradient, self.rows.ravel(), parts.reshape(-1, 3))
        return gradient

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (b, 9, 9) [N/m]."""
        cosines, lengths, directions = self._angles(x)
        g = _cosine_gradient(cosines, lengths, directions).reshape(-1, 6)
        second = 8 * self.stiffnesses / np.maximum(1 + cosines, FOLDED) ** 3
        inner = second[:, None, None] * g[:, :, None] * g[:, None, :]
        inner += self._slopes(cosines)[:, None, None] * _cosine_hessian(cosines, lengths, directions)
        if project:
            values, vectors = np.linalg.eigh(inner)
            inner = np.einsum("bik,bk,bjk->bij", vectors, np.maximum(values, 0.0), vectors)
        return ElementHessian(self.rows, np.einsum("ia,bij,jc->bac", _EDGES, inner, _EDGES))

    def _angles(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """c (b,), and the lengths (b, 2) [m] and directions (b, 2, 3) of both edges; of one without length 0."""
        edges = np.diff(x[self.rows], axis=1)
        lengths = np.linalg.norm(edges, axis=2)
        directions = edges / np.where(lengths > 0, lengths, 1.0)[:, :, None]
        return np.einsum("bp,bp->b", directions[:, 0], directions[:, 1]), lengths, directions

    def _slopes(self, cosines: Floats) -> Floats:
        """df/dc, (b,) [J]."""
        return np.asarray(-4 * self.stiffnesses / np.maximum(1 + cosines, FOLDED) ** 2, np.float64)


_EDGES = np.kron(np.array([[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0]]), np.eye(3))
"""Both edges, (6,), of the positions of three vertices, (9,)."""


def _cosine_gradient(cosines: Floats, lengths: Floats, directions: Floats) -> Floats:
    """dc by both edges, (b, 2, 3) [1/m]."""
    across = directions[:, ::-1] - cosines[:, None, None] * directions
    return np.asarray(across / np.where(lengths > 0, lengths, 1.0)[:, :, None], np.float64)


def _cosine_hessian(cosines: Floats, lengths: Floats, directions: Floats) -> Floats:
    """d2c by both edges, (b, 6, 6) [1/m2]."""
    t, other = directions[:, 0], directions[:, 1]
    a, b = np.where(lengths > 0, lengths, 1.0).T
    unit, c = np.eye(3), cosines[:, None, None]

    def outer(u: Floats, v: Floats) -> Floats:
        return np.asarray(u[:, :, None] * v[:, None, :], np.float64)

    hessian = np.zeros((len(cosines), 6, 6))
    for rows, one, two, length in ((slice(0, 3), t, other, a), (slice(3, 6), other, t, b)):
        straight = outer(one, one)
        own = outer(one, two) + outer(two, one) + c * (unit - 3 * straight)
        hessian[:, rows, rows] = -own / (length**2)[:, None, None]
    mixed = (unit - outer(other, other) - outer(t, t) + c * outer(t, other)) / (a * b)[:, None, None]
    hessian[:, :3, 3:], hessian[:, 3:, :3] = mixed, mixed.transpose(0, 2, 1)
    return hessian


@dataclass(frozen=True)
class RodsEnergy(Restrictable, Energy, Coupling, EnergyReport):
    """Rods along lines of vertices.

    Parameters
    ----------
    stretching : Links
        A spring for each edge: rows (e, 3) of its ends, the second twice.
    bending : RodBending
        A term for each vertex between two edges.
    """

    stretching: Links
    bending: RodBending

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        return self.stretching.value(x) + self.bending.value(x)

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return self.stretching.gradient(x) + self.bending.gradient(x)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (e + b, 9, 9) [N/m]."""
        parts = self.stretching.hessian(x, project), self.bending.hessian(x, project)
        return ElementHessian(*(np.concatenate([getattr(part, name) for part in parts]) for name in _PARTS))

    def restricted_to(self, moving: np.ndarray, x: Floats) -> Self:
        """The edges and vertices with a vertex that moves."""
        return type(self)(self.stretching.restricted_to(moving, x), self.bending.restricted_to(moving, x))

    def couplings(self, x: Floats, dx: Floats) -> Ints:
        """The rows of neighbouring edges, (b, 3)."""
        return self.bending.rows

    def defaults_used(self) -> tuple[str, ...]:
        """Number of edges."""
        return (f"{len(self.stretching.rows)} edges with a rod",)


_PARTS = ("elements", "blocks")


def rods_along(curves: list[tuple[EdgeCurve, float, float]]) -> RodsEnergy:
    """Rods along curves, each with EA [N] and EI [N m2]; a closed curve bends at the vertex where it ends too.

    Examples
    --------
    >>> import numpy as np
    >>> energy = rods_along([(EdgeCurve(np.arange(3), np.ones(2)), 10.0, 4.0)])
    >>> energy.value(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]]))  # tan(45 degrees) = 1, 2 EI/l
    8.0
    """
    pairs, springs, lengths, triples, moments = [], [], [], [], []
    for curve, along, across in curves:
        pairs.append(np.column_stack([curve.edges, curve.edges[:, 1]]))
        lengths.append(curve.lengths)
        springs.append(along / curve.lengths)
        line, sizes = curve.vertices, curve.lengths
        if line[0] == line[-1]:
            line, sizes = np.append(line, line[1]), np.append(sizes, sizes[0])
        triples.append(np.column_stack([line[:-2], line[1:-1], line[2:]]))
        moments.append(across / (0.5 * (sizes[:-1] + sizes[1:])))
    rows, m = np.concatenate(pairs), sum(map(len, pairs))
    weights = np.tile([1.0, -1.0, 0.0], (m, 1))
    links = weights, np.zeros((m, 3)), np.concatenate(lengths), np.concatenate(springs), np.zeros(m, bool)
    return RodsEnergy(Links(rows, *links), RodBending(np.concatenate(triples), np.concatenate(moments)))


def stiffeners(world: World, keys: Stiffeners) -> Energy | Off:
    """Rods of the tables of a scene, and those of [[rod]]; off where every stiffness is 0.

    Raises
    ------
    InputError
        Names the table and key.
    """
    curves = [
        (EdgeCurve(rod.line + rows.start, rod.lengths), rod.stretch_stiffness, rod.bending_stiffness)
        for rod, rows in world.rods
    ]
    for k, each in enumerate(keys.stiffener):
        name = f"effects.stiffeners.stiffener[{k}]"
        if each.stretch_stiffness == 0 and each.bending_stiffness == 0:
            continue
        for curve in edge_curves(f"{name}.select", world, each.select):
            short = np.flatnonzero(curve.lengths <= 0)
            if short.size:
                raise InputError(f"{name}: edge {short[0]} of its line has no length.", "Repair the mesh.")
            curves.append((curve, each.stretch_stiffness, each.bending_stiffness))
    if not curves:
        return Off("every stiffness is 0" if keys.stiffener else "there is no stiffener")
    return rods_along(curves)


_LEFT = {"select": "left"}
EXAMPLE = Example(
    keys={"stiffener": [{"select": [0, 1, 2, 5], "stretch_stiffness": 2.0, "bending_stiffness": 0.7}]},
    in_scene={"stiffener": [{**_LEFT, "stretch_stiffness": 20.0, "bending_stiffness": 1e-3}]},
    zero={"stiffener": [{**_LEFT, "bending_stiffness": 0}]},
)
