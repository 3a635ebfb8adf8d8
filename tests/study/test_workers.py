"""Worker processes: killed when the budget is spent, and an answer for one that fails."""

from dataclasses import replace

import numpy as np
from small_scenes import small_scene, without

from clothsim.study import workers
from clothsim.study.workers import JITTER, PointJob, ProcessorTime, _started, answer, worker_processes

SCENE = small_scene(effects=without("body_contact"), body=(), run={"duration": 0.04, "frames_per_second": 25})


def test_a_run_that_is_too_long_is_stopped_when_the_budget_is_spent(tmp_path, monkeypatch):
    endless = replace(SCENE, run={"duration": 1000.0, "frames_per_second": 25}).to_text()
    jobs = [PointJob(endless, endless, tmp_path / f"{k}.npz") for k in range(3)]
    begun = []
    monkeypatch.setattr(workers, "_started", lambda scratch: begun.append(_started(scratch)) or begun[-1])
    spent = ProcessorTime()
    with worker_processes(2, spent) as run:
        got = list(run(jobs, lambda job: True, lambda: 6.0 - spent.seconds()))
    assert 6.0 < spent.seconds() < 12.0
    assert [output for _, output in got] == [None] * 3
    assert len(begun) == 2
    assert all(process.poll() is not None for process in begun)
    assert not list(tmp_path.iterdir())


def test_jobs_that_do_not_fit_start_no_process(tmp_path):
    job = PointJob("", "", tmp_path / "a.npz")
    with worker_processes(1, ProcessorTime()) as run:
        assert list(run([job], lambda job: False, lambda: 10.0)) == [(job, None)]


def ask(scene, target, seed=0):
    return answer({"scene": scene.to_text(), "warm": "", "target": str(target), "seed": seed})


def test_a_job_leaves_positions_and_its_mesh_and_jitter_is_small(tmp_path):
    output = [ask(SCENE, tmp_path / f"{seed}.npz", seed) for seed in (0, 0, 1)]
    assert [each["failed"] for each in output] == ["", "", ""]
    arrays = [dict(np.load(tmp_path / f"{seed}.npz")) for seed in (0, 1)]
    assert arrays[0]["rest_0"].shape == arrays[0]["positions"].shape == (25, 3)
    off = np.abs(arrays[1]["positions"] - arrays[0]["positions"]).max()
    assert 0 < off < 100 * JITTER


def test_a_capped_solve_and_a_bad_scene_are_no_data_points(tmp_path):
    capped = replace(SCENE, solver={**SCENE.solver, "max_iterations": 1, "tolerance": 1e-12})
    assert ask(capped, tmp_path / "a.npz")["failed"]
    bad = ask(replace(SCENE, cloth={"mesh": "missing.obj"}), tmp_path / "b.npz")
    assert "missing.obj" in bad["failed"]
    assert not list(tmp_path.iterdir())
