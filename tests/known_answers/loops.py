"""Elastica with weight, rest curvature and contact, as boundary value problems (A11).

Planar strips of bending stiffness 1: the angle theta(s) of the tangent, the moment m and the internal force n of what
lies beyond s on what lies before it obey

    theta' = m + k,    m' = n_x sin theta - n_z cos theta,    n_z' = q,    x' = cos theta,    z' = sin theta

with the curvature k at rest and the weight q a length; n_x is constant. Solved by collocation (`solve_bvp`); the tests
minimise the energy of a chain of links for the same shapes, which shares no equation with it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from clothsim.base.arrays import Floats

CLOSE = 1e-7
MOST_NODES = 20_000
Conditions = Callable[[Floats, Floats, Floats], list[float]]


@dataclass(frozen=True)
class Strip:
    """A solution: arc length (k,), rows theta, m, x, z (4, k), and the unknown numbers of the problem."""

    s: Floats
    rows: Floats
    unknowns: Floats

    def where(self, height: float) -> float:
        """Arc length at which z rises through a height."""
        return float(np.interp(height, self.rows[3], self.s))


def solved(
    force: Callable[[Floats, Floats], tuple[Floats, Floats]],
    length: Callable[[Floats], float],
    conditions: Conditions,
    start: tuple[Floats, Floats],
    unknowns: list[float],
    curvature: float = 0.0,
) -> Strip:
    """Solve on 0 <= u <= 1, s = u length(unknowns); force(s, unknowns) is (n_x, n_z); start: u and rows."""
    from scipy.integrate import solve_bvp

    def rates(u: Floats, y: Floats, p: Floats) -> Floats:
        size = length(p)
        n_x, n_z = force(u * size, p)
        bent = n_x * np.sin(y[0]) - n_z * np.cos(y[0])
        return size * np.stack([y[1] + curvature, bent, np.cos(y[0]), np.sin(y[0])])

    found = solve_bvp(rates, conditions, *start, p=unknowns, tol=CLOSE, max_nodes=MOST_NODES)
    assert found.success, found.message
    return Strip(found.x * length(found.p), found.y, found.p)


@lru_cache
def heart_loop(weight: float, gap: float) -> Strip:
    """Half of a strip of length 1 whose ends stand upright, `gap` apart, and which hangs down between them.

    Peirce's heart loop (1930, The handle of cloth as a measurable quantity, J. Text. Inst. 21, T377), whose weightless
    depth he gives as .1337. weight: q L^3/B. The weight grows from 0, each solution the start of the next.
    """
    half = 0.5
    u = np.linspace(0, 1, 201)
    theta = np.pi / 2 - 1.5 * np.pi * u
    start = u, np.stack([theta, 0 * u - 3 * np.pi, 0.1 * np.sin(np.pi * u), -0.13 * u])

    def conditions(a: Floats, b: Floats, p: Floats) -> list[float]:
        return [a[0] - np.pi / 2, a[2] - gap / 2, a[3], b[0] + np.pi, b[2]]

    unknowns = [0.0]
    for q in np.linspace(0, weight, 2 + int(weight / 40)):
        strip = solved(lambda s, p, q=q: (p[0] + 0 * s, q * (s - half)), lambda p: half, conditions, start, unknowns)
        start, unknowns = (strip.s / half, strip.rows), list(strip.unknowns)
    return strip


def depth_of_heart(weight: float, gap: float) -> float:
    """Depth of that loop below its ends, over its length."""
    return float(-heart_loop(weight, gap).rows[3, -1])


@lru_cache
def pinched_ring(height: float) -> tuple[float, float]:
    """Force and width of a ring of radius 1 that two opposite forces press to `height` of its diameter.

    force: R^2/B of it, a width of 1; width: over the diameter. For small loads 1 - height is
    (pi/4 - 2/pi)/2 times the force (Timoshenko 1955, Strength of Materials I, art. 80).
    """
    u, quarter = np.linspace(0, 1, 101), np.pi / 2
    start = u, np.stack([-quarter * u, 0 * u, np.sin(quarter * u), np.cos(quarter * u) - 1])
    strip = solved(
        lambda s, p: (0 * s, p[0] + 0 * s),
        lambda p: quarter,
        lambda a, b, p: [a[0], a[2], a[3], b[0] + quarter, b[3] + height],
        start,
        [0.1],
        curvature=-1.0,
    )
    return float(2 * strip.unknowns[0]), float(strip.rows[2, -1])


@lru_cache
def lifted_strip(height: float) -> Strip:
    """The part of a long strip above a smooth table whose edge is lifted to `height` (B/q)^(1/3), its end free to turn.

    unknowns: n_z where it leaves the table, and the length of that part; both in units of B = q = 1. The strip slides
    freely, so that n_x = 0; the moment is 0 where it leaves the table. Where it is shallow the length is
    (24 height)^(1/4), and the edge carries half of its weight.
    """
    length = (24 * height) ** 0.25
    u = np.linspace(0, 1, 201)
    s = length * u
    start = np.stack([length / 4 * s**2 - s**3 / 6, length / 2 * s - s**2 / 2, s, length / 12 * s**3 - s**4 / 24])
    return solved(
        lambda s, p: (0 * s, p[0] + s),
        lambda p: p[1],
        lambda a, b, p: [a[0], a[1], a[2], a[3], b[1], b[3] - height],
        (u, start),
        [-length / 2, length],
    )
