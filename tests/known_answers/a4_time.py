"""A4, time: free fall, free flight, the energy of a step, the orders of both formulas, the pendulum."""

from dataclasses import replace
from functools import cache, partial

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.mesh.world import World, make_world
from clothsim.physics.energies.base import Constraint, Energy
from clothsim.solve.stepping.stepping import Integrator
from tests.known_answers.row import Outcome, Row
from tests.known_answers.unit_meshes import UNIT, cloth, irregular_grid, random_rotation
from tests.known_answers.unit_solver import NOTHING, integrator_of, newton_of, pinned, run_of, those_on
from tests.support.effect_builders import bending, gravity, inertia, membrane

GRAVITY = np.array([0.3, -0.5, -9.81])
HEIGHT = 0.8
"""Of the pendulum [m]."""
FORMULAS = ("backward_euler", "bdf2")


# --- scenes ---------------------------------------------------------------------------------------------------------


def sheet(positions: Floats | None = None, velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> World:
    """An irregular sheet of 12 triangles, from `positions` where they are given."""
    rest, triangles = irregular_grid()
    one = replace(cloth(rest, triangles, velocity=velocity), positions=rest if positions is None else positions)
    return make_world([one])


def falling(formula: str, dt: float, velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Integrator:
    """That sheet in free fall."""
    world = sheet(velocity=velocity)
    weight = gravity(world, acceleration=GRAVITY)
    hinges = bending(world, model="hinge")
    energies = those_on(inertia=inertia(world), membrane=membrane(world), bending=hinges, gravity=weight)
    return replace(integrator_of(world, energies, dt, tolerance=1e-9), formula=formula)


def tumbling() -> tuple[World, dict[str, Energy]]:
    """A sheet that starts strained, bent and thrown, without weight."""
    rest, _ = irregular_grid()
    start = rest @ random_rotation(1).T + 0.06 * np.random.default_rng(1).standard_normal(rest.shape)
    world = sheet(positions=start, velocity=(1.0, -2.0, 0.5))
    return world, those_on(inertia=inertia(world), membrane=membrane(world), bending=bending(world, model="hinge"))


@cache
def ringing() -> tuple[World, dict[str, Energy], Floats]:
    """A strained sheet of 4 triangles: world, energies, and where it is at 0.8 s by a method of order 8, (n, 3)."""
    from scipy.integrate import solve_ivp

    rest, triangles = irregular_grid(nx=2, ny=1)
    start = rest @ np.diag([1.25, 0.9, 1.0]) @ random_rotation(2).T
    world = make_world([replace(cloth(rest, triangles), positions=start)])
    energies = those_on(inertia=inertia(world), membrane=membrane(world))
    n = start.size

    def rate(t: float, y: Floats) -> Floats:
        force = -energies["membrane"].gradient(y[:n].reshape(-1, 3))
        return np.concatenate([y[n:], (force / world.masses[:, None]).ravel()])

    begin = np.concatenate([start.ravel(), np.zeros(n)])
    exact = solve_ivp(rate, (0, 0.8), begin, method="DOP853", rtol=1e-11, atol=1e-12).y[:n, -1].reshape(-1, 3)
    return world, energies, exact


def pendulum(degrees: float) -> tuple[World, dict[str, Energy], dict[str, Constraint]]:
    """One triangle, so stiff that it keeps its shape, held at two corners; the third swings from `degrees`."""
    rest = np.array([[-0.3, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, -HEIGHT, 0.0]])
    angle = np.radians(degrees)
    start = rest.copy()
    start[2] = [0.0, -HEIGHT * np.cos(angle), HEIGHT * np.sin(angle)]
    stiff = replace(UNIT, youngs_modulus=1e6)
    world = make_world([replace(cloth(rest, np.array([[0, 1, 2]]), stiff), positions=start)])
    world, held = pinned(world, select=[0, 1])
    weight = gravity(world, acceleration=(0.0, -9.81, 0.0))
    return world, those_on(inertia=inertia(world), membrane=membrane(world), gravity=weight), {"pins": held}


# --- what is seen of them -------------------------------------------------------------------------------------------


def late(formula: str, dt: float, duration: float) -> float:
    """Distance fallen beyond g T^2/2, along g over |g| [m]."""
    integrator = falling(formula, dt)
    end = run_of(integrator, duration)[-1].state
    fallen = end.positions - integrator.world.start() - GRAVITY * duration**2 / 2
    return float((fallen @ GRAVITY).mean() / np.linalg.norm(GRAVITY))


def swing_ratio(steps_a_period: int, degrees: float = 60.0) -> float:
    """T/T0 of the pendulum by BDF2, T0 the period of small swings, from the two times at which it passes below."""
    world, energies, held = pendulum(degrees)
    t0 = 2 * np.pi * np.sqrt(HEIGHT / 9.81)
    integrator = integrator_of(world, energies, t0 / steps_a_period, held, tolerance=1e-6)
    reports = run_of(replace(integrator, formula="bdf2"), 1.05 * t0)
    z = np.array([report.state.positions[2, 2] for report in reports])
    t = np.array([report.state.time for report in reports])
    down, up = (np.flatnonzero((sign * z[:-1] > 0) & (sign * z[1:] <= 0))[0] for sign in (1, -1))
    crossings = [t[k] + (t[k + 1] - t[k]) * z[k] / (z[k] - z[k + 1]) for k in (down, up)]
    return float(2 * (crossings[1] - crossings[0]) / t0)


def ringing_error(formula: str, dt: float) -> float:
    """Largest distance [m] of the ringing sheet from the exact motion at 0.8 s, which stays in its plane.

    It is compressed in it at times, and unstable: a run displaces it by 1e-6 m then (`sim.branch_switching`).
    """
    world, energies, exact = ringing()
    integrator = integrator_of(world, energies, dt, tolerance=1e-9)
    integrator = replace(integrator, formula=formula, leaves_unstable=False)
    return float(np.abs(run_of(integrator, 0.8)[-1].state.positions - exact).max())


def momentum_drift(steps: int = 20, dt: float = 0.05) -> float:
    """Largest change of the linear momentum of the tumbling sheet, a step, as a share of the momentum."""
    world, energies = tumbling()
    reports = run_of(integrator_of(world, energies, dt, tolerance=1e-9), steps * dt)
    momentum = np.array([world.masses @ report.state.velocities[: world.n_cloth] for report in reports])
    exact = world.masses.sum() * np.array([1.0, -2.0, 0.5])
    return float(np.abs(momentum - exact).max() / np.abs(exact).max() / steps)


def energy_gained(dt: float) -> float:
    """The most that |v(n+1) - v(n)|_M^2/2 + Psi(n+1) exceeds |v(n)|_M^2/2 + Psi(n), as a share; negative: never."""
    world, energies = tumbling()
    elastic = [energies["membrane"], energies["bending"]]

    def kinetic(v: Floats) -> float:
        return 0.5 * float(world.masses @ (v**2).sum(axis=1))

    x, v, most = world.start(), world.start_velocities(), -np.inf
    for report in run_of(integrator_of(world, energies, dt, tolerance=1e-9), 10 * dt):
        after = report.state
        before = kinetic(v) + sum(energy.value(x) for energy in elastic)
        now = kinetic(after.velocities - v) + sum(energy.value(after.positions) for energy in elastic)
        most = max(most, now / before - 1)
        x, v = after.positions, after.velocities
    return most


def newton_of_translation() -> int:
    """Iterations that move a sheet which flies without turning: with a tolerance above its speed no check is added."""
    world = sheet(velocity=(3.0, -2.0, 1.0))
    energies = those_on(inertia=inertia(world), membrane=membrane(world), bending=bending(world, model="hinge"))
    newton = newton_of(world, energies, dt=0.1, velocities=world.start_velocities(), tolerance=100.0)
    return newton.minimise(world.start(), NOTHING).iterations


# --- the rows -------------------------------------------------------------------------------------------------------


def _fall(formula: str, dt: float = 0.02, duration: float = 0.4) -> Outcome:
    """Backward Euler: g T dt/2. BDF2 begun by such a step: 3/4 g dt^2, as far as its second root 1/3 has decayed."""
    g = float(np.linalg.norm(GRAVITY))
    exact = g * duration * dt / 2 if formula == "backward_euler" else 0.75 * g * dt**2
    return Outcome(late(formula, dt, duration), exact, 1e-8)


def _order(formula: str, exact: float, bar: float) -> Outcome:
    coarse, fine = (ringing_error(formula, dt) for dt in (0.01, 0.005))
    return Outcome(float(np.log2(coarse / fine)), exact, bar, unit="orders")


def _swing() -> Outcome:
    """2 K(sin^2(30 deg))/pi; what is late by a share (w dt)^2/3 is taken out by two dt."""
    from scipy.special import ellipk

    coarse, fine = (swing_ratio(steps) for steps in (100, 200))
    exact = float(2 * ellipk(np.sin(np.radians(30)) ** 2) / np.pi)
    order = float(np.log2(abs((coarse - exact) / (fine - exact))))
    return Outcome((4 * fine - coarse) / 3, exact, 1e-4, printed="1.0731820071", order=order, orders=(1.85, 2.4))


ROWS = (
    Row("A4a", "free fall, backward Euler: error of the position, g T dt/2 [m]", partial(_fall, "backward_euler")),
    Row("A4b", "free fall, BDF2: error of the position, 0.75 g dt^2 [m]", partial(_fall, "bdf2")),
    Row("A4c", "order of backward Euler for a vibrating strained sheet", partial(_order, "backward_euler", 1.0, 0.1)),
    Row("A4d", "order of BDF2 for the same sheet", partial(_order, "bdf2", 2.0, 0.15)),
    Row("A4e", "pendulum released at 60 degrees, BDF2: T/T0", _swing),
    Row(
        "A4f",
        "free flight: change of momentum per step",
        lambda: Outcome(momentum_drift(), 0.0, 1e-12, unit="relative"),
    ),
    Row(
        "A4g",
        "rigid translation: Newton iterations",
        lambda: Outcome(float(newton_of_translation()), 1.0, 0.0, unit="iterations"),
    ),
    Row(
        "A4h",
        "unforced steps of 0.02, 0.2 and 2 s: largest gain of energy",
        lambda: Outcome(max(0.0, *(energy_gained(dt) for dt in (0.02, 0.2, 2.0))), 0.0, 1e-12, unit="relative"),
    ),
)
