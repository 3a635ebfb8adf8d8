"""Error of a goal by triangles: what the finer mesh changes, on cloths at rest."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from analytic_study import SHEET, Runners

from clothsim import InputError, Scene, simulate
from clothsim.cli import main
from clothsim.gradients.losses import Height, border_sides, hem_loss
from clothsim.gradients.state_at_rest import StateAtRest
from clothsim.mesh.generators.shapes import disk, rectangle, tube
from clothsim.scene.assembly.refinement import with_cells
from clothsim.study import pictures
from clothsim.study.goal_report import NamedGoal, goal_error, goal_lines, goal_report
from clothsim.study.parameters import PARAMETERS
from clothsim.study.points import BASE, Bench, point
from clothsim.study.study import study_accuracy

SOFT = {"youngs_modulus": 1e4, "bending_stiffness": 2e-3, "density": 0.15, "thickness": 3e-4}
TOP, ENDS = {"select": "top"}, {"group": [{"select": "left"}, {"select": "right"}]}
REST = {"membrane": {}, "bending": {}, "gravity": {}}


def hanging(size, cells, rotation, pins, effects=REST):
    cloth = {"mesh": "rectangle", "size": size, "cells": cells, "rotation_degrees": rotation}
    solver = {"dt": 0.1, "threads": 1, "tolerance": 1e-6}
    run = {"duration": 0.5, "frames_per_second": 10}
    return Scene(cloth=cloth | SOFT, effects=effects | {"pins": pins}, solver=solver, run=run)


SCENES = {
    "strip from an edge": hanging([0.1, 0.3], [2, 6], [90, 0, 0], TOP),
    "strip that sags": hanging([0.3, 0.1], [6, 2], [0, 0, 0], ENDS),
    "square from two corners": hanging([0.3, 0.3], [6, 6], [60, 0, 0], {"select": [6, 48]}),
}


def found_in(scene, goal=hem_loss):
    finer = with_cells(scene, 2)
    return goal_error(scene, simulate(scene).positions(-1), finer, simulate(finer).positions(-1), goal)


@pytest.fixture(scope="module")
def square():
    return found_in(SCENES["square from two corners"])


@pytest.mark.parametrize("name", ["strip from an edge", "strip that sags"])
def test_the_parts_sum_to_the_difference(name):
    found = found_in(SCENES[name], hem_loss if "edge" in name else lambda world: Height())
    assert abs(found.true) > 1e-6
    assert 0.9 < found.effectivity < 1.1
    assert abs(found.estimated) <= found.by_triangle.sum()
    if "edge" in name:  # the parts have one sign, but those of membrane and bending in a sagging strip have not
        assert found.by_triangle.sum() < 6 * abs(found.estimated)


def test_point_pins_make_the_error_of_a_hem(square):
    assert 0.5 < square.effectivity < 2.0
    middles = square.positions[square.triangles].mean(axis=1)
    pins = square.positions[[6, 48]]
    near = np.linalg.norm(middles[:, None] - pins, axis=2).min(axis=1) < 0.08
    there = square.by_triangle[near].sum() / square.by_triangle.sum()
    assert there > 0.25
    assert there > 5 * square.areas[near].sum() / square.areas.sum()
    assert square.area_of(0.5) < square.area_of(0.9) <= 1.0


def test_a_mesh_that_is_no_finer_has_no_error():
    scene = SCENES["strip from an edge"]
    ends = simulate(scene).positions(-1)
    found = goal_error(scene, ends, scene, ends, hem_loss)
    assert found.true == 0.0
    assert np.abs(found.by_vertex).max() < 1e-12
    assert np.isnan(found.effectivity)


def test_powers_sum_to_that_of_the_force():
    scene = hanging([0.3, 0.1], [6, 2], [0, 0, 0], {"select": "left", "clamp": True})  # with ghosts
    for model in ("midedge", "hinge"):
        own = replace(scene, effects=scene.effects | {"bending": {"model": model}})
        made = StateAtRest.of_scene(own, simulate(own).positions(-1))
        rng = np.random.default_rng(0)
        x = made.x + 1e-3 * rng.standard_normal(made.x.shape)
        velocities = rng.standard_normal(made.x.shape)
        velocities[made.world.n_cloth :] = 0.0
        wanted = float(np.vdot(made.potential.gradient(x), velocities))
        assert made.powers(x, velocities, made.world.n_cloth).sum() == pytest.approx(wanted, rel=1e-10)


def test_sides_of_borders():
    assert sorted(map(len, border_sides(*rectangle(cells=(5, 3))))) == [4, 4, 6, 6]
    assert len(border_sides(*disk(cells=4))) == 1
    assert len(border_sides(*tube(cells=(6, 3)))) == 2  # however few cells are around it


def test_what_has_no_error_by_triangles(tmp_path, capsys):
    scene = SCENES["strip from an edge"]
    ends = np.zeros((21, 3))
    below = {"name": "b", "mesh": "sphere", "position": [0, 0, -5]}
    for effects in ({"inertia": {}}, {"body_contact": {}, "friction": {}}):
        other = replace(scene, effects=scene.effects | effects, body=below)
        with pytest.raises(InputError, match=next(reversed(effects))):
            StateAtRest.of_scene(other, ends)
    rigid: Any = SimpleNamespace(energies={}, world=SimpleNamespace(rigid=("button",)))
    with pytest.raises(InputError, match="rigid"):
        StateAtRest.refuse_history(rigid)
    with pytest.raises(InputError, match="cells"):
        study_accuracy(scene, tmp_path / "no", ["dt"], runners=Runners(), goal=NamedGoal("hem", hem_loss))
    assert not (tmp_path / "no" / "study.json").exists()
    file = tmp_path / "scene.toml"
    file.write_text('[cloth]\nmesh = "rectangle"\n[effects.membrane]\n')
    assert main(["study", str(file), "--goal", "hemline"]) == 2
    assert "hemline" in capsys.readouterr().err


def test_report_of_a_goal(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(pictures, "draw", lambda file, surfaces, **keys: drawn.append((file, surfaces, keys)))
    scene, finer = SCENES["strip from an edge"], point({"cells": 1})
    bench = Bench(scene, scene, {"cells": PARAMETERS["cells"]})
    ends = {where: simulate(bench.scene(where)).positions(-1) for where in (BASE, finer)}
    gatherer: Any = SimpleNamespace(
        bench=bench, outcomes=ends, good=lambda where: True, own_positions=ends.get, directory=tmp_path
    )
    goal = goal_report(gatherer, NamedGoal("hem", hem_loss))
    assert goal["failed"] == ""
    assert goal["cells"] == [4, 12]
    assert goal["believed"]
    assert goal["finer"] - goal["value"] == pytest.approx(goal["difference"])
    with np.load(tmp_path / "goal.npz") as arrays:
        assert arrays["by_triangle"].shape == (24,)
        assert arrays["by_vertex"].sum() == pytest.approx(goal["estimated"])
    (file, [surface], keys), *others = drawn
    assert (file, others) == (tmp_path / "goal.png", [])
    assert keys["smooth"] is False
    assert 0.0 <= surface.values.min() < 1.0 < surface.values.max()
    assert len(goal_lines(goal)) == 2
    assert len(goal_lines(goal | {"believed": False})) == 3
    del ends[finer]
    assert goal_report(gatherer, NamedGoal("hem", hem_loss))["failed"]


def test_a_study_with_a_goal(tmp_path, monkeypatch):
    monkeypatch.setattr(
        "clothsim.study.study.goal_report", lambda gatherer, goal: {"name": goal.name, "failed": "a reason"}
    )
    scene = replace(SHEET, effects={"membrane": {}, "gravity": {}, "pins": TOP})
    goal = NamedGoal("hem", hem_loss)
    done = study_accuracy(scene, tmp_path, ["cells"], budget=1e9, workers=1, runners=Runners(), goal=goal)
    assert done.result["goal"] == {"name": "hem", "failed": "a reason"}
    assert "a reason" in str(done)
