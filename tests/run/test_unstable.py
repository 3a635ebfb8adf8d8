"""solver.unstable_equilibrium: what a run records, resumed runs, stepping by hand."""

import numpy as np
import pytest

from clothsim import Scene, Simulation, resume, simulate
from clothsim.files.meshes.readers.obj import obj_text
from clothsim.mesh.generators.shapes import rectangle
from clothsim.run.step_reports import Progress

LENGTH, PRESSED = 0.5, 0.8
FABRIC = {"thickness": 1e-3, "youngs_modulus": 1e6, "poisson_ratio": 0.0, "bending_stiffness": 1e-2}
EFFECTS = {
    "inertia": {},
    "membrane": {},
    "bending": {},
    "damping": {"rate": 10.0},
    "pins": {"group": [{"select": "left"}, {"select": "right"}]},
}


class StoppedError(Exception):
    """Raised by a listener to stop a run."""


@pytest.fixture
def pressed(tmp_path):
    """A function: the scene of a flat strip pressed to PRESSED of its length."""
    points, triangles = rectangle((LENGTH, 0.05), (12, 1))
    file = tmp_path / "pressed.obj"
    file.write_text(obj_text(points * [PRESSED, 1, 1], triangles), encoding="utf-8")

    def scene(effects=EFFECTS, **solver):
        settings = {"dt": 0.02, "threads": 1, "linear": "superlu"}
        return Scene(
            cloth={"mesh": "rectangle", "size": [LENGTH, 0.05], "cells": [12, 1], **FABRIC},
            effects=effects,
            solver=settings | solver,
            run={"duration": 4.0, "frames_per_second": 10.0, "until": "rest"},
            seed={"from": "file", "file": str(file)},
        )

    return scene


def frames(run):
    return np.array([run.positions(k) for k in range(len(run))])


def test_a_run_records_what_it_left(pressed, tmp_path):
    verdicts: list[Progress] = []
    run = simulate(pressed(), tmp_path / "run", progress=verdicts.append)
    found = run.summary["certificate"]["unstable_equilibria"]
    assert set(found) == {"left", "kept", "first_at", "growth_rate"}
    assert (found["left"], found["kept"]) == (1, 0)
    assert found["first_at"] == pytest.approx(0.02)
    assert found["growth_rate"] > 100
    assert run.summary["certificate"]["at_rest"] is True
    entries = [entry["unstable"] for entry in run.record()]
    assert [len(entry) for entry in entries] == [1] + [0] * (len(entries) - 1)
    entry = entries[0][0]
    assert entry["growth_rate"] == found["growth_rate"]
    assert entry["displacement"][2] != 0
    middle = run.positions(-1)[entry["vertex"], 2]
    assert np.sign(middle) == np.sign(entry["displacement"][2])
    assert [progress.verdict for progress in verdicts].count("unstable") == 1
    assert run.summary["certificate"]["step_energy_rise"] <= 1e-9


def test_a_kept_state_is_counted(pressed, tmp_path):
    run = simulate(pressed(unstable_equilibrium="keep"), tmp_path / "run")
    found = run.summary["certificate"]["unstable_equilibria"]
    assert found["left"] == 0
    assert found["kept"] >= 1
    assert not run.positions(-1)[:, 2].any()
    assert run.summary["certificate"]["at_rest"] is False  # it was true beside an unstable state
    assert run.summary["end"] != "at rest"


def test_a_run_without_any_says_so(pressed, tmp_path):
    loaded = {**EFFECTS, "gravity": {}}
    found = simulate(pressed(loaded), tmp_path / "run").summary["certificate"]["unstable_equilibria"]
    assert found == {"left": 0, "kept": 0, "first_at": None, "growth_rate": 0.0}


@pytest.mark.parametrize("integrator", ["backward_euler", "bdf2"])
def test_a_resumed_run_has_the_same_bits_and_record(pressed, tmp_path, integrator):
    scene = pressed(integrator=integrator)
    whole = simulate(scene, tmp_path / "whole")

    def stop(state):
        if state.time > 0.35:
            raise StoppedError

    with pytest.raises(StoppedError):
        simulate(scene, tmp_path / "half", on_step=stop)
    resumed = resume(tmp_path / "half")
    assert np.array_equal(frames(resumed), frames(whole))
    assert resumed.summary["certificate"] == whole.summary["certificate"]


@pytest.mark.parametrize("friction", [{}, {"friction": {}}])
def test_a_sheet_that_lies_on_a_table_keeps_its_bits(tmp_path, friction):
    """Across the edge between the two triangles of the table's face."""
    lying = {"inertia": {}, "membrane": {}, "bending": {}, "gravity": {}, "body_contact": {"d_hat": 4e-3}} | friction
    runs = [
        simulate(
            Scene(
                cloth={"mesh": "rectangle", "size": [0.3, 0.3], "cells": [4, 4], "position": [0, 0, 2e-3]},
                body={"name": "table", "mesh": "slab", "size": [2, 2, 0.1], "position": [0, 0, -0.05]},
                effects=lying,
                solver={"dt": 0.02, "threads": 1, "linear": "superlu", "unstable_equilibrium": choice},
                run={"duration": 0.8},
            ),
            tmp_path / choice,
        )
        for choice in ("leave", "keep")
    ]
    assert np.array_equal(frames(runs[0]), frames(runs[1]))
    assert runs[0].summary["certificate"]["unstable_equilibria"]["first_at"] is None
    assert runs[0].summary["certificate"]["at_rest"] is True


def test_seeds_of_a_scene_take_opposite_sides_by_hand(pressed):
    sides = []
    for seed in (0, 1):
        simulation = Simulation(pressed(perturbation_seed=seed))
        states = list(simulation)
        assert len(states[0].unstable) == 1
        assert states[-1].at_rest
        z = states[-1].positions["cloth"][:, 2]
        sides.append(z[np.abs(z).argmax()])
    assert sides[0] == pytest.approx(-sides[1], rel=1e-6)
