"""Unforced runs with contact and friction: energy inequality (docs/results/validation.md, A4), memory, bits."""

import gc
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from effect_builders import bending, body_contact, friction, gravity, inertia, membrane, self_contact
from meshes import UNIT, cloth, grid
from solving import integrator_of, run_of

from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.mesh.body import make_body
from clothsim.mesh.world import make_world
from clothsim.solve.stepping.state import first_state
from clothsim.solve.stepping.stepping import advance

PLATE = np.array([[-50.0, -40, 0], [50, -50, 0], [45, 50, 0], [-50, 50, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
SOFT = replace(UNIT, youngs_modulus=20.0, bending_stiffness=0.02)
STORED = ("membrane", "bending", "body_contact", "self_contact")


def integrator(world, contact, dt, mu=0.4, **more):
    """Backward Euler on inertia, membrane, bending, contact and friction."""
    effects = {"inertia": inertia(world), "membrane": membrane(world), "bending": bending(world), **more}
    effects |= {contact.__name__: contact(world, d_hat=0.02)}
    effects |= {"friction": friction(world, coefficient=mu, contacts=(contact.__name__,))}
    return integrator_of(world, effects, dt, tolerance=1e-6)


def thrown(dt=0.01):
    """A sheet flies aslant into a plate, turned so that a corner comes first."""
    positions, triangles = grid(4, 4)
    angle = 0.3
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    start = positions @ turn.T + [0.1, 0.2, 0.06]
    sheet = replace(cloth(positions, triangles, SOFT, velocity=(2.0, 0.5, -3.0)), positions=start)
    return integrator(make_world([sheet], [make_body("plate", *PLATE)]), body_contact, dt)


def released(dt=0.01):
    """A strip twisted by two turns, whose layers touch when it is let go."""
    positions, triangles = grid(16, 2, 1.0, 0.25)
    angle = 4 * np.pi * positions[:, 0]
    side = positions[:, 1] - 0.125
    start = np.column_stack([0.3 * positions[:, 0], side * np.cos(angle), side * np.sin(angle)])
    strip = replace(cloth(positions, triangles, SOFT), positions=start)
    return integrator(make_world([strip]), self_contact, dt)


def colliding(dt=0.01):
    """Two sheets meet, with vertices over faces."""
    sheets = []
    for k, (height, speed) in enumerate(((0.0, 1.0), (0.06, -2.0))):
        positions, triangles = grid(4 - k, 4 - k, 0.9 + 0.1 * k)
        sheet = cloth(positions, triangles, SOFT, name=f"sheet {k}", velocity=(0.5 * speed, 0.0, speed))
        sheets.append(replace(sheet, positions=positions + np.array([0.03 * k, 0.05 * k, height])))
    return integrator(make_world(sheets), self_contact, dt)


def kinetic(world, v):
    return 0.5 * float(world.masses @ (v[: world.n_cloth] ** 2).sum(axis=1))


@pytest.mark.parametrize("dt", [0.005, 0.02, 0.1])
@pytest.mark.parametrize("scene", [thrown, released, colliding])
def test_no_unforced_step_gains_energy(scene, dt):
    """|v(n+1) - v(n)|_M^2/2 + Psi(n+1) + D(n+1) - D(n) <= |v(n)|_M^2/2 + Psi(n), barrier and friction of one step.

    The minimiser is no worse than where the step starts. D, what friction takes, is never below that at the start.
    """
    running = scene(dt)
    world = running.world
    x, v, touched, lost = world.start(), world.start_velocities(), 0, []
    for report in run_of(running, 12 * dt):
        after, bound = report.state, report.potential.energies
        psi = {
            place: sum(bound[k].value(y) for k in STORED if k in bound)
            for place, y in (("n", x), ("n+1", after.positions))
        }
        taken = bound["friction"].value(after.positions) - bound["friction"].value(x)
        before = kinetic(world, v) + psi["n"]
        noise = 1e-13 * (kinetic(world, v) + abs(psi["n"]) + abs(bound["friction"].value(x)))
        assert taken >= -noise
        assert kinetic(world, after.velocities - v) + psi["n+1"] + taken <= before + noise
        lost.append(before - kinetic(world, after.velocities) - psi["n+1"])
        touched += len(bound["friction"].elements) > 0
        assert report.minimum_gap > 0
        x, v = after.positions, after.velocities
    assert touched >= 1
    assert sum(lost) > 1e-3
    assert len(intersecting_pairs(x[: world.n_cloth], world.triangles)) == 0


def test_contact_keeps_momentum():
    """No force from outside: the two sheets and the strip keep theirs, whatever touches and rubs."""
    for scene in (colliding, released):
        running = scene(0.02)
        world = running.world
        first = world.masses @ world.start_velocities()[: world.n_cloth]
        scale = np.sqrt(2 * kinetic(world, world.start_velocities()) * world.masses.sum()) or 1.0
        for report in run_of(running, 0.2):
            momentum = world.masses @ report.state.velocities[: world.n_cloth]
            assert np.abs(momentum - first).max() < 1e-9 * scale


def lying():
    """A sheet at rest on a plate, under its weight."""
    positions, triangles = grid(2, 2)
    sheet = replace(cloth(positions, triangles, SOFT), positions=positions + np.array([0.1, 0.2, 0.012]))
    world = make_world([sheet], [make_body("plate", *PLATE)])
    return integrator(world, body_contact, 0.01, gravity=gravity(world))


def test_memory_is_flat_over_many_steps():
    """Two hundred steps in contact; the first thirty fill every cache."""
    running = lying()
    state = first_state(running.world, running.dt)
    tracemalloc.start()
    traced = []
    for k in range(200):
        report = advance(running, state, until=1e3)
        assert report.converged
        state = report.state
        if k in (29, 199):
            gc.collect()  # what waits for the collector is no leak
            traced.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert len(report.potential.energies["friction"].elements) > 0
    assert traced[1] - traced[0] < 50_000


@pytest.mark.parametrize("scene", [thrown, released, colliding])
def test_the_same_run_twice_has_the_same_bits(scene):
    """On one thread; the second time also with the caches of a run that has gone on."""
    running = scene()
    first = [report.state.positions for report in run_of(running, 0.06)]
    for again in (scene(), running):
        second = [report.state.positions for report in run_of(again, 0.06)]
        assert len(first) == len(second)
        assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))
