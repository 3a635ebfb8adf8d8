"""Expected cost: vertices as generated, and refusal before anything is built."""

import numpy as np
import pytest
from small_scenes import BALL, RUN, SHEET, SOLVER, small_scene

from clothsim import InputError, Scene, check, simulate
from clothsim.cli import main
from clothsim.mesh.generators.table import GENERATORS
from clothsim.scene import cost as cost_module
from clothsim.scene.cost import Cost, expected_cost

FALL = {"effects": {"inertia": {}, "gravity": {}}, "body": ()}


@pytest.mark.parametrize(
    "keys",
    [
        {"mesh": "rectangle", "cells": [3, 5]},
        {"mesh": "rectangle", "cells": [3, 5], "diagonals": "crisscross"},
        {"mesh": "rectangle"},
        {"mesh": "tube", "cells": [7, 4]},
        {"mesh": "disk", "cells": 5},
        {"mesh": "pillow", "cells": 4},
        {"mesh": "slab", "cells": [2, 3, 4]},
        {"mesh": "sphere", "subdivisions": 2},
        {"mesh": "sphere"},
    ],
)
def test_the_vertices_of_a_generated_mesh_are_counted_without_it(keys):
    arguments = {key: value for key, value in keys.items() if key != "mesh"}
    scene = Scene(cloth=keys, effects={"inertia": {}})
    assert expected_cost(scene).vertices == len(GENERATORS[keys["mesh"]](**arguments)[0])


@pytest.mark.parametrize("mesh", ["shirt", "skirt", "trousers"])
def test_a_garment_has_at_most_the_vertices_expected(mesh):
    vertices = len(GENERATORS[mesh](edge=0.04)[0])
    assert (
        0.3 < vertices / expected_cost(Scene(cloth={"mesh": mesh, "edge": 0.04}, effects={"inertia": {}})).vertices <= 1
    )


def test_steps_and_frames_are_those_of_the_run(tmp_path):
    scene = small_scene(**FALL)
    cost, run = expected_cost(scene), simulate(scene, tmp_path)
    assert cost.steps == pytest.approx(run.summary["steps"])
    assert cost.frames == pytest.approx(len(run.times) - 1)
    assert not cost.notable


@pytest.mark.parametrize(
    "sections",
    [
        {"cloth": SHEET | {"cells": [4096, 4096]}},
        {"body": BALL | {"mesh": "slab", "cells": [4096, 4096, 4096]}},
        {"solver": SOLVER | {"dt": 1e-9}},
        {"run": RUN | {"frames_per_second": 1e9}},
        {"run": RUN | {"duration": 1e9}},
    ],
)
def test_what_no_machine_can_do_is_refused_before_it_is_built(tmp_path, sections):
    sections = {**FALL, **sections}
    if "radius" in sections["body"]:
        sections["body"] = {key: value for key, value in sections["body"].items() if key in ("name", "mesh", "cells")}
    scene = small_scene(**sections)

    def begun(_):
        raise AssertionError("not refused")

    with pytest.raises(InputError, match="force=True"):
        simulate(scene, tmp_path / "never", announce=begun)
    assert not (tmp_path / "never").exists()
    assert [(finding.severity, finding.kind) for finding in check(scene)] == [("error", "cost")]


@pytest.mark.parametrize(
    ("cost", "is_too_much"),
    [
        (Cost(vertices=4, body_vertices=0, steps=2e7, frames=1), True),
        (Cost(vertices=1_000_000, body_vertices=0, steps=2e4, frames=1), True),
        (Cost(vertices=1000, body_vertices=0, steps=100, frames=1e8), True),
        (Cost(vertices=2_000_000, body_vertices=0, steps=10, frames=1), True),
        (Cost(vertices=0, body_vertices=20_000_000, steps=10, frames=1), True),
        (Cost(vertices=100_000, body_vertices=100_000, steps=1e4, frames=1e4), False),
    ],
    ids=["steps", "time", "disk", "memory", "memory of bodies", "none"],
)
def test_each_bound_refuses_alone(monkeypatch, cost, is_too_much):
    monkeypatch.setattr(cost_module, "_machine_memory", lambda: 1.6e10)
    assert cost.too_much is is_too_much


def test_the_command_check_refuses_it_too(tmp_path, capsys):
    file = tmp_path / "long.toml"
    file.write_text('[cloth]\nmesh = "rectangle"\ncells = [2, 2]\n[effects.inertia]\n[solver]\ndt = 1e-9\n')
    assert main(["check", str(file)]) == 1
    assert "--force" in capsys.readouterr().out


def test_force_begins_it_all_the_same(tmp_path):
    class EnoughError(Exception):
        pass

    lines = []

    def stop(_):
        raise EnoughError

    scene = small_scene(**{**FALL, "run": RUN | {"duration": 1e9}})
    with pytest.raises(EnoughError):
        simulate(scene, tmp_path, on_step=stop, message=lines.append, force=True)
    assert len(lines) == 1


def test_a_large_run_is_announced_and_is_a_warning_of_check():
    lines, scene = [], small_scene(**{**FALL, "run": RUN | {"duration": 2e4}})

    def stop(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate(scene, on_step=stop, message=lines.append)
    assert len(lines) == 1
    found = [(finding.severity, finding.kind) for finding in check(scene)]
    assert found == [("warning", "start"), ("warning", "cost")]  # 20,000 s are asked about too


@pytest.mark.parametrize(
    "sections",
    [
        {"cloth": SHEET | {"velocity": [0, 0, 1e6]}},
        {"cloth": SHEET | {"velocity": [0, 0, 1e30]}},
        {"body": BALL | {"motion": {"velocity": [1e6, 0, 0]}}},
        {"body": BALL | {"motion": {"velocity": [1e300, 0, 0]}}},
    ],
)
def test_a_motion_over_many_sizes_of_the_scene_in_a_step_is_refused_with_contact(tmp_path, sections):
    with pytest.raises(InputError, match=r"times the size.*force=True"):
        simulate(small_scene(**sections), tmp_path / "never")
    assert not (tmp_path / "never").exists()


def test_without_contact_a_cloth_may_fly(tmp_path):
    scene = small_scene(**{**FALL, "cloth": SHEET | {"velocity": [0, 0, 1e6]}})
    run = simulate(scene, tmp_path)
    assert np.ptp(run.positions(-1)[:, 2]) < 1e-6
    assert run.positions(-1)[0, 2] == pytest.approx(1.6e5, rel=1e-3)
