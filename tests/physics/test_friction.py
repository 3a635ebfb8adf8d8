"""Coulomb friction of a sheet on an incline and of a belt round a drum (VALIDATION A5)."""

from dataclasses import replace

import numpy as np
import pytest
from meshes import UNIT, cloth, grid, irregular_grid
from scipy.optimize import brentq
from solving import integrator_of, run_of

from clothsim.contact.body_contact import body_contact
from clothsim.contact.friction import friction
from clothsim.energies.bending import bending
from clothsim.energies.gravity import gravity
from clothsim.energies.inertia import inertia
from clothsim.energies.membrane import membrane
from clothsim.energies.pins import pins
from clothsim.mesh.body import make_body
from clothsim.mesh.world import make_world

G, D_HAT, STIFFNESS = 9.81, 0.01, 50.0
FLOOR = np.array([[-50.0, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]]), np.array([[0, 1, 2], [0, 2, 3]])


def gap_under(pressure):
    """Where kappa/4 |b'| = pressure, b(d) = -(d^2 - dh^2)^2 ln(d^2/dh^2) / dh^3."""

    def slope(y):
        return 4 * y * (y**2 - 1) * np.log(y**2) + 2 * (y**2 - 1) ** 2 / y

    return D_HAT * brentq(lambda y: STIFFNESS / 4 * slope(y) - pressure, 1e-6, 1 - 1e-12, xtol=1e-15)


def sliding(angle, mu, dt, duration, eps_v=1e-3, iterations=1, tolerance=1e-9, formula="backward_euler"):
    """A sheet at rest on a floor, gravity turned by `angle`: the reports of the run and the sheet's displacement."""
    positions, triangles = irregular_grid()
    height = gap_under(UNIT.density * G * np.cos(angle))
    sheet = replace(cloth(positions, triangles), positions=positions + np.array([20.0, -20.0, height]))
    world = make_world([sheet], [make_body("floor", *FLOOR)])
    energies = {
        "inertia": inertia(world),
        "membrane": membrane(world),
        "gravity": gravity(world, acceleration=(G * np.sin(angle), 0, -G * np.cos(angle))),
        "body_contact": body_contact(world, d_hat=D_HAT, stiffness=STIFFNESS),
        "friction": friction(world, coefficient=mu, eps_v=eps_v, iterations=iterations, contacts=("body_contact",)),
    }
    reports = run_of(replace(integrator_of(world, energies, dt, tolerance=tolerance), formula=formula), duration)
    state = reports[-1].state
    n = world.n_cloth
    return (state.positions - world.start())[:n], state.velocities[:n]


def test_sliding_acceleration_is_g_sin_minus_mu_g_cos():
    """Backward Euler: x = a T (T + dt) / 2."""
    angle, mu, dt, duration = np.radians(30), 0.5, 0.01, 1.0
    way, velocity = sliding(angle, mu, dt, duration)
    a = G * (np.sin(angle) - mu * np.cos(angle))
    expected = a * duration * (duration + dt) / 2
    assert expected == pytest.approx(0.33185842, abs=6e-9)
    # while the sheet is slower than eps_v friction is not yet full: less than eps_v times the duration
    assert way[:, 0] == pytest.approx(expected, abs=1e-3 * duration)
    assert velocity[:, 0] == pytest.approx(a * duration, abs=1e-3)
    assert np.abs(way[:, 1:]).max() < 1e-6


def test_sliding_of_bdf2_is_as_far_as_its_free_fall():
    """x = a (T^2/2 + 3/4 dt^2): friction takes its velocities from the same formula."""
    angle, mu, dt, duration = np.radians(30), 0.5, 0.02, 0.5
    way, velocity = sliding(angle, mu, dt, duration, eps_v=1e-5, formula="bdf2")
    a = G * (np.sin(angle) - mu * np.cos(angle))
    assert way[:, 0] == pytest.approx(a * (duration**2 / 2 + 0.75 * dt**2), abs=2e-5)
    assert velocity[:, 0] == pytest.approx(a * duration, abs=2e-5)


@pytest.mark.parametrize("formula", ["backward_euler", "bdf2"])
@pytest.mark.parametrize("share", [0.25, 0.5, 0.9])
def test_below_the_threshold_it_creeps_at_the_share_of_eps_v_that_ipc_friction_has(share, formula):
    mu, eps_v = 0.6, 1e-2
    _, velocity = sliding(np.arctan(share * mu), mu, 0.05, 1.0, eps_v, formula=formula)
    expected = 1 - np.sqrt(1 - share)
    if share == 0.5:
        assert expected == pytest.approx(0.29289322, abs=5e-9)
    assert velocity[:, 0] / eps_v == pytest.approx(expected, rel=1e-5)


def test_above_the_threshold_it_slides_away():
    mu = 0.5
    _, velocity = sliding(np.arctan(1.1 * mu), mu, 0.02, 0.5)
    angle = np.arctan(1.1 * mu)
    assert velocity[:, 0].min() > 100 * 1e-3
    assert velocity[:, 0] == pytest.approx(G * (np.sin(angle) - mu * np.cos(angle)) * 0.5, rel=0.01)


def test_without_a_coefficient_nothing_holds():
    way, _ = sliding(np.radians(30), 1e-12, 0.01, 0.2)
    assert way[:, 0] == pytest.approx(G * 0.5 * 0.2 * 0.21 / 2, rel=1e-6)


def test_more_passes_of_lagging_do_not_change_a_steady_slide():
    one, _ = sliding(np.radians(30), 0.5, 0.02, 0.2)
    three, _ = sliding(np.radians(30), 0.5, 0.02, 0.2, iterations=3)
    assert three == pytest.approx(one, abs=1e-7)


def drum(radius, width, segments):
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


def belt_tensions(mu, cells, steps=10):
    """Tensions at both ends of a belt that is drawn over half of a drum at a constant speed, quasi-statically.

    The ends are pinned at the gap at which the belt rides (.97 d_hat): elsewhere the tails would lean, and the angle of
    contact not be pi.
    """
    radius, gap, tail, width, speed, dt = 1.0, 0.0097, 0.4, 0.1, 0.2, 0.05
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
    world, held = pins(world, group=groups)
    energies = {
        "membrane": membrane(world),
        "bending": bending(world),
        "body_contact": body_contact(world, d_hat=0.01, stiffness=500.0),
        "friction": friction(world, coefficient=mu, eps_v=2e-3, contacts=("body_contact",)),
    }
    integrator = integrator_of(world, energies, dt, {"pins": held}, tolerance=1e-7)
    report = run_of(integrator, steps * dt)[-1]
    gradient = report.potential.gradient(report.state.positions)
    slack, tight = (float(np.abs(gradient[end].sum(axis=0)[2])) for end in ends)
    return tight, slack


def test_capstan():
    """T2 / T1 = exp(mu phi), phi the angle of contact."""
    mu = 0.3
    expected = np.exp(mu * np.pi)
    assert expected == pytest.approx(2.56633240, abs=5e-9)
    tight, slack = belt_tensions(mu, 80)
    assert tight / slack == pytest.approx(expected, rel=5e-3)
    tight, slack = belt_tensions(1e-9, 40, steps=3)
    assert tight == pytest.approx(slack, rel=1e-3)
