"""State of rest: distance from equilibrium against closed forms, turning points, creep, what still changes."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from effect_builders import air, damping, gravity, inertia, membrane, pins, springs
from meshes import cloth, grid
from solving import integrator_of, run_of

from clothsim.mesh.body import frame_motion, make_body, rigid_motion
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.solve.newton.stability import HORIZON
from clothsim.solve.stepping.state import Rest, first_state
from clothsim.solve.stepping.stepping import advance
from clothsim.solve.stepping.time_loop import SLOW_STEPS, static_model, with_rest_state

STIFFNESS = 40.0


def tied_triangle(**effects):
    """One triangle, each vertex on a spring of its own to where it starts, with gravity along -z."""
    world = make_world([cloth(*grid(1, 1))])
    tie = [{"select": list(range(world.n_cloth)), "stiffness": STIFFNESS}]
    energies = {"inertia": inertia(world), "gravity": gravity(world), "springs": springs(world, spring=tie)}
    return integrator_of(world, {**energies, **{name: make(world) for name, make in effects.items()}}, 0.01)


def after_slow_steps(integrator, until=1.0, **changes):
    """The report of one step from a state that was slow for many, at the end of a frame."""
    state = replace(first_state(integrator.world, integrator.dt), slow_steps=SLOW_STEPS, **changes)
    report = replace(advance(integrator, state, state.time + integrator.dt), frame_done=True, fastest=0.0)
    return with_rest_state(integrator, state, report, until)


def test_displacement_to_equilibrium_of_a_tied_weight():
    """u = -m g / (k + m / T^2), whatever the damping."""
    integrator = tied_triangle(damping=lambda world: damping(world, rate=5.0))
    report = advance(integrator, first_state(integrator.world, 1e-9), 1e-9)
    masses = integrator.world.masses
    fallen = -masses * 9.81 / (STIFFNESS + masses / HORIZON**2)
    displacement = static_model(integrator, report).displacement()
    assert displacement[:, 2] == pytest.approx(fallen, rel=1e-10)
    assert np.abs(displacement[:, :2]).max() < 1e-15


def test_a_turning_point_is_no_rest():
    """The start of a fall has no speed, as the highest point of a swing."""
    assert after_slow_steps(tied_triangle()).state.rest is Rest.DISTANT


@pytest.mark.parametrize("rate", [0.0, 1e5])
def test_creep_is_no_rest(rate):
    """With a strong damping every step is slow, and the distance the same as without."""
    integrator = tied_triangle(damping=lambda world: damping(world, rate=rate)) if rate else tied_triangle()
    report = after_slow_steps(integrator)
    assert report.state.rest is Rest.DISTANT
    if rate:
        assert np.linalg.norm(report.state.velocities, axis=1).max() < 2e-4


def test_rest_after_slow_steps_at_the_end_of_a_frame_only():
    world = make_world([cloth(*grid(1, 1))])
    integrator = integrator_of(world, {"inertia": inertia(world), "membrane": membrane(world)}, 0.01)
    reports = run_of(integrator, 0.5, frames_per_second=10.0)
    resting = [report.state.at_rest for report in reports]
    assert resting.index(True) == 9  # the end of the first frame, after SLOW_STEPS steps
    assert SLOW_STEPS == 10
    assert all(resting[9:])


def test_a_free_sheet_that_drifts_slowly_is_as_its_speed():
    """Rigid modes have no stiffness: their noise is no distance from equilibrium."""
    world = make_world([cloth(*grid(3, 3))])
    integrator = integrator_of(world, {"inertia": inertia(world), "membrane": membrane(world)}, 0.01)
    for speed, wanted in [(5e-4, Rest.REACHED), (2e-3, Rest.MOVING)]:
        state = first_state(world, 0.01)
        state = replace(state, velocities=np.full_like(state.positions, speed), slow_steps=SLOW_STEPS)
        report = replace(advance(integrator, state, 0.01), frame_done=True)
        assert with_rest_state(integrator, state, report, 1.0).state.rest is wanted


# --- what still changes ---------------------------------------------------------------------------------------------


def sheet_with_body(motion):
    ball = make_body("ball", np.eye(3), [[0, 1, 2]], motion)
    world = make_world([cloth(*grid(1, 1))], [ball])
    return integrator_of(world, {"inertia": inertia(world), "membrane": membrane(world)}, 0.01)


def test_a_body_that_moves_later_prevents_rest_and_one_that_has_stopped_does_not():
    frames = np.eye(3) + np.array([0.0, 0.0, 1e-3])[:, None, None]
    stops_at = 0.2
    moving = sheet_with_body(frame_motion(frames, 2 / stops_at))
    assert after_slow_steps(moving).state.rest is Rest.CHANGING
    assert after_slow_steps(moving, time=stops_at - 0.011).state.rest is Rest.CHANGING
    stood = replace(first_state(moving.world, 0.01), time=stops_at, slow_steps=SLOW_STEPS)
    stood.positions[moving.world.n_cloth :] += [0, 0, 1e-3]
    report = replace(advance(moving, stood, stops_at + 0.01), frame_done=True)
    assert with_rest_state(moving, stood, report, 1.0).state.rest is Rest.REACHED


def test_a_full_turn_a_frame_is_a_motion():
    turning = sheet_with_body(rigid_motion(rotate_degrees_per_second=(0, 0, 3600.0)))
    assert after_slow_steps(turning).state.rest is Rest.CHANGING


def test_pins_that_move_prevent_rest():
    world, held = pins(make_world([cloth(*grid(1, 1))]), select=[0], motion={"velocity": (1e-6, 0, 0)})
    energies = {"inertia": inertia(world), "membrane": membrane(world)}
    assert after_slow_steps(integrator_of(world, energies, 0.01, {"pins": held})).state.rest is Rest.CHANGING


@dataclass(frozen=True)
class Pulse(Energy):
    """A force on vertex 0 between two times."""

    since: float
    until: float
    force: float = 0.0

    def begin(self, step):
        return replace(self, force=float(self.since <= step.time + step.dt < self.until))

    def value(self, x):
        return self.force * x[0, 2]

    def gradient(self, x):
        return np.eye(1, len(x)).T * [0.0, 0.0, self.force]

    def hessian(self, x, project=True):
        return ElementHessian(np.zeros((0, 1), np.int64), np.zeros((0, 3, 3)))


@pytest.mark.parametrize(
    ("since", "until", "wanted"), [(0.5, 0.6, Rest.CHANGING), (0.9, 9.0, Rest.CHANGING), (3.0, 9.0, Rest.REACHED)]
)
def test_a_load_that_comes_later_prevents_rest_if_it_comes_before_the_end(since, until, wanted):
    world = make_world([cloth(*grid(1, 1))])
    energies = {"inertia": inertia(world), "membrane": membrane(world), "pulse": Pulse(since, until)}
    assert after_slow_steps(integrator_of(world, energies, 0.01), until=2.0).state.rest is wanted


def test_a_steady_wind_allows_rest_a_gust_does_not():
    def tied_in(wind):
        tied = tied_triangle(air=lambda world: air(world, wind=wind))
        return after_slow_steps(replace(tied, rest_speed=10.0)).state.rest

    assert tied_in((0.0, 1.0, 0.0)) is Rest.REACHED
    assert tied_in({"kind": "gust", "velocity": (0.0, 1.0, 0.0)}) is Rest.CHANGING


def test_a_steady_wind_counts_as_a_load():
    """Without gravity, the distance is that of the wind's force on the cloth at rest."""
    world = make_world([cloth(*grid(1, 1))])
    tie = [{"select": list(range(world.n_cloth)), "stiffness": STIFFNESS}]
    energies = {"inertia": inertia(world), "springs": springs(world, spring=tie), "air": air(world, wind=(0, 0, 2.0))}
    integrator = integrator_of(world, energies, 1e-9)
    report = advance(integrator, first_state(world, 1e-9), 1e-9)
    model = static_model(integrator, report)
    force = -model.gradient()[: world.n_cloth, 2]
    assert force.sum() > 0.1
    at_rest = energies["air"].begin(model.rest).gradient(model.rest.positions)[: world.n_cloth, 2]
    assert force == pytest.approx(-at_rest, rel=1e-9)
    moved = model.displacement()[:, 2]
    assert moved == pytest.approx(force / (STIFFNESS + world.masses / HORIZON**2), rel=1e-9)
