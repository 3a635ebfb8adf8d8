"""`contact.backend = "ipctk"` from a scene file to the frames: certified runs, the same motion as by numba."""

import sys

import numpy as np
import pytest

from clothsim import simulate
from clothsim.base.errors import MissingPackageError
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.contact.ipctk_barrier import IpctkBarrier
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.toml_file import load_scene

SCENES = {
    "body": """
[cloth]
mesh = "rectangle"
size = [0.2, 0.2]
cells = [4, 4]
position = [0.003, 0.004, 0.054]
velocity = [0.1, 0.0, -0.3]
[[body]]
name = "ball"
mesh = "sphere"
radius = 0.05
[effects.inertia]
[effects.membrane]
[effects.bending]
[effects.gravity]
[effects.body_contact]
d_hat = 5e-3
[effects.friction]
coefficient = 0.3
[effects.self_contact]
d_hat = 5e-3
""",
    "two cloths": """
[[cloth]]
name = "low"
mesh = "rectangle"
size = [0.2, 0.2]
cells = [4, 4]
[[cloth]]
name = "high"
mesh = "rectangle"
size = [0.15, 0.15]
cells = [3, 3]
position = [0.003, 0.004, 0.006]
velocity = [0.1, 0.0, -0.3]
[effects.inertia]
[effects.membrane]
[effects.bending]
[effects.self_contact]
d_hat = 5e-3
[effects.friction]
coefficient = 0.3
""",
}
REST = """
[solver]
dt = 0.01
tolerance = 1e-6
linear = "superlu"
[run]
duration = 0.04
frames_per_second = 100
"""


def scene_with(backend, name, folder):
    file = folder / f"{backend}.toml"
    file.write_text(f'{SCENES[name]}{REST}[contact]\nbackend = "{backend}"\n', encoding="utf-8")
    return load_scene(file)


@pytest.mark.parametrize("scene", SCENES)
def test_both_backends_give_the_same_motion(scene, tmp_path):
    backends = "numba", "ipctk"
    runs = {backend: simulate(scene_with(backend, scene, tmp_path), tmp_path / backend) for backend in backends}
    effect = "body_contact" if scene == "body" else "self_contact"
    for run in runs.values():
        assert run.status == "completed", run.reason
        assert run.summary["certificate"]["intersection_free"] is True
        assert run.summary["certificate"]["minimum_gap"] > 0
        assert run.summary["effects"][effect]["pairs"] > 0
        assert run.summary["effects"][effect]["ccd_calls"] > 0
    frames = {name: np.array([run.positions(k) for k in range(len(run.times))]) for name, run in runs.items()}
    moved = np.abs(frames["numba"][-1] - frames["numba"][0]).max()
    free = np.abs(frames["numba"][-1] - frames["numba"][0] - 0.04 * np.array([0.1, 0.0, -0.3])).max()
    assert min(moved, free) > 1e-3  # contact has turned the motion
    # each step ends within tolerance times dt of its solution, wherever the two paths come from
    assert np.abs(frames["numba"] - frames["ipctk"]).max() < 1e-4 * moved


@pytest.mark.parametrize(("backend", "kind"), [("auto", Barrier), ("numba", Barrier), ("ipctk", IpctkBarrier)])
def test_backend_key_applies_to_every_contact_effect(backend, kind, tmp_path):
    energies = build(scene_with(backend, "body", tmp_path)).energies
    assert {type(energies[name]) for name in ("body_contact", "self_contact")} == {kind}


def test_without_ipctk_its_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "ipctk", None)
    monkeypatch.delitem(sys.modules, "clothsim.physics.contact.ipctk_barrier")
    with pytest.raises(MissingPackageError) as caught:
        build(scene_with("ipctk", "body", tmp_path))
    assert "contact.backend" in caught.value.sentence
    assert "clothsim[oracle]" in caught.value.remedy
