"""Other simulators: the scene that they get, what is counted in their frames, and a peer that is not installed."""

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from clothsim.base.errors import InputError
from tests.benchmarks.peers import peer_process
from tests.benchmarks.peers.__main__ import PEERS, intersections, main, measured
from tests.benchmarks.peers.peer_scene import Simulation, read_scene
from tests.benchmarks.peers.shared_sheet import shared_sheet

STEPS = 3


@pytest.fixture(scope="module")
def scene():
    return shared_sheet(4, STEPS * 0.02)


def test_the_scene_is_the_cotton_of_the_benchmark(scene):
    assert scene.positions.shape == (25, 3)
    assert scene.triangles.shape == (32, 3)
    assert scene.positions[:, 2] == pytest.approx(0.35)
    assert (scene.density, scene.poisson, scene.bending) == pytest.approx((0.15, 0.243, 9.2e-6))
    assert scene.stretch == pytest.approx(0.821e6 * 0.318e-3)
    assert (scene.dt, scene.steps, scene.friction) == (0.02, STEPS, 0.4)
    assert np.linalg.norm(scene.ball_positions, axis=1).max() <= scene.radius * (1 + 1e-12)


def test_stiffness_of_the_equivalent_shell(scene):
    young, thickness = scene.shell
    assert young * thickness == pytest.approx(scene.stretch)
    assert young * thickness**3 / (12 * (1 - scene.poisson**2)) == pytest.approx(scene.bending)
    mu, lam = scene.lame
    assert lam / (2 * mu + lam) == pytest.approx(scene.poisson)


def test_a_scene_survives_its_file(scene, tmp_path):
    scene.write(tmp_path / "scene.npz")
    read = read_scene(tmp_path / "scene.npz")
    assert np.array_equal(read.positions, scene.positions)
    assert np.array_equal(read.ball_triangles, scene.ball_triangles)
    assert (type(read.steps), read.steps, read.bending) == (int, STEPS, scene.bending)


def test_what_intersects_is_counted(scene):
    above = scene.positions
    through = above - [0.0, 0.0, 0.35]
    result = intersections(scene, np.array([above, through, above]))
    assert (result["own"], result["ball"], result["bad"]) == (0, 0, 1)
    assert result["depth"] == pytest.approx(0.3)
    assert result["lowest"] == pytest.approx(0.35)
    folded = above.copy()
    folded[:2] = [0.1, 0.13, 0.25], [0.1, 0.2, 0.45]  # the edge between them crosses the sheet
    assert intersections(scene, np.array([through]))["ball"] > 0
    assert intersections(scene, np.array([folded]))["own"] > 0


def test_a_peer_runs_in_its_process(scene, tmp_path, monkeypatch):
    made = []

    def build(given, speed=0.0):
        made.append(given.cells)
        x = np.array(given.positions)

        def step():
            x[:, 2] -= speed * given.dt

        return Simulation(step, lambda: x, "falls")

    monkeypatch.setitem(
        sys.modules, "tests.benchmarks.peers.falling_peer", SimpleNamespace(build=build, PACKAGE="numpy")
    )
    scene.write(tmp_path / "scene.npz")
    replace(scene, cells=2).write(tmp_path / "warm.npz")
    result = peer_process.run("falling_peer", tmp_path, {"speed": 0.5})
    assert made == [2, 4]
    assert (result["settings"], result["version"]) == ("falls", np.__version__)
    frames = np.load(tmp_path / "frames.npz")["frames"]
    assert frames.shape == (STEPS, 25, 3)
    assert frames[:, 0, 2] == pytest.approx([0.34, 0.33, 0.32])


def test_a_missing_package_is_named(scene, tmp_path, monkeypatch):
    def build(given):
        raise ModuleNotFoundError("No module named 'absent'", name="absent")

    monkeypatch.setitem(sys.modules, "tests.benchmarks.peers.absent_peer", SimpleNamespace(build=build))
    for name in ("scene", "warm"):
        scene.write(tmp_path / f"{name}.npz")
    assert peer_process.run("absent_peer", tmp_path, {}) == {"missing": "absent"}


def test_the_sentence_about_a_missing_package_has_the_command(scene, tmp_path):
    python = tmp_path / "python"  # stands for an interpreter with NumPy and without the peer
    python.write_text('#!/bin/sh\necho \'{"missing": "mujoco"}\' > "$4/result.json"\n', encoding="utf-8")
    python.chmod(0o755)
    with pytest.raises(InputError, match="mujoco needs the package mujoco") as caught:
        measured("mujoco", scene, str(python))
    assert "pip install 'mujoco>=4'" in caught.value.remedy


def test_clothsim_itself_is_measured(capsys):
    assert main(["clothsim", "--cells", "4", "--seconds", "0.04"]) == 0
    shown = capsys.readouterr().out
    assert "4 x 4 cells, 0.04 s" in shown
    assert "0 of 2 frames intersect" in shown


def test_every_peer_says_what_it_takes_and_lacks():
    for file, _ in PEERS.values():
        module = __import__(f"tests.benchmarks.peers.{file}", fromlist=["build"])
        assert callable(module.build)
        assert all(isinstance(getattr(module, name), str) for name in ("PACKAGE", "PIP", "CANNOT"))
