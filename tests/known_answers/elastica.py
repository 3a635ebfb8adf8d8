"""Closed forms and ODEs of bending: cantilevers, the roll-up, the loaded ring, columns and beams that buckle (A3)."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from clothsim.base.arrays import Floats


def cantilever(load: Callable[[float], float]) -> tuple[float, float]:
    """Reach and drop of the tip: theta'' = -load(r) cos theta over the distance r from the tip, theta the slope down.

    theta'(0) = 0 at the tip, theta(1) = 0 at the clamp: shooting for the slope at the tip.
    """
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq

    def shoot(slope: float) -> Floats:
        def rates(r: float, y: Floats) -> list[float]:
            return [y[1], -load(r) * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]

        return solve_ivp(rates, (0, 1), [slope, 0, 0, 0], method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]

    reach, drop = shoot(brentq(lambda slope: shoot(slope)[0], 0, np.pi / 2, xtol=1e-14))[2:]
    return float(reach), float(drop)


@lru_cache
def hanging_cantilever(gamma: float) -> tuple[float, float]:
    """The tip under gravity: the section at r from the tip carries the weight beyond it, gamma r."""
    return cantilever(lambda r: gamma * r)


@lru_cache
def pushed_cantilever(load: float) -> tuple[float, float]:
    """The tip under an end shear P L^2/B = load."""
    return cantilever(lambda r: load)


def rolled_up(turns: float) -> tuple[float, float]:
    """Reach and drop of the tip under an end moment turns 2 pi B/L."""
    angle = 2 * np.pi * turns
    return float(np.sin(angle) / angle), float((1 - np.cos(angle)) / angle)


def elastica_height(chord: float) -> float:
    """Height/L of a strip with hinged ends that are `chord` L apart, above its chord, in its first mode.

    chord = 2 E(k)/K(k) - 1, height = k/K(k) (Timoshenko & Gere 1961, section 2.7).
    """
    from scipy.optimize import brentq
    from scipy.special import ellipe, ellipk

    k = brentq(lambda k: 2 * ellipe(k * k) / ellipk(k * k) - 1 - chord, 1e-9, 0.9, xtol=1e-14)
    return float(k / ellipk(k * k))


def loaded_ring(inner: float, outer: float, nu: float) -> float:
    """w D/(q b^4) at the outer border of a ring that is clamped inside and free outside, under an even load q.

    w = c1 + c2 ln r + c3 r^2 + c4 r^2 ln r + q r^4/(64 D) (Timoshenko & Woinowsky-Krieger 1959, art. 15-17).
    """

    def terms(r: float) -> Floats:
        """w, w', w'' and the derivative of the Laplacian at r of the four terms and of the load's, (4, 5)."""
        log = np.log(r)
        return np.array(
            [
                [1, log, r**2, r**2 * log, r**4 / 64],
                [0, 1 / r, 2 * r, r * (2 * log + 1), r**3 / 16],
                [0, -1 / r**2, 2, 2 * log + 3, 3 * r**2 / 16],
                [0, 0, 0, 4 / r, r / 2],
            ]
        )

    clamp, free = terms(inner), terms(outer)
    rows = np.array([clamp[0], clamp[1], free[2] + nu * free[1] / outer, free[3]])
    constants = np.linalg.solve(rows[:, :4], -rows[:, 4])
    return float(free[0] @ [*constants, 1.0]) / outer**4


def upright_column() -> float:
    """rho_A g L^3/B at which a column clamped below bends under its own weight: (9/4) j^2, j of J_-1/3 (Greenhill)."""
    return 9 / 4 * first_zero(-1 / 3) ** 2


def deep_beam(nu: float) -> float:
    """rho_A g L^3/B at which a deep cantilever tips over sideways: 6 j sqrt(2/(1 + nu)), j of J_-1/6.

    phi'' + (q s^2/2)^2/(EI GJ) phi = 0, s from the tip, EI GJ = 2 B^2/(1 + nu) (Timoshenko & Gere 1961, section 6.4).
    """
    return 6 * first_zero(-1 / 6) * float(np.sqrt(2 / (1 + nu)))


def first_zero(order: float) -> float:
    """The first positive zero of J_order, for orders between -1 and 0."""
    from scipy.optimize import brentq
    from scipy.special import jv

    return float(brentq(lambda z: jv(order, z), 0.5, 2.6, xtol=1e-14))
