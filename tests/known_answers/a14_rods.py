"""A14, rods: Euler's load, elastica, a heavy cantilever, a heavy loop, an upright column and a catenary.

EI = 1 and a length of 1; a clamp is in the middle of an edge whose both ends are held, so that the vertices next to it
bend over the length that they have.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import unit
from clothsim.mesh.rod import make_rod
from clothsim.mesh.world import World, make_world
from clothsim.physics.energies.base import Energy, Prescribed
from clothsim.physics.energies.edge_curves import EdgeCurve
from clothsim.physics.energies.gravity import GravityEnergy
from clothsim.physics.energies.stiffeners import RodsEnergy, rods_along
from tests.known_answers.a2_catenary import catenary
from tests.known_answers.a3_bending import LOADS, order
from tests.known_answers.elastica import elastica_height, upright_column
from tests.known_answers.loops import depth_of_heart, heart_loop
from tests.known_answers.plates import elastica
from tests.known_answers.row import Outcome, Row
from tests.known_answers.unit_meshes import cloth, grid
from tests.known_answers.unit_solver import equilibrium, held, second_derivatives
from tests.support.effect_builders import self_contact

STRETCH = 1e6
"""EA, so that no rod is longer by more than its error of bending."""
SECOND = (1.7, 2.3)


def chain(edges: int) -> tuple[World, Ints]:
    """A world with a free vertex for each end of `edges` edges, and their rows; its other vertices are to be held."""
    world = make_world([cloth(*grid(edges, 1))])
    return world, 2 * np.arange(edges + 1)


def rod(rows: Ints, length: float = 1.0, bending: float = 1.0, stretch: float = STRETCH) -> RodsEnergy:
    """A rod of equal edges along rows of x, of a length at rest."""
    n = len(rows) - 1
    return rods_along([(EdgeCurve(rows, np.full(n, length / n)), stretch, bending)])


def weighing(rows: Ints, length: float, weight: float) -> GravityEnergy:
    """A weight for each length [N/m] along z."""
    share = np.full(len(rows), length / (len(rows) - 1))
    share[[0, -1]] *= 0.5
    return GravityEnergy(rows[:, None], weight * share, np.array([0.0, 0.0, -1.0]), np.zeros(3))


def rested(world: World, rows: Ints, start: Floats, fixed: Ints, *energies: Energy) -> Floats:
    """The shape at rest (n, 3) of a chain that starts at `start` (n, 3), some of its vertices `fixed`."""
    x = world.start()
    x[rows] = start
    still = np.concatenate([np.setdiff1d(np.arange(len(x)), rows), rows[fixed]])
    named = {str(k): energy for k, energy in enumerate(energies)}
    return equilibrium(world, named, x, held(x, still), tolerance=1e-7, max_iterations=400)[rows]


def _against(found: Callable[[int], float], exact: Callable[[], float], bar: float, edges: int) -> Outcome:
    coarse, fine, known = found(edges), found(2 * edges), float(exact())
    return Outcome(fine, known, bar, order=order(coarse, fine, known), orders=SECOND)


def buckling_load(edges: int) -> float:
    """P L^2/EI at which a straight rod with hinged ends bends: where the least eigenvalue across it is 0."""
    from scipy.optimize import brentq

    _, rows = chain(edges)
    energy, x = rod(rows), np.zeros((rows[-1] + 2, 3))
    across = 3 * rows[1:-1] + 2

    def least(load: float) -> float:
        x[rows, 0] = np.linspace(0, 1 - load / STRETCH, edges + 1)
        matrix = second_derivatives(energy, x).toarray()
        return float(np.linalg.eigvalsh(matrix[np.ix_(across, across)])[0])

    return float(brentq(least, 5.0, 15.0, xtol=1e-10))


def risen(chord: float, edges: int) -> float:
    """Height of a rod with hinged ends, `chord` apart."""
    world, rows = chain(edges)
    s = np.linspace(0, 1, edges + 1)
    start = np.column_stack([chord * s, 0 * s, elastica_height(chord) * np.sin(np.pi * s)])
    return float(rested(world, rows, start, np.array([0, edges]), rod(rows))[:, 2].max())


def drooped(gamma: float, edges: int) -> float:
    """Drop of the tip over its reach, of a rod that is clamped level: w L^3/EI = gamma."""
    world, rows = chain(edges)
    size = 1 / (edges - 0.5)
    start = np.column_stack([size * (np.arange(edges + 1) - 0.5), np.zeros((edges + 1, 2))])
    length = edges * size
    for part in LOADS:
        start = rested(world, rows, start, np.array([0, 1]), rod(rows, length), weighing(rows, length, part * gamma))
    return float(-start[-1, 2] / start[-1, 0])


def heart(weight: float, edges: int) -> float:
    """Depth of a loop whose ends stand upright side by side, over its length: w L^3/EI = weight; `edges` even."""
    world, rows = chain(edges)
    size = 1 / (edges - 1)
    s = np.clip((np.arange(edges + 1) - 0.5) * size, 0, 1)
    known, half = heart_loop(weight, 0.0), np.minimum(s, 1 - s)  # it stands up where it starts far from hanging
    x, z = (np.interp(half, known.s, row) for row in known.rows[2:])
    start = np.column_stack([np.where(s < 0.5, x, -x), 0 * s, z])
    start[[0, 1, -2, -1]] = [[0, 0, side * size] for side in (-0.5, 0.5, 0.5, -0.5)]
    ends = np.array([0, 1, edges - 1, edges])
    length = edges * size
    shape = rested(world, rows, start, ends, rod(rows, length), weighing(rows, length, weight))
    return float(-shape[:, 2].min())


def column(edges: int) -> float:
    """w L^3/EI at which an upright rod that is clamped below bends under its own weight."""
    from scipy.optimize import brentq

    world, rows = chain(edges)
    size = 1 / (edges - 0.5)
    length = edges * size
    straight = np.zeros((edges + 1, 3))
    straight[:, 2] = size * (np.arange(edges + 1) - 0.5)
    across = 3 * rows[2:]

    def least(weight: float) -> float:
        energy, x = rod(rows, length), world.start()
        above = weight * size * (edges - np.arange(edges) - 0.5)  # of the vertices above each edge, the last has half
        x[rows] = straight
        x[rows[1:], 2] -= np.cumsum(size * above / STRETCH)
        return float(np.linalg.eigvalsh(second_derivatives(energy, x).toarray()[np.ix_(across, across)])[0])

    return float(brentq(least, 4.0, 12.0, xtol=1e-10))


def sagging(ratio: float, edges: int) -> float:
    """Sag over length of a rod without bending stiffness, `ratio` as long as its span."""
    world, rows = chain(edges)
    s, length = np.linspace(0, 1, edges + 1), ratio
    start = np.column_stack([s, 0 * s, -4 * catenary(length)[1] * length * s * (1 - s)])
    energies = rod(rows, length, bending=0.0), weighing(rows, length, 1.0)
    return float(-rested(world, rows, start, np.array([0, edges]), *energies)[:, 2].min() / length)


def open_knot(edges: int, radius: float) -> tuple[World, Floats]:
    """A rod with an open knot of two turns and straight ends, of the size 1, and the directions of its ends.

    A trefoil that is cut, its ends drawn on until they cross: the determinant of it is 7.
    """
    u = np.linspace(0.0, 2 * np.pi, 1401)[60:-60]
    x, y, z = np.sin(u) + 2 * np.sin(2 * u), np.cos(u) - 2 * np.cos(2 * u), -0.6 * np.sin(3 * u)
    points = 0.5 * np.column_stack([x, y, z])
    outward = np.stack([unit(points[0] - points[1]), unit(points[-1] - points[-2])])
    far = np.linspace(2.0, 0.0, 200, endpoint=False)[:, None]
    points = np.concatenate([points[0] + far * outward[0], points, points[-1] + far[::-1] * outward[1]])
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    even = np.linspace(0, s[-1], edges + 1)
    rod_points = np.column_stack([np.interp(even, s, column) for column in points.T])
    return make_world([make_rod("rod", rod_points, radius, 1.0, 1.0)]), outward


def knotted(edges: int, radius: float) -> tuple[float, Floats]:
    """F R^2/EI of a loose knot that is pulled at both ends without friction, and its shape.

    R is the radius of curvature in the middle of its turns, to which the knot is drawn in steps. Of thin rods these are
    circles: n turns have the energy n pi EI/R and take up 2 pi n R of the length, so that F = EI/(2 R^2) for any n
    (Audoly, Clauvelin and Neukirch 2007, for one turn).
    """
    world, _ = open_knot(edges, radius)
    line, _ = world.rods[0]
    rods = rods_along([(EdgeCurve(line.line, line.lengths), 1e4, 1.0)])
    contact = self_contact(world, stiffness=50.0, d_hat=radius / 2)
    assert isinstance(contact, Energy)
    x = world.start()
    ends = np.array([0, edges])
    loose, side = x[ends], np.sign(x[0, 0] - x[edges, 0])
    tight = 0.5 * (float(line.lengths.sum()) - 2 * np.pi) * side * np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    for part in np.linspace(0.0, 1.0, 9):
        target = Prescribed(ends, loose + part * (tight - loose))
        x = equilibrium(world, {"rods": rods, "contact": contact}, x, target, tolerance=1e-6, max_iterations=400)
    force = float(np.abs(rods.gradient(x)[0, 0]))
    directions = unit(np.diff(x, axis=0))
    cosines = (directions[1:] * directions[:-1]).sum(axis=1)
    bends = 2 * np.sqrt((1 - cosines) / (1 + cosines)) / line.lengths[1:]
    middle = len(bends) // 2
    return force / float(bends[middle - 3 : middle + 4].mean()) ** 2, x


def _knot() -> Outcome:
    return Outcome(knotted(160, 0.015)[0], 0.5, 0.03)


FOUND: tuple[tuple[str, Callable[[int], float], Callable[[], float], float, int], ...] = (
    ("hinged ends: Euler load P L^2/EI", buckling_load, lambda: np.pi**2, 1e-3, 20),
    ("hinged ends 0.6 L apart: height/L", partial(risen, 0.6), partial(elastica_height, 0.6), 2e-3, 20),
    ("heavy cantilever, Gamma = 10: drop/reach", partial(drooped, 10.0), partial(elastica, 10.0), 5e-3, 20),
    ("heavy loop, w L^3/EI = 40: depth/L", partial(heart, 40.0), partial(depth_of_heart, 40.0, 0.0), 5e-3, 40),
    ("upright under its weight: w L^3/EI at which it buckles", column, upright_column, 2e-3, 20),
    ("catenary, L/S = 1.5: sag/L", partial(sagging, 1.5), lambda: catenary(1.5)[1], 2e-3, 20),
)
"""What each row asks, what finds it with a number of edges, the exact value, the bar, and the coarser number."""

ROWS = tuple(
    Row(f"A14{'abcdef'[k]}", f"rod, {asked}", partial(_against, *how)) for k, (asked, *how) in enumerate(FOUND)
)
ROWS += (Row("A14g", "rod, loose knot of two turns, r/R = 0.03: F R^2/EI", _knot),)
