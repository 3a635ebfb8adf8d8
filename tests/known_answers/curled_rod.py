"""A rod that is curled at rest and hangs from a clamp, as boundary value problems (A15).

Kirchhoff's equations of a rod of length 1 whose clamp points down. The directors are d1 along the width, d3 along the
rod, d2 = d3 x d1; U = (k1, k2, twist) and M are the components of curvature and moment in them, F those of the force,
which is the weight of what hangs below, q (1 - s) downwards:

    M = (k1 - k, B k2, C twist),    M' = M x U - d3 x F,    d_i' = U x d_i,    r' = d3,    M(1) = 0.

The bending stiffness about d1 is 1, B that about d2 (edgewise), C that against twist, k the curvature at rest. Tension
straightens the rod; a rod of C < 2 saves more by turning its curl aside, and leaves its plane at a critical weight
(Miller, Lazarus, Audoly & Reis 2014, Phys. Rev. Lett. 112, 068103; the test of bending and twisting of Romero et al.
2021). Solved by collocation (`solve_bvp`); the tests minimise the energy of a chain of links for the same shapes, which
shares no equation with it.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats

CLOSE, ON_THE_WAY = 1e-7, 1e-4
"""Relative residuals of collocation: of a solution, and of those that lead to it."""
MOST_NODES = 20_000
NODES = 201
ASIDE = 0.5
"""Twist at rest with which a rod is loaded that is to leave its plane; the last solution is without it."""


@dataclass(frozen=True)
class Rod:
    """A rod of length 1 and bending stiffness 1 about its width.

    curl: curvature at rest; edgewise, twisting: stiffnesses B and C; width: of the strip that it is the limit of, for
    which `Strip`'s corrections are made, 0 for none of them.
    """

    curl: float
    edgewise: float
    twisting: float
    width: float = 0.0

    @property
    def layer(self) -> float:
        """Length over which a clamp holds a strip from twisting, as it keeps the end flat (Vlasov 1961).

        A section turned by a has the curvature y a'' along the strip at the distance y from its middle: a'' has the
        stiffness w^2/12, so that the twist is (1 - exp(-s/layer)) of that of a free end.
        """
        return self.width / float(np.sqrt(12 * self.twisting))

    def twist(self, s: Floats, torque: Floats) -> Floats:
        """Twist under a torque: with a width the clamp's layer, and the stretched borders of a helicoid (Green 1936).

        These add E2 w^5/360 twist^3 to the torque; E2 w^2/12 is the edgewise stiffness of a unit of width.
        """
        free = torque / self.twisting
        if not self.width:
            return free
        borders = self.edgewise * self.width**2 / (30 * self.twisting)
        return free / (1 + borders * free**2) * (1 - np.exp(-s / self.layer))


@dataclass(frozen=True)
class Hanging:
    """A solution: arc length (k,), and directors in quaternions, moment and position, rows (10, k)."""

    s: Floats
    rows: Floats

    @property
    def line(self) -> Floats:
        """Positions (k, 3) of the middle of the rod: x along d2 at the clamp, z up."""
        return self.rows[7:].T


def hanging(rod: Rod, weight: float, aside: bool = False) -> Hanging:
    """The shape under a weight, in its plane or aside; the weight grows from 0, each solution the start of the next."""
    return _hanging(rod, weight, aside)


@lru_cache
def _hanging(rod: Rod, weight: float, aside: bool) -> Hanging:
    s = np.linspace(0, 1, NODES)
    half = rod.curl * s / 2
    to_down = np.array([0.0, 1.0, 1.0, 0.0]) / np.sqrt(2)  # d1, d2, d3 are y, x, -z
    start = np.zeros((10, NODES))
    start[:4] = _product(to_down[:, None], np.stack([np.cos(half), np.sin(half), 0 * s, 0 * s]))
    for q in np.linspace(0, weight, 2 + int(weight)):
        start = _solved(rod, q, ASIDE if aside else 0.0, s, start, ON_THE_WAY).sol(s)
    found = _solved(rod, weight, 0.0, s, start)
    return Hanging(found.x, found.y)


def _solved(rod: Rod, weight: float, twisted: float, s: Floats, start: Floats, close: float = CLOSE) -> Any:
    from scipy.integrate import solve_bvp

    clamp = start[:4, 0]

    def rates(s: Floats, y: Floats) -> Floats:
        turn, moment = y[:4], y[4:7]
        curved = np.stack([moment[0] + rod.curl, moment[1] / rod.edgewise, twisted + rod.twist(s, moment[2])])
        a, b, c, d = turn
        up = np.stack([2 * (b * d - a * c), 2 * (c * d + a * b), 1 - 2 * (b * b + c * c)])  # z in the directors
        force = -weight * (1 - s) * up
        change = np.cross(moment, curved, axis=0) + np.stack([force[1], -force[0], 0 * s])
        along = np.stack([2 * (b * d + a * c), 2 * (c * d - a * b), up[2]])
        return np.concatenate([_product(turn, np.stack([0 * s, *curved])) / 2, change, along])

    def ends(first: Floats, last: Floats) -> Floats:
        return np.concatenate([first[:4] - clamp, last[4:7], first[7:]])

    found = solve_bvp(rates, ends, s, start, tol=close, max_nodes=MOST_NODES)
    assert found.success, found.message
    return found


def _product(p: Floats, q: Floats) -> Floats:
    """Product of quaternions (4, k), the real part first."""
    a, v, b, w = p[0], p[1:], q[0], q[1:]
    real = a * b - (v * w).sum(axis=0)
    return np.concatenate([real[None], a * w + b * v + np.cross(v, w, axis=0)])


@lru_cache
def critical_weight(rod: Rod, stable: float, unstable: float) -> float:
    """The weight, between two, at which the shape in the plane turns unstable.

    With (m, 0, 0) the moment and (0, F2, F3) the force in the plane, small rotations a = (0, a2, a3) of the directors
    change U by (0, a2' - k1 a3, a3' + k1 a2) and F by F x a. At that weight one of the two such motions from the clamp
    ends without N, the change of M.
    """
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq

    def end(weight: float) -> float:
        def rates(s: float, y: Floats) -> Floats:
            angle, m, *_ = y
            a2, a3, n2, n3 = y[2:].reshape(4, 2)
            k1, pull = m + rod.curl, weight * (1 - s)
            across, along = pull * np.sin(angle), pull * np.cos(angle)
            u2, u3 = n2 / rod.edgewise, rod.twist(np.array(s), n3)
            balance = k1 * n3 - m * u3 + along * a2 - across * a3, m * u2 - k1 * n2
            return np.concatenate([[k1, across], u2 + k1 * a3, u3 - k1 * a2, *balance])

        start = np.zeros(10)
        start[1], start[[6, 9]] = hanging(rod, weight).rows[4, 0], 1e-6
        motions = solve_ivp(rates, (0, 1), start, method="DOP853", rtol=1e-10, atol=1e-14).y[6:, -1].reshape(2, 2)
        return float(np.linalg.det(motions)) * 1e12

    return float(brentq(end, stable, unstable, xtol=1e-6))
