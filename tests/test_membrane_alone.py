"""Membrane-only run without the files of the other effects (docs/contributing.md)."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from import_graph import FILES, PACKAGE, home, needed, of_effects
from small_scenes import BALL, EFFECTS, SHEET, SOLVER, small_scene, without

from clothsim.mesh.topology import unique_edges
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.effects import EFFECTS as TABLE
from clothsim.solve.stepping.state import first_state
from clothsim.solve.stepping.time_loop import steps

ALONE = ("inertia", "membrane")
RUN = """
import json, sys
from importlib.abc import MetaPathFinder
from pathlib import Path

class Gone(MetaPathFinder):
    names = set(json.loads(Path("gone.json").read_text()))

    def find_spec(self, name, path=None, target=None):
        if name in self.names:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Gone())
import clothsim

scene = clothsim.Scene(**json.loads(Path("scene.json").read_text()))
run = clothsim.simulate(scene, "out")
assert run.status == "completed", run.reason
counters = {
    name: {key: number for key, number in account.items() if key not in ("seconds", "parts")}
    for name, account in run.summary["effects"].items()
}
told = {
    "from": str(Path(clothsim.__file__).parent),
    "effects": counters,
    "iterations": [step["newton_iterations"] for step in run.record()],
    "linear_solves": run.summary["linear_solves"],
    "positions": [run.positions(k).tobytes().hex() for k in range(len(run.times))],
    "modules": sorted(sys.modules),
}
Path("told.json").write_text(json.dumps(told))
"""


def stretched_sheet(folder):
    """A scene of a sheet that starts stretched and out of its plane, and rings."""
    folder.mkdir()
    rng = np.random.default_rng(5)
    rows = np.stack(np.meshgrid(np.linspace(-0.6, 0.6, 5), np.linspace(-0.5, 0.5, 5), indexing="ij"), axis=2)
    points = np.column_stack([rows.reshape(-1, 2), np.zeros(25)]) + 0.02 * rng.standard_normal((25, 3))
    lines = ["v {:.6f} {:.6f} {:.6f}\n".format(*point) for point in points]
    (folder / "start.obj").write_text("".join([*lines, "f 1 2 6\n"]))  # a mesh file has a face
    scene = {
        "cloth": SHEET,
        "effects": {name: {} for name in ALONE},
        "solver": SOLVER,
        "run": {"duration": 0.1, "frames_per_second": 50},
        "seed": {"from": "file", "file": "start.obj"},
    }
    (folder / "scene.json").write_text(json.dumps(scene))


def reported(folder, gone):
    """Summary of the run in an interpreter of its own without the modules `gone`."""
    (folder / "gone.json").write_text(json.dumps(sorted(gone)))
    script = folder / "run.py"
    script.write_text(RUN)
    done = subprocess.run(
        [sys.executable, script.name],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(PACKAGE.parent), "PYTHONSAFEPATH": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    seen = json.loads((folder / "told.json").read_text())
    assert seen.pop("from") == str(PACKAGE)
    return seen, set(seen.pop("modules"))


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """The run with the whole package, and with one that lacks the files of all other effects.

    Not a copy without them: to numba that is another package, whose kernels it compiles once more.
    """
    folder = tmp_path_factory.mktemp("alone")
    gone = of_effects(FILES) - needed(*ALONE)
    assert len(gone) > len(TABLE) - len(ALONE)
    for name in ("whole", "pruned"):
        stretched_sheet(folder / name)
    return reported(folder / "whole", set()), reported(folder / "pruned", gone)


def test_a_membrane_runs_the_same_without_the_files_of_the_others(both):
    (whole, _), (pruned, _) = both
    assert whole == pruned
    assert set(whole["effects"]) == set(ALONE)
    assert sum(whole["iterations"]) > len(whole["iterations"])
    assert len(set(whole["positions"])) == len(whole["positions"])


def test_a_membrane_imports_no_module_of_the_others(both):
    (_, modules), (_, pruned) = both
    assert of_effects(modules) == needed(*ALONE)
    others = {home(name) for name in TABLE if name not in ALONE}
    assert len(others) >= len(TABLE) - len(ALONE)
    assert not others & (modules | pruned)


# --- what is not zero in the matrix ---------------------------------------------------------------------------------


def prepared(effects, **sections):
    scene = small_scene(effects=effects, **sections)
    return prepare(scene, build(scene))


def blocks(pattern):
    """The pairs (i, j), i <= j, of vertices that the matrix couples."""
    rows = np.repeat(np.arange(pattern.n_vertices), np.diff(pattern.starts))
    return set(zip(rows.tolist(), pattern.columns.tolist(), strict=True))


def rings(world):
    """The pairs of vertices that share an edge, or are opposite one another over an edge, and every vertex alone."""
    triangles = world.triangles
    edges = {tuple(sorted(edge)) for edge in unique_edges(triangles).tolist()}
    beside = {edge: [set(t) - set(edge) for t in triangles.tolist() if set(edge) <= set(t)] for edge in edges}
    across = {tuple(sorted([*a, *b])) for a, b in (pair for pair in beside.values() if len(pair) == 2)}
    alone = {(i, i) for i in range(world.n_cloth)}
    return edges | alone, edges | alone | across


def test_the_matrix_of_a_membrane_is_the_one_ring_and_bending_adds_the_second():
    one, two = rings(build(small_scene()).world)
    assert len(one) < len(two)
    membrane = {"inertia": {}, "membrane": {}}
    assert blocks(prepared(membrane).integrator.system.pattern) == one
    assert blocks(prepared(membrane | {"bending": {}}).integrator.system.pattern) == two


def test_the_matrix_of_a_run_has_no_block_of_contact_without_pairs():
    """Also not after steps in which contact looked for pairs and found none; with pairs it has."""
    _, two = rings(build(small_scene()).world)
    everything = EFFECTS | {"self_contact": {}, "friction": {}}
    far = prepared(everything, body=BALL | {"position": [0.0, 0.0, -50.0]})
    states = steps(far.integrator, first_state(far.built.world, 0.02), 0.16, 25)
    assert all(report.converged for report in states)
    assert blocks(far.integrator.system.pattern) == two
    assert blocks(prepared(without("body_contact"), body=()).integrator.system.pattern) == two
