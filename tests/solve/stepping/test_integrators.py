"""Difference formulas: exactness on polynomials, restarts of BDF2, retries."""

from dataclasses import replace

import numpy as np
import pytest
from effect_builders import gravity, inertia, pins
from meshes import cloth, grid, small_world
from solving import integrator_of

from clothsim.mesh.body import make_body, rigid_motion
from clothsim.mesh.world import make_world
from clothsim.solve.stepping.integrators import LARGEST_RATIO, formula_of, prescribed
from clothsim.solve.stepping.state import Previous, State, first_state
from clothsim.solve.stepping.stepping import advance

H = 0.1


def state_on(path, h, before, t=0.7):
    """The state at t of a point whose place and speed are path(t), path'(t), with the one `before` seconds earlier."""
    places = [np.array([[path(s), 0.0, 0.0]]) for s in (t, t - before)]
    speeds = [np.array([[path.deriv()(s), 0.0, 0.0]]) for s in (t, t - before)]
    return State(t, h, 3, 0, places[0], speeds[0], previous=Previous(places[1], speeds[1], before))


@pytest.mark.parametrize("ratio", [0.3, 1.0, 2.3])
def test_bdf2_differentiates_a_parabola_exactly(ratio):
    path = np.poly1d([1.3, -0.4, 2.0])
    state = state_on(path, H, H / ratio)
    formula = formula_of("bdf2", state, H)
    assert formula.order == 2
    assert formula.ratio == pytest.approx(ratio)
    end = np.array([[path(0.7 + H), 0.0, 0.0]])
    assert formula.velocities(end)[0, 0] == pytest.approx(path.deriv()(0.7 + H), rel=1e-12)
    acceleration = (path.deriv()(0.7 + H) - formula.past.velocities[0, 0]) / formula.past.dt
    assert acceleration == pytest.approx(2.6, rel=1e-12)


def test_with_equal_steps_it_is_the_formula_of_the_books():
    """v = (3 x(n+1) - 4 x(n) + x(n-1)) / 2h, and the weight of inertia is 9 / (8 h^2)."""
    state = state_on(np.poly1d([1.0, 0.0, 0.0, 0.0]), H, H)
    formula = formula_of("bdf2", state, H)
    x = np.array([[0.3, 0.1, -0.2]])
    assert formula.velocities(x) == pytest.approx((3 * x - 4 * state.positions + state.previous.positions) / (2 * H))
    assert 1 / (2 * formula.past.dt**2) == pytest.approx(9 / (8 * H**2))


@pytest.mark.parametrize("integrator", ["backward_euler", "bdf2"])
def test_backward_euler_where_there_is_no_step_before(integrator):
    state = replace(state_on(np.poly1d([1.0, 0.0]), H, H), previous=None)
    formula = formula_of(integrator, state, H)
    assert formula.order == 1
    assert formula.past.positions is state.positions
    assert formula.past.velocities is state.velocities
    assert formula.past.dt == H


def test_backward_euler_after_a_step_that_was_far_shorter():
    state = state_on(np.poly1d([1.0, 0.0]), H, H / LARGEST_RATIO)
    assert formula_of("bdf2", state, H).order == 1
    assert formula_of("bdf2", state, 0.99 * H).order == 2


def test_a_retry_with_half_the_dt_has_its_own_ratio():
    """The bits are those of a step that took the short dt at once."""
    from hurdle import Hurdle

    world = small_world()
    energies = {"inertia": inertia(world), "gravity": gravity(world)}

    def bdf2(*hurdles):
        named = {f"hurdle {k}": h for k, h in enumerate(hurdles)}
        return replace(integrator_of(world, energies | named, 0.1, tolerance=1e-9), formula="bdf2")

    failing, free = bdf2(Hurdle(longest=0.03, since=0.05)), bdf2()
    first = advance(free, first_state(world, 0.1), until=1.0).state
    retried = advance(failing, first, until=0.1 + 0.9)
    direct = advance(free, replace(first, dt=retried.dt), until=0.1 + 0.9)
    assert len(retried.failures) == 2
    assert retried.dt == direct.dt == pytest.approx(0.025)
    assert np.array_equal(retried.state.positions, direct.state.positions)
    assert np.array_equal(retried.state.velocities, direct.state.velocities)
    assert retried.state.previous.dt == retried.dt


TRIANGLE = np.array([[0.0, 0, -1], [1, 0, -1], [0, 1, -1]]), np.array([[0, 1, 2]])


def world_of(**motions):
    bodies = [make_body(name, *TRIANGLE, rigid_motion(**motion)) for name, motion in motions.items()]
    return make_world([cloth(*grid(2, 2))], bodies)


def test_still_bodies_prescribe_nothing():
    where = prescribed(world_of(a={}, b={}), [], 1.0)
    assert len(where.vertices) == 0
    assert where.positions.shape == (0, 3)


def test_moving_bodies_and_pins_are_joined():
    world = world_of(still={}, rising={"velocity": (0.0, 0.0, 2.0)})
    world, constraint = pins(world, select=[4])
    where = prescribed(world, [constraint], 0.5)
    rows = world.body_slices[1]
    assert where.vertices.tolist() == [*range(rows.start, rows.stop), 4]
    assert np.array_equal(where.positions[:3], TRIANGLE[0] + [0, 0, 1.0])
    assert np.array_equal(where.positions[3], world.start()[4])


def test_a_body_turns_about_its_centre():
    turning = {"rotate_degrees_per_second": (0.0, 0.0, 90.0), "centre": (1.0, 0.0, 0.0)}
    where = prescribed(world_of(turning=turning), [], 1.0)
    assert np.allclose(where.positions, [[1, -1, -1], [1, 0, -1], [0, -1, -1]], atol=1e-15)
