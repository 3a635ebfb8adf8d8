"""Animated bodies: their table, refused input, and cloth in contact with them."""

import re

import numpy as np
import pytest
from real_data import DATA, needs_data
from scipy.spatial.transform import Rotation
from small_scenes import SHEET, SOLVER, small_scene

import clothsim
from clothsim import InputError, Scene
from clothsim.files.meshes.mesh_file import read_mesh
from clothsim.mesh.generators.shapes import sphere
from clothsim.run.receipt import explain_scene
from clothsim.scene.assembly.scene_world import build

POSITIONS, TRIANGLES = sphere(radius=0.3, subdivisions=1)


def write_frames(folder, *shifts, squeeze=0.0, triangles=TRIANGLES):
    """The ball of `small_scene`, a frame for each shift [m]; `squeeze` flattens it from frame to frame."""
    for k, shift in enumerate(shifts):
        points = POSITIONS * [1, 1, 1 - squeeze * k] + shift
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
        (folder / f"ball{k}.obj").write_text("\n".join(lines + [f"f {a} {b} {c}" for a, b, c in triangles + 1]))
    return {"name": "ball", "frames": "ball*.obj"}


def body_of(folder, keys, **sections):
    built = build(Scene(cloth=SHEET, body=keys, effects={"membrane": {}}, directory=folder, **sections))
    return built.world.bodies[0], (*built.warnings, *built.notes)


def test_every_frame_is_placed_as_one_mesh_is(tmp_path):
    place = {"position": [1.0, 2.0, 3.0], "rotation_degrees": [20.0, 0.0, 50.0], "scale": 2.0}
    body, notes = body_of(tmp_path, write_frames(tmp_path, [0, 0, 0], [0.3, 0, 0], squeeze=0.2) | place)
    turn = Rotation.from_euler("xyz", place["rotation_degrees"], degrees=True)
    for time, fraction in ((0.0, 0.0), (0.02, 0.5), (0.04, 1.0), (7.0, 1.0)):
        points = POSITIONS * [1, 1, 1 - 0.2 * fraction] + fraction * np.array([0.3, 0, 0])
        assert np.abs(body.at(time) - turn.apply(2 * points) - place["position"]).max() < 1e-13
    assert any(re.search(r"ball.*\b2\b.*\b25\b.*0\.04 s", note) for note in notes)


def test_the_rate_is_the_scenes(tmp_path):
    body, _ = body_of(tmp_path, write_frames(tmp_path, [0, 0, 0], [1, 0, 0]) | {"frames_per_second": 10})
    assert np.abs(body.at(0.025) - POSITIONS - [0.25, 0, 0]).max() < 1e-14


def test_one_frame_is_a_still_body(tmp_path):
    body, notes = body_of(tmp_path, write_frames(tmp_path, [0, 0, 0]))
    assert body.motion.still
    assert any(re.search(r"ball.*\b1 frame\b", note) for note in notes)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"motion": {"velocity": [0, 0, 1]}}, "frames.*motion"),
        ({"mesh": "sphere"}, "frames.*mesh"),
        ({"frames": 3}, "body.frames"),
        ({"frames": "bell*.obj"}, r"'bell\*\.obj'"),
        ({"frames_per_second": 0}, "frames_per_second"),
        ({"radius": 1.0}, "'radius'"),
        ({"component": 1}, "component"),
    ],
)
def test_bad_tables_are_named(tmp_path, keys, message):
    table = write_frames(tmp_path, [0, 0, 0], [0, 0, 1]) | keys
    with pytest.raises(InputError, match=message):
        body_of(tmp_path, table)


def test_a_frame_of_another_topology_or_without_area_is_named(tmp_path):
    table = write_frames(tmp_path, [0, 0, 0], [0, 0, 1])
    lines = (tmp_path / "ball1.obj").read_text().splitlines()
    a, b, _ = TRIANGLES[0]
    flat = [*lines]
    flat[a] = flat[b]
    (tmp_path / "ball1.obj").write_text("\n".join(flat))
    with pytest.raises(InputError, match=r"ball1\.obj.*\b0\b"):
        body_of(tmp_path, table)
    (tmp_path / "ball1.obj").write_text("\n".join(lines[:-1]))
    with pytest.raises(InputError, match=r"ball1\.obj.* 79 .*ball0\.obj.* 80"):
        body_of(tmp_path, table)


@pytest.mark.parametrize(("dt", "reported"), [(0.04, False), (0.02, False), (0.05, True)])
def test_steps_longer_than_a_frame_are_reported(tmp_path, dt, reported):
    table = write_frames(tmp_path, [0, 0, 0], [0, 0, 1])
    _, notes = body_of(tmp_path, table, solver={"dt": dt}, run={"frames_per_second": 5})
    assert any("0.05 s" in note and "0.04 s" in note for note in notes) == reported


def animated(folder, *shifts, squeeze=0.0, **sections):
    return small_scene(body=write_frames(folder, *shifts, squeeze=squeeze), directory=folder, **sections)


RISING = ([0, 0, 0], [0, 0, 0.02], [0, 0, 0.05])


def test_a_run_with_an_animated_body(tmp_path):
    scene = animated(tmp_path, *RISING, squeeze=0.02)
    run = clothsim.simulate(scene, tmp_path / "run")
    assert run.status == "completed", run.reason
    certificate = run.summary["certificate"]
    assert certificate["intersection_free"]
    assert certificate["energy_drift"] == "bodies, pins or wind do work"
    for frame in range(len(run.times)):
        k = min(frame, 2)
        ((_, points, _),) = run.bodies(frame)
        assert np.abs(points - POSITIONS * [1, 1, 1 - 0.02 * k] - RISING[k]).max() < 1e-6
    assert run.positions(-1)[:, 2].max() > points[:, 2].max() > 0.33


def test_a_stopped_run_goes_on_as_if_it_had_not_been(tmp_path):
    class StoppedError(Exception):
        pass

    def stop(progress):
        if progress.time > 0.07:
            raise StoppedError

    scene = animated(tmp_path, *RISING)
    whole = clothsim.simulate(scene, tmp_path / "whole")
    with pytest.raises(StoppedError):
        clothsim.simulate(scene, tmp_path / "stopped", progress=stop)
    again = clothsim.resume(tmp_path / "stopped")
    for frame in range(len(whole.times)):
        assert np.array_equal(again.positions(frame), whole.positions(frame))


def test_a_body_that_leaps_through_the_cloth_in_a_frame_never_crosses_it(tmp_path):
    # the cloth flies high and may cross itself there: the scene has no self-contact
    solver = {**SOLVER, "integrator": "backward_euler", "converge": True}
    run = clothsim.simulate(animated(tmp_path, [0, 0, 0], [0, 0, 1.0], solver=solver), tmp_path / "run")
    assert run.summary["certificate"]["intersections"]["cloth_body"]["states"] == 0
    assert run.status == "completed", run.reason
    assert run.positions(-1)[:, 2].max() > 1.3


def test_the_receipt_of_a_scene_with_an_animated_body(tmp_path):
    assert explain_scene(animated(tmp_path, *RISING), steps=1).effects["body_contact"]["on"]


@needs_data
def test_the_kick(tmp_path):
    folder = DATA / "dress_on_body" / "kick"
    body, notes = body_of(folder, {"frames": "shell*.obj", "name": "kick"})
    assert len(body.positions) == 12811
    assert body.motion.displacements.shape == (21, 12811, 3)
    for frame in (7, 20):
        points = read_mesh(folder / f"shell{frame:03d}.obj").positions
        assert np.abs(body.at(frame / 25) - points).max() < 1e-12
    steps = np.linalg.norm(np.diff(body.motion.displacements, axis=0), axis=2)
    assert 0.045 < steps.max() < 0.047
    assert any("0.8 s" in note for note in notes)
