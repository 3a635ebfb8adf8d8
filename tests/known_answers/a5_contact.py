"""A5, contact: the gap at rest and the reaction, creep and slide on an incline, a belt round a drum."""

from dataclasses import replace
from functools import partial

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.body import make_body
from clothsim.mesh.world import World, make_world
from clothsim.physics.energies.base import Energy
from tests.known_answers.row import Outcome, Row
from tests.known_answers.unit_meshes import UNIT, cloth, grid, irregular_grid
from tests.known_answers.unit_solver import equilibrium, integrator_of, pinned, run_of, those_on
from tests.support.effect_builders import bending, body_contact, friction, gravity, inertia, membrane

G, D_HAT, STIFFNESS = 9.81, 0.01, 50.0
SLAB = np.array([[-50.0, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
ASIDE = np.array([20.0, -20.0, 0.0])
"""Over one triangle of the slab of two, away from the diagonal between them."""


# --- closed forms ---------------------------------------------------------------------------------------------------


def slope(ratio: float) -> float:
    """|b'| of b(d) = -(d^2 - dh^2)^2 ln(d^2/dh^2) / dh^3 at d = ratio dh."""
    square = ratio**2 - 1
    return float(4 * ratio * square * np.log(ratio**2) + 2 * square**2 / ratio)


def gap_ratio(force: float) -> float:
    """d/dh where |b'| = force."""
    from scipy.optimize import brentq

    return float(brentq(lambda ratio: slope(ratio) - force, 1e-6, 1 - 1e-12, xtol=1e-15))


def slides(angle: float, mu: float) -> float:
    """g (sin - mu cos) [m/s2]."""
    return float(G * (np.sin(angle) - mu * np.cos(angle)))


# --- scenes ---------------------------------------------------------------------------------------------------------


def resting(d_hat: float, stiffness: float | str, height: float) -> tuple[World, dict[str, Energy]]:
    """A sheet at a height over a slab."""
    positions, triangles = irregular_grid()
    sheet = replace(cloth(positions, triangles), positions=positions + ASIDE + np.array([0, 0, height]))
    world = make_world([sheet], [make_body("slab", *SLAB)])
    contact = body_contact(world, d_hat=d_hat, stiffness=stiffness)
    return world, those_on(membrane=membrane(world), gravity=gravity(world), body_contact=contact)


def sliding(
    angle: float,
    mu: float,
    dt: float,
    duration: float,
    eps_v: float = 1e-3,
    iterations: int = 1,
    tolerance: float = 1e-9,
    formula: str = "backward_euler",
) -> tuple[Floats, Floats]:
    """Displacements and last velocities of a sheet at rest on a floor, gravity turned by `angle`, both (n, 3)."""
    positions, triangles = irregular_grid()
    height = D_HAT * gap_ratio(4 * UNIT.density * G * np.cos(angle) / STIFFNESS)
    sheet = replace(cloth(positions, triangles), positions=positions + ASIDE + np.array([0, 0, height]))
    world = make_world([sheet], [make_body("floor", *SLAB)])
    energies = those_on(
        inertia=inertia(world),
        membrane=membrane(world),
        gravity=gravity(world, acceleration=(G * np.sin(angle), 0, -G * np.cos(angle))),
        body_contact=body_contact(world, d_hat=D_HAT, stiffness=STIFFNESS),
        friction=friction(world, coefficient=mu, eps_v=eps_v, iterations=iterations, contacts=("body_contact",)),
    )
    reports = run_of(replace(integrator_of(world, energies, dt, tolerance=tolerance), formula=formula), duration)
    state = reports[-1].state
    n = world.n_cloth
    return (state.positions - world.start())[:n], state.velocities[:n]


def drum(radius: float, width: float, segments: int) -> tuple[Floats, Ints]:
    """A closed band about the y axis."""
    angles = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    ring = radius * np.column_stack([np.cos(angles), np.zeros(segments), np.sin(angles)])
    a = np.arange(segments)
    b = (a + 1) % segments
    triangles = np.concatenate(
        [np.column_stack([a, b, b + segments]), np.column_stack([a, b + segments, a + segments])]
    )
    sides = np.array([0.0, width / 2, 0.0])
    return np.concatenate([ring - sides, ring + sides]), triangles


def belt_tensions(mu: float, cells: int, steps: int = 10, dt: float = 0.05, iterations: int = 1) -> tuple[float, float]:
    """Tensions [N] at both ends of a belt that is drawn over half of a drum at a constant speed, quasi-statically.

    iterations: of lagged friction, each with the normals and normal forces of the one before. The ends are pinned at
    the gap at which the belt rides (.97 d_hat): elsewhere the tails would lean, and the angle of contact not be pi.
    """
    radius, gap, tail, width, speed = 1.0, 0.0097, 0.4, 0.1, 0.2
    outer = radius + gap
    positions, triangles = grid(cells, 1, 2 * tail + np.pi * outer, width)
    s = positions[:, 0] - tail
    angle = np.clip(s / outer, 0.0, np.pi)
    below = np.where(s < 0, s, np.where(s > np.pi * outer, np.pi * outer - s, 0.0))
    wrapped = np.column_stack([-outer * np.cos(angle), positions[:, 1] - width / 2, outer * np.sin(angle) + below])
    rest = positions * [0.99, 1.0, 1.0]  # one percent of tension to begin with
    # a membrane folds for nothing where it is slack across; the bending that forbids it carries 1e-3 of the load
    fabric = replace(UNIT, youngs_modulus=200.0, poisson_ratio=0.0, bending_stiffness=2e-3)
    belt = replace(cloth(rest, triangles, fabric), positions=wrapped)
    world = make_world([belt], [make_body("drum", *drum(radius, 4 * width, 400))])
    ends = [np.flatnonzero(positions[:, 0] == x) for x in (0.0, positions[:, 0].max())]
    groups = [
        {"select": end, "motion": {"velocity": (0, 0, sign * speed)}} for end, sign in zip(ends, (1, -1), strict=True)
    ]
    world, held = pinned(world, group=groups)
    energies = those_on(
        membrane=membrane(world),
        bending=bending(world, model="hinge"),
        body_contact=body_contact(world, d_hat=0.01, stiffness=500.0),
        friction=friction(world, coefficient=mu, eps_v=2e-3, iterations=iterations, contacts=("body_contact",)),
    )
    report = run_of(integrator_of(world, energies, dt, {"pins": held}, tolerance=1e-7), steps * dt)[-1]
    gradient = report.potential.gradient(report.state.positions)
    slack, tight = (float(np.abs(gradient[end].sum(axis=0)[2])) for end in ends)
    return tight, slack


# --- the rows -------------------------------------------------------------------------------------------------------


def _at_rest(height: float, stiffness: float) -> tuple[World, dict[str, Energy], Floats]:
    world, energies = resting(D_HAT, stiffness, height)
    return world, energies, equilibrium(world, energies, world.start(), tolerance=1e-12, max_iterations=200)


def _gap() -> Outcome:
    """A vertex and a face are weighed by a quarter of the vertex's area: kappa A/4 |b'| = m g; here both are 1."""
    stiffness = 4 * UNIT.density * G
    world, _, x = _at_rest(0.9 * D_HAT, stiffness)
    ratios = x[: world.n_cloth, 2] / D_HAT
    exact = gap_ratio(1.0)
    return Outcome(float(ratios[np.abs(ratios - exact).argmax()]), exact, 1e-7, printed="0.78004076")


def _reaction() -> Outcome:
    world, energies, x = _at_rest(0.9 * D_HAT, STIFFNESS)
    reaction = energies["body_contact"].gradient(x)[world.n_cloth :, 2].sum()
    return Outcome(float(reaction), float(world.masses.sum() * G), 1e-8)


def _creep(share: float, printed: str, formula: str) -> Outcome:
    mu, eps_v = 0.6, 1e-2
    _, velocity = sliding(float(np.arctan(share * mu)), mu, 0.05, 1.0, eps_v, formula=formula)
    return Outcome(float(velocity[:, 0].mean() / eps_v), float(1 - np.sqrt(1 - share)), 1e-5, printed=printed)


def _slide() -> Outcome:
    """Backward Euler: a T (T + dt)/2. While slower than eps_v friction is not yet full: off by eps_v T at most."""
    angle, mu, dt, duration, eps_v = float(np.radians(30)), 0.5, 0.01, 1.0, 1e-4
    way, _ = sliding(angle, mu, dt, duration, eps_v)
    exact = slides(angle, mu) * duration * (duration + dt) / 2
    return Outcome(float(way[:, 0].mean()), exact, eps_v * duration / exact, printed="0.33185842")


def _slide_bdf2() -> Outcome:
    angle, mu, dt, duration, eps_v = float(np.radians(30)), 0.5, 0.02, 0.5, 1e-5
    way, _ = sliding(angle, mu, dt, duration, eps_v, formula="bdf2")
    exact = slides(angle, mu) * (duration**2 / 2 + 0.75 * dt**2)
    return Outcome(float(way[:, 0].mean()), exact, 3e-4)


def _capstan(mu: float, printed: str, dt: float = 0.05, iterations: int = 1, bar: float = 5e-3) -> Outcome:
    tight, slack = belt_tensions(mu, 80, round(0.5 / dt), dt, iterations)
    return Outcome(tight / slack, float(np.exp(mu * np.pi)), bar, printed=printed)


LAGGED = "friction uses the normal forces at the start of the step"


ROWS = (
    Row("A5a", "gap at rest / d_hat at F/(kappa d_hat^3) = 1", _gap),
    Row("A5b", "reaction force of the slab [N]", _reaction),
    Row("A5c", "creep at half the friction limit: v / eps_v", partial(_creep, 0.5, "0.29289322", "backward_euler")),
    Row("A5d", "the same with BDF2", partial(_creep, 0.5, "0.29289322", "bdf2")),
    Row("A5e", "slide on 30 degrees, mu 0.5, dt 0.01 s: distance after 1 s [m]", _slide),
    Row("A5f", "the same with BDF2, dt 0.02 s: distance after 0.5 s, a (T^2/2 + 0.75 dt^2) [m]", _slide_bdf2),
    Row("A5g", "capstan, mu 0.3, half a turn, dt 0.05 s: tension ratio", partial(_capstan, 0.3, "2.56633240")),
    Row("A5h", "the same, mu 0.5", partial(_capstan, 0.5, "4.81047738"), LAGGED),
    Row("A5i", "the same, mu 0.5, 8 lagged iterations", partial(_capstan, 0.5, "4.81047738", iterations=8, bar=3e-3)),
    Row("A5j", "the same, mu 0.5, dt 0.0125 s", partial(_capstan, 0.5, "4.81047738", 0.0125)),
)
