"""Simulators at equal error: distances, costs at equal error, energies, stored runs, and the table."""

import sys
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

from clothsim.solve.stepping.state import first_state
from tests.benchmarks.peers import blender_cloth, clothsim_itself, equal_error, equal_error_picture, mujoco_ipc
from tests.benchmarks.peers.equal_error import BASE, DTS, PROGRAMS, Program, Row, Run, cost_ratios, line, row_at, run_of
from tests.benchmarks.peers.peer_scene import GRAVITY, Simulation
from tests.benchmarks.peers.shared_sheet import released, shared_sheet

CELLS, TIME = 4, 0.04
N = (CELLS + 1) ** 2


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(equal_error, "TIMES", {CELLS: (TIME,)})


@pytest.fixture
def falling(monkeypatch, small):
    """Stands for every simulator: a sheet in free fall, an error of `speed` dt, one CPU second a step."""
    asked = []

    def simulated(name, scene, python, options):
        asked.append((name, scene.dt, options, python))
        times = scene.dt * np.arange(1, scene.steps + 1)
        height = (2.0 if name == "mujoco" else 1.0) * scene.dt * times / times[-1]
        frames = scene.positions + np.outer(height, [0.0, 0.0, 1.0])[:, None]
        steps = {"frames": frames, "cpu": np.arange(1.0, scene.steps + 1), "energies": np.full(scene.steps, -1e-3)}
        return {"settings": "falls", "notes": "", "version": "1"}, steps

    monkeypatch.setattr(equal_error, "simulated", simulated)
    return asked


def run_at(height, cpu=1.0, energy=0.0, bad=()):
    frames = np.tile([0.0, 0.0, height], (2, 3, 1))
    return Run(np.array([0.02, 0.04]), np.array([0.5, 1.0]) * cpu, np.full(2, energy), frames, np.array(bad), ("",) * 4)


def test_a_row_has_both_errors_the_doubt_and_what_intersects_until_its_time():
    runs = {0.02: run_at(3e-3, 1.0, -2e-3, (True, False)), 0.01: run_at(1e-3, 2.0, -1e-3, (False, False, True, True))}
    own, base = (run_at(0.0, energy=5e-3), run_at(0.5e-3)), run_at(-1e-3)
    row = row_at(Program("one", "mujoco"), 0.02, runs, own, base)
    assert row.points == (
        (0.02, 0.5, pytest.approx(3.0), pytest.approx(4.0), -2.0),
        (0.01, 1.0, pytest.approx(1.0), pytest.approx(2.0), -1.0),
    )
    assert (row.doubt, row.to_base, row.energy) == pytest.approx((0.5, 1.0, 5.0))
    assert (row.bad, row.checked) == (1, 3)


def test_costs_are_compared_at_equal_error():
    points = [(0.02, 4.0), (0.01, 2.0), (0.005, 1.0)]
    base = Row(BASE, tuple((dt, 0.1 / dt, error, 9.0, 0.0) for dt, error in points), 0.1, 0.0, 0.0, 0, 3)
    dear = Row("dear", tuple((dt, 0.3 / dt, 2 * error, 9.0, 0.0) for dt, error in points), 0.1, 5.0, 0.0, 0, 3)
    assert cost_ratios(dear, base) == pytest.approx([6.0, 6.0])
    assert line("here", dear, base)[-4:] == ["6", "5", "0 / 0 / 0 / 0", "0 of 3"]
    far = Row("far", ((0.02, 1.0, 50.0, 9.0, np.nan),), 0.1, 5.0, np.nan, 0, 1)
    assert line("here", far, base)[3:] == ["50 (9), 1.00", "no common error", "5", "no velocities", "0 of 1"]


def test_energy_is_kinetic_and_that_of_gravity_since_the_start():
    start = np.zeros((2, 3))
    masses, v = np.array([1.0, 2.0]), np.array([[3.0, 0.0, 4.0], [0.0, 0.0, 0.0]])
    moved = Simulation(lambda: None, lambda: start - [0.0, 0.0, 0.5], "", lambda: v, masses)
    assert moved.energy(start) == pytest.approx(12.5 - 1.5 * GRAVITY)
    assert np.isnan(Simulation(lambda: None, lambda: start, "").energy(start))


def test_a_run_is_stored_on_the_common_frames_and_not_repeated(falling, tmp_path):
    program = Program("Fallen", "mujoco", {"a": 1}, fine={"b": 2})
    run = run_of(program, CELLS, 0.01, "python", tmp_path)
    assert run.times == pytest.approx([0.02, 0.04])
    assert list(run.cpu) == [2.0, 4.0]
    assert list(run.intersecting) == [False] * 4  # every frame, not the stored alone
    again = run_of(program, CELLS, 0.01, "python", tmp_path)
    assert np.array_equal(again.frames, run.frames)
    assert again.words[:3] == ("falls", "", "1")
    assert run_of(program, CELLS, 0.01, "python", tmp_path, reference=True).intersecting.size == 0
    assert falling == [("mujoco", 0.01, {"a": 1}, "python"), ("mujoco", 0.01, {"b": 2}, "python")]


def test_a_frame_that_intersects_is_counted(monkeypatch, small, tmp_path):
    def simulated(name, scene, python, options):
        frames = np.array([scene.positions, scene.positions - [0.0, 0.0, 0.3]])  # through the ball
        steps = {"frames": frames, "cpu": np.ones(2), "energies": np.zeros(2)}
        return {"settings": "", "notes": "", "version": ""}, steps

    monkeypatch.setattr(equal_error, "simulated", simulated)
    assert list(run_of(Program("bad", "mujoco"), CELLS, 0.02, "", tmp_path).intersecting) == [False, True]


def test_the_command_prints_and_writes_the_table_of_the_given_simulators(falling, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(equal_error, "DOCS", tmp_path)
    page = tmp_path / "results" / "performance.md"
    page.parent.mkdir()
    (tmp_path / "pictures").mkdir()
    page.write_text("before\n<!-- peers -->\nold\n<!-- /peers -->\nafter\n")
    command = ["--peer", "mujoco=there", "--cells", str(CELLS), "-o", str(tmp_path / "runs"), "--docs"]
    assert equal_error.main(command) == 0
    rows = [row.split(" | ") for row in capsys.readouterr().out.splitlines() if row.startswith(f"| {CELLS} x")]
    assert [row[1] for row in rows] == [BASE, "clothsim, backward Euler", "MuJoCo"]
    # clothsim at dt .02: 20 mm, its reference .625 mm; MuJoCo 40 mm, its reference .625 mm
    assert [row[3] for row in rows] == ["19 (19), 2.00", "19 (19), 2.00", "39 (39), 2.00"]
    assert rows[2][2] == "0.62"
    assert rows[2][7:] == ["2", "0", "-1 / -1 / -1 / -1 / -1", "0 of 30 |"]
    assert page.read_text().startswith("before\n<!-- peers -->\nMeasured on ")
    assert (tmp_path / "pictures" / "peers.png").stat().st_size > 10_000
    assert {dt for name, dt, options, _ in falling if options == {"solver": {}}} == set(DTS)
    assert sorted(dt for name, dt, _, python in falling if python == "there")[:2] == [DTS[-1] / 8, DTS[-1] / 4]


def test_a_simulator_that_there_is_not_is_refused(capsys):
    with pytest.raises(SystemExit):
        equal_error.main(["--peer", "houdini=python"])
    assert "there is no houdini" in capsys.readouterr().err


def test_each_program_has_a_style_and_a_model():
    names = [program.name for program in PROGRAMS]
    assert len(equal_error_picture.STYLES) == len(set(names)) == len(names)
    assert all(program.model in ("", BASE) for program in PROGRAMS)


def test_a_sheet_without_friction_lacks_the_effect():
    assert "friction" not in released(CELLS, 0.0).effects
    assert released(CELLS).effects["friction"] == {"coefficient": 0.4}
    assert shared_sheet(CELLS, 0.06, friction=0.0).friction == 0.0


@pytest.mark.parametrize(("integrator", "third"), [("backward_euler", 6.0), ("bdf2", 5.222)])
def test_clothsim_without_friction_falls_by_its_formula(integrator, third):
    scene = shared_sheet(CELLS, 0.06, friction=0.0)
    simulation = clothsim_itself.build(scene, solver={"integrator": integrator})
    for _ in range(3):
        simulation.step()
    fallen = (scene.positions - simulation.positions())[:, 2]
    assert fallen == pytest.approx(third * GRAVITY * scene.dt**2, rel=1e-4)
    assert simulation.masses.sum() == pytest.approx(0.15)
    assert simulation.notes().endswith("in 3 steps")


def test_a_step_that_clothsim_divides_is_completed(monkeypatch):
    scene = shared_sheet(CELLS, 0.02, friction=0.0)
    monkeypatch.setattr("clothsim.solve.stepping.state.first_state", lambda world, dt: first_state(world, dt / 2))
    simulation = clothsim_itself.build(scene, solver={"integrator": "backward_euler"})
    simulation.step()
    assert simulation.notes().endswith("in 2 steps")
    assert (scene.positions - simulation.positions())[:, 2] == pytest.approx(3.0 * GRAVITY * 0.01**2, rel=1e-4)


def test_mujoco_is_read_after_the_step(monkeypatch):
    """As mj_step does, the step here leaves the positions of its start in flexvert_xpos."""
    data = SimpleNamespace(z=0.0, body=0.0, flexvert_xpos=None, qvel=np.zeros(3 * N), solver_niter=[400])

    def step(_, data):
        data.body, data.flexvert_xpos, data.z = data.z, np.full((N, 3), data.z), data.z - 1.0

    def kinematics(_, data):
        data.body = data.z

    def flex(_, data):
        data.flexvert_xpos = np.full((N, 3), data.body)

    model = SimpleNamespace(body_mass=np.ones(N + 1))
    fake = SimpleNamespace(
        MjModel=SimpleNamespace(from_xml_string=lambda text: model),
        MjData=lambda model: data,
        mj_step=step,
        mj_kinematics=kinematics,
        mj_flex=flex,
    )
    monkeypatch.setitem(sys.modules, "mujoco", fake)
    simulation = mujoco_ipc.build(shared_sheet(CELLS, 0.04, friction=0.0))
    simulation.step()
    assert simulation.positions()[0, 2] == -1.0
    assert len(simulation.masses) == N
    assert simulation.notes() == "1 steps stop at 400 iterations"


def test_a_frame_of_blender_lasts_as_long_as_a_step(monkeypatch):
    """At time_scale 1 a sheet in Blender 5.0.1 falls by g (0.0316 s)^2 / 2 in its first frame, at every frame rate."""
    bpy = MagicMock()
    monkeypatch.setitem(sys.modules, "bpy", bpy)
    blender_cloth.build(shared_sheet(CELLS, 0.04, 0.01, friction=0.0))
    modifier = bpy.data.objects.new.return_value.modifiers.new.return_value
    assert modifier.settings.time_scale == pytest.approx(0.01 / 0.0316228)
    assert (modifier.collision_settings.friction, bpy.context.scene.frame_end) == (0.0, 5)
