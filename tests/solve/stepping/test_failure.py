"""Failures: cause, element by name, position, remedy; infeasible motions (docs/results/hard_cases.md, B9, B20, B21)."""

import numpy as np
import pytest
from effect_builders import pins
from meshes import cloth, grid
from small_scenes import BALL, EFFECTS, RUN, SHEET, SOLVER, small_scene, without

from clothsim import resume, simulate
from clothsim.mesh.body import make_body
from clothsim.mesh.world import make_world
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.solve.newton.outcome import Ending
from clothsim.solve.stepping.failure import Cause, _resist, simplex_name, vertex_name
from clothsim.solve.stepping.stepping import MOST_BLOCKED

D_HAT = 0.01


def press(stop):
    """A sheet on a table, and a press that comes down to `stop` above the table within the run."""
    motion = {"velocity": [0.0, 0.0, (stop - 0.05) / RUN["duration"]]}
    return small_scene(
        cloth={**SHEET, "size": [0.5, 0.5], "position": [0.0, 0.0, 0.008]},
        body=[
            {"name": "press", "mesh": "slab", "size": [1, 1, 0.1], "position": [0, 0, 0.10], "motion": motion},
            {"name": "table", "mesh": "slab", "size": [1, 1, 0.1], "position": [0, 0, -0.05]},
        ],
        effects=EFFECTS | {"body_contact": {"d_hat": D_HAT}},
    )


def edges_together(speed):
    """The left and the right edge of a sheet, driven into one another."""
    groups = [
        {"select": side, "motion": {"velocity": [sign * speed, 0.0, 0.0]}}
        for side, sign in (("left", 1), ("right", -1))
    ]
    effects = without("body_contact", "gravity") | {"self_contact": {}, "pins": {"group": groups}}
    return small_scene(body=(), effects=effects)


def test_a_press_that_leaves_half_of_d_hat_closes(tmp_path):
    run = simulate(press(0.5 * D_HAT), tmp_path)
    assert run.status == "completed", run.reason
    assert run.summary["failure"] is None
    assert 0 < run.summary["certificate"]["minimum_gap"] <= 0.25 * D_HAT


def test_a_press_that_goes_past_the_table_fails_and_names_the_pinch(tmp_path):
    run = simulate(press(-0.01), tmp_path)
    failure = run.summary["failure"]
    assert run.status == "failed"
    assert failure["cause"] == Cause.BLOCKED
    assert all(name in failure["sentence"] for name in ("cloth", "press", "table"))
    assert "of cloth and " in failure["element"]
    assert {"press", "table"} <= set(failure["remedy"].replace(",", " ").split())
    assert abs(failure["position"][2]) < 1e-6
    assert np.abs(failure["position"][:2]).max() <= 0.26
    assert failure["time"] == pytest.approx(RUN["duration"] * 5 / 6, abs=RUN["duration"] / 8)


def test_two_groups_of_pins_driven_into_one_another_are_infeasible_and_end_soon(tmp_path):
    run = simulate(edges_together(4.0), tmp_path)
    failure = run.summary["failure"]
    assert run.status == "failed"
    assert failure["cause"] == Cause.BLOCKED
    assert f"{MOST_BLOCKED} tries" in run.reason
    assert "pins.group[0] and pins.group[1]" in failure["remedy"]
    assert abs(failure["position"][0]) < 0.01
    assert failure["dt"] > SOLVER["dt"] / 2**6
    assert sum(len(entry["failures"]) for entry in run.record()) < 8


def test_pins_driven_into_a_body_name_both(tmp_path):
    held = {"select": [12], "motion": {"velocity": [0.0, 0.0, -0.5]}}
    run = simulate(small_scene(effects=without("gravity") | {"pins": held}), tmp_path)
    failure = run.summary["failure"]
    assert failure["element"].startswith("vertex 12 of cloth (pins) and ")
    assert failure["element"].endswith(" of ball")
    assert failure["position"] == pytest.approx([0, 0, 0.3], abs=1e-6)
    assert {"pins", "ball"} <= set(failure["remedy"].replace(",", " ").split())
    assert failure["dt"] > SOLVER["dt"] / 2**6
    assert run.reason.startswith(f"At {failure['time']:.4g} s: {failure['sentence']}")


def test_a_body_that_would_cross_the_cloth_in_one_step_takes_it_along(tmp_path):
    """B20: two metres a step at the first dt, right through a sheet that is held at its border."""
    ball = BALL | {"position": [0.0, 0.0, -1.0], "motion": {"velocity": [0.0, 0.0, 100.0]}}
    scene = small_scene(body=ball, effects=EFFECTS | {"pins": {"select": "boundary"}}, run={**RUN, "duration": 0.04})
    run = simulate(scene, tmp_path)
    assert run.summary["certificate"]["intersection_free"]
    assert run.positions(-1)[12, 2] > run.bodies(-1)[0][1][:, 2].max() > 2.0


def test_a_failed_run_resumed_fails_again_at_once(tmp_path):
    first = simulate(press(-0.01), tmp_path)
    steps = first.summary["steps"]
    again = resume(tmp_path)
    assert again.summary["failure"] == first.summary["failure"]
    assert again.reason == first.reason
    assert again.summary["steps"] == steps == len(again.record())
    assert len(again.times) == len(first.times)


def test_newtons_ends_carry_the_vertex_by_its_name(tmp_path):
    scene = small_scene(
        cloth=[{**SHEET, "name": "a", "position": [5.0, 0.0, 0.0]}, {**SHEET, "name": "b"}],
        body=(),
        effects={"inertia": {}, "membrane": {}, "gravity": {}, "pins": {"select": "left"}},
        solver=SOLVER | {"max_iterations": 1},
    )
    failure = simulate(scene, tmp_path).summary["failure"]
    assert failure["cause"] == Cause.ITERATION_LIMIT
    assert failure["element"].split(" of ")[1] in ("a", "b")
    assert 0 <= int(failure["element"].split()[1]) < 25
    assert failure["element"] in failure["sentence"]
    assert "solver.max_iterations" in failure["remedy"]


def test_rows_have_names():
    positions, triangles = grid(1, 1)
    floor = make_body("floor", np.array([[0.0, 0, -1], [1, 0, -1], [0, 1, -1]]), np.array([[0, 1, 2]]))
    world = make_world([cloth(positions, triangles, name="a"), cloth(positions, triangles, name="b")], [floor])
    world, held = pins(world, select=[5], group=[{"select": [1], "clamp": False}])
    assert vertex_name(world, [held], 5) == "vertex 1 of b (pins)"
    assert vertex_name(world, [held], 1) == "vertex 1 of a (pins.group[0])"
    assert vertex_name(world, [held], 8) == "vertex 0 of floor"
    assert simplex_name(world, [held], np.array([10, 8, 9])) == "triangle 0 of floor"
    assert simplex_name(world, [held], np.array([4, 6])) == "edge 0-2 of b"


def test_every_end_but_convergence_is_a_cause():
    ends = {ending.name for ending in Ending if ending is not Ending.CONVERGED}
    assert {cause.name for cause in Cause} == {*ends, Cause.INTERSECTION.name, Cause.BUDGET.name}


@pytest.mark.parametrize(
    ("given", "named", "unnamed"),
    [
        ({"membrane": {}, "pins": {"select": [0]}}, ["effects.inertia"], ["effects.pins", "effects.membrane"]),
        ({"inertia": {}, "membrane": {}, "pins": {"select": [0]}}, ["solver.dt"], ["effects."]),
        ({"bending": {}}, ["effects.inertia", "effects.pins", "effects.membrane"], []),
    ],
)
def test_a_remedy_names_no_effect_that_the_scene_has(given, named, unnamed):
    integrator = prepare(scene := small_scene(body=(), effects=given), build(scene)).integrator
    remedy = _resist(integrator.potential, integrator.constraints.values(), "inertia" in given)
    assert all(name in remedy for name in named)
    assert not any(name in remedy for name in unnamed)
