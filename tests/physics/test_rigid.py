"""Rigid bodies against closed forms: fall, spin, pendulum, precession, momentum, rolling; rest; refused scenes."""

import numpy as np
import pytest
from rigid_scenes import EFFECTS, WEIGHTLESS, moments_of, momentum, rigid_scene
from scipy.special import ellipk

from clothsim import Scene, Simulation, simulate
from clothsim.base.errors import InputError, IntersectionWarning
from clothsim.physics.energies.base import Step
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.solve.linear import linear_system
from clothsim.solve.stepping.integrators import predicted_start
from clothsim.solve.stepping.state import first_state

G = 9.81
FLOOR = {"name": "floor", "mesh": "slab", "size": [4, 2, 0.1], "position": [0, 0, -0.05]}


def test_a_free_body_falls_on_its_parabola_and_turns_at_its_rate():
    spin, errors = np.radians(360.0), []
    for dt in (0.01, 0.005):
        ball = {"mesh": "sphere", "subdivisions": 1, "velocity": [0.5, 0, 0], "spin_degrees_per_second": [360, 0, 0]}
        found, _ = moments_of(rigid_scene(ball, dt=dt))
        end = found[-1]
        angle = np.arctan2(end.maps[0, 2, 1], end.maps[0, 1, 1])
        errors.append(angle - spin * end.time)
        assert end.centre[0] == pytest.approx(0.05, abs=1e-9)
        assert end.strain < 1e-5
        # BDF2 started by a step of backward Euler is g h^2/4 t^0 low at first, constant from then on
        assert end.centre[2] == pytest.approx(-G * end.time**2 / 2, abs=G * dt**2)
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)


def test_a_pendulum_on_a_hinge_has_its_period():
    length, width, amplitude = 0.4, 0.05, np.radians(10.0)
    centre = 0.5 * length * np.array([np.sin(amplitude), 0.0, -np.cos(amplitude)])
    bar = {"mesh": "slab", "size": [width, width, length], "rotation_degrees": [0, -10, 0], "position": centre}
    bar |= {"joint": {"point": [0, 0, 0], "axis": [0, 2, 0]}}
    arm, inertia = length / 2, (length**2 + width**2) / 12 + length**2 / 4
    exact = 4 * np.sqrt(inertia / (G * arm)) * ellipk(np.sin(amplitude / 2) ** 2)
    off = []
    for dt in (0.02, 0.01):
        found, _ = moments_of(rigid_scene(bar, dt=dt, duration=1.6))
        times = np.array([each.time for each in found])
        angles = np.array([np.arctan2(each.maps[0, 0, 2], each.maps[0, 2, 2]) for each in found]) - amplitude
        before = np.flatnonzero(np.sign(angles[:-1]) != np.sign(angles[1:]))
        zeros = times[before] - angles[before] * (times[before + 1] - times[before]) / np.diff(angles)[before]
        off.append(2 * np.diff(zeros).mean() / exact - 1)
        assert found[-1].maps[0] @ [0, 1, 0] == pytest.approx([0, 1, 0], abs=1e-12)
    assert abs(off[1]) < 2e-3
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.2)


def test_a_top_on_a_ball_joint_precesses():
    """Steady precession of a horizontal axis: Omega = m g d / (I w)."""
    spin = 100.0
    top = {"mesh": "capsule", "radius": 0.08, "height": 0.25, "segments": 12, "position": [0.1, 0, 0]}
    top |= {"rotation_degrees": [0, 90, 0], "joint": {"point": [0, 0, 0]}}
    still = build(rigid_scene(top)).world.rigid[0]
    second = np.linalg.pinv(still.gradients) @ np.diag(still.masses) @ np.linalg.pinv(still.gradients).T / still.mass
    rate = G * 0.1 / ((second[1, 1] + second[2, 2]) * spin)
    top |= {"spin_degrees_per_second": np.degrees([spin, 0, rate])}
    off = []
    for dt in (0.002, 0.001):
        found, _ = moments_of(rigid_scene(top, dt=dt, duration=0.06))
        angles = np.unwrap([np.arctan2(each.maps[0, 1, 0], each.maps[0, 0, 0]) for each in found])
        off.append(np.polyfit([each.time for each in found], angles, 1)[0] / rate - 1)
    assert abs(off[1]) < 0.02
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.3)


def test_two_balls_that_collide_keep_their_momentum():
    ball = {"mesh": "sphere", "radius": 0.1, "subdivisions": 2}
    rigid = [
        ball | {"name": "first", "velocity": [1.0, 0, 0]},
        ball | {"name": "second", "position": [0.22, 0.03, 0.02]},
    ]
    scene = rigid_scene(rigid, effects=WEIGHTLESS | {"body_contact": {}}, dt=0.004, duration=0.12, tolerance=1e-9)
    found, simulation = moments_of(scene)
    linear, angular, energy = momentum(simulation)
    mass = simulation._session.built.world.rigid[0].mass
    assert found[-1].velocity[0] < 0.7
    assert linear == pytest.approx([mass, 0, 0], abs=1e-6 * mass)
    assert angular == pytest.approx(np.zeros(3), abs=5e-3 * mass * 0.1)  # BDF2 keeps it to its order
    assert 0.3 * mass < energy < 0.5 * mass


def test_a_ball_rolls_down_a_slope_at_five_sevenths():
    slope = np.radians(10.0)
    down = {"acceleration": G * np.array([np.sin(slope), 0, -np.cos(slope)])}
    effects = {"inertia": {}, "membrane": {}, "gravity": down}
    effects |= {"body_contact": {"d_hat": 1e-3}, "friction": {"coefficient": 0.5}}
    ball = {"mesh": "sphere", "radius": 0.1, "subdivisions": 3, "position": [0, 0, 0.1005]}
    found, _ = moments_of(rigid_scene(ball, FLOOR, effects, dt=0.01, duration=0.4))
    times, speeds = np.transpose([(each.time, each.velocity[0]) for each in found if each.time > 0.1])
    rolling = 5 / 7 * G * np.sin(slope)
    assert np.polyfit(times, speeds, 1)[0] == pytest.approx(rolling, rel=0.05)  # its facets slow it down
    turning = [(each.maps[0, 0, 2] > 0) for each in found[5:]]
    assert all(turning)


def test_a_cube_at_rest_on_the_floor_stays_and_its_weight_is_carried(tmp_path):
    cube = {"name": "cube", "mesh": "slab", "size": [0.2, 0.2, 0.2], "position": [0, 0, 0.1006], "density": 500.0}
    scene = rigid_scene(
        cube,
        FLOOR,
        {"inertia": {}, "membrane": {}, "gravity": {}, "body_contact": {"d_hat": 1e-3}, "friction": {}},
        duration=0.3,
    )
    scene = Scene(**{name: getattr(scene, name) for name in ("body", "rigid", "effects", "solver")},
                  cloth=scene.cloth, run={"duration": 0.3, "frames_per_second": 10, "forces": True})  # fmt: skip
    run = simulate(scene, tmp_path)
    assert run.status == "completed"
    assert run.intersection_free
    cubes = [run.bodies(k) for k in (1, -1)]
    first, last = ({name: points for name, points, _ in each}["cube"] for each in cubes)
    assert np.abs(first - last).max() < 5e-4
    assert run.forces().bodies["floor"][-1][2] == pytest.approx(-500 * 0.008 * G, rel=0.05)


@pytest.mark.parametrize(("rate", "said"), [(400.0, False), (700.0, True)])
def test_a_body_that_will_lose_spin_is_named_with_a_shorter_step(rate, said):
    built = build(rigid_scene({"name": "top", "mesh": "slab", "spin_degrees_per_second": [0, 0, rate]}))
    notes = [note for note in built.warnings if "solver.dt" in note]
    assert len(notes) == said
    assert all("top" in note and "7 degrees" in note and "0.004" in note for note in notes)


def test_a_rigid_body_is_not_moved_by_hand():
    simulation = Simulation(rigid_scene({"name": "ball", "mesh": "sphere"}))
    with pytest.raises(InputError, match="ball is rigid"):
        simulation.drive_body("ball", velocity=[1.0, 0, 0])


def test_a_scene_of_rigid_bodies_is_stored_and_restored(tmp_path):
    ball = {"name": "ball", "mesh": "sphere", "subdivisions": 1, "spin_degrees_per_second": [200, 0, 0]}
    simulation = Simulation(rigid_scene(ball))
    for _ in range(3):
        simulation.step()
    simulation.save(tmp_path / "state")
    restored = Simulation.restore(tmp_path / "state")
    for each in (simulation, restored):
        each.step()
    assert np.array_equal(restored.state.bodies["ball"], simulation.state.bodies["ball"])


@pytest.mark.parametrize(
    ("rigid", "effects", "words"),
    [
        ({"mesh": "sphere"}, {"membrane": {}}, "inertia"),
        ({"mesh": "sphere", "joint": {"axis": [0, 0, 1]}}, {"inertia": {}}, "point"),
        ({"mesh": "sphere", "joint": {"point": [0, 0, 0], "axis": [0, 0, 0]}}, {"inertia": {}}, "axis"),
        ({"mesh": "sphere", "density": -1}, {"inertia": {}}, "density"),
        ({"mesh": "rectangle"}, {"inertia": {}}, "open"),
        ({"mesh": "sphere", "tie": [{"stiffness": 1.0}]}, {"inertia": {}}, "select"),
        ({"mesh": "sphere", "tie": [{"select": [999]}]}, {"inertia": {}}, "999"),
        ({"mesh": "sphere", "colour": "red"}, {"inertia": {}}, "colour"),
        (
            {"mesh": "sphere", "radius": 0.04, "position": [0, 3, 2]},
            {"inertia": {}, "body_contact": {}},
            "intersects",
        ),
    ],
)
def test_a_bad_rigid_body_is_named(rigid, effects, words):
    with pytest.raises(InputError, match=words):
        build(rigid_scene(rigid, effects=effects))


def test_a_body_that_spins_is_solved_from_where_it_turns_to(tmp_path):
    block = {"mesh": "slab", "size": [0.1, 0.2, 0.3], "spin_degrees_per_second": [0, 0, 900]}
    run = simulate(rigid_scene(block, dt=0.01, duration=0.05, tolerance=1e-3), tmp_path)
    assert run.summary["newton_iterations"] <= 3 * run.summary["steps"]  # 13 a step from the positions as they are


def test_the_prediction_keeps_the_distances_and_the_joint():
    coordinates = {}
    for name, joint in (("free", None), ("hinged", {"point": [0.3, 0, 0], "axis": [0, 0, 1]})):
        block = {"mesh": "slab", "size": [0.1, 0.2, 0.3], "spin_degrees_per_second": [0, 0, 900]}
        scene = rigid_scene(block | ({"joint": joint} if joint else {}))
        built = build(scene)
        session = prepare(scene, built)
        state = first_state(built.world, 0.01)
        bound = session.integrator.potential.begin(
            Step(0.0, 0.01, state.positions, state.velocities, 1.0, np.zeros_like(state.positions))
        )
        ahead = predicted_start(built.world, session.integrator.system.dependent, bound, state, 0.01)
        assert bound.energies["rigidity"].value(ahead) < 1e-15
        rows = built.world.rigid_slices[0]
        turned = ahead[rows] - ahead[rows].mean(axis=0)
        angle = np.arctan2(turned[0, 1], turned[0, 0]) - np.arctan2(
            *(state.positions[rows] - state.positions[rows].mean(axis=0))[0, [1, 0]]
        )
        assert np.degrees(angle) % 360 == pytest.approx(9.0, abs=1e-6)
        coordinates[name] = ahead[rows].mean(axis=0) - state.positions[rows].mean(axis=0)
    assert coordinates["free"] == pytest.approx(np.zeros(3), abs=1e-12)
    turn = np.radians(9.0)
    assert coordinates["hinged"] == pytest.approx(0.3 * np.array([1 - np.cos(turn), -np.sin(turn), 0]), abs=1e-12)


def test_rigid_bodies_that_intersect_are_seen_by_the_exact_check(tmp_path):
    ball = {"mesh": "sphere", "radius": 0.1, "subdivisions": 1}
    rigid = [ball | {"name": "a", "velocity": [2.0, 0, 0]}, ball | {"name": "b", "position": [0.22, 0.01, 0.02]}]
    with pytest.warns(IntersectionWarning, match="a and b intersect"):
        run = simulate(rigid_scene(rigid, effects=WEIGHTLESS, dt=0.01, duration=0.05), tmp_path)
    assert run.intersection_free is False
    assert run.intersections["rigid"]["states"] > 0
    assert run.intersections["cloth_body"]["states"] == 0


def test_a_scene_far_from_the_origin_is_the_same(tmp_path):
    far, ends = np.array([2e3, -1e3, 500.0]), []
    for shift in (np.zeros(3), far):

        def at(*point, shift=shift):
            return shift + np.array(point)

        rigid = [
            {"name": "ball", "mesh": "sphere", "radius": 0.1, "subdivisions": 2, "position": at(0, 0, 0.13)},
            {"name": "door", "mesh": "slab", "size": [0.1, 0.02, 0.2], "position": at(1, 0, 0.3)}
            | {"joint": {"point": at(1, 0, 0.5), "axis": [0, 1, 0]}, "spin_degrees_per_second": [0, 90, 0]},
        ]
        floor = FLOOR | {"position": at(*FLOOR["position"])}
        cloth = {"mesh": "rectangle", "size": [0.1, 0.1], "cells": [2, 2], "position": at(0, 0.5, 1)}
        scene = rigid_scene(rigid, floor, EFFECTS | {"body_contact": {}}, duration=0.1, cloth=cloth)
        world = build(scene).world
        for body, rows, surface in zip(world.rigid, world.coordinate_slices, world.rigid_slices, strict=True):
            followed = body.offset + body.weights @ world.start()[rows]
            assert world.start()[surface] == pytest.approx(followed, abs=1e-12)
        run = simulate(scene, tmp_path / str(len(ends)))
        ends.append({name: points - shift for name, points, _ in run.bodies(-1)})
    for name in ("ball", "door"):
        assert ends[1][name] == pytest.approx(ends[0][name], abs=1e-6)


def test_vertices_follow_their_coordinates_where_patches_are_eliminated(monkeypatch):
    monkeypatch.setattr(linear_system, "MIN_VERTICES", 1)
    sheet = {"mesh": "rectangle", "size": [0.6, 0.6], "cells": [10, 10]}
    ball = {"mesh": "sphere", "radius": 0.1, "subdivisions": 2, "position": [0.03, 0.02, 0.12], "velocity": [0, 0, -3]}
    effects = EFFECTS | {"bending": {}, "pins": {"select": "boundary"}, "body_contact": {}, "self_contact": {}}
    found, simulation = moments_of(rigid_scene(ball, effects=effects, dt=0.01, duration=0.06, cloth=sheet))
    world, x = simulation._session.built.world, simulation._state.positions
    body, rows, surface = world.rigid[0], world.coordinate_slices[0], world.rigid_slices[0]
    assert x[surface] == pytest.approx(body.offset + body.weights @ x[rows], abs=1e-12)
    assert found[-1].strain < 1e-3


def test_a_block_just_above_a_floor_is_not_thrown_up_by_the_cell_of_a_cloth():
    sheet = {"name": "sheet", "mesh": "rectangle", "size": [1, 1], "cells": [10, 10], "position": [3, 0, 0.5]}
    block = {"name": "block", "mesh": "slab", "size": [0.1, 0.1, 0.1], "position": [0, 0, 0.0505], "density": 500}
    effects = EFFECTS | {"body_contact": {}}
    simulation = Simulation(rigid_scene(block, FLOOR, effects, cloth=sheet, tolerance=1e-3))
    heights = [state.bodies["block"][:, 2].min() for state in simulation]
    assert min(heights) > 0
    assert max(heights) < 0.001  # 16 mm at the d_hat of the cloth's cells, 10 mm
