"""run.until = "rest": the end of a run, resumed runs, stepping by hand, the limit."""

import numpy as np
import pytest

from clothsim import Scene, Simulation, open_run, resume, simulate
from clothsim.files.meshes.readers.obj import write_obj

CLOTH = {"mesh": "rectangle", "size": [0.1, 0.1], "cells": [2, 2], "rotation_degrees": [60, 0, 0]}
"""A sheet that hangs by its left edge and swings into the vertical plane."""
EFFECTS = {
    "inertia": {},
    "membrane": {},
    "bending": {},
    "gravity": {},
    "damping": {"rate": 20.0},
    "pins": {"select": "top"},
}
SOLVER = {"dt": 0.02, "threads": 1, "linear": "superlu"}
LIMIT = 4.0


class StoppedError(Exception):
    """Raised by a listener to stop a run."""


def swinging(until="rest", duration=LIMIT, effects=EFFECTS, **run):
    settings = {"duration": duration, "frames_per_second": 10, "until": until, **run}
    return Scene(cloth=CLOTH, effects=effects, solver=SOLVER, run=settings)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run that comes to rest before its limit."""
    return simulate(swinging(), tmp_path_factory.mktemp("run"))


def frames(run):
    return np.array([run.positions(k) for k in range(len(run))])


def test_the_run_ends_with_the_first_frame_at_rest(run):
    certificate = run.summary["certificate"]
    assert run.status == "completed"
    assert certificate["at_rest"] is True
    assert 0 < certificate["fastest_speed"] < 1e-3
    assert certificate["fastest_speed"] == run.record()[-1]["fastest"]
    assert 0.5 < run.times[-1] < LIMIT / 2
    assert run.times == pytest.approx(0.1 * np.arange(len(run)))


def test_the_frames_are_those_of_a_run_to_the_limit_and_the_last_is_within_a_millimetre_of_its_end(run, tmp_path):
    whole = simulate(swinging("time"), tmp_path)
    assert np.array_equal(frames(whole)[: len(run)], frames(run))
    assert np.abs(whole.positions(-1) - run.positions(-1)).max() < 1e-3
    certificate = whole.summary["certificate"]
    assert certificate["at_rest"] is True
    assert certificate["fastest_speed"] < 1e-6
    assert whole.times[-1] == pytest.approx(LIMIT)


def test_a_smaller_rest_speed_runs_longer_and_ends_nearer(run, tmp_path):
    finer = simulate(swinging(rest_speed=1e-5), tmp_path)
    assert finer.times[-1] > run.times[-1]
    assert finer.summary["certificate"]["fastest_speed"] < 1e-5


def test_the_limit_without_rest_is_no_failure(tmp_path):
    short = simulate(swinging(duration=0.3), tmp_path)
    assert short.status == "completed"
    assert short.summary["certificate"]["at_rest"] is False
    assert short.summary["certificate"]["fastest_speed"] > 0.01
    assert short.times[-1] == pytest.approx(0.3)


def test_a_resumed_run_ends_at_the_same_frame_with_the_same_bits(run, tmp_path):
    def stop(state):
        if state.time > run.times[-2] - 0.05:
            raise StoppedError

    with pytest.raises(StoppedError):
        simulate(swinging(), tmp_path, on_step=stop)
    assert open_run(tmp_path).status == "interrupted"
    resumed = resume(tmp_path)
    assert np.array_equal(frames(resumed), frames(run))
    assert resumed.summary["certificate"] == run.summary["certificate"]
    again = resume(tmp_path)
    assert again.summary["steps"] == run.summary["steps"]
    assert again.summary["certificate"] == run.summary["certificate"]


def test_stepping_by_hand_ends_at_rest_and_goes_on_after_a_change(run, tmp_path):
    simulation = Simulation(swinging())
    states = list(simulation)
    assert [state.at_rest for state in states] == [False] * (len(states) - 1) + [True]
    assert np.array_equal(states[-1].positions["cloth"], run.positions(-1))
    assert simulation.finished
    simulation.save(tmp_path / "rest.npz")
    assert Simulation.restore(tmp_path / "rest.npz").finished
    simulation.gravity = (0.0, 5.0, 0.0)
    assert not simulation.finished
    more = list(simulation)
    assert more[-1].at_rest
    assert more[-1].time < LIMIT
    assert more[-1].positions["cloth"][:, 1].mean() > states[-1].positions["cloth"][:, 1].mean() + 0.02


def draped(folder, **sections):
    """A sheet on a ball with friction: vertices of the ball touch its triangles, which tilt."""
    cloth = {"mesh": "rectangle", "size": [0.3, 0.3], "cells": [8, 8], "position": [0.01, 0.02, 0.16]}
    scene = Scene(
        cloth={**cloth, "rotation_degrees": [0, 0, 15], "fabric": "cotton"},
        body={"mesh": "sphere", "radius": 0.15, "subdivisions": 3},
        effects={"inertia": {}, "membrane": {}, "bending": {}, "gravity": {}, "damping": {"rate": 4.0},
                 "body_contact": {}, "friction": {"coefficient": 0.5}},
        solver={**SOLVER, "dt": 0.05},
        run={"duration": 4.0, "frames_per_second": 10, "until": "rest"},
        **sections,
    )  # fmt: skip
    return simulate(scene, folder)


def test_a_drape_with_friction_comes_to_rest_and_from_its_own_end_stays(tmp_path):
    first = draped(tmp_path / "first")
    assert first.summary["certificate"]["at_rest"] is True
    triangles = first.trajectory.surfaces[0].own_triangles
    seed = {"from": "file", "file": str(write_obj(tmp_path / "end.obj", first.positions(-1), triangles))}
    again = draped(tmp_path / "again", seed=seed)
    assert again.summary["certificate"]["at_rest"] is True
    first_step, *others = (entry["newton_iterations"] for entry in again.record())
    assert first_step <= 3  # friction that a mesh does not hold is searched again
    assert set(others) == {1}
    assert len(again.record()) < 20
    assert np.linalg.norm(frames(again) - first.positions(-1), axis=2).max() < 2e-4


def test_a_quasi_static_run_is_at_rest_once_its_loads_are_complete(tmp_path):
    static = {name: keys for name, keys in EFFECTS.items() if name not in ("inertia", "damping")}
    run = simulate(swinging(duration=1.0, effects=static), tmp_path)
    assert run.times[-1] == pytest.approx(1.0)
    assert run.summary["certificate"]["at_rest"] is True
    assert run.summary["certificate"]["fastest_speed"] is None
