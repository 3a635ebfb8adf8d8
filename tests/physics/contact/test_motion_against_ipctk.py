"""The same motion with contact by ipctk, on a body and between cloths: certified runs."""

import numpy as np
import pytest
from ipctk_barrier import IpctkBarrier, by_ipctk

from clothsim import simulate
from clothsim.physics.contact import setup
from clothsim.physics.contact.setup import contact_energy
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


def scene_at(name, folder):
    file = folder / "scene.toml"
    file.write_text(f"{SCENES[name]}{REST}", encoding="utf-8")
    return load_scene(file)


@pytest.mark.parametrize("name", SCENES)
def test_the_same_motion_by_ipctk(name, tmp_path, monkeypatch):
    scene = scene_at(name, tmp_path)
    runs = {"ours": simulate(scene, tmp_path / "ours")}
    monkeypatch.setattr(setup, "contact_energy", lambda *keys: by_ipctk(contact_energy(*keys)))
    effect = "body_contact" if name == "body" else "self_contact"
    assert type(build(scene).energies[effect]) is IpctkBarrier
    runs["ipctk"] = simulate(scene, tmp_path / "ipctk")
    for run in runs.values():
        assert run.status == "completed", run.reason
        assert run.summary["certificate"]["intersection_free"] is True
        assert run.summary["certificate"]["minimum_gap"] > 0
        assert run.summary["effects"][effect]["pairs"] > 0
        assert run.summary["effects"][effect]["ccd_calls"] > 0
    frames = {name: np.array([run.positions(k) for k in range(len(run.times))]) for name, run in runs.items()}
    moved = np.abs(frames["ours"][-1] - frames["ours"][0]).max()
    free = np.abs(frames["ours"][-1] - frames["ours"][0] - 0.04 * np.array([0.1, 0.0, -0.3])).max()
    assert min(moved, free) > 1e-3  # contact has turned the motion
    # each step ends within tolerance times dt of its solution, wherever the two paths come from
    assert np.abs(frames["ours"] - frames["ipctk"]).max() < 1e-4 * moved
