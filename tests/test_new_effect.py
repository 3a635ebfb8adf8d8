"""The README's recipe for a new effect, followed by a stranger: one file, one line in the table, nothing else."""

import numpy as np
import pytest
from differences import gradient_error, hessian_error, taylor_slopes
from meshes import deformed, small_world
from small_scenes import SHEET, SOLVER, small_scene
from solving import step_at

from clothsim import InputError, simulate
from clothsim.cli import main
from clothsim.run.receipt import explain_scene
from clothsim.scene.effects import EFFECTS, Effect

FILE = '''
"""The effect `trampoline`: every vertex is drawn back to a level, as by a bed of springs."""

from dataclasses import dataclass

import numpy as np

from clothsim.energies.base import Energy, Off
from clothsim.energies.hessians import ElementHessian


@dataclass(frozen=True)
class Trampoline(Energy):
    """E = sum k m (z - level)^2 / 2. masses (n,) [kg]; strength k [1/s2]; level [m]."""

    masses: np.ndarray
    strength: float
    level: float

    def value(self, x):
        z = x[: len(self.masses), 2] - self.level
        return float(0.5 * self.strength * self.masses @ z**2)

    def gradient(self, x):
        out = np.zeros_like(x)
        out[: len(self.masses), 2] = self.strength * self.masses * (x[: len(self.masses), 2] - self.level)
        return out

    def hessian(self, x, project=True):
        blocks = self.strength * self.masses[:, None, None] * np.diag([0.0, 0.0, 1.0])
        return ElementHessian(np.arange(len(self.masses))[:, None], blocks)


def trampoline(world, *, strength=1.0, level=0.0):
    if strength == 0:
        return Off("strength is 0")
    return Trampoline(world.masses, float(strength), level - float(world.origin[2]))
'''
LINE = {"trampoline": Effect("trampoline:trampoline", "drawn back to a level")}
SCENE = """
[cloth]
mesh = "rectangle"
cells = [4, 4]
position = [0.0, 0.0, 0.33]

[effects.inertia]
[effects.trampoline]
strength = 40.0

[solver]
linear = "superlu"
threads = 1

[run]
duration = 0.04
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the stranger's file, which is in the table."""
    (tmp_path / "trampoline.py").write_text(FILE)
    (tmp_path / "scene.toml").write_text(SCENE)
    monkeypatch.syspath_prepend(tmp_path)
    for name, effect in LINE.items():
        monkeypatch.setitem(EFFECTS, name, effect)
    return tmp_path


def test_it_passes_the_derivative_checks_of_the_table(folder):
    world = small_world()
    energy = EFFECTS["trampoline"].build(world, {"strength": 3.0, "level": 0.1}, {})
    x = deformed(world)
    bound = energy.begin(step_at(x))
    assert gradient_error(bound, x) < 1e-7
    assert hessian_error(bound, x) < 1e-6
    assert taylor_slopes(bound, x)[1] > 2.8


def test_it_runs_in_a_scene_and_oscillates_as_it_should(folder):
    """Alone with inertia each vertex is an oscillator: backward Euler is (1 + k h^2) z = z_n + h v_n."""
    effects = {"inertia": {}, "trampoline": {"strength": 40.0}}
    run = simulate(
        small_scene(body=(), effects=effects, run={"duration": 0.2, "frames_per_second": 50}), folder / "run"
    )
    assert run.status == "completed", run.reason
    h, z, v = SOLVER["dt"], SHEET["position"][2], 0.0
    for frame in range(1, len(run.times)):
        before, z = z, (z + h * v) / (1 + 40.0 * h**2)
        v = (z - before) / h
        assert np.abs(run.positions(frame)[:, 2] - z).max() < 1e-12
    assert z < 0.2


def test_it_is_explained_with_its_price(folder, capsys):
    told = explain_scene(small_scene(body=(), effects={"inertia": {}, "trampoline": {}}), steps=2).effects["trampoline"]
    assert told["on"]
    assert told["evaluations"] > 0
    assert told["hessian_nonzeros"] == 9 * 25
    assert main(["explain", str(folder / "scene.toml"), "--steps", "2"]) == 0
    assert "\ntrampoline " in capsys.readouterr().out


def test_a_zero_is_off_and_an_unknown_key_is_refused(folder):
    off = explain_scene(small_scene(effects={"inertia": {}, "trampoline": {"strength": 0}}), steps=1).effects
    assert (off["trampoline"]["on"], off["trampoline"]["reason"]) == (False, "strength is 0")
    with pytest.raises(InputError, match="strenght"):
        small_scene(effects={"trampoline": {"strenght": 2.0}})
    absent = explain_scene(small_scene(effects={"inertia": {}}), steps=1).effects["trampoline"]
    assert absent["reason"] == "not named in the scene"
