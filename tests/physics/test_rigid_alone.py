"""Scenes of rigid bodies without cloth: the same motion as beside a cloth, every door of a run."""

import subprocess
import sys

import numpy as np
import pytest
from rigid_scenes import ASIDE, WEIGHTLESS, moments_of, momentum, rigid_scene

from clothsim import InputError, Scene, check, load_scene, open_run, resume, simulate
from clothsim.run.frames import Colouring

FLOOR = {"name": "floor", "mesh": "slab", "size": [1, 1, 0.02], "position": [0, 0, -0.01]}
BLOCK = {"name": "block", "mesh": "slab", "size": [0.1, 0.1, 0.1], "position": [0, 0, 0.0505]}
ON = {"inertia": {}, "gravity": {}, "body_contact": {}}


def centre_heights(scene):
    moments, _ = moments_of(scene)
    return np.array([moment.centre[2] for moment in moments])


def test_a_block_half_a_millimetre_above_a_floor_is_not_thrown():
    """Its cells of 10 cm would make d_hat a centimetre: it was thrown 56 mm up in .15 s."""
    heights = centre_heights(rigid_scene(BLOCK, FLOOR, ON, cloth=(), duration=0.15))
    assert heights.min() > 0.05
    assert heights.max() < 0.0505 + 5e-4


def test_it_moves_as_beside_a_cloth():
    effects = ON | {"body_contact": {"d_hat": 1e-3}, "friction": {"coefficient": 0.3, "elastic_slip": 1e-5}}
    pushed = {**BLOCK, "velocity": [0.3, 0, 0], "position": [0, 0, 0.0512]}
    alone, beside = (
        moments_of(rigid_scene(pushed, FLOOR, effects, cloth=cloth))[0][-1].centre for cloth in ((), ASIDE)
    )
    assert alone[:2] == pytest.approx(beside[:2], abs=2e-4)  # the height follows the stiffness of the barrier
    assert 0 < alone[0] < 0.03


def test_a_free_body_keeps_its_momentum():
    thrown = {**BLOCK, "velocity": [0.1, 0, 0.2], "spin_degrees_per_second": [0, 90, 0]}
    moments, simulation = moments_of(rigid_scene(thrown, effects=WEIGHTLESS, cloth=()))
    linear, _, _ = momentum(simulation)
    assert linear == pytest.approx(np.array([0.1, 0, 0.2]) * simulation._session.built.world.rigid[0].mass, rel=1e-6)
    assert moments[-1].strain < 1e-3


def test_every_door_of_a_run(tmp_path):
    scene = rigid_scene(BLOCK, FLOOR, ON, cloth=())
    assert check(scene) == [] or {finding.severity for finding in check(scene)} == {"warning"}
    run = simulate(scene, tmp_path / "run")
    assert run.status == "completed"
    assert run.summary["certificate"]["cloth_body"] == "no cloth"
    assert run.intersection_free
    assert run.summary["certificate"]["stretch_min"] is None
    assert len(run.positions(-1)) == 0
    assert [name for name, _, _ in run.bodies(-1)] == ["floor", "block"]
    assert Colouring.names(run) == ["plain"]
    assert len(Colouring.of_run(run, "plain").mesh(-1).positions) == 16
    done = run.export(tmp_path / "run.glb")
    assert done.files[0].stat().st_size > 1000
    assert check(tmp_path / "run") == []
    assert resume(tmp_path / "run").status == "completed"
    assert open_run(tmp_path / "run").scene.rigid == scene.rigid


def test_a_scene_file_of_rigid_bodies_alone(tmp_path):
    rigid = "[[rigid]]\nmesh = 'slab'\nsize = [0.1, 0.1, 0.1]\n[effects.inertia]\n[effects.gravity]\n"
    (tmp_path / "scene.toml").write_text(rigid + "[run]\nduration = 0.02\nframes_per_second = 50\n")
    assert load_scene(tmp_path / "scene.toml").cloths == ()
    command = [sys.executable, "-m", "clothsim", "run", "scene.toml", "-o", "out", "--quiet"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "Warning" not in done.stderr
    assert (tmp_path / "out" / "picture.png").is_file()


@pytest.mark.parametrize("asked", [{"solver": {"error": 1e-3}}, {"solver": {"estimate": True}}, {}])
def test_measures_of_cloth_are_refused(tmp_path, asked):
    scene = Scene(rigid=BLOCK, effects={"inertia": {}, "gravity": {}}, run={"duration": 0.02}, **asked)
    with pytest.raises(InputError, match="no cloth"):
        simulate(scene, tmp_path, differentiable=not asked)


def test_neither_cloth_nor_rigid_body_is_refused(tmp_path):
    (tmp_path / "scene.toml").write_text("[effects.inertia]\n")
    with pytest.raises(InputError, match="cloth"):
        load_scene(tmp_path / "scene.toml")
    with pytest.raises(InputError, match="cloth"):
        simulate(Scene(body=FLOOR, effects={"inertia": {}, "gravity": {}}), tmp_path / "out")
