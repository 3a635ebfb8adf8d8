"""The page of the engine door: its code runs, and what it names is there; a problem steps as a simulation does."""

import importlib
import re
from pathlib import Path

import numpy as np
import pytest
from small_scenes import EFFECTS, small_scene

from clothsim import InputError, Simulation
from clothsim.engine import Problem, build, step
from clothsim.run.session import prepare

PAGE = (Path(__file__).parents[1] / "docs" / "engine.md").read_text(encoding="utf-8")


def test_the_code_of_the_page_gives_the_number_that_it_says(capsys):
    names = {}
    for block in re.findall(r"^```python\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE):
        exec(compile(block, "engine.md", "exec"), names)
    steps, height = capsys.readouterr().out.split()
    assert int(steps) == 100
    assert float(height) == pytest.approx(0.1 * np.cos(2.0), abs=1e-4)


def test_the_names_of_the_page_are_at_the_doors():
    rows = re.findall(r"^\| (`.*?) \|", PAGE, re.MULTILINE)
    assert len(rows) >= 9
    for row in rows:
        words = re.findall(r"`([\w.]+)`", row)
        door = words.pop(0) if words[0].startswith("clothsim.") else "clothsim.engine"
        assert {*words} <= {*importlib.import_module(door).__all__}


def test_a_problem_has_the_bits_of_a_simulation():
    run = {"duration": 0.2, "frames_per_second": 25}
    scene = small_scene(effects=EFFECTS, solver={"dt": 0.02, "threads": 1}, run=run)
    simulation = Simulation(scene)
    built = build(scene)
    own = prepare(scene, built).integrator
    linear = scene.solver_settings.linear
    problem = Problem(built.world, built.energies, built.constraints, own.dt, own.settings, own.formula, linear)
    state = problem.start()
    for _ in range(5):
        expected = simulation.step()
        frame = (state.step // 2 + 1) / 25  # a simulation divides the time to its next frame
        report = step(problem, state, until=frame)
        state = report.state
        assert report.failure is None
        (cloth,) = expected.positions.values()
        assert np.array_equal(state.positions[: len(cloth)] + built.world.origin, cloth)


@pytest.mark.parametrize(
    "wrong", [{"energies": {}}, {"energies": {"inertia": 3}}, {"dt": 0.0}, {"dt": float("nan")}, {"formula": "rk4"}]
)
def test_a_problem_that_cannot_be_stepped_is_refused(wrong):
    built = build(small_scene(effects=EFFECTS))
    with pytest.raises(InputError):
        Problem(**{"world": built.world, "energies": built.energies, **wrong})
