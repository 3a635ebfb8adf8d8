"""Stepping by hand: the same bits as a run, changes between steps, copies, and failures."""

import copy
import pickle
import shutil
from dataclasses import replace

import numpy as np
import pytest
from meshes import grid
from small_scenes import BALL, EFFECTS, RUN, SHEET, SOLVER, end, small_scene

from clothsim import InputError, Scene, resume, simulate
from clothsim.files.meshes.readers.obj import write_obj
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint, write_checkpoint
from clothsim.run.fields import FIELDS
from clothsim.run.simulation import Simulation
from clothsim.solve.stepping.failure import Failure

SKY = {"inertia": {}, "membrane": {}, "bending": {}, "gravity": {}, "air": {"wind": [1.0, 0.0, 0.0]}}
HELD = SKY | {"pins": {"select": [0, 4]}}
LONG = {"duration": 0.4, "frames_per_second": 25}


def flying(effects=SKY, **sections):
    return small_scene(body=(), effects=effects, **sections)


# --- stepping -------------------------------------------------------------------------------------------------------


def test_steps_have_the_bits_of_a_run():
    scene = small_scene()
    run, simulation = simulate(scene), Simulation(scene)
    frames = {0: simulation.state}
    for state in simulation:
        frames.setdefault(state.frame, state)
    assert [frames[k].time for k in sorted(frames)] == run.times.tolist()
    for k, state in frames.items():
        assert np.array_equal(state.positions["cloth"], run.positions(k))
    assert state.step == run.summary["steps"] == 8
    assert simulation.finished
    assert not list(simulation)


@pytest.mark.parametrize("friction", [{"friction": {}}, {"friction": {"eps_v": 1e-3}}, {}])
def test_a_state_holds_the_numbers_of_its_step(friction):
    """Anchors of static friction store energy beside what the other energies store."""
    scene = small_scene(effects=EFFECTS | friction)
    run, simulation = simulate(scene), Simulation(scene)
    assert (simulation.state.step, simulation.state.dt, simulation.state.energies) == (0, 0.0, {})
    for entry in run.record():
        state = simulation.step()
        assert state.newton_iterations == entry["newton_iterations"]
        assert state.minimum_gap == (entry["minimum_gap"] or np.inf)
        assert (state.time, state.dt, state.step) == (entry["time"], entry["dt"], entry["step"])
        incremental = ("inertia", "damping", "friction")
        stored = sum(value for name, value in state.energies.items() if name not in incremental)
        in_anchors = state.mechanical_energy - state.kinetic_energy - stored
        assert state.mechanical_energy == pytest.approx(entry["energy"], rel=1e-12)
        assert abs(in_anchors) < 1e-15 or in_anchors > 0.0 == ("eps_v" in friction.get("friction", {"eps_v": 0}))
    assert set(state.positions) == set(state.velocities) == {"cloth"}
    assert state.bodies["ball"].shape == (run.bodies(0)[0][1]).shape
    with pytest.raises(ValueError, match="read-only"):
        state.positions["cloth"][0] = 0.0


def test_steps_go_on_beyond_the_duration():
    short, whole = Simulation(flying()), Simulation(flying(run=LONG))
    for _ in short:
        whole.step()
    assert np.array_equal(end(short), end(whole))
    assert short.state.time > short.duration


# --- changes --------------------------------------------------------------------------------------------------------


def test_a_wind_changed_half_way_has_the_bits_of_two_runs_joined(tmp_path):
    """The first run is stopped at half its time, and its checkpoint goes on with the other scene."""

    class StoppedError(Exception):
        pass

    def stop(progress):
        if progress.step == 5:
            raise StoppedError

    first, second = flying(), flying(SKY | {"air": {"wind": [-3.0, 1.0, 0.0], "drag": 2.0}})
    with pytest.raises(StoppedError):
        simulate(first, tmp_path, progress=stop)
    saved = read_checkpoint(tmp_path / CHECKPOINT_NAME)
    write_checkpoint(tmp_path / CHECKPOINT_NAME, replace(saved, scene_text=second.to_text()))
    joined = resume(tmp_path)
    simulation = Simulation(first)
    end(simulation, saved.state.step)
    simulation.change("air", drag=2.0)
    simulation.wind = (-3.0, 1.0, 0.0)
    for state in simulation:
        assert state.time > saved.state.time
    assert saved.state.step == 4
    assert np.array_equal(state.positions["cloth"], joined.positions(-1))
    assert not np.array_equal(state.positions["cloth"], simulate(first).positions(-1))


@pytest.mark.parametrize(
    ("scene", "changed", "change"),
    [
        (flying(), flying(SKY | {"air": {"wind": [0, 4, 0]}}), lambda s: setattr(s, "wind", [0, 4, 0])),
        (
            flying(),
            flying(SKY | {"gravity": {"acceleration": [0, 1, 0]}}),
            lambda s: setattr(s, "gravity", np.array([0.0, 1.0, 0.0])),
        ),
        (
            flying(),
            flying(cloth=SHEET | {"fabric": "denim", "density": 0.2}),
            lambda s: s.set_fabric("denim", density=0.2),
        ),
        (
            small_scene(),
            small_scene(body=BALL | {"motion": {"velocity": [0, 0, 0.5], "rotate_degrees_per_second": [0, 0, 90]}}),
            lambda s: s.drive_body(
                "ball", velocity=(0, 0, 0.5), rotate_degrees_per_second=(0, 0, 90), centre=(0, 0, 0)
            ),
        ),
        (
            flying(HELD),
            flying(HELD | {"pins": {"select": [0, 4], "motion": {"velocity": [0, 0, 1], "centre": [0, 0, 0]}}}),
            lambda s: s.drive_pins(velocity=(0, 0, 1), centre=(0, 0, 0)),
        ),
    ],
    ids=["wind", "gravity", "fabric", "body", "pins"],
)
def test_a_change_at_the_start_has_the_bits_of_a_scene_that_reports_it(scene, changed, change):
    by_hand, output, as_it_was = Simulation(scene), Simulation(changed), Simulation(scene)
    change(by_hand)
    assert np.array_equal(end(by_hand), end(output))
    assert not np.array_equal(end(as_it_was), by_hand.state.positions["cloth"])


def test_what_is_changed_can_be_read():
    simulation = Simulation(flying())
    assert simulation.wind == (1.0, 0.0, 0.0)
    assert simulation.gravity == (0.0, 0.0, -9.81)
    simulation.wind = {"kind": "gust", "velocity": [2, 0, 0]}
    assert simulation.wind["kind"] == "gust"
    assert simulation.scene.effects["air"].wind is simulation.wind


def test_pins_go_where_they_are_moved_stay_there_and_are_released():
    simulation = Simulation(flying(HELD, run=LONG))
    targets = simulation.pins["pins"] + [0.0, 0.1, 0.02]
    simulation.move_pins(targets)
    for _ in range(2):
        assert np.array_equal(simulation.step().positions["cloth"][[0, 4]], targets)
    simulation.drive_pins(velocity=(0.0, 0.0, 1.0))
    assert simulation.step().positions["cloth"][[0, 4]] == pytest.approx(targets + np.array([0, 0, 0.02]), abs=1e-14)
    simulation.release_pins()
    assert simulation.pins == {}
    high = simulation.step().positions["cloth"][[0, 4], 2]
    assert simulation.step().positions["cloth"][4, 2] < high[1] + 0.02
    simulation.add_pins("hand", [12])
    there = simulation.pins["hand"]
    assert np.array_equal(simulation.step().positions["cloth"][[12]], there)
    assert np.array_equal(simulation.pins["hand"], there)


def test_a_body_goes_where_it_is_moved_and_pushes_the_cloth():
    simulation = Simulation(small_scene())
    up = simulation.state.bodies["ball"] + [0.0, 0.0, 0.06]
    simulation.move_body("ball", up)
    for _ in range(2):
        assert np.array_equal(simulation.step().bodies["ball"], up)
    assert simulation.state.positions["cloth"][12, 2] > 0.36


# --- copies ---------------------------------------------------------------------------------------------------------


def test_a_branch_goes_its_own_way():
    simulation = Simulation(flying(HELD))
    end(simulation, 2)
    branch = simulation.branch()
    assert branch.state is simulation.state
    branch.wind = (0.0, 5.0, 0.0)
    branch.release_pins()
    other, straight = end(branch), Simulation(flying(HELD))
    assert simulation.wind == (1.0, 0.0, 0.0)
    assert np.array_equal(end(simulation), end(straight, 6))
    assert not np.array_equal(other, simulation.state.positions["cloth"])


def test_a_saved_simulation_goes_on_with_the_same_bits(tmp_path):
    effects = EFFECTS | {"pins": {"select": [0, 4]}, "friction": {"coefficient": 0.4}, "plastic_bending": {}}
    scene = small_scene(effects=effects, solver=SOLVER | {"integrator": "bdf2"}, run=LONG)
    simulation = Simulation(scene)
    end(simulation, 2)
    simulation.change("friction", coefficient=0.2)
    simulation.set_fabric("denim")
    simulation.drive_body("ball", velocity=(0.1, 0.0, 0.2), rotate_degrees_per_second=(0, 0, 30))
    simulation.move_pins(simulation.pins["pins"] + 0.01)
    simulation.add_pins("middle", [12])
    end(simulation, 3)
    simulation.release_pins("middle")
    simulation.save(tmp_path / "state.npz")
    again = Simulation.restore(tmp_path / "state.npz")
    assert (again.state.time, again.state.step) == (simulation.state.time, 5)
    assert np.array_equal(end(again), end(simulation))
    assert again.scene.effects["friction"] == {"coefficient": 0.2}
    assert set(again.pins) == {"pins"}


FILES = SKY | {"damping": {"rate": "rate.npy"}}


@pytest.fixture
def with_files(tmp_path):
    """A simulation of two steps whose scene names files in a folder, and that folder."""
    folder = tmp_path / "scene"
    folder.mkdir()
    points, triangles = grid(4, 4)
    write_obj(folder / "sheet.obj", points, triangles)
    np.save(folder / "rate.npy", np.linspace(0.0, 2.0, len(triangles)))
    cloth = {"name": "cloth", "mesh": "sheet.obj", "position": [0, 0, 1]}
    scene = Scene(cloth=cloth, effects=FILES, solver=SOLVER, run=RUN, directory=folder)
    simulation = Simulation(scene)
    end(simulation, 2)
    return simulation, folder


def test_a_saved_simulation_has_its_mesh_files(tmp_path, with_files):
    """It goes on elsewhere, after the files are gone: those of the scene, and its own copy after it is read."""
    simulation, folder = with_files
    simulation.save(tmp_path / "state.npz")
    shutil.rmtree(folder)
    (tmp_path / "elsewhere").mkdir()
    moved = (tmp_path / "state.npz").rename(tmp_path / "elsewhere" / "state.npz")
    again = Simulation.restore(moved)
    moved.unlink()
    again.change("gravity", acceleration=[0, 0, -9.0])
    again.change("gravity", acceleration=[0, 0, -9.81])
    again.save(tmp_path / "twice.npz")
    twice = Simulation.restore(tmp_path / "twice.npz")
    assert str(tmp_path) not in read_checkpoint(tmp_path / "twice.npz").scene_text
    expected = end(simulation)
    assert np.array_equal(end(again), expected)
    assert np.array_equal(end(twice), expected)


def test_a_saved_file_outside_of_its_folder_is_refused(tmp_path, with_files):
    simulation, _ = with_files
    simulation.save(tmp_path / "state.npz")
    saved = read_checkpoint(tmp_path / "state.npz")
    write_checkpoint(tmp_path / "state.npz", replace(saved, files={**saved.files, "../escaped": b"x"}))
    with pytest.raises(InputError) as caught:
        Simulation.restore(tmp_path / "state.npz")
    assert "../escaped" in caught.value.sentence


def test_a_missing_file_is_named_when_it_is_saved(tmp_path, with_files):
    simulation, folder = with_files
    (folder / "rate.npy").unlink()
    with pytest.raises(InputError) as caught:
        simulation.save(tmp_path / "state.npz")
    assert "rate.npy" in caught.value.sentence
    assert not (tmp_path / "state.npz").exists()


@pytest.mark.parametrize("copied", [copy.deepcopy, copy.copy, lambda made: pickle.loads(pickle.dumps(made))])
def test_a_copy_goes_on_with_the_same_bits_and_its_own_way(copied):
    simulation = Simulation(small_scene(effects=EFFECTS | {"pins": {"select": [0, 4]}}))
    simulation.move_pins(simulation.pins["pins"] + 0.01)
    end(simulation, 2)
    again = copied(simulation)
    assert again.state.minimum_gap == simulation.state.minimum_gap
    assert again.state.energies == simulation.state.energies
    other = copied(simulation)
    other.release_pins()
    moved = end(other)
    assert np.array_equal(end(again), end(simulation))
    assert not np.array_equal(moved, simulation.state.positions["cloth"])


def test_a_failure_is_copied():
    simulation = Simulation(small_scene())
    simulation.failure = Failure("blocked", "", "vertex 3 of cloth", None, "", 2, 0.04, 0.02)
    assert copy.deepcopy(simulation).failure == simulation.failure


def test_a_copy_with_a_python_function_is_refused_and_a_branch_has_it():
    simulation = Simulation(flying())
    simulation.wind = lambda points, time: np.array([time, 0.0, 0.0])
    with pytest.raises(InputError):
        pickle.dumps(simulation)
    assert np.array_equal(end(simulation.branch()), end(simulation))


def test_a_run_can_be_gone_on_with_by_hand(tmp_path):
    run = simulate(flying(), tmp_path)
    simulation, whole = Simulation.restore(tmp_path), Simulation(flying())
    assert np.array_equal(simulation.state.positions["cloth"], run.positions(-1))
    for _ in whole:
        pass
    assert np.array_equal(end(simulation, 2), end(whole, 2))


# --- fields ---------------------------------------------------------------------------------------------------------


def test_fields_are_those_that_a_run_writes(tmp_path):
    run = simulate(small_scene(run=RUN | {"fields": list(FIELDS)}), tmp_path)
    simulation = Simulation(small_scene())
    with pytest.raises(InputError, match="contact_pressure"):
        simulation.field("contact_pressure")
    *_, state = simulation
    branch = simulation.branch()
    simulation.step()
    assert state.frame == len(run) - 1
    for name in FIELDS:
        assert np.array_equal(branch.field(name).astype(np.float32), run.field(name))
    assert not np.array_equal(simulation.field("contact_pressure"), branch.field("contact_pressure"))
